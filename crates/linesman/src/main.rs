//! The command line of Linesman.

fn main() {}
