//! # Frames come back late
//!
//! Frames come back later than the line can make them.
//!
//! **How it is found.** A line takes the same time for the same frame, to some nanoseconds; what a frame waits
//! for on its card is the frame before it. One that takes 60 µs more than the shortest of its length, and far
//! more than this computer usually wanders, was kept back. Many in a row that take the same longer time took
//! another way: no finding; nor is it one as long as no process data are exchanged in a cycle. A recording tells
//! it too, since it has the times at which frames went out and came back. It is told of frames that are late by a
//! tenth of the cycle or more, and of any that cost a SubDevice its step. A computer that keeps frames back from
//! the first one on shows by the fastest frames: two in a hundred that are later by a fifth of the cycle are told.
//!
//! **What it means.** The line is well: no controller counts anything. The computer, its card, a switch or a
//! converter in between kept the frame back. Single frames now and then are the computer's: interrupts, another
//! program, power saving. When most frames are late by more and less, they wait in a queue. SubDevices that work
//! in step with a SYNC signal miss outputs that come behind it, and leave OP; that is listed beneath. For all
//! others it is worth knowing, no more.
//!
//! **What to do.** `linesman host --measure 10` tells how late this computer is, and what mends it. Take switches
//! and converters out of the way.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::round_trip::LateFrame;
use crate::model::spell::TOGETHER;
use crate::model::{Device, NetworkModel};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "T411",
    name: "frames-late",
    severity: Severity::Info,
    class: Class::Timing,
    source: include_str!("late.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// What did not come again for this long is over.
const QUIET: Span = Span::s(2);
/// Where nobody keeps step, what is late by this part of the cycle is told: half of what is doubtful to whoever does.
const NOTABLE: u64 = 10;
/// What is late by this part of the cycle all the time is told, whatever is usual here …
const HELD_BACK: u64 = 10;
/// … if it is so many frames …
const SEVERAL: u64 = 16;
/// … and such a share, in percent.
const OFTEN_PERCENT: u64 = 2;
/// With this share the frames wait in a queue, in percent.
const QUEUE_PERCENT: u64 = 50;

/// Frames that came back late.
struct Late {
    /// The first one of the latest spell.
    first: LateFrame,
    /// The latest one.
    last: LateFrame,
    /// By how much at most.
    worst: Span,
    /// Whether most frames are late, as in a queue.
    is_queue: bool,
    text: String,
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    // Nobody waits for a frame that is sent when its sender likes.
    let keeps_step = model.devices.iter().any(|device| device.sync_on.is_some_and(|on| on.value));
    let Some(cycle) = shortest_cycle(model) else { return };
    // What is late by less does no harm, unless somebody lost step by it.
    let hurts = |late: &Late| keeps_step && !hurt(model, late, cycle, conditions).is_empty();
    let matters = |late: &Late| late.worst * NOTABLE >= cycle || hurts(late);
    let unusual = unusual(model, cycle).filter(matters);
    let Some(late) = unusual.or_else(|| held_back(model, cycle)) else { return };
    let condition = condition(view, &late, cycle, keeps_step, conditions);
    conditions.push(condition);
}

/// Frames that were later than is usual here.
fn unusual(model: &NetworkModel, cycle: Span) -> Option<Late> {
    let round_trips = &model.round_trips;
    let latest = round_trips.late.latest();
    let last = *latest.back()?;
    let mut earlier = round_trips.late.earlier();
    let mut first = last;
    for late in latest.iter().rev() {
        if first.sent.since(late.sent) > TOGETHER {
            earlier = None;
            break;
        }
        first = *late;
    }
    let of_spell = || latest.iter().filter(|late| late.sent >= first.sent);
    let worst = of_spell().map(|late| late.by).chain(earlier.map(|earlier| earlier.worst)).max();
    let worst = worst.unwrap_or(Span::ZERO);
    let first = earlier.map_or(first, |earlier| earlier.first);
    let text = format!(
        "{} later than the line takes: by {:.3} ms at most, {} % of the cycle",
        match round_trips.late_count {
            1 => "one frame came back".to_owned(),
            late => format!(
                "{late} of {} frames between the first late one and the last came back",
                round_trips.compared
            ),
        },
        worst.as_secs_f64() * 1e3,
        percent(worst, cycle)
    );
    Some(Late { first, last, worst, is_queue: round_trips.is_queue(), text })
}

/// Frames that were late by a part of the cycle that matters, all the time: who listens since then knows no better.
fn held_back(model: &NetworkModel, cycle: Span) -> Option<Late> {
    let held = model.round_trips.held_back(Span::ns(cycle.as_nanos() / HELD_BACK))?;
    if held.count < SEVERAL || held.count * 100 < held.compared * OFTEN_PERCENT {
        return None;
    }
    let worst = held.worst.by;
    let text = format!(
        "{} of {} frames came back {:.3} ms or more later than the fastest of their length, the worst by \
         {:.3} ms, {} % of the cycle",
        held.count,
        held.compared,
        held.by.as_secs_f64() * 1e3,
        worst.as_secs_f64() * 1e3,
        percent(worst, cycle)
    );
    let is_queue = held.count * 100 >= held.compared * QUEUE_PERCENT;
    Some(Late { first: held.first, last: held.last, worst, is_queue, text })
}

fn percent(part: Span, whole: Span) -> u64 {
    part.as_nanos() * 100 / whole.as_nanos().max(1)
}

fn condition(
    view: &View<'_>,
    late: &Late,
    cycle: Span,
    keeps_step: bool,
    conditions: &[Condition],
) -> Condition {
    let model = view.model;
    let Late { first, last, worst, .. } = late;
    let (cause, other) = if late.is_queue {
        (FaultName::LateFrames, FaultName::HostJitter)
    } else {
        (FaultName::HostJitter, FaultName::LateFrames)
    };
    let is_recorded = !model.traffic.recording.is_direction_known();
    let mut condition = Condition::new(&PAGE, Place::Host, cause, first.sent)
        .confidence(0.6)
        .or(other, 0.3)
        .confirmed(first.sent + first.by)
        .about([Symptom::FramesLate])
        .shown_by(Evidence::frame(last.sent + last.by, last.frame, late.text.clone()))
        .advise("Run `linesman host --measure 10`: it tells what makes this computer late, and what mends it.")
        .advise("Take switches and media converters out of the way between card and first SubDevice.");
    let hurt = hurt(model, late, cycle, conditions);
    if hurt.is_empty() && is_recorded {
        let text = match keeps_step {
            true => "no SubDevice has lost its step meanwhile, as far as the recording shows",
            false => {
                "nobody keeps step with SYNC signals, as far as the recording shows: nobody missed them"
            }
        };
        condition = condition.shown_by(Evidence::host(Some(last.sent), text));
    }
    if !hurt.is_empty() {
        condition.severity = Severity::Error;
        condition = condition.explaining(hurt.iter().map(|device| Symptom::StateLost(device.id)));
        condition =
            condition.explaining(hurt.iter().map(|device| Symptom::WorkingCounter(device.id)));
    } else if keeps_step && *worst >= cycle {
        // Where nobody keeps step, a late frame costs a cycle; every computer has some.
        condition.severity = Severity::Warning;
    }
    if last.sent + QUIET < view.now {
        condition = condition.ended(last.sent + last.by);
    }
    condition
}

/// SubDevices that lost step while frames were late. Where damage on the line explains it of one, as frames that are lost
/// bring neither outputs nor the time of the reference clock, it was that, unless others were late by a part of the cycle
/// that matters.
fn hurt<'m>(
    model: &'m NetworkModel,
    late: &Late,
    cycle: Span,
    known: &[Condition],
) -> Vec<&'m Device> {
    // The set-up of SYNC signals may have been before the first frame that was seen.
    let may_be_unseen = !model.sees_all_orders;
    let may_keep_step = |device: &&Device| device.sync_on.map_or(may_be_unseen, |on| on.value);
    let in_step = model.devices.iter().filter(may_keep_step);
    let until = late.last.sent + late.last.by;
    let is_slight = late.worst * NOTABLE < cycle;
    let is_explained = |device: &Device| {
        let lost = Symptom::StateLost(device.id);
        let mut known = known.iter().filter(|one| one.page.class == Class::Hardware);
        known.any(|one| one.explains.contains(&lost))
    };
    let lost_step = |device: &&Device| {
        device.lost_step_within(late.first.sent, until, Some(cycle + late.worst))
    };
    in_step.filter(lost_step).filter(|device| !(is_slight && is_explained(device))).collect()
}

/// The shortest cycle of process data.
fn shortest_cycle(model: &NetworkModel) -> Option<Span> {
    model.cyclic.iter().filter_map(|cyclic| cyclic.sent.cycle()).min()
}
