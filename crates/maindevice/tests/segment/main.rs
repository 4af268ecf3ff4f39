//! A MainDevice on a virtual segment, in virtual time.

mod al_errors;
mod bench;
mod clocks;
mod described;
mod library;
mod mailbox;
mod many;
mod ring;
mod robust;
mod run;
mod scan;
mod soak;
mod software;
mod start_up;
mod wire_faults;
