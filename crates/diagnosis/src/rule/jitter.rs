//! # Jitter against the cycle
//!
//! Process data are sent, or come back, unevenly.
//!
//! **How it is found.** The usual interval between two frames with the same process data is the cycle. An
//! interval that is 20 % of the cycle too long or too short is doubtful, 30 % are bad (S0, runtime
//! errors). Several within ten seconds are the finding. Where all frames leave evenly and come back
//! unevenly, they were late behind the point of observation: in a queue, in the card.
//!
//! **What it means.** A SubDevice that works in step with its SYNC signal needs its outputs before the
//! signal, in every cycle. Frames that come later than the shift allows are missed: the SubDevice counts
//! them (0x1C32:0B) and, after some, leaves OP with a synchronisation error. As long as no SYNC signal was
//! seen being switched on (0x0981), jitter makes outputs uneven and does no other harm: no finding, but a note
//! where it is seen in a recording that frames came to the card unevenly, by 10 % of the cycle or more.
//!
//! **What to do.** `linesman host --measure 10` tells how late this computer begins its cycles, and what to
//! change. Then lengthen the cycle, or move the shift of the SYNC signal away from the frame.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::spell::{Earlier, TOGETHER};
use crate::model::{Absence, CycleDeviation, CycleTiming, Cyclic, Device};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "T410",
    name: "jitter",
    severity: Severity::Warning,
    class: Class::Timing,
    source: include_str!("jitter.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// How much jitter is too much.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Verdict {
    /// 20 % of the cycle and more: synchronisation may be lost.
    Doubtful,
    /// 30 % of the cycle and more: synchronisation errors are likely.
    Bad,
}

impl Verdict {
    const DOUBTFUL_PERCENT: u64 = 20;
    const BAD_PERCENT: u64 = 30;

    /// The verdict on a deviation; `None` where it does no harm.
    #[must_use]
    pub const fn of(deviation: Span, cycle: Span) -> Option<Self> {
        let (by, of) = (deviation.as_nanos() as u128 * 100, cycle.as_nanos() as u128);
        if by >= of * Self::BAD_PERCENT as u128 {
            Some(Self::Bad)
        } else if by >= of * Self::DOUBTFUL_PERCENT as u128 {
            Some(Self::Doubtful)
        } else {
            None
        }
    }

    /// From where on it is bad.
    #[must_use]
    pub const fn bad_from(cycle: Span) -> Span {
        Span::ns(cycle.as_nanos() / 100 * Self::BAD_PERCENT)
    }
}

/// One late frame makes two uneven intervals; a single one is no matter.
const OFTEN: usize = 3;
/// What did not come again for this long is over.
const QUIET: Span = Span::s(2);

/// The latest stretch of uneven intervals.
struct Interval<'a> {
    cyclic: &'a Cyclic,
    cycle: Span,
    /// Whether the frames left unevenly already.
    at_sending: bool,
    off: Vec<CycleDeviation>,
    /// Those before, which are not kept one by one.
    earlier: Option<Earlier<CycleDeviation>>,
}

impl Interval<'_> {
    fn worst(&self) -> Span {
        let earlier = self.earlier.map(|earlier| earlier.worst);
        self.off.iter().map(|off| off.by).chain(earlier).max().unwrap_or(Span::ZERO)
    }

    fn times(&self) -> u64 {
        self.off.len() as u64 + self.earlier.map_or(0, |earlier| earlier.count)
    }

    fn verdict(&self) -> Option<Verdict> {
        let bad =
            self.off.iter().filter(|off| Verdict::of(off.by, self.cycle) == Some(Verdict::Bad));
        if bad.count() >= OFTEN {
            Some(Verdict::Bad)
        } else {
            Verdict::of(self.worst(), self.cycle)
        }
    }
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let has_sync = |device: &&Device| device.sync_on.is_some_and(|on| on.value);
    let in_step: Vec<&Device> = view.model.devices.iter().filter(has_sync).collect();
    // A MainDevice that seeks SubDevices and sets them up sends when it has the time.
    let away: Vec<&Absence> = view.model.devices.iter().flat_map(|one| &one.absences).collect();
    let cyclic = view.model.cyclic.iter();
    let spells = cyclic.filter_map(|cyclic| spell(cyclic, !in_step.is_empty(), &away));
    let worst = spells.max_by_key(|spell| spell.worst());
    let Some(spell) = worst else { return };
    let (Some(first), Some(last)) = (spell.off.first(), spell.off.last()) else { return };
    let first = spell.earlier.map_or(*first, |earlier| earlier.first);
    // Whoever runs free takes outputs when they come. A recording, which has the times at which frames came to the
    // card, is the only witness of what the computer did before.
    let is_recorded = !view.model.traffic.recording.is_direction_known();
    if in_step.is_empty() && !(is_recorded && spell.at_sending) {
        return;
    }
    let severity = match spell.verdict() {
        _ if in_step.is_empty() => Severity::Info,
        Some(Verdict::Doubtful) => Severity::Warning,
        Some(Verdict::Bad) => Severity::Error,
        None => return,
    };
    // Single frames are kept back by the computer, most of them by a queue; who waits for those that are out sends
    // unevenly, too.
    let round_trips = &view.model.round_trips;
    let is_single = spell.at_sending || round_trips.late_count > 0;
    let (cause, other) = if is_single && !round_trips.is_queue() {
        (FaultName::HostJitter, FaultName::LateFrames)
    } else {
        (FaultName::LateFrames, FaultName::HostJitter)
    };
    // What was lost before, or by another cause, is none of its doing.
    let longest = spell.cycle + spell.worst();
    let is_hurt = |device: &&&Device| device.lost_step_within(first.at, last.at, Some(longest));
    let hurt = in_step.iter().filter(is_hurt);
    let mut condition = Condition::new(&PAGE, Place::Host, cause, first.at)
        .confidence(if spell.at_sending { 0.7 } else { 0.6 })
        .or(other, 0.25)
        .confirmed(spell.off[OFTEN - 1].at)
        .shown_by(evidence(&spell, last.at, in_step.len()))
        .explaining(hurt.map(|device| Symptom::StateLost(device.id)))
        .explaining([Symptom::FramesLate])
        .advise(
            "Run `linesman host --measure 10`: it tells what makes this computer late, and what mends it.",
        );
    condition.severity = severity;
    if !in_step.is_empty() {
        condition = condition.advise(
            "Lengthen the cycle, or move the shift of the SYNC signal away from the frame.",
        );
    }
    if last.at + QUIET < view.model.now {
        condition = condition.ended(last.at);
    }
    conditions.push(condition);
}

/// The latest spell of a datagram: of its sending, else of its return; where nobody keeps step, of less, too.
fn spell<'a>(cyclic: &'a Cyclic, keeps_step: bool, away: &[&Absence]) -> Option<Interval<'a>> {
    let of = |beat: &CycleTiming, at_sending| {
        let cycle = beat.cycle()?;
        let mut off: Vec<CycleDeviation> = Vec::new();
        let all = if keeps_step { &beat.off } else { &beat.uneven };
        let is_own = |at: Instant| !away.iter().any(|absence| absence.disturbs(at));
        // Those before belong to it as long as none is missing in between.
        let mut earlier = all.earlier().filter(|earlier| {
            let spell = earlier.first.at..=earlier.last.at;
            is_own(earlier.first.at) && !away.iter().any(|one| spell.contains(&one.since.at))
        });
        for one in all.latest().iter().rev() {
            if off.last().is_some_and(|later| later.at.since(one.at) > TOGETHER) {
                earlier = None;
                break;
            }
            if is_own(one.at) {
                off.push(*one);
            }
        }
        off.reverse();
        let earlier = earlier.copied();
        (off.len() >= OFTEN).then_some(Interval { cyclic, cycle, at_sending, off, earlier })
    };
    of(&cyclic.sent, true).or_else(|| of(&cyclic.returned, false))
}

fn evidence(spell: &Interval<'_>, at: Instant, in_step: usize) -> Evidence {
    let ms = |span: Span| span.as_nanos() as f64 / 1e6;
    let worst = spell.worst();
    let percent = worst.as_nanos() as f64 * 100.0 / spell.cycle.as_nanos() as f64;
    let what = if spell.at_sending { "were sent" } else { "came back" };
    let whom = match in_step {
        0 => "nobody keeps step with SYNC signals, as far as the recording shows".to_owned(),
        1 => "one SubDevice works in step with a SYNC signal".to_owned(),
        count => format!("{count} SubDevices work in step with SYNC signals"),
    };
    let text = format!(
        "process data at {} {what} unevenly {} times: by {:.3} ms of a cycle of {:.3} ms at most, that is \
         {percent:.0} %; {whom}",
        spell.cyclic.start,
        spell.times(),
        ms(worst),
        ms(spell.cycle)
    );
    Evidence::host(Some(at), text)
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: SYN-31 partial: the limits themselves
    #[test]
    fn limits_are_20_and_30_percent_of_the_cycle() {
        let of = |us| Verdict::of(Span::us(us), Span::ms(2));
        assert_eq!(of(399), None);
        assert_eq!(of(400), Some(Verdict::Doubtful));
        assert_eq!(of(599), Some(Verdict::Doubtful));
        assert_eq!(of(600), Some(Verdict::Bad));
        assert_eq!(Verdict::bad_from(Span::ms(2)), Span::us(600));
    }
}
