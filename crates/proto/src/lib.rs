//! The EtherCAT protocol as data.
//!
//! What the specification says once stands here once: commands and what each does to data, address
//! and working counter; registers with their bits; states, transitions and status codes; the SII
//! image; the order of ports, the tree that follows from it, and the delays along it; how long a
//! frame is on the wire. MainDevice, virtual segment, capture decoder, diagnosis and `explain` all
//! read these tables. There is no I/O here and no clock: bytes and numbers in, meaning out.
//!
//! Read first: [`frame`] (what travels), [`command`] (what a datagram asks), [`register`] (what a
//! controller holds), [`topology`] (which way a frame goes).
//!
//! The letters in references: *S1*, *S2* are the two sections of the ESC data sheet, *ETG.nnnn* the
//! technology group's documents as cited by the public sources that follow them.

pub mod address;
pub mod ads;
pub mod command;
pub mod esl;
pub mod ethernet;
pub mod frame;
pub mod mailbox;
pub mod port;
pub mod register;
pub mod sii;
pub mod state;
pub mod time;
pub mod topology;
