//! Frames and datagrams of one network, counted, and how they fared.

use linesman_proto::time::Instant;

use super::Seen;
use super::host::Tally;

/// What passed the observer.
#[derive(Clone, Default, Debug)]
pub struct Traffic {
    /// EtherCAT frames seen, copies and both directions included.
    pub frames: u64,
    /// Frames that are not EtherCAT.
    pub foreign: u64,
    /// Requests: frames on their way out, each once.
    pub sent: u64,
    /// Frames that came back.
    pub returned: u64,
    /// Frames whose way out was seen and whose return was not, though others came back later.
    pub lost: Tally,
    /// The first lost frame.
    pub first_lost: Option<Seen<()>>,
    /// Frames that came back with a wrong check sequence.
    pub damaged: Tally,
    /// Frames of which bytes are missing at the end.
    pub truncated: u64,
    /// Datagrams judged: each request once.
    pub datagrams: u64,
    /// Datagrams that nobody answered: their frame never came back, or came back with working
    /// counter 0 where an answer was expected.
    pub unanswered: u64,
    /// The largest working counter of a broadcast read: how many controllers answered at most.
    pub broadcast_answers: u16,
    /// The working counter of the latest broadcast read, with when it last changed.
    pub broadcast_now: Option<Seen<u16>>,
    /// The first frame.
    pub first: Option<Instant>,
    /// The latest frame.
    pub last: Option<Instant>,
}
