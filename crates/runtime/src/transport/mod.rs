//! Transports of a session: network cards, or a virtual segment in this process.

pub mod cards;
pub mod common_time;
pub mod segment;

pub use cards::Cards;
pub use common_time::TimeShare;
pub use linesman_session::transport::{FrameSink, RxFrame, Transport};
pub use segment::{Pace, SegmentTransport};
