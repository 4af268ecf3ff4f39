//! What can go wrong: one file per kind of fault.
