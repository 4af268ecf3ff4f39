//! Working counter of a datagram that is sent again and again, and its deficits.

use std::collections::VecDeque;

use linesman_proto::time::Instant;

use super::Seen;

/// Deficits kept of one datagram.
pub const DEFICITS_KEPT: usize = 16;

/// A stretch of time in which a working counter was too low.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Deficit {
    /// Expected working counter.
    pub expected: u16,
    /// The first working counter that was too low.
    pub first: Seen<u16>,
    /// The lowest one.
    pub lowest: u16,
    /// Number of datagrams that came back with it.
    pub count: u64,
    /// When it was right again.
    pub ended: Option<Instant>,
}

/// Knowledge of orders by which the MainDevice takes SubDevices out of the states in which they exchange process data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ordered {
    /// It has.
    Yes,
    /// It has not.
    No,
    /// It may have, in a frame that was not seen.
    Unseen,
}

/// The working counter of one datagram over time. The learner fills it in, or an observation file.
#[derive(Clone, Debug)]
pub struct WorkingCounterHistory {
    count: u64,
    first: Seen<u16>,
    now: Seen<u16>,
    highest: Seen<u16>,
    planned: Option<u16>,
    deficits: VecDeque<Deficit>,
    may_be_ordered: Option<Seen<u16>>,
    /// True if the process data were laid out anew since it last came back: the next working counter is the
    /// first of the new layout.
    is_laid_out_anew: bool,
}

impl WorkingCounterHistory {
    /// Of a datagram that came back for the first time, with the working counter that was planned for it.
    #[must_use]
    pub const fn new(first: Seen<u16>, planned: Option<u16>) -> Self {
        Self {
            count: 1,
            first,
            now: first,
            highest: first,
            planned,
            deficits: VecDeque::new(),
            may_be_ordered: None,
            is_laid_out_anew: false,
        }
    }

    // ---- what learner and observation files tell ----

    /// Takes a working counter. `ordered` tells, when it falls, whether the MainDevice asked for it by taking a
    /// SubDevice out of SAFEOP or OP. Says whether it is news.
    pub fn record(&mut self, wkc: Seen<u16>, ordered: impl FnOnce() -> Ordered) -> bool {
        self.count += 1;
        if std::mem::take(&mut self.is_laid_out_anew) {
            (self.first, self.now, self.highest) = (wkc, wkc, wkc);
            return true;
        }
        let open = self.deficits.back_mut().filter(|deficit| deficit.ended.is_none());
        if wkc.value == self.now.value {
            if let Some(deficit) = open {
                deficit.count += 1;
            }
            return false;
        }
        self.now = wkc;
        if wkc.value >= self.highest.value {
            if let Some(deficit) = open {
                deficit.ended = Some(wkc.at);
            }
            if wkc.value > self.highest.value {
                self.highest = wkc;
            }
            return true;
        }
        if let Some(deficit) = open {
            deficit.count += 1;
            deficit.lowest = deficit.lowest.min(wkc.value);
            return true;
        }
        match ordered() {
            Ordered::Yes => {
                self.highest = wkc;
                return true;
            }
            Ordered::Unseen => {
                (self.highest, self.may_be_ordered) = (wkc, Some(wkc));
                return true;
            }
            Ordered::No => {}
        }
        self.push_deficit(Deficit {
            expected: self.highest.value,
            first: wkc,
            lowest: wkc.value,
            count: 1,
            ended: None,
        });
        true
    }

    /// Notes that the FMMUs of the datagram were set otherwise at `at`: what was expected holds no longer, what was
    /// missing before that was missing all the same.
    pub(super) fn lay_out_anew(&mut self, at: Instant) {
        self.is_laid_out_anew = true;
        if let Some(deficit) = self.deficits.back_mut() {
            deficit.ended.get_or_insert(at);
        }
    }

    /// Notes that the working counter is lower than planned although nothing explains it: the datagram came back so
    /// from the first time on. Says whether that is news.
    pub fn note_below_plan(&mut self) -> bool {
        let Some(planned) = self.planned.filter(|planned| self.highest.value < *planned) else {
            return false;
        };
        let lowest = self.now.value;
        self.highest = Seen { value: planned, ..self.now };
        if self.has_deficit() {
            return false;
        }
        let (expected, first, count) = (planned, self.now, 1);
        self.push_deficit(Deficit { expected, first, lowest, count, ended: None });
        true
    }

    /// Notes that the working counter rises though nobody has ordered it: it was too low from the first time on that the
    /// datagram was seen.
    pub fn note_low_before(&mut self, rise: Seen<u16>) {
        let is_first = self.deficits.is_empty() && !self.is_laid_out_anew;
        if is_first && rise.value > self.highest.value && self.now.value == self.first.value {
            self.deficits.push_back(Deficit {
                expected: rise.value,
                first: self.first,
                lowest: self.first.value,
                count: self.count,
                ended: Some(rise.at),
            });
        }
    }

    /// Notes that the datagram came back so many times more while its working counter is too low, if it is.
    pub(crate) fn add_to_deficit(&mut self, count: u64) {
        if let Some(deficit) = self.deficits.back_mut().filter(|deficit| deficit.ended.is_none()) {
            deficit.count = deficit.count.saturating_add(count);
        }
    }

    fn push_deficit(&mut self, deficit: Deficit) {
        if self.deficits.len() == DEFICITS_KEPT {
            self.deficits.pop_front();
        }
        self.deficits.push_back(deficit);
    }

    // ---- what rules ask ----

    /// Number of times that the datagram came back.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The working counter it came back with for the first time.
    #[must_use]
    pub const fn first(&self) -> Seen<u16> {
        self.first
    }

    /// The working counter it comes back with, since when.
    #[must_use]
    pub const fn now(&self) -> Seen<u16> {
        self.now
    }

    /// The highest working counter since the process data were set up, when it was first reached:
    /// what is expected from then on.
    #[must_use]
    pub const fn highest(&self) -> Seen<u16> {
        self.highest
    }

    /// True if it was higher than the first time, since the process data were set up.
    #[must_use]
    pub const fn has_risen(&self) -> bool {
        self.highest.value > self.first.value
    }

    /// True if a working counter was planned for the datagram, and was reached.
    #[must_use]
    pub fn is_as_planned(&self) -> bool {
        self.planned.is_some_and(|planned| self.highest.value >= planned)
    }

    /// True if a working counter was planned for the datagram, and was not reached.
    #[must_use]
    pub fn is_below_plan(&self) -> bool {
        self.planned.is_some_and(|planned| self.highest.value < planned)
    }

    /// When it was too low, oldest first, at most [`DEFICITS_KEPT`].
    #[must_use]
    pub const fn deficits(&self) -> &VecDeque<Deficit> {
        &self.deficits
    }

    /// True if it is too low now.
    #[must_use]
    pub fn has_deficit(&self) -> bool {
        self.deficits.back().is_some_and(|deficit| deficit.ended.is_none())
    }

    /// The working counter was too low from the first time on that the datagram was seen, and rose though nobody had
    /// ordered it.
    #[must_use]
    pub fn low_before(&self) -> Option<&Deficit> {
        let first = self.deficits.front().filter(|_| self.planned.is_none())?;
        (first.first == self.first).then_some(first)
    }

    /// True if it has fallen, since the process data were set up, where that may have been ordered without anybody having
    /// seen it.
    #[must_use]
    pub fn may_be_ordered(&self) -> bool {
        self.may_be_ordered.is_some_and(|fell| fell.at >= self.first.at)
    }
}
