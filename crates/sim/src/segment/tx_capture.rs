//! Transmitted frames as a capture tool sees them with a packet socket on the interface.
//!
//! The kernel shows a frame right before it hands it to the driver of the card, and at that time
//! (`net/core/dev.c` of Linux, `xmit_one`). So nobody is shown what never came that far: a frame whose card has
//! no carrier any more, for which the queue in front of it throws all away (`net/sched/sch_generic.c`,
//! `noop_enqueue`); one for which the card takes nothing, so that its queue stands still (`sch_direct_xmit`) and
//! the sender is told that it is full. A frame that the computer keeps back is shown when it goes on to the
//! card; one that the card keeps back was shown before.
//!
//! A driver that refuses a frame although its queue is open has it shown once more with each attempt, and one
//! that takes frames and throws them away has them shown; neither is a card of this segment.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use super::Segment;

/// A frame that was handed to the driver of a card.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Outgoing {
    /// When.
    pub at: Instant,
    /// The card.
    pub path: Path,
}

/// Frames that go out, for who listens.
#[derive(Clone, Default, Debug)]
pub(super) struct TxCapture {
    is_active: bool,
    frames: VecDeque<(Outgoing, Vec<u8>)>,
}

impl Segment {
    /// Somebody listens on the cards, or nobody does any more: frames that go out are kept for
    /// [`Segment::poll_outgoing`].
    pub fn listen(&mut self, listens: bool) {
        self.tx_capture.is_active = listens;
        self.tx_capture.frames.clear();
    }

    /// The next frame that was handed to the driver of a card; its bytes replace those in `buffer`.
    pub fn poll_outgoing(&mut self, buffer: &mut Vec<u8>) -> Option<Outgoing> {
        let (outgoing, mut bytes) = self.tx_capture.frames.pop_front()?;
        std::mem::swap(buffer, &mut bytes);
        self.recycle(bytes);
        Some(outgoing)
    }

    /// Hands a frame to the driver, in front of everyone who listens; false if it takes none.
    #[inline]
    pub(super) fn capture(&mut self, at: Instant, path: Path, frame: &[u8]) -> bool {
        self.tx_capture.is_active && self.store_capture(at, path, frame)
    }

    fn store_capture(&mut self, at: Instant, path: Path, frame: &[u8]) -> bool {
        if !self.world.cards[path.index()].takes_frames(at) {
            return false;
        }
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.extend_from_slice(frame);
        self.tx_capture.frames.push_back((Outgoing { at, path }, bytes));
        true
    }
}
