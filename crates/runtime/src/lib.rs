//! Threads, selectors and recorders: what joins the cores to a real interface.
