//! The EtherCAT MainDevice: exchange engine, procedures, cyclic process data.
//!
//! [`MainDevice`] is an engine without a clock and without sockets: one instance per network, fed
//! with frames and time, asked for frames and the next deadline. Inside, [`exchange`] sends
//! datagrams and matches what comes back; [`executor`] runs procedures ([`procedure`]) that await
//! answers; `cyclic` exchanges process data; `supervisor` brings each SubDevice to its target and
//! keeps it there; [`mailbox`] talks to the software of SubDevices; [`service`] does single things
//! for tools; [`virtual_switch`] passes Ethernet frames between SubDevices and this computer.
//!
//! Read first: "Shapes" in `ARCHITECTURE.md`.

mod cyclic;
pub mod event;
pub mod exchange;
pub mod executor;
pub mod mailbox;
pub mod main_device;
pub mod network_group;
pub mod options;
pub mod procedure;
pub mod service;
pub mod statistics;
mod supervisor;
pub mod virtual_switch;
pub mod watch;

pub use cyclic::{FrameStatus, OutsideTime, Quality, TaskTimes};
pub use event::Event;
pub use exchange::{
    Access, DatagramData, Departure, ExchangeError, Reply, Request, Target, Transmit,
};
pub use main_device::{MainDevice, ProbeRequest};
pub use network_group::NetworkGroup;
pub use options::{CounterPoll, Options, Polling, Rounds};
pub use statistics::Statistics;
pub use supervisor::{BringUpTimes, DeviceTimes, GroupPlace, Phase, StartUpError};
pub use watch::Watch;
