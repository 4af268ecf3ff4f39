//! What was wanted, what is there, what follows: project, inventory, plan.
