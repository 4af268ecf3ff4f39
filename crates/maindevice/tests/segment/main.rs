//! A MainDevice on a virtual segment, in virtual time.

mod bench;
mod described;
mod library;
mod mailbox;
mod ring;
mod robust;
mod run;
mod scan;
mod soak;
mod software;
mod start_up;
mod wire_faults;
