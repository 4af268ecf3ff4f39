//! # No outputs for longer than a watchdog holds
//!
//! The MainDevice's side stopped sending process data, and watchdogs expired.
//!
//! **How it is found.** A SubDevice left OP with AL status code 0x001B, or is in SAFEOP with an error whose code nobody
//! has read. Right before, the datagrams with its
//! outputs paused for as long as its watchdog (0x0400, 0x0420; 100 ms after a reset) or longer. Either none
//! was sent in that time, or the card did not take them though it had a link. If they were sent and did not
//! come back, or nobody was there any more to send them to, the line is to blame: then this rule says nothing,
//! and findings about links and damage do.
//!
//! Without any watchdog that expired: all frames stayed away for 20 ms or more and then came again, while no
//! link was lost, no SubDevice restarted, and no counter of any of them moved, and the card refused frames
//! meanwhile. Frames that it took and that nobody brought back vanished on the line (`H100`). A recording has those that
//! the card took alone: where it refused them, nothing is recorded as sent. If another program drives the line and nothing
//! at all was sent for 20 ms or more and all went on then, with no link lost and no counter moved as far as that was
//! read, that is a note.
//!
//! **What it means.** The application, or the program that sends, stood still: a long call within the cycle
//! (an SDO, a file, a print), a garbage collector, a debugger, a process without real-time priority, a
//! virtual machine whose host was busy. The SubDevices are well, and did what they should.
//!
//! **What to do.** Keep mailbox and files out of the cyclic thread; give it real-time priority
//! (`linesman host` tells what is missing). Only then think of a longer watchdog: it is what keeps a
//! machine safe while nobody controls it.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::ErrorCounter;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{AlError, CycleTiming, Device, HoleSearch, NetworkModel, Pause};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "X513",
    name: "outputs-paused",
    severity: Severity::Error,
    class: Class::Host,
    source: include_str!("paused.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// So many frames in a row that do not come back …
const SEVERAL: u64 = 3;
/// … for so long are no accident.
const STALLED: Span = Span::ms(20);
/// Where nobody reads counters, a pause is worth a word that is as long as watchdogs hold after a reset.
const NOTABLE: Span = Span::ms(100);
/// States are polled after the pause: an expiry is read so long after it at most.
const READ_WITHIN: Span = Span::ms(1500);

/// A pause and whom it hit.
struct PauseFound<'a> {
    pause: Pause,
    /// Whether frames were made and the card did not take them.
    at_card: Option<Path>,
    devices: Vec<&'a Device>,
}

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    if model.capture_probe.inside().is_some() {
        // A probe inside the line does not see what the MainDevice sends.
        return;
    }
    let mut all: Vec<PauseFound<'_>> = Vec::new();
    for device in &model.devices {
        let mut errors = device.al.errors.iter();
        let Some(error) = errors.rfind(|error| error.may_be_watchdog()) else { continue };
        let Some((pause, at_card)) = pause_before(model, device, error) else { continue };
        match all.iter_mut().find(|found| found.pause.to == pause.to) {
            Some(found) => found.devices.push(device),
            None => all.push(PauseFound { pause, at_card, devices: vec![device] }),
        }
    }
    // One finding, however often it came: the latest pause is shown.
    let Some(latest) = all.iter().max_by_key(|found| found.pause.to) else {
        conditions.extend(stalled(model).or_else(|| stood_still(model)));
        return;
    };
    let devices: Vec<DeviceId> =
        all.iter().flat_map(|found| found.devices.iter().map(|device| device.id)).collect();
    conditions.push(condition(model, latest, &devices));
}

/// The pause that let a watchdog expire.
fn pause_before(
    model: &NetworkModel,
    device: &Device,
    error: &AlError,
) -> Option<(Pause, Option<Path>)> {
    let watchdog = device.watchdog.span()?;
    // Where nobody saw whose process data they are, they may be its own.
    let mine = model.cyclic.iter().filter(|cyclic| {
        let mut owners = model.owners(cyclic).peekable();
        owners.peek().is_none() || owners.any(|owner| owner.device == device.id && owner.writes)
    });
    for cyclic in mine {
        let of = |beat: &CycleTiming| {
            // Who had starved before anybody listened is starved by pauses that go on.
            let fits = |pause: &&Pause| {
                let is_before = pause.from < error.status.at
                    && error.status.at.since(pause.to.min(error.status.at)) <= READ_WITHIN;
                pause.span() >= watchdog && (is_before || error.was_left_over())
            };
            beat.pauses.iter().rev().find(fits).copied()
        };
        // Made, and not taken by the card: then nothing came back either.
        let refused = Path::ALL.into_iter().find(|path| {
            let failures = &model.host.card(*path).send_failures;
            let since = error.status.at.before(watchdog + READ_WITHIN);
            failures.last.is_some_and(|last| last >= since)
                && failures.first.is_some_and(|first| first <= error.status.at + READ_WITHIN)
        });
        if let Some(pause) = of(&cyclic.sent) {
            // With nobody there to answer, nothing is sent for them either: the line paused first.
            let is_ours = match refused {
                Some(card) => !lost_its_link(model, card, pause),
                None => !was_silent(model, pause),
            } && kept_links(model, pause);
            return is_ours.then_some((pause, None));
        }
        if let (Some(card), Some(last)) = (refused, model.traffic.returns.latest()) {
            let silences = model.traffic.losses.silences().iter().rev();
            let mut silences = silences.filter(|silence| silence.since.at < error.status.at);
            let silence = silences.next()?;
            let to = silence.ended.unwrap_or(last.at.max(silence.last.at));
            let pause = Pause { from: silence.since.at, to };
            // A card without a link takes no frames, and is not to blame.
            if lost_its_link(model, card, pause) {
                return None;
            }
            return (pause.span() + cyclic.sent.cycle().unwrap_or(Span::ZERO) >= watchdog)
                .then_some((pause, Some(card)));
        }
    }
    None
}

/// Whether the line had stopped to answer when a pause began, or while it lasted.
fn was_silent(model: &NetworkModel, pause: Pause) -> bool {
    model.traffic.losses.silences().iter().any(|silence| {
        let ended = silence.ended.unwrap_or(Instant::MAX);
        silence.since.at <= pause.to && ended >= pause.from
    })
}

/// Whether a card had no link for some of a pause.
fn lost_its_link(model: &NetworkModel, card: Path, pause: Pause) -> bool {
    let card = model.host.card(card);
    card.carrier.is_some_and(|carrier| {
        !carrier.value || card.carrier_changes > 0 && carrier.at >= pause.from
    })
}

fn condition(model: &NetworkModel, found: &PauseFound<'_>, all: &[DeviceId]) -> Condition {
    let ms = |span: Span| span.as_nanos() as f64 / 1e6;
    let Pause { from, to } = found.pause;
    let shortest = found.devices.iter().filter_map(|device| device.watchdog.span()).min();
    let what = match found.at_card {
        None => "nothing was sent to the outputs".to_owned(),
        Some(card) => format!("card {card} took no frames"),
    };
    let text = format!(
        "{what} for {:.1} ms; the watchdog of {} holds for {:.1} ms",
        ms(found.pause.span()),
        found.devices.first().map(|device| model.label(device.id)).unwrap_or_default(),
        ms(shortest.unwrap_or(Span::ZERO))
    );
    let symptoms =
        all.iter().flat_map(|id| [Symptom::StateLost(*id), Symptom::WorkingCounter(*id)]);
    Condition::new(&PAGE, Place::Host, FaultName::WatchdogStarved, from)
        .confidence(0.7)
        .or(FaultName::HostJitter, 0.25)
        .confirmed(watchdog_expired(found, to))
        .ended(to)
        .shown_by(Evidence::host(Some(from), text))
        .explaining(symptoms)
        .explaining([Symptom::FramesLost, Symptom::NobodyAnswers])
        .advise("Find what stood still: mailbox or files within the cyclic thread, a debugger, a busy host.")
        .advise("Run `linesman host`: it tells what lets this computer stop a program.")
        .advise("Lengthen the watchdog only if the machine stays safe for that long without control.")
}

/// Everything stopped and went on, and no link was lost, nothing restarted, nothing was counted anywhere:
/// the frames did not leave this computer, or did not come into it.
fn stalled(model: &NetworkModel) -> Option<Condition> {
    let over =
        model.traffic.losses.silences().iter().rev().filter_map(|one| Some((one, one.ended?)));
    let (silence, ended) = over
        .into_iter()
        .find(|(one, ended)| one.frames >= SEVERAL && ended.since(one.since.at) >= STALLED)?;
    let pause = Pause { from: silence.since.at, to: ended };
    // Frames that come back when a port is closed had left, and others come in.
    let vanished = |hole: HoleSearch| {
        let until = hole.ended.map_or(Instant::MAX, |ended| ended + READ_WITHIN);
        let is_hole = hole.has_helped || hole.found.is_some();
        is_hole && hole.since.at <= pause.to && pause.from <= until
    };
    if model.hole.is_some_and(vanished) {
        return None;
    }
    // Only counters that were read since then can say that nothing was counted.
    let were_read = model.devices.iter().any(|device| {
        let mut tracks = device.counters.tracks();
        tracks.any(|(counter, track)| {
            matches!(counter, ErrorCounter::LostLink(_)) && track.last.at > ended
        })
    });
    let kept_carrier = Path::ALL.into_iter().all(|card| !lost_its_link(model, card, pause));
    if !(were_read && kept_carrier && kept_links(model, pause)) {
        return None;
    }
    let ms = pause.span().as_secs_f64() * 1e3;
    let text = format!(
        "{} frames in a row did not come back, for {ms:.1} ms, then all did; no link was lost and no \
         counter of any SubDevice moved",
        silence.frames
    );
    let refused = Path::ALL.into_iter().find(|card| {
        let last = model.host.card(*card).send_failures.last;
        last.is_some_and(|last| last >= pause.from && last <= pause.to + READ_WITHIN)
    });
    // A frame that was seen and that no card refused has left, and vanished on the line.
    let card = refused?;
    let frame = silence.since.frame.unwrap_or(0);
    let mut condition = Condition::new(&PAGE, Place::Host, FaultName::WatchdogStarved, pause.from)
        .confidence(0.8)
        .or(FaultName::HostDrops, 0.1)
        .confirmed(pause.to)
        .ended(pause.to)
        .shown_by(Evidence::frame(pause.from, frame, text));
    // Nobody was hurt: no watchdog expired.
    condition.severity = Severity::Warning;
    let text = format!("card {card} had a link and took no frames meanwhile");
    condition = condition.shown_by(Evidence::host(Some(pause.from), text));
    let follows = model.devices.iter().flat_map(|device| {
        let id = device.id;
        [
            Symptom::Silent(id),
            Symptom::StateLost(id),
            Symptom::WorkingCounter(id),
            Symptom::Emergency(id),
        ]
    });
    Some(
        condition
            .explaining(follows)
            .explaining([Symptom::FramesLost, Symptom::NobodyAnswers])
            .advise("Look into the system's log for messages of the card's driver.")
            .advise("Run `linesman host`: it tells what lets this computer stop a program."),
    )
}

/// Somebody else drives the line, and nothing was sent for a while, to anybody; then all went on as before. No watchdog
/// expired: nobody was hurt. Frames that were not sent are not lost, and no link is open for that.
fn stood_still(model: &NetworkModel) -> Option<Condition> {
    let is_hurt = |device: &Device| device.al.errors.iter().any(AlError::may_be_watchdog);
    if model.sees_all_orders || model.devices.iter().any(is_hurt) {
        return None;
    }
    let went_on = |pause: &Pause| {
        model.cyclic.iter().any(|cyclic| {
            let has_begun = cyclic.wkc.first().at <= pause.from;
            has_begun && cyclic.sent.last().is_some_and(|last| last > pause.to)
        })
    };
    let pause = model.quiet().find(|pause| went_on(pause) && !was_silent(model, *pause))?;
    let kept_carrier = Path::ALL.into_iter().all(|card| !lost_its_link(model, card, pause));
    if !(kept_carrier && kept_links(model, pause)) {
        return None;
    }
    let were_read = model.devices.iter().any(|device| {
        let mut tracks = device.counters.tracks();
        tracks.any(|(counter, track)| {
            matches!(counter, ErrorCounter::LostLink(_)) && track.last.at > pause.to
        })
    });
    if !were_read && pause.span() < NOTABLE {
        return None;
    }
    let known = match were_read {
        true => "no link was lost and no counter of any SubDevice moved",
        false => "nothing was lost and nobody has started anew; nobody has read links or counters",
    };
    let text = format!(
        "nothing was sent for {:.1} ms, then all went on; {known}",
        pause.span().as_secs_f64() * 1e3
    );
    let first_link = Place::Link {
        network: model.network,
        a: End::MainDevice(Path::A),
        b: None,
        direction: None,
    };
    let mut condition = Condition::new(&PAGE, Place::Host, FaultName::WatchdogStarved, pause.from)
        .confidence(0.5)
        .or(FaultName::HostJitter, 0.3)
        .confirmed(pause.to)
        .ended(pause.to)
        .shown_by(Evidence::host(Some(pause.from), text))
        .advise(
            "Ask whether the program that sends was to pause: a change of its state, a debugger.",
        )
        .advise("Run `linesman host`: it tells what lets this computer stop a program.");
    if !were_read && model.host.card(Path::A).carrier.is_none() {
        // A card without a link takes no frames either.
        condition = condition.or_at(FaultName::LinkFlapping, first_link, 0.1);
    }
    condition.severity = Severity::Info;
    Some(condition)
}

/// Whether no controller lost a link, found damage or started anew about a pause.
fn kept_links(model: &NetworkModel, pause: Pause) -> bool {
    model.devices.iter().all(|device| {
        let tracks = device.counters.tracks();
        let mut rises = tracks.flat_map(|(_, track)| &track.rises);
        let mut changes = device.dl.changes.iter().map(|change| change.at);
        let mut falls = device.al.changes.iter().filter(|change| {
            change.is_own_fall() && change.to.state().state() == Some(AlState::Init)
        });
        let until = pause.to + READ_WITHIN;
        !rises.any(|rise| rise.after_time <= pause.to && rise.at >= pause.from)
            && !changes.any(|at| at >= pause.from && at <= until)
            && !falls.any(|change| change.at >= pause.from && change.at <= until)
    })
}

/// When the first of the watchdogs had expired.
fn watchdog_expired(found: &PauseFound<'_>, to: Instant) -> Instant {
    let first = found.devices.iter().filter_map(|device| device.watchdog.span()).min();
    first.map_or(to, |span| (found.pause.from + span).min(to))
}
