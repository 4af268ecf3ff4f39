//! Numbers of controllers that broadcast reads and positions tell of.

use linesman_proto::address::Path;
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;

use crate::model::Seen;

/// Rise of the number of controllers that answer a broadcast read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CountRise {
    /// The number before, with the first read that had it.
    pub fewer: Seen<u16>,
    /// The number since.
    pub more: Seen<u16>,
}

/// Results of broadcast reads. The learner fills them in, or an observation file.
#[derive(Clone, Default, Debug)]
pub struct BroadcastReads {
    most: u16,
    now: Option<Seen<u16>>,
    rose: Option<CountRise>,
    latest: Option<Instant>,
    split: Option<Seen<(u16, u16)>>,
    was_processed_by_one: bool,
    processed_alone: Option<Seen<Path>>,
    positions: u16,
    al_highest: Option<AlState>,
}

impl BroadcastReads {
    // ---- what learner and observation files tell ----

    /// Takes the number of controllers that answer, and the most that did, as somebody else counted them.
    pub(crate) fn report(&mut self, most: u16, now: Option<Seen<u16>>) {
        (self.most, self.now) = (most, now);
    }

    /// Takes the number of controllers that answered a read that all answer. `can_rise` if process data are exchanged already and the
    /// frame has no second copy: more of them than ever before have then come in the run. Says whether the number is
    /// another one.
    pub(crate) fn record(&mut self, seen: Seen<u16>, can_rise: bool) -> bool {
        if can_rise && seen.value > self.most {
            let fewer = self.now.filter(|now| now.value == self.most && self.most > 0);
            self.rose = fewer.map(|fewer| CountRise { fewer, more: seen }).or(self.rose);
        }
        self.most = self.most.max(seen.value);
        self.latest = self.latest.max(Some(seen.at));
        let is_news = self.now.is_none_or(|known| known.value != seen.value);
        if is_news {
            self.now = Some(seen);
        }
        is_news
    }

    /// In a ring, both copies of a read were processed by somebody: by how many each.
    pub(crate) const fn record_split(&mut self, seen: Seen<(u16, u16)>) {
        self.split = Some(seen);
    }

    /// Both copies of a read came back, and one alone was processed by anybody: the one that this card had sent, if
    /// that is known.
    pub(crate) const fn record_processed_by_one(&mut self, card: Option<Seen<Path>>) {
        self.was_processed_by_one = true;
        self.processed_alone = card;
    }

    /// A frame passed so many controllers, by what they add to positions.
    pub fn record_positions(&mut self, passed: u16) {
        self.positions = self.positions.max(passed);
    }

    /// A read of AL status proves that a controller is in this state, at least.
    pub(crate) fn record_state(&mut self, state: Option<AlState>) {
        self.al_highest = self.al_highest.max(state);
    }

    // ---- what rules ask ----

    /// The largest working counter of a broadcast read: how many controllers answered at most.
    #[must_use]
    pub const fn most(&self) -> u16 {
        self.most
    }

    /// The working counter of the latest broadcast read, with when it last changed.
    #[must_use]
    pub const fn now(&self) -> Option<Seen<u16>> {
        self.now
    }

    /// The latest time that more controllers answered a broadcast read than ever before though process data were exchanged
    /// already.
    #[must_use]
    pub const fn rose(&self) -> Option<CountRise> {
        self.rose
    }

    /// When a broadcast read that all controllers answer last came back.
    #[must_use]
    pub const fn latest(&self) -> Option<Instant> {
        self.latest
    }

    /// In a ring, the latest broadcast read ever whose copies were both processed by somebody: by how many
    /// each, in the order in which they came back. Who is reached by card B alone gets no time of a reference
    /// clock that card A reaches.
    #[must_use]
    pub const fn split(&self) -> Option<Seen<(u16, u16)>> {
        self.split
    }

    /// True if a broadcast read came back in two copies, and one of them alone was processed by anybody.
    #[must_use]
    pub const fn was_processed_by_one(&self) -> bool {
        self.was_processed_by_one
    }

    /// True if broadcast reads came back in two copies: both cards of a ring send them.
    #[must_use]
    pub const fn came_in_copies(&self) -> bool {
        self.was_processed_by_one || self.split.is_some()
    }

    /// The latest broadcast read whose copies both came back, and of which one alone was processed by anybody:
    /// the card that had sent that one. In a closed ring that is card A, unless all are plugged in the wrong
    /// way round.
    #[must_use]
    pub const fn processed_alone(&self) -> Option<Seen<Path>> {
        self.processed_alone
    }

    /// Most controllers that a frame passed, by what they add to positions.
    #[must_use]
    pub const fn positions(&self) -> u16 {
        self.positions
    }

    /// Least number of controllers, by working counters and positions.
    #[must_use]
    pub fn counted(&self) -> u16 {
        self.most.max(self.positions)
    }

    /// The highest state that broadcast reads of AL status prove.
    #[must_use]
    pub const fn al_highest(&self) -> Option<AlState> {
        self.al_highest
    }
}
