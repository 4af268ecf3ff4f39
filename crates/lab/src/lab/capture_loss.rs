//! Loss of exchanges on their way to the diagnosis: a recorder that drops, a tap that is overrun.

use std::collections::VecDeque;

use linesman_diagnosis::observe::Direction;
use linesman_proto::command::Addressing;
use linesman_proto::frame::FrameView;
use linesman_sim::seed::Stream;

/// Exchanges that may be under way at once.
const UNDER_WAY: usize = 64;
/// Error counters of the ports (S2 2.9).
const COUNTERS: std::ops::Range<u16> = 0x0300..0x0314;

/// Hides a share of the exchanges in which error counters are read, both the request and its return.
#[derive(Clone, Debug)]
pub(super) struct CaptureLoss {
    stream: Stream,
    share: f64,
    /// Requests that were hidden: first index and length.
    hidden: VecDeque<(u8, usize)>,
}

impl CaptureLoss {
    pub(super) fn new(stream: Stream, share: f64) -> Self {
        Self { stream, share, hidden: VecDeque::new() }
    }

    /// Whether this frame is not seen.
    pub(super) fn hides(&mut self, direction: Direction, bytes: &[u8]) -> bool {
        let Ok(view) = FrameView::parse(bytes) else { return false };
        let Some(Ok(first)) = view.datagrams().next() else { return false };
        let key = (first.index(), bytes.len());
        if direction == Direction::Received {
            let found = self.hidden.iter().position(|known| *known == key);
            return found.and_then(|at| self.hidden.remove(at)).is_some();
        }
        let mut read = view.datagrams().flatten().filter(|datagram| datagram.code() != 0);
        let has_counters = read.any(|datagram| {
            let is_addressed = datagram
                .command()
                .is_some_and(|command| command.addressing() == Addressing::Station);
            is_addressed && COUNTERS.contains(&datagram.ado().0)
        });
        let is_hidden = has_counters && self.stream.chance(self.share);
        if is_hidden {
            if self.hidden.len() >= UNDER_WAY {
                self.hidden.pop_front();
            }
            self.hidden.push_back(key);
        }
        is_hidden
    }
}
