//! # Frames damaged or lost between two ports of a capture probe
//!
//! A capture probe (ET2000) that is looped into the line sees frames come undamaged to one of its ports, and damaged,
//! or not at all, to the next one.
//!
//! **How it is found.** Each record of the probe (ESL) tells the port and errors of the check sequence. The copies of
//! a frame are put in the order in which it passes the ports. How many SubDevices lie before a port is told by the
//! address of broadcasts, which each SubDevice counts up. So what shows at a port and not at the one before arose
//! between the two, whatever any counter says. A SubDevice that finds a frame bad adds an odd nibble, which the probe
//! tells as an alignment error: a bad frame without it became bad after the last SubDevice, with it before that one.
//!
//! A tap inside the line adds no record, and its cards drop damaged frames: `linesman diagnose FILE --probe LINK` says
//! where it sits, and a frame that passed it on its way out and not on its way back was damaged or lost behind it.
//!
//! **What it means.** One of the links or devices between the two ports damages frames or loses them, in the
//! direction that is named. All of them are possible; where error counters were read, they narrow it, and the finding
//! of that link says what the probe saw. Nothing is said of what lies behind the last port on the way.
//!
//! **What to do.** Move the probe, or a channel of it, to a link in the middle of the range, and record again: each
//! time half of the range is left. Or read the error counters of the SubDevices in the range.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::route::Direction;

use super::{Rule, RulePage, View, frame_errors};
use crate::finding::{Alternative, Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::cause::CausePlace;
use crate::locate::probe_places::{ProbeSign, places};
use crate::model::probe_record::{ProbeSection, ProbeTally};
use crate::model::{NetworkModel, Pause};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H116",
    name: "damage-at-probe",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("damage_at_probe.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// So few marked frames may owe their odd nibble to the damage itself.
const FEW: u64 = 2;
/// So many frames are cut off, or lost, where a link or a device goes and comes.
const CUT_BY_CHANGE: u64 = 8;
/// What explains lost frames was noticed so shortly before or after them.
const AROUND: Span = Span::ms(500);
/// What did not come again for this long is over.
const QUIET: Span = Span::s(2);
/// A pause of the frames at a port that is worth a word.
const LONG: Span = Span::ms(20);
/// Most places that are named one by one.
const NAMED: usize = 4096;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for section in view.model.capture_probe.sections() {
        let marked = match section.marked.frames.sum {
            0..=FEW => ProbeSign::FewMarked,
            _ => ProbeSign::Marked,
        };
        let (fresh, lost) = match view.model.capture_probe.order.is_tap() {
            // Its cards do not tell whether a controller has found the frame bad.
            true => (ProbeSign::FewMarked, ProbeSign::Missing),
            false => (ProbeSign::Fresh, ProbeSign::Lost),
        };
        let kinds = [(fresh, section.fresh), (marked, section.marked), (lost, section.lost)];
        for (sign, tally) in kinds {
            add(view, section, sign, tally, conditions);
        }
        show_turn(view, section, conditions);
    }
    let pause = nothing_came(view, conditions);
    conditions.extend(pause);
    add_link_before_probe(view, conditions);
}

fn add(
    view: &View<'_>,
    section: &ProbeSection,
    sign: ProbeSign,
    tally: ProbeTally,
    conditions: &mut Vec<Condition>,
) {
    let model = view.model;
    let (Some(first), Some(last)) = (tally.frames.first, tally.frames.last) else { return };
    let found = model
        .tree
        .as_ref()
        .and_then(|tree| places(&model.capture_probe, tree, section.from, section.to, sign));
    let found: Vec<Place> =
        found.unwrap_or_default().into_iter().map(|at| place(model, at)).collect();
    let text = text(model, section, sign, tally);
    let evidence = Evidence::frame(first, tally.first.unwrap_or(0), text);
    let count = tally.frames.sum;
    // What counters, links or states have placed already, in this range.
    let is_here = |one: &Condition| found.iter().any(|place| place.is_same_spot(&one.place));
    let is_known = |one: &&mut Condition| match one.page.code {
        "H110" | "H111" => is_here(one),
        _ => count <= CUT_BY_CHANGE && explains(one, first, last),
    };
    let mut known = conditions.iter_mut().filter(is_known).peekable();
    if known.peek().is_some() {
        known.for_each(|one| one.evidence.push(evidence.clone()));
        return;
    }
    let network = Place::Network { network: model.network };
    let at = found.first().copied().unwrap_or(network);
    let share = 1.0 / found.len().max(1) as f64;
    let mut condition = Condition::new(&PAGE, at, cause(&at, sign), first)
        .confirmed(first)
        .confidence(0.9 * share)
        .shown_by(evidence)
        .explaining([Symptom::FramesLost, Symptom::CardErrors])
        .explaining(frame_errors::starved(view));
    for other in found.iter().skip(1).take(NAMED) {
        condition.alternatives.push(Alternative {
            cause: cause(other, sign),
            place: Some(*other),
            confidence: 0.9 * share,
        });
    }
    condition.severity = match (sign, count) {
        (ProbeSign::Lost | ProbeSign::Missing, 1) => Severity::Info,
        (ProbeSign::Lost, _) | (_, 1) => Severity::Warning,
        (_, _) => Severity::Error,
    };
    if last + QUIET < view.now {
        condition = condition.ended(last);
    }
    conditions.push(advise(condition, model, section, found.len()));
}

/// Nothing came to the first port of a probe inside the line for a while. A MainDevice that had lost frames before sends
/// nothing meanwhile: then that is evidence of what has damaged them.
fn nothing_came(view: &View<'_>, conditions: &mut [Condition]) -> Option<Condition> {
    let model = view.model;
    let first = model.capture_probe.inside()?;
    let pauses = model.cyclic.iter().flat_map(|cyclic| &cyclic.sent.pauses);
    let is_long = |pause: &&Pause| pause.span() >= LONG && is_quiet(model, pause);
    let longest = pauses.filter(is_long).max_by_key(|pause| pause.span())?;
    let mut damage = model.capture_probe.sections().iter().filter(|one| has_begun(one, longest));
    if damage.next().is_some() {
        let text =
            format!("then nothing came to {} for {}", port_text(model, first), longest.span());
        let is_damage = |one: &&mut Condition| {
            matches!(one.page.code, "H110" | "H111" | "H116") && one.since <= longest.from
        };
        for one in conditions.iter_mut().filter(is_damage) {
            one.evidence.push(Evidence::frame(longest.from, 0, text.clone()));
        }
        return None;
    }
    let tree = model.tree.as_ref();
    let found =
        tree.and_then(|tree| places(&model.capture_probe, tree, None, first, ProbeSign::Lost));
    let found: Vec<Place> =
        found.unwrap_or_default().into_iter().map(|at| place(model, at)).collect();
    let text = format!(
        "nothing came to {} for {}: nothing was sent, or it was lost before",
        port_text(model, first),
        longest.span()
    );
    let network = Place::Network { network: model.network };
    let at = found.first().copied().unwrap_or(network);
    let share = 0.9 / found.len().max(1) as f64;
    let mut condition = Condition::new(&PAGE, at, FaultName::WatchdogStarved, longest.from)
        .confirmed(longest.to)
        .confidence(share)
        .shown_by(Evidence::frame(longest.from, 0, text))
        .explaining(frame_errors::starved(view))
        .ended(longest.to);
    for other in found.iter().skip(1).take(NAMED) {
        let cause = cause(other, ProbeSign::Lost);
        condition.alternatives.push(Alternative { cause, place: Some(*other), confidence: share });
    }
    condition.severity = Severity::Warning;
    Some(condition.advise(
        "Put a channel of the probe into the link of the MainDevice: it tells what was sent.",
    ))
}

/// True if no frame at all came for most of a pause of the process data: those of a new start-up may come meanwhile.
fn is_quiet(model: &NetworkModel, pause: &Pause) -> bool {
    let quiet = |one: Pause| {
        let (from, to) = (one.from.max(pause.from), one.to.min(pause.to));
        to > from && to.since(from) * 2 >= pause.span()
    };
    model.quiet().any(quiet)
}

/// True if more frames than a change of a link costs were damaged or lost in a section when a pause began.
fn has_begun(section: &ProbeSection, pause: &Pause) -> bool {
    let then = |tally: ProbeTally| {
        let (Some(first), Some(last)) = (tally.frames.first, tally.frames.last) else {
            return false;
        };
        tally.frames.sum > CUT_BY_CHANGE && first <= pause.from && pause.from <= last + AROUND
    };
    [section.fresh, section.marked, section.lost].into_iter().any(then)
}

/// The probe may sit at either end of the link of the MainDevice: what was not sent, and what was lost on that link before
/// the probe, look alike.
fn add_link_before_probe(view: &View<'_>, conditions: &mut [Condition]) {
    let model = view.model;
    let record = &model.capture_probe;
    let Some(first) = record.order.ports().first().filter(|_| record.order.len() > 1) else {
        return;
    };
    if record.order.before(first.number) != Some(0) {
        return;
    }
    let tree = model.tree.as_ref();
    let found = tree.and_then(|tree| places(record, tree, None, first.number, ProbeSign::Lost));
    let link = found.into_iter().flatten().find(|at| matches!(at, CausePlace::Link(..)));
    let Some(link) = link.map(|at| place(model, at)) else { return };
    for paused in conditions.iter_mut().filter(|one| one.page.code == "X513") {
        let cause = cause(&link, ProbeSign::Lost);
        let confidence = paused.confidence / 2.0;
        paused.alternatives.push(Alternative { cause, place: Some(link), confidence });
    }
}

/// True if a condition explains a few frames that were lost or cut off then.
fn explains(condition: &Condition, first: Instant, last: Instant) -> bool {
    let is_then = condition.since.before(AROUND) <= last
        && condition.ended.is_none_or(|ended| ended + AROUND >= first);
    let is_loss = |symptom: &Symptom| {
        matches!(symptom, Symptom::FramesLost | Symptom::NobodyAnswers | Symptom::LinkDown(..))
    };
    is_then
        && condition.page.code != PAGE.code
        && condition.page.code != "H112"
        && condition.explains.iter().any(is_loss)
}

/// Frames that turned back are evidence of a line that ends early.
fn show_turn(view: &View<'_>, section: &ProbeSection, conditions: &mut [Condition]) {
    let model = view.model;
    let (Some(first), Some(last)) = (section.turned.frames.first, section.turned.frames.last)
    else {
        return;
    };
    let text = format!(
        "{} of {} frames turned back between {} and {}: from {first} to {last} the line ended there",
        section.turned.frames.sum,
        model.capture_probe.passages,
        from_text(model, section.from),
        port_text(model, section.to),
    );
    for one in conditions.iter_mut().filter(|one| explains(one, first, last)) {
        let evidence = Evidence::frame(first, section.turned.first.unwrap_or(0), text.clone());
        one.evidence.push(evidence);
    }
}

fn place(model: &NetworkModel, at: CausePlace) -> Place {
    let network = model.network;
    let link = |index: usize| model.tree.as_ref().and_then(|tree| tree.links().get(index));
    match at {
        CausePlace::Link(index, direction) => {
            let direction = direction.map(|direction| match direction {
                Direction::Downstream => LinkDirection::AToB,
                Direction::Upstream => LinkDirection::BToA,
            });
            link(index).map_or(Place::Network { network }, |link| {
                Place::link(network, link.map(|node| DeviceId(node as u32)), direction)
            })
        }
        CausePlace::Device(node) => Place::device(network, DeviceId(node as u32)),
        CausePlace::Host => Place::Host,
    }
}

const fn cause(place: &Place, sign: ProbeSign) -> FaultName {
    match (place, sign) {
        (Place::Host, ProbeSign::Lost) => FaultName::HostDrops,
        (Place::Host, _) => FaultName::NicDamaged,
        (Place::Device { .. }, ProbeSign::Lost) => FaultName::DeviceOff,
        (Place::Device { .. }, _) => FaultName::DeviceInternal,
        (_, ProbeSign::Lost) => FaultName::FalseLink,
        (_, _) => FaultName::CableDegraded,
    }
}

/// What was seen, and where it arose.
fn text(
    model: &NetworkModel,
    section: &ProbeSection,
    sign: ProbeSign,
    tally: ProbeTally,
) -> String {
    let (count, of) = (tally.frames.sum, model.capture_probe.passages);
    let (from, to) = (from_text(model, section.from), port_text(model, section.to));
    let undamaged = match section.from {
        Some(_) => "came undamaged to",
        None => "were sent by",
    };
    match sign {
        ProbeSign::Lost => {
            format!(
                "{count} of {of} frames {undamaged} {from} and not to {to}: they were lost between the two"
            )
        }
        ProbeSign::Missing => format!(
            "{count} of {of} frames came to {from} and not to {to}: they were damaged or lost between the two (a \
             card drops damaged frames)"
        ),
        ProbeSign::Fresh => format!(
            "{count} of {of} frames had a wrong check sequence at {to}, and {undamaged} {from}; no SubDevice had \
             marked them as bad: they became bad behind the last SubDevice, on the link of this port or in what \
             sends on it"
        ),
        ProbeSign::Marked => format!(
            "{count} of {of} frames had a wrong check sequence at {to}, and {undamaged} {from}; a SubDevice had \
             marked all of them as bad: they became bad between the two, before the last SubDevice"
        ),
        ProbeSign::FewMarked => format!(
            "{count} of {of} frames had a wrong check sequence at {to}, and {undamaged} {from}: they became bad \
             between the two"
        ),
    }
}

fn from_text(model: &NetworkModel, port: Option<u8>) -> String {
    port.map_or_else(|| "the MainDevice".to_owned(), |port| port_text(model, port))
}

/// A port of the probe with its place: `port 2 of the probe (on the link to SubDevice 5, on the way out)`.
fn port_text(model: &NetworkModel, port: u8) -> String {
    match model.capture_probe.order.is_tap() {
        true => format!("the tap {}", port_place(model, port)),
        false => format!("port {port} of the probe ({})", port_place(model, port)),
    }
}

/// The place of a port of the probe: `on the link to SubDevice 5, on the way out`.
#[must_use]
pub fn port_place(model: &NetworkModel, port: u8) -> String {
    let order = &model.capture_probe.order;
    let (way, out) = match order.is_back(port) {
        true => ("way back", port ^ 1),
        false => ("way out", port),
    };
    let Some(before) = order.before(out) else {
        return format!("place unknown, on the {way}");
    };
    let nodes = model.tree.as_ref().map(|tree| tree.order());
    let node = nodes.and_then(|nodes| nodes.get(usize::from(before)).copied());
    let label = node.map(|node| model.label(DeviceId(node as u32)));
    let label = label.unwrap_or_else(|| format!("SubDevice {}", before + 1));
    format!("on the link to {label}, on the {way}")
}

fn advise(
    condition: Condition,
    model: &NetworkModel,
    section: &ProbeSection,
    places: usize,
) -> Condition {
    let (from, to) = (from_text(model, section.from), port_text(model, section.to));
    let condition = match places {
        0 | 3.. => condition.advise(format!(
            "Put a channel of the probe into a link between {from} and {to}, and record again: one half of the \
             range is left."
        )),
        1 | 2 => condition,
    };
    let condition = match model.capture_probe.order.is_tap() {
        true => condition.advise(
            "Look whether the computer that recorded has lost frames itself (`capinfos`, drops of its cards): that looks \
             the same.",
        ),
        false => condition,
    };
    condition
        .advise("Read the error counters (0x0300 to 0x0313) of the SubDevices in the range: they name the link.")
        .advise("Check cables, plugs and contacts in the range, then the devices.")
}
