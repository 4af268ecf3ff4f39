//! Threads, selectors and recorders: what joins the cores to a real interface.
//!
//! [`selector`] says what a word like `eth0+eth1` means, wherever it is written; [`capture`] reads
//! files, [`transport`] is where frames go, [`drive`] runs a MainDevice there, [`listen`] hears what is on a card, [`question_socket`]
//! asks SubDevices there, [`host_watch`] asks about a card, [`record`] writes what was seen to a file, [`ring_recorder`] to a ring of files. [`serve`] puts a segment on real
//! interfaces: [`wiring`] brings its outputs to its inputs, [`control`] breaks and heals it from
//! outside, [`truth_writer`] writes down what really happened, [`names`] says where. [`plan_file`] reads
//! the file that a line is planned with, [`named_files`] the files that a file names. [`gateway`] passes mailbox messages
//! of other programs to a line that runs, [`ads`] answers them by the protocol of the vendor, [`network_access`] says whom they serve; [`ethernet`] passes frames between its SubDevices and an interface of this computer. [`service_session`] serves a line that nobody drives. [`stop`] is the wish to stop, [`wait`] waits for a person at the line,
//! [`part`] says that a part of a command has failed.

pub mod ads;
pub mod bundle;
pub mod capture;
pub mod control;
mod control_socket;
pub mod drive;
pub mod ethernet;
#[cfg(feature = "event-log")]
pub mod event_log;
pub mod gateway;
pub mod host_watch;
pub mod listen;
pub mod named_files;
pub mod names;
pub mod network_access;
pub mod online;
pub mod part;
pub mod plan_file;
pub mod question_socket;
pub mod record;
mod request_rates;
pub mod ring_recorder;
pub mod run;
pub mod selector;
pub mod serve;
pub mod service;
pub mod service_session;
pub mod stop;
#[cfg(feature = "journald")]
pub mod system_log;
mod tcp_server;
pub mod transport;
pub mod truth_writer;
pub mod wait;
mod watched_file;
pub mod wiring;
