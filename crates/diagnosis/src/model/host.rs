//! Observations of the host about its cards, added up.

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use super::Seen;
use crate::observe::{HostEvent, HostObservation};

/// Both cards.
#[derive(Clone, Default, Debug)]
pub struct HostHistory {
    /// Whether the host's own counters are watched at all: only then does 0 mean "none".
    pub is_watched: bool,
    cards: [CardHistory; 2],
}

/// One card.
#[derive(Clone, Default, Debug)]
pub struct CardHistory {
    /// Whether it has a link, as last heard, with when that changed.
    pub carrier: Option<Seen<bool>>,
    /// When the link went last.
    pub carrier_lost: Option<Instant>,
    /// How often the link came or went.
    pub carrier_changes: u64,
    /// Frames it dropped because their check sequence was wrong.
    pub crc: Tally,
    /// Frames it dropped for other receive errors.
    pub other_errors: Tally,
    /// Frames it dropped for want of room.
    pub card_drops: Tally,
    /// Frames the socket dropped for want of room.
    pub socket_drops: Tally,
    /// Frames that could not be sent.
    pub send_failures: Tally,
    /// Cycles that began late; the sum is in ns.
    pub late: Tally,
    /// Steps of the clock; the sum is in ns, without sign.
    pub clock_steps: Tally,
}

/// Something counted, with when it first and last happened.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Tally {
    /// All together.
    pub sum: u64,
    /// The largest single one.
    pub largest: u64,
    /// How many observations had it.
    pub times: u64,
    /// When it was first observed.
    pub first: Option<Instant>,
    /// When it was last observed.
    pub last: Option<Instant>,
    /// What `sum` was when the present spell of errors began.
    pub before_spell: u64,
    /// When it was first observed in this spell.
    pub first_of_spell: Option<Instant>,
}

impl Tally {
    /// How much of it belongs to the present spell of errors.
    #[must_use]
    pub const fn of_spell(&self) -> u64 {
        self.sum.saturating_sub(self.before_spell)
    }

    /// A new spell of errors begins.
    pub const fn begin_spell(&mut self) {
        self.before_spell = self.sum;
        self.first_of_spell = None;
    }

    /// Counts `by` more at `at`; nothing when it is 0.
    pub fn add(&mut self, by: u64, at: Instant) {
        if by == 0 {
            return;
        }
        self.sum = self.sum.saturating_add(by);
        self.largest = self.largest.max(by);
        self.times += 1;
        self.first.get_or_insert(at);
        self.first_of_spell.get_or_insert(at);
        self.last = Some(at);
    }
}

impl HostHistory {
    /// A card.
    #[must_use]
    pub const fn card(&self, path: Path) -> &CardHistory {
        &self.cards[path.index()]
    }

    /// A new spell of errors begins.
    pub fn begin_spell(&mut self) {
        for card in &mut self.cards {
            card.crc.begin_spell();
        }
    }

    /// Takes an observation.
    pub fn record(&mut self, observation: &HostObservation) {
        // Whoever tells of the link alone has not told of the counters.
        self.is_watched |= matches!(
            observation.what,
            HostEvent::CardErrors { .. } | HostEvent::CardDrops(_) | HostEvent::SocketDrops(_)
        );
        let at = observation.time;
        let card = &mut self.cards[observation.path.index()];
        match observation.what {
            HostEvent::Carrier(on) => match card.carrier {
                Some(known) if known.value == on => {}
                known => {
                    card.carrier_changes += u64::from(known.is_some());
                    card.carrier = Some(Seen::new(on, at, None));
                    card.carrier_lost = if on { card.carrier_lost } else { Some(at) };
                }
            },
            HostEvent::CardErrors { crc, other } => {
                card.crc.add(crc, at);
                card.other_errors.add(other, at);
            }
            HostEvent::CardDrops(count) => card.card_drops.add(count, at),
            HostEvent::SocketDrops(count) => card.socket_drops.add(count, at),
            HostEvent::SendFailures(count) => card.send_failures.add(count, at),
            HostEvent::Late(by) => card.late.add(by.as_nanos(), at),
            HostEvent::ClockStep(by) => card.clock_steps.add(by.unsigned_abs(), at),
        }
    }
}
