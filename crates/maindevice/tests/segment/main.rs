//! A MainDevice on a virtual segment, in virtual time.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod addressing;
mod al_errors;
mod aoe;
mod bench;
mod clocks;
mod delays;
mod described;
mod ethernet;
#[allow(clippy::disallowed_macros, reason = "it prints a table for people")]
mod ethernet_rate;
mod ethernet_tcp;
mod hot_connect;
mod hot_connect_ports;
mod identity;
mod library;
mod loop_control;
mod mailbox;
#[allow(clippy::disallowed_macros, reason = "it prints a table for people")]
mod many;
mod network_time;
mod plotted_times;
mod reference_clock;
mod ring;
mod ring_cuts;
mod ring_soak;
mod robust;
mod rounds;
mod run;
mod scan;
mod soak;
mod soe;
mod software;
mod start_up;
mod synchronisation;
mod tasks;
mod timing;
mod timing_drawn;
mod watch;
mod wire_faults;
