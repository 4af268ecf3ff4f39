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

/// What has become of the copies of a frame, by the card that sends them.
#[derive(Clone, Copy, Debug)]
// Copied as one word.
#[repr(align(8))]
pub(crate) struct Copies {
    /// On their way.
    pub(crate) outstanding: [bool; 2],
    /// Come back.
    pub(crate) arrived: [bool; 2],
    /// Further copies of the same frame that each card has sent and that have not come back.
    pub(crate) spares: [u8; 2],
    /// Copies that nobody has fetched yet.
    pub(crate) unsent: u16,
}

impl Copies {
    /// Of a frame that goes out, `times` times by each card.
    pub(super) fn new(times: u8, ring: bool) -> Self {
        Self {
            outstanding: [true, ring],
            arrived: [false; 2],
            spares: [times.saturating_sub(1); 2],
            unsent: u16::from(times) << u16::from(ring),
        }
    }
}

/// One frame on its way.
#[derive(Debug)]
pub(crate) struct Slot {
    pub(crate) state: SlotState,
    pub(crate) purpose: Purpose,
    /// The prebuilt frame whose only copy is waited for; [`Slot::NONE`] where it is another frame, or
    /// none.
    pub(crate) awaited: u32,
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
    pub(crate) deadline: Instant,
    pub(crate) copies: Copies,
    /// How many counted in the broadcast read of what has arrived at each card; of a ring only.
    pub(crate) counted: [u16; 2],
    /// The datagrams in it, in order; empty for cyclic frames.
    pub(crate) requests: Vec<Queued>,
}

impl Slot {
    /// No prebuilt frame.
    pub(crate) const NONE: u32 = u32::MAX;

    /// A slot with room for the longest frame, so that using it allocates nothing.
    pub(crate) fn new() -> Self {
        Self {
            state: SlotState::Free,
            purpose: Purpose::Acyclic,
            awaited: Self::NONE,
            sent: Vec::with_capacity(MAX_LEN),
            cards: Vec::with_capacity(MAX_ACYCLIC_DATAGRAMS),
            reply: Vec::with_capacity(MAX_LEN),
            number: 0,
            withheld: false,
            truncated: false,
            deadline: Instant::MAX,
            copies: Copies::new(0, false),
            counted: [0; 2],
            requests: Vec::with_capacity(MAX_ACYCLIC_DATAGRAMS),
        }
    }

    /// It goes out.
    #[inline]
    pub(super) fn begin(&mut self, purpose: Purpose, deadline: Instant, copies: &Copies) {
        self.state = SlotState::Waiting;
        self.purpose = purpose;
        self.deadline = deadline;
        self.copies = *copies;
        self.truncated = false;
        self.reply.clear();
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
        let spares = &mut self.copies.spares[sender.index()];
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
        let Copies { outstanding, arrived, .. } = self.copies;
        !outstanding.into_iter().zip(arrived).any(|(out, back)| out && !back)
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
