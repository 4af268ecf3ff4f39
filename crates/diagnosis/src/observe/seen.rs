//! One frame as it was seen, and one observation of the host.

use linesman_proto::address::{Network, Path};
use linesman_proto::esl::EslRecord;
use linesman_proto::time::{Instant, Span};

/// Which way a frame went past the observer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Direction {
    /// It left the MainDevice.
    Sent,
    /// It came back to the MainDevice.
    Received,
    /// The observer cannot tell, such as most capture files.
    Unknown,
}

/// A frame as a socket, a capture or the virtual segment saw it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameSeen<'a> {
    /// The network it belongs to.
    pub network: Network,
    /// The card, where there is one to name.
    pub path: Option<Path>,
    /// Which way it went.
    pub direction: Direction,
    /// When, since the start of the run. It may run backwards between interfaces of a capture.
    pub time: Instant,
    /// Its number: as a capture tool counts, from 1.
    pub number: u64,
    /// Whether its check sequence was right; `None` when nobody looked.
    pub fcs: Option<bool>,
    /// Whether bytes at its end were not recorded.
    pub truncated: bool,
    /// Record that a capture probe on a link has added, where the frame was recorded by one.
    pub probe: Option<EslRecord>,
    /// The frame from its destination address on, without check sequence.
    pub bytes: &'a [u8],
}

/// Something the host noticed, which no frame shows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct HostObservation {
    /// The network.
    pub network: Network,
    /// The card.
    pub path: Path,
    /// When, since the start of the run.
    pub time: Instant,
    /// What.
    pub what: HostEvent,
}

/// What the host noticed. Counts are those since the last observation of the same kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum HostEvent {
    /// The card has a link, or has none any more.
    Carrier(bool),
    /// The card dropped damaged frames.
    CardErrors {
        /// Frames whose check sequence was wrong.
        crc: u64,
        /// Other receive errors: symbols, alignment, length.
        other: u64,
    },
    /// The card dropped frames for want of room.
    CardDrops(u64),
    /// The socket dropped frames for want of room.
    SocketDrops(u64),
    /// Frames could not be sent.
    SendFailures(u64),
    /// A cycle began this much late.
    Late(Span),
    /// The clock was set by this many ns.
    ClockStep(i64),
}
