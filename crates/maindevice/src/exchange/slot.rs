//! A slot: one frame on its way, with up to two copies.

use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::ethernet::{HEADER_LEN, MAX_LEN};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameView, WKC_LEN};
use linesman_proto::time::Instant;

use super::prebuilt::Shaped;
use super::queue::Queued;
use super::{MAX_ACYCLIC_DATAGRAMS, OLD, Received};

/// Whose frame it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Purpose {
    /// Datagrams of procedures, listed in the slot.
    Acyclic,
    /// A prebuilt frame of the plan.
    Cyclic {
        /// Its index among those of all tasks.
        frame: u32,
    },
}

/// What has become of a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum SlotState {
    /// Never used.
    #[default]
    Free,
    /// Out on the line.
    Waiting,
    /// All copies came back.
    Answered,
    /// Given up.
    GivenUp,
}

/// One frame on its way.
#[derive(Debug)]
pub(crate) struct Slot {
    pub(crate) state: SlotState,
    pub(crate) purpose: Purpose,
    /// The frame before datagrams of the other card are masked.
    pub(crate) sent: Vec<u8>,
    /// The card that carries each datagram, where it is one only; empty when all go by both.
    pub(crate) cards: Vec<Option<Path>>,
    /// What came back: the first copy, later with the second merged in. Empty for a cyclic frame
    /// that has one copy only, which is read where it was received.
    pub(crate) reply: Vec<u8>,
    /// The number of a cyclic frame, and whether its outputs were withheld.
    pub(crate) number: u32,
    pub(crate) withheld: bool,
    /// It came back without its end.
    pub(crate) truncated: bool,
    /// Further copies of the same frame that each card has sent and that have not come back.
    pub(crate) spares: [u8; 2],
    /// Copies that nobody has fetched yet.
    pub(crate) unsent: u16,
    pub(crate) deadline: Instant,
    /// Copies by the card that sent them: on their way, or come back.
    pub(crate) outstanding: [bool; 2],
    pub(crate) arrived: [bool; 2],
    /// The datagrams in it, in order; empty for cyclic frames.
    pub(crate) requests: Vec<Queued>,
}

impl Slot {
    /// A slot with room for the longest frame, so that using it allocates nothing.
    pub(crate) fn new() -> Self {
        Self {
            state: SlotState::Free,
            purpose: Purpose::Acyclic,
            sent: Vec::with_capacity(MAX_LEN),
            cards: Vec::with_capacity(MAX_ACYCLIC_DATAGRAMS),
            reply: Vec::with_capacity(MAX_LEN),
            number: 0,
            withheld: false,
            truncated: false,
            spares: [0; 2],
            unsent: 0,
            deadline: Instant::MAX,
            outstanding: [false; 2],
            arrived: [false; 2],
            requests: Vec::with_capacity(MAX_ACYCLIC_DATAGRAMS),
        }
    }

    /// It goes out, `times` times by each card; gives how many copies that are.
    #[inline]
    pub(super) fn begin(
        &mut self,
        purpose: Purpose,
        deadline: Instant,
        times: u8,
        ring: bool,
    ) -> u16 {
        self.state = SlotState::Waiting;
        self.purpose = purpose;
        self.deadline = deadline;
        self.outstanding = [true, ring];
        self.arrived = [false; 2];
        self.truncated = false;
        self.spares = [times.saturating_sub(1); 2];
        self.reply.clear();
        u16::from(times) << u16::from(ring)
    }

    /// Whether `reply` is a copy of this frame that card `sender` sent, come back from the line:
    /// the same datagrams with the same marks.
    pub(super) fn matches(&self, reply: &[u8], sender: Path) -> Shaped {
        let (Ok(sent), Ok(came)) = (FrameView::parse(&self.sent), FrameView::parse(reply)) else {
            return Shaped::Otherwise;
        };
        let mut came = came.datagrams();
        for (at, sent) in sent.datagrams().enumerate() {
            let (Ok(sent), Some(came)) = (sent, came.next()) else { return Shaped::Otherwise };
            let Ok(came) = came else { return Shaped::CutOff };
            let Some(command) = sent.command() else { return Shaped::Otherwise };
            let same = came.code() == as_sent_by(command, self.card(at), sender).code()
                && came.index() == sent.index()
                && came.offset() == sent.offset()
                && came.data_len() == sent.data_len()
                && came.more_follow() == sent.more_follow()
                && came.ado() == sent.ado()
                && (command.increments_position() || came.adp() == sent.adp());
            if !same {
                return Shaped::Otherwise;
            }
        }
        if came.next().is_none() { Shaped::AsSent } else { Shaped::Otherwise }
    }

    /// What a copy is that came at `now` although the slot, number `at`, waits for none.
    pub(super) fn answered_again(&mut self, at: u8, now: Instant, sender: Path) -> Received {
        let spares = &mut self.spares[sender.index()];
        match self.state {
            SlotState::Answered if *spares > 0 => {
                *spares -= 1;
                Received::Spare(at)
            }
            SlotState::Free => Received::Stray,
            SlotState::GivenUp => Received::Late,
            // Numbers come again. No line doubles what was answered so long ago.
            SlotState::Answered if now > self.deadline + OLD => Received::Stray,
            SlotState::Answered | SlotState::Waiting => Received::Duplicate,
        }
    }

    /// The card that alone carries a datagram.
    fn card(&self, datagram: usize) -> Option<Path> {
        self.cards.get(datagram).copied().flatten()
    }

    /// Whether all copies that were sent have come back.
    pub(crate) fn is_complete(&self) -> bool {
        !self.outstanding.into_iter().zip(self.arrived).any(|(out, back)| out && !back)
    }
}

/// What a datagram is in the copy that `sender` sends: nothing, if it is for the other card. A position
/// would mean another controller there.
pub(crate) fn as_sent_by(command: Command, card: Option<Path>, sender: Path) -> Command {
    match card {
        Some(card) if card != sender => Command::Nop,
        Some(_) | None => command,
    }
}

/// Turns a frame of ours into the copy that `sender` sends: `cards` tells who carries each datagram.
pub(crate) fn mask(frame: &mut [u8], cards: &[Option<Path>], sender: Path) {
    let mut at = HEADER_LEN + ETHERCAT_HEADER_LEN;
    for card in cards {
        let Some(header) = frame.get_mut(at..at + DATAGRAM_HEADER_LEN) else { return };
        if let Some(command) = Command::from_code(header[0]) {
            header[0] = as_sent_by(command, *card, sender).code();
        }
        let len = u16::from_le_bytes([header[6], header[7]]) & 0x07FF;
        at += DATAGRAM_HEADER_LEN + usize::from(len) + WKC_LEN;
    }
}
