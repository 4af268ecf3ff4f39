//! # Frames are lost or damaged, and nothing says where
//!
//! The MainDevice misses frames, or its card drops damaged ones, and no counter of a SubDevice names a place.
//!
//! **How it is found.** An observation file or a pasted text tells of frames that did not come back, of datagrams
//! that were not back in time and never came, or of damaged frames that the card dropped, while the error
//! counters of the SubDevices were not read, or did not move. Beside another MainDevice, and in its recordings, frames
//! are seen to go out and not to come back, and nobody reads counters: a note where it is one. Other findings that explain lost
//! frames take precedence.
//!
//! **What it means.** A frame that is damaged on the line comes back, and the card counts it: so many damaged
//! frames at the card are damage somewhere on the way round. Frames that are missing while the card counts no
//! damaged one were not damaged: the computer lost them, they came too late, or a link was open for a moment.
//! Without the card's counters all of these are possible. A few lost frames of the time when the line started are
//! no trouble.
//!
//! **What to do.** Read the error counters of all SubDevices (0x0300 to 0x0313) and those of the card
//! (`ethtool -S eth0`), twice with some minutes between them, and give both readings: `linesman schema
//! observations`. Live, `linesman counters eth0 --clear --for 60` does it.

use linesman_config::fault::{Class, FaultName};

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View, nobody_answers};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, NetworkModel, Tally, Traffic};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H114",
    name: "frames-lost-unplaced",
    severity: Severity::Warning,
    class: Class::Hardware,
    source: include_str!("frames_unplaced.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Of so many frames one may get lost on a good line.
const RARE: u64 = 100_000;
/// A single one proves no trouble.
const SEVERAL: u64 = 2;
/// What explains lost frames was noticed so shortly before or after them.
const AROUND: Span = Span::ms(500);
/// What did not come again for this long is over.
const QUIET: Span = Span::s(2);
/// Of so many frames one is too much for a line that is to work.
const OFTEN: u64 = 1_000;

/// Losses before an error of step that are taken for its cause. A single one is not: SubDevices bear missed events up to
/// a limit (0x10F1:02).
const FOR_A_STEP: usize = 2;
/// So many intervals make a rhythm.
const RHYTHM: usize = 6;

/// What is missing or damaged.
struct Missing {
    lost: u64,
    /// Damaged frames that the card dropped; `None` when nobody told.
    damaged: Option<u64>,
    corrupted: u64,
    first: Tally,
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    if model.traffic.recording.frames() > 0 {
        conditions.extend(seen(view, conditions));
        return;
    }
    if !model.reported.tells_of_frames() && !model.host.is_watched {
        return;
    }
    let explains = |symptom: Symptom| {
        conditions
            .iter()
            .any(|one| one.explains.contains(&symptom) || one.symptoms.contains(&symptom))
    };
    let (lost_told, card_told) = (explains(Symptom::FramesLost), explains(Symptom::CardErrors));
    let mut missing = missing(model);
    if lost_told {
        missing.lost = 0;
    }
    if card_told {
        missing.damaged = missing.damaged.map(|_| 0);
    }
    let damaged = missing.damaged.unwrap_or(0).saturating_add(missing.corrupted);
    if missing.lost == 0 && damaged == 0 {
        return;
    }
    conditions.push(condition(view, &missing, damaged));
}

/// Frames that were seen to go out and not to come back, beside another MainDevice or in a recording.
///
/// Who drives the line asks for counters, and says no more than these do.
fn seen(view: &View<'_>, conditions: &[Condition]) -> Option<Condition> {
    let model = view.model;
    let traffic = &model.traffic;
    // In a ring one copy may be lost alone.
    let tallies =
        [traffic.losses.frames(), traffic.losses.copies(Path::A), traffic.losses.copies(Path::B)];
    let first = tallies.iter().filter_map(|tally| tally.first).min()?;
    let last = tallies.iter().filter_map(|tally| tally.last).max()?;
    let count: u64 = tallies.iter().map(|tally| tally.sum).sum();
    // A recorder that misses requests misses returns, too.
    let is_recorder = traffic.recording.has_gaps()
        || traffic.recording.cut() > 0
        || traffic.recording.missed() > 0;
    // What is lost in a row is another rule's; of those that are still missing it is not known whether they are the
    // first of many.
    let in_a_row = traffic.losses.silences().iter().filter(|one| {
        let is_open = one.ended.is_none() && !view.has_ended;
        is_open || one.frames >= nobody_answers::CERTAIN
    });
    let single = count.saturating_sub(in_a_row.map(|one| one.frames).sum());
    let went_on = traffic.returns.latest().is_some_and(|returned| returned.at > first);
    if single == 0 || !went_on || model.sees_all_orders || traffic.is_one_sided() || is_recorder {
        return None;
    }
    if conditions.iter().any(|one| explains_losses(one, first, last)) {
        return None;
    }
    let damaged = model.host.is_watched.then_some(model.host.card(Path::A).crc.sum);
    // Many cards count no damaged frame at all: none counted proves nothing.
    let condition = causes(view, damaged.unwrap_or(0), false, first);
    let what =
        if traffic.losses.frames().sum == 0 { "copies of frames in the ring" } else { "frames" };
    let text = match count {
        1 => format!("one of {} {what} did not come back, at {last}", traffic.requests.sent()),
        _ => format!(
            "{count} of {} {what} did not come back, single ones or a few in a row, the last at {last}",
            traffic.requests.sent()
        ),
    };
    let known = traffic.losses.first().and_then(|seen| seen.frame).unwrap_or(0);
    let hurt: Vec<DeviceId> = out_of_step(model).collect();
    let follows = |id: &DeviceId| [Symptom::StateLost(*id), Symptom::WorkingCounter(*id)];
    let mut condition = condition
        .confirmed(last)
        .explaining([Symptom::FramesLost])
        .explaining(hurt.iter().flat_map(follows));
    let is_rare = count.saturating_mul(RARE) <= traffic.requests.sent();
    condition.severity = if !hurt.is_empty() {
        Severity::Error
    } else if is_rare || single < SEVERAL || traffic.losses.frames().sum == 0 {
        // A ring that lost one copy has lost nothing.
        Severity::Info
    } else {
        Severity::Warning
    };
    condition = condition.shown_by(Evidence::frame(first, known, text));
    let rhythm = rhythm(traffic);
    condition.evidence.extend(rhythm.map(|text| Evidence::host(Some(last), text)));
    let counters = model.devices.iter().filter(|device| device.counters.is_known()).count();
    let text = match (counters, damaged) {
        (0, None) => {
            "nobody reads error counters, and those of the MainDevice's card are not known"
        }
        (0, Some(_)) => "nobody reads error counters",
        (_, _) => "no error counter that was read names a place",
    };
    condition = condition.shown_by(Evidence::host(Some(last), text.to_owned()));
    if last + QUIET < view.now {
        condition = condition.ended(last);
    }
    Some(advise(condition, model, damaged, damaged.unwrap_or(0)))
}

/// True if a condition explains frames that were lost between two times.
fn explains_losses(condition: &Condition, first: Instant, last: Instant) -> bool {
    let is_then = condition.since.before(AROUND) <= last
        && condition.ended.is_none_or(|ended| ended + AROUND >= first);
    let mut symptoms = condition.explains.iter().chain(&condition.symptoms);
    let is_loss = |symptom: &Symptom| {
        matches!(symptom, Symptom::FramesLost | Symptom::NobodyAnswers | Symptom::CardErrors)
    };
    is_then && symptoms.any(is_loss)
}

/// SubDevices that lost their step with the frames after some frames got lost.
fn out_of_step(model: &NetworkModel) -> impl Iterator<Item = DeviceId> {
    let lost = model.traffic.losses.times();
    let follows = move |device: &&Device| {
        // How many in a row are lost is not known of each time.
        let has_lost = |at: &&Instant| device.lost_step_within(**at, **at, None);
        lost.iter().filter(has_lost).nth(FOR_A_STEP - 1).is_some()
    };
    model.devices.iter().filter(follows).map(|device| device.id)
}

/// The rhythm in which frames got lost, in words: at equal intervals, or in bursts.
fn rhythm(traffic: &Traffic) -> Option<String> {
    let mut times: Vec<Instant> = traffic.losses.times().iter().copied().collect();
    times.sort_unstable();
    let mut gaps: Vec<u64> =
        times.windows(2).map(|pair| pair[1].since(pair[0]).as_nanos()).collect();
    if gaps.len() < RHYTHM {
        return None;
    }
    gaps.sort_unstable();
    let middle = gaps[gaps.len() / 2];
    let sum = gaps.iter().fold(0_u64, |sum, gap| sum.saturating_add(*gap));
    let mean = sum / gaps.len() as u64;
    if middle <= mean / 10 {
        return Some(
            "they were lost in bursts, with long times without any between them".to_owned(),
        );
    }
    let near = gaps.iter().filter(|gap| gap.abs_diff(middle) <= middle / 10).count();
    (near * 10 >= gaps.len() * 8).then(|| {
        format!(
            "they were lost about every {}: look what works, or is switched, in this rhythm",
            Span::ns(middle)
        )
    })
}

fn missing(model: &NetworkModel) -> Missing {
    let reported = &model.reported;
    let sum = |tally: Option<Tally>| tally.map_or(0, |tally| tally.sum);
    // What was not back in time and came later was late.
    let came = sum(reported.unmatched).saturating_add(sum(reported.late));
    let vanished = sum(reported.timed_out).saturating_sub(came);
    let crc = model.host.card(Path::A).crc;
    let tallies = [reported.lost, reported.timed_out, reported.corrupted, Some(crc)];
    let first =
        tallies.into_iter().flatten().filter(|tally| tally.sum > 0).min_by_key(|one| one.first);
    Missing {
        lost: sum(reported.lost).max(vanished),
        damaged: model.host.is_watched.then_some(crc.sum),
        corrupted: sum(reported.corrupted),
        first: first.unwrap_or_default(),
    }
}

fn condition(view: &View<'_>, missing: &Missing, damaged: u64) -> Condition {
    let model = view.model;
    let since = missing.first.first.unwrap_or(view.now);
    let condition = causes(view, damaged, missing.damaged.is_some(), since);
    let mut condition = condition.confirmed(since).explaining([Symptom::FramesLost]);
    condition.severity = severity(model, missing.lost.saturating_add(damaged), damaged);
    for text in texts(model, missing) {
        condition = condition.shown_by(Evidence::host(Some(since), text));
    }
    advise(condition, model, missing.damaged, damaged).advise(
        "Note the counts, wait some minutes, and read them again: only what rises is of now.",
    )
}

/// What loses frames without a trace in the counters of SubDevices; `is_watched` where those of the card are known.
fn causes(view: &View<'_>, damaged: u64, is_watched: bool, since: Instant) -> Condition {
    let network = Place::Network { network: view.model.network };
    if damaged > 0 {
        Condition::new(&PAGE, network, FaultName::CableDegraded, since)
            .confidence(0.35)
            .or(FaultName::EmcNoise, 0.2)
            .or_at(FaultName::NicDamaged, Place::Host, 0.15)
            .or(FaultName::TransmitterDamaged, 0.1)
            .or(FaultName::ReceiverDamaged, 0.05)
            .or(FaultName::DeviceInternal, 0.05)
    } else if is_watched {
        Condition::new(&PAGE, Place::Host, FaultName::HostDrops, since)
            .confidence(0.4)
            .or_at(FaultName::LinkFlapping, network, 0.2)
            .or(FaultName::LateFrames, 0.15)
            .or_at(FaultName::FalseLink, network, 0.1)
    } else {
        Condition::new(&PAGE, network, FaultName::CableDegraded, since)
            .confidence(0.2)
            .or_at(FaultName::HostDrops, Place::Host, 0.19)
            .or(FaultName::EmcNoise, 0.15)
            .or(FaultName::LinkFlapping, 0.1)
            .or_at(FaultName::NicDamaged, Place::Host, 0.09)
            .or(FaultName::TransmitterDamaged, 0.07)
            .or(FaultName::ReceiverDamaged, 0.07)
            .or(FaultName::DeviceInternal, 0.07)
            .or(FaultName::FalseLink, 0.02)
    }
}

/// What to read next.
fn advise(
    condition: Condition,
    model: &NetworkModel,
    card_damaged: Option<u64>,
    damaged: u64,
) -> Condition {
    let mut condition = condition;
    if model.devices.iter().all(|device| !device.counters.is_known()) {
        condition = condition.advise(
            "Read the error counters of all SubDevices (0x0300 to 0x0313), in order: they name the link.",
        );
    }
    match card_damaged {
        None => condition.advise(
            "Read the counters of the network card (`ethtool -S eth0`): damaged frames are counted there, \
             dropped ones, too.",
        ),
        Some(_) if damaged == 0 => condition
            .advise("Run `linesman host --measure 10`: it tells what makes this computer lose frames.")
            .advise(
                "Look at the lost-link counters (0x0310 to 0x0313): a contact that opens loses frames, too.",
            ),
        Some(_) => condition,
    }
}

/// One lost frame is worth knowing; what is rare, and not going on, too.
fn severity(model: &NetworkModel, count: u64, damaged: u64) -> Severity {
    let reported = &model.reported;
    let is_over = reported.loss_rate.is_some_and(|rate| rate <= 0.0) && damaged == 0;
    let is_rare = reported.sent.is_some_and(|sent| count.saturating_mul(RARE) <= sent);
    let is_often = reported.sent.is_some_and(|sent| count.saturating_mul(OFTEN) >= sent.max(1));
    if count == 1 || (is_rare && is_over) {
        Severity::Info
    } else if is_often && !is_over && count >= 10 {
        Severity::Error
    } else {
        Severity::Warning
    }
}

fn texts(model: &NetworkModel, missing: &Missing) -> Vec<String> {
    let reported = &model.reported;
    let mut texts = Vec::new();
    if missing.lost > 0 {
        let of = reported.sent.map_or(String::new(), |sent| format!(" of {sent}"));
        let timed = reported.timed_out.map_or(0, |tally| tally.sum);
        let what =
            if reported.lost.is_some_and(|tally| tally.sum > 0) { "frames" } else { "datagrams" };
        let late = match timed {
            0 => String::new(),
            timed => format!("; {timed} datagrams were not back in time"),
        };
        texts.push(format!(
            "the MainDevice counts {} {what}{of} that did not come back{late}",
            missing.lost
        ));
    }
    match missing.damaged {
        Some(0) if missing.lost > 0 => {
            texts.push(
                "its card counts no damaged frame: they were not damaged on the line".to_owned(),
            );
        }
        Some(0) => {}
        Some(damaged) => texts.push(format!("its card dropped {damaged} damaged frames")),
        None => texts.push("the counters of its card are not known".to_owned()),
    }
    if missing.corrupted > 0 {
        texts.push(format!("{} frames came back with a content that cannot be", missing.corrupted));
    }
    let read = model.devices.iter().filter(|device| device.counters.is_known()).count();
    texts.push(match read {
        0 => "no error counter of a SubDevice was read".to_owned(),
        read if read == model.devices.len() => {
            "no error counter of a SubDevice names a place".to_owned()
        }
        read => {
            format!("the error counters of {read} of {} SubDevices were read", model.devices.len())
        }
    });
    match reported.loss_rate {
        Some(rate) if rate <= 0.0 => {
            texts.push("none is being lost now: they may be old".to_owned())
        }
        Some(rate) => texts.push(format!("{rate} frames a second are being lost now")),
        None => {}
    }
    texts
}
