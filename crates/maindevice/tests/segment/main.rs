//! A MainDevice on a virtual segment, in virtual time.

mod bench;
mod clocks;
mod described;
mod mailbox;
mod ring;
mod robust;
mod run;
mod scan;
mod soak;
mod software;
mod start_up;
