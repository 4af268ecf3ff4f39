//! Frame that passed, without its bytes.

use linesman_diagnosis::{Direction, FrameSeen};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::Instant;

/// Room for one frame, in bytes: the longest has 1,514, and what is longer than any may be has its
/// end cut off.
pub const FRAME_ROOM: usize = 1_536;

/// Time, number, card and direction of a frame that passed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameSummary {
    /// When, as [`FrameSeen::time`].
    pub time: Instant,
    /// Its number, as [`FrameSeen::number`].
    pub number: u64,
    /// The card.
    pub path: Option<Path>,
    /// Which way it went.
    pub direction: Direction,
    /// Its end is missing.
    pub truncated: bool,
}

impl FrameSummary {
    /// The frame with its bytes, as a diagnosis sees it.
    #[inline]
    #[must_use]
    pub fn seen(self, bytes: &[u8]) -> FrameSeen<'_> {
        let Self { time, number, path, direction, truncated } = self;
        let network = Network::default();
        FrameSeen {
            network,
            path,
            direction,
            time,
            number,
            fcs: None,
            truncated,
            probe: None,
            bytes,
        }
    }
}
