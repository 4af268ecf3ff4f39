//! What a capture shows beyond its verdict: datagrams one by one, the network, its dialogue and its timing.
//!
//! Frames come in as bytes with a time, a card and a direction, from whatever read them (`linesman-link` reads
//! the files); this crate does no I/O and reads no clock.
//!
//! [`Survey`] takes the exchanges of a diagnosis as its engine pairs them, and makes a [`CaptureReport`] of them and of
//! the engine's model: [`network`] tells what is on the line, [`dialogue`] puts mailbox messages together,
//! [`timing`] measures cycles and responses. [`row`] has frames one by one, [`expression`] the conditions that pick
//! them, [`knowledge`] what the frames before tell of a row, [`wireshark`] the profile
//! for Wireshark; [`masking`] takes the process data out of frames, and [`anonymous`] all that says whose machine it is.

pub mod access;
pub mod anonymous;
pub mod comparison;
pub mod dialogue;
pub mod expression;
pub mod knowledge;
pub mod masking;
pub mod network;
pub mod record;
pub mod row;
pub mod survey;
pub mod timing;
pub mod wireshark;

pub use network::report::CaptureReport;
pub use survey::Survey;
