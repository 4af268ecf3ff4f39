//! Process data: each logical datagram with the working counter it usually comes back with.

use std::collections::VecDeque;

use linesman_proto::address::{DeviceId, LogicalAddress};
use linesman_proto::command::Command;
use linesman_proto::time::Instant;

use super::input_activity::InputActivity;
use super::{CycleTiming, Seen};

/// Deficits kept of one datagram.
pub const DEFICITS_KEPT: usize = 16;

/// A logical datagram that is sent again and again.
#[derive(Clone, Debug)]
pub struct Cyclic {
    /// LRD, LWR or LRW.
    pub command: Command,
    /// What another program calls it, where nobody saw the datagram itself.
    pub name: Option<String>,
    /// Where it begins.
    pub start: LogicalAddress,
    /// Its length in bytes.
    pub len: u16,
    /// How often it came back.
    pub count: u64,
    /// The working counter it came back with for the first time.
    pub first: Seen<u16>,
    /// The working counter it comes back with, since when.
    pub wkc: Seen<u16>,
    /// The highest working counter since the process data were set up, when it was first reached:
    /// what is expected from then on.
    pub highest: Seen<u16>,
    /// The working counter that was planned for it, where that is known.
    pub planned: Option<u16>,
    /// When the working counter was too low, oldest first, at most [`DEFICITS_KEPT`].
    pub deficits: VecDeque<Deficit>,
    /// When it was sent.
    pub sent: CycleTiming,
    /// When it came back.
    pub returned: CycleTiming,
    /// Which of its inputs move.
    pub motion: InputActivity,
    /// When the working counter last fell, where it may have been ordered without anybody having seen it.
    pub may_be_ordered: Option<Seen<u16>>,
    /// Whether the process data were laid out anew since it last came back: the next working counter is the
    /// first of the new layout.
    is_laid_out_anew: bool,
}

/// A stretch of time in which a working counter was too low.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Deficit {
    /// What was expected.
    pub expected: u16,
    /// The first working counter that was too low.
    pub first: Seen<u16>,
    /// The lowest one.
    pub lowest: u16,
    /// How many datagrams came back so.
    pub count: u64,
    /// When it was right again.
    pub ended: Option<Instant>,
}

/// Whether the MainDevice has taken SubDevices out of the states in which they exchange process data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ordered {
    /// It has.
    Yes,
    /// It has not.
    No,
    /// It may have, in a frame that was not seen.
    Unseen,
}

/// Who has an FMMU on a logical datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Owner {
    /// The controller.
    pub device: DeviceId,
    /// It puts inputs there.
    pub reads: bool,
    /// It takes outputs from there.
    pub writes: bool,
}

impl Cyclic {
    /// A datagram that came back for the first time.
    #[must_use]
    pub fn new(command: Command, start: LogicalAddress, len: u16, wkc: Seen<u16>) -> Self {
        Self {
            command,
            name: None,
            start,
            len,
            count: 1,
            first: wkc,
            wkc,
            highest: wkc,
            planned: None,
            deficits: VecDeque::new(),
            sent: CycleTiming::default(),
            returned: CycleTiming::default(),
            motion: InputActivity::default(),
            may_be_ordered: None,
            is_laid_out_anew: false,
        }
    }

    /// What it is called in messages.
    #[must_use]
    pub fn label(&self) -> String {
        match &self.name {
            Some(name) => format!("{} `{name}`", self.command),
            None => format!("{} at {}, {} bytes", self.command, self.start, self.len),
        }
    }

    /// Whether a working counter is too low now.
    #[must_use]
    pub fn has_deficit(&self) -> bool {
        self.deficits.back().is_some_and(|deficit| deficit.ended.is_none())
    }

    /// Notes that FMMUs of this datagram were set otherwise at `at`: what was expected of it holds no longer, what
    /// was missing before that was missing all the same.
    pub fn lay_out_anew(&mut self, at: Instant) {
        self.is_laid_out_anew = true;
        self.set_up_again();
        if let Some(deficit) = self.deficits.back_mut() {
            deficit.ended.get_or_insert(at);
        }
    }

    /// Notes that FMMUs of this datagram were set again: while SubDevices are brought up frames come unevenly.
    pub fn set_up_again(&mut self) {
        self.motion.forget();
        (self.sent, self.returned) = (CycleTiming::default(), CycleTiming::default());
    }

    /// Notes that the working counter is lower than planned although nothing explains it: the datagram came back so
    /// from the first time on. Says whether that is news.
    pub fn note_below_plan(&mut self) -> bool {
        let Some(planned) = self.planned.filter(|planned| self.highest.value < *planned) else {
            return false;
        };
        let lowest = self.wkc.value;
        self.highest = Seen { value: planned, ..self.wkc };
        if self.has_deficit() {
            return false;
        }
        if self.deficits.len() == DEFICITS_KEPT {
            self.deficits.pop_front();
        }
        let (expected, first, count) = (planned, self.wkc, 1);
        self.deficits.push_back(Deficit { expected, first, lowest, count, ended: None });
        true
    }

    /// Notes that the working counter rises though nobody has ordered it: it was too low from the first time on that the
    /// datagram was seen.
    pub fn note_low_before(&mut self, rise: Seen<u16>) {
        let is_first = self.deficits.is_empty() && !self.is_laid_out_anew;
        if is_first && rise.value > self.highest.value && self.wkc.value == self.first.value {
            self.deficits.push_back(Deficit {
                expected: rise.value,
                first: self.first,
                lowest: self.first.value,
                count: self.count,
                ended: Some(rise.at),
            });
        }
    }

    /// The working counter was too low from the first time on that the datagram was seen, and rose though nobody had
    /// ordered it.
    #[must_use]
    pub fn low_before(&self) -> Option<&Deficit> {
        let first = self.deficits.front().filter(|_| self.planned.is_none())?;
        (first.first == self.first).then_some(first)
    }

    /// Takes a working counter. `ordered` tells, when it falls, whether the MainDevice asked for it by taking a
    /// SubDevice out of SAFEOP or OP. Says whether it is news.
    pub fn record(&mut self, wkc: Seen<u16>, ordered: impl FnOnce() -> Ordered) -> bool {
        self.count += 1;
        if std::mem::take(&mut self.is_laid_out_anew) {
            (self.first, self.wkc, self.highest) = (wkc, wkc, wkc);
            return true;
        }
        let open = self.deficits.back_mut().filter(|deficit| deficit.ended.is_none());
        if wkc.value == self.wkc.value {
            if let Some(deficit) = open {
                deficit.count += 1;
            }
            return false;
        }
        self.wkc = wkc;
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
        if self.deficits.len() == DEFICITS_KEPT {
            self.deficits.pop_front();
        }
        self.deficits.push_back(Deficit {
            expected: self.highest.value,
            first: wkc,
            lowest: wkc.value,
            count: 1,
            ended: None,
        });
        true
    }
}
