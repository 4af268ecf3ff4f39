//! # A SubDevice refuses a state, or leaves it
//!
//! A SubDevice sets the error bit of AL status (0x0130) and gives a code (0x0134).
//!
//! **How it is found.** AL status is read with the error bit, and the code shortly after. If the
//! SubDevice had not yet been in the state that AL control (0x0120) asked for, it *refused* the change
//! (`S200`); if it had been there, it *left* that state by itself (`S201`, watchdog `S202`,
//! synchronisation `T400`). A watchdog watches in OP alone: who is asked for OP and gives 0x001B was there for a moment.
//!
//! Where nobody reads the code, an error in SAFEOP while process data are exchanged is most likely an expired watchdog: it
//! is the one that takes a SubDevice there whenever outputs stay away.
//!
//! An error that stood already when the SubDevice was first read, and that the MainDevice acknowledged, is left
//! over from an earlier run: a note. Watchdogs of several SubDevices that expire at about the same time are one
//! finding, of the network.
//!
//! **What it means.** A refusal is about settings in most cases: process data, SyncManagers, mailbox,
//! start-up commands that do not fit the device. With 0x0018, 0x0019 and 0x002B its application has no values
//! to exchange; where its outputs are sent, it is the application that stands still.
//! Leaving a state is about what happens while it runs:
//! outputs that stop (watchdog), clocks and frames that come at the wrong time, or an error of the
//! device itself. If there is trouble with cables at the same moment, that comes first: the code is then
//! what follows.
//!
//! A SubDevice that works in step with SYNC signals and leaves OP with 0x001A was not done in time: its work
//! takes longer than the cycle, or its outputs come late. It counts both, in 0x1C32 and 0x1C33 (subindex 12
//! and 11); live, the diagnosis reads them. With 0x002C, 0x002D and 0x0033 its signals themselves do not come.
//!
//! Where several SubDevices lose synchronisation, a reference clock nearer to the MainDevice is proposed, if there is
//! one.
//!
//! **What to do.** The code says more than the state: its own page has the checks, most promising first.

mod nearer_reference;
mod unseen;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::state::status_code::Class as CodeClass;
use linesman_proto::state::{AlState, AlStatusCode, StatusCode};

use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{AlError, Device, NetworkModel};

/// It refused a change.
pub const REFUSED: RulePage = RulePage {
    code: "S200",
    name: "state-refused",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("state_error.rs"),
};

/// It left its state with an error.
pub const LEFT: RulePage = RulePage {
    code: "S201",
    name: "state-left",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("state_error.rs"),
};

/// Its watchdog expired.
pub const WATCHDOG: RulePage = RulePage {
    code: "S202",
    name: "watchdog-expired",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("state_error.rs"),
};

/// It lost synchronisation.
pub const SYNC: RulePage = RulePage {
    code: "T400",
    name: "synchronisation-lost",
    severity: Severity::Error,
    class: Class::Timing,
    source: include_str!("state_error.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[REFUSED, LEFT, WATCHDOG, SYNC], judge };

/// A MainDevice that does not try again for so long does not want the state any more.
const GIVEN_UP: Span = Span::s(10);
const AL_CONTROL: RegisterAddress = RegisterAddress(0x0120);
const AL_STATUS: RegisterAddress = RegisterAddress(0x0130);
const AL_STATUS_CODE: RegisterAddress = RegisterAddress(0x0134);
/// Subindices of 0x1C32 and 0x1C33 (ETG.1020): SM event missed, cycle time too small.
const EVENT_MISSED: u8 = 0x0B;
const CYCLE_EXCEEDED: u8 = 0x0C;
/// A MainDevice that starts has acknowledged old errors by then.
const ACKNOWLEDGED_WITHIN: Span = Span::ms(500);
/// States are read in turn: what is read within this time happened at once.
const AT_ONCE: Span = Span::ms(1_500);
/// So many watchdogs that expire at once have one cause.
const SEVERAL: usize = 2;
/// So many SubDevices are named.
const NAMED: usize = 6;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let unseen = unseen::errors(view.model);
    conditions.extend(unseen::condition(view, &unseen));
    for device in &view.model.devices {
        // One finding for each kind of trouble, however often it came back: the latest is shown.
        let mut pages: Vec<(&'static RulePage, &AlError, u32)> = Vec::new();
        for error in &device.al.errors {
            let page = page_of(view.model, error);
            match pages.iter_mut().find(|(known, ..)| known.code == page.code) {
                Some((_, latest, times)) => {
                    *latest = error;
                    *times += 1;
                }
                None => pages.push((page, error, 1)),
            }
        }
        for (page, error, times) in pages {
            let is_told = unseen.iter().any(|(other, _)| other.id == device.id);
            if !is_told && !may_be_left_over(view, error) && !error.may_be_echo() {
                conditions.push(condition(view, device, page, error, times));
            }
        }
    }
    if unseen.is_empty() {
        conditions.extend(starved_together(view, conditions));
    }
}

/// Whether an error stood already when its SubDevice was first read, a moment ago: a MainDevice that starts
/// acknowledges it.
fn may_be_left_over(view: &View<'_>, error: &AlError) -> bool {
    let is_new = view.now.since(error.status.at) < ACKNOWLEDGED_WITHIN && !view.has_ended;
    is_new
        && view.model.traffic.recording.frames() > 0
        && was_left_over(view.model, error)
        && error.ended.is_none()
}

/// Whether an error is of a time before this run: where process data went on while it stood, it belongs to them.
fn was_left_over(model: &NetworkModel, error: &AlError) -> bool {
    let ended = error.ended.unwrap_or(error.status.at);
    let is_running = model.cyclic.iter().any(|cyclic| cyclic.wkc.first().at < ended);
    error.was_left_over() && !is_running
}

/// Watchdogs that expired in several SubDevices at about the same time, without anything that explains it of each:
/// nobody has sent outputs.
fn starved_together(view: &View<'_>, conditions: &[Condition]) -> Option<Condition> {
    let model = view.model;
    let is_explained =
        |id: DeviceId| conditions.iter().any(|one| one.explains.contains(&Symptom::StateLost(id)));
    let starved = model.devices.iter().filter_map(|device| {
        let mut errors = device.al.errors.iter().rev();
        let error = errors.find(|error| {
            let page = page_of(model, error);
            page.code == WATCHDOG.code || (page.code == LEFT.code && error.may_be_watchdog())
        })?;
        Some((device, error)).filter(|_| !is_explained(device.id))
    });
    let starved: Vec<(&Device, &AlError)> = starved.collect();
    let latest = starved.iter().map(|(_, error)| error.status.at).max()?;
    let together: Vec<(&Device, &AlError)> =
        starved.into_iter().filter(|(_, error)| error.status.at + AT_ONCE >= latest).collect();
    if together.len() < SEVERAL {
        return None;
    }
    let since = together.iter().map(|(_, error)| error.status.at).min()?;
    let ids = || together.iter().map(|(device, _)| device.id);
    let names: Vec<String> = ids().take(NAMED).map(|id| model.label(id)).collect();
    let more = match together.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} others"),
    };
    let are_read = together.iter().all(|(_, error)| error.code.is_some());
    let what = match are_read {
        true => format!("the watchdogs of {} SubDevices expired", together.len()),
        false => format!(
            "{} SubDevices went to SAFEOP with an error whose code was not read of all",
            together.len()
        ),
    };
    let text = format!("{what} at about the same time: {}{more}", names.join(", "));
    let place = Place::Network { network: model.network };
    let mut condition = Condition::new(&WATCHDOG, place, FaultName::WatchdogStarved, since)
        .confidence(0.8)
        .or_at(FaultName::HostJitter, Place::Host, 0.1)
        .or(FaultName::LateFrames, 0.05)
        .confirmed(since)
        .about(ids().map(Symptom::StateLost))
        .explaining(ids().flat_map(|id| {
            [Symptom::StateLost(id), Symptom::WorkingCounter(id), Symptom::Emergency(id)]
        }))
        .shown_by(Evidence::host(Some(since), text))
        .advise(
            "Look whether the MainDevice, or its cyclic task, stopped or paused: a debugger, a restart, a \
             long call within the cycle.",
        )
        .advise("Run `linesman host --measure 10` on its computer: it tells what makes it pause.")
        .advise("The SubDevices are well: do not exchange them for this.");
    let ended: Option<Vec<Instant>> =
        together.iter().map(|(device, error)| over(view, device, error)).collect();
    if let Some(ended) = ended.and_then(|all| all.into_iter().max()) {
        condition = condition.ended(ended);
    }
    Some(condition)
}

fn page_of(model: &NetworkModel, error: &AlError) -> &'static RulePage {
    // Who was higher before and was asked for nothing has left; a watchdog watches those that are in OP alone, so that who
    // is asked for OP and signals it was there for a moment.
    let fell = error.from.is_some_and(|from| error.status.value.state().state() < Some(from));
    let watchdog = AlStatusCode::SYNC_MANAGER_WATCHDOG;
    let is_watchdog = error.code.is_some_and(|code| code.value == watchdog);
    // A MainDevice that is refused a state while it starts does not go on to exchange process data.
    let is_unread = error.code.is_none() && error.from.is_none() && !model.cyclic.is_empty();
    let asked_for_nothing = error.requested.is_none() && (fell || is_unread);
    if !error.had_arrived && !asked_for_nothing && !is_watchdog {
        return &REFUSED;
    }
    match error.code.map(|code| code.value) {
        Some(code) if code == watchdog => &WATCHDOG,
        // Its SYNC signals do not come as they should, whatever class the code is of.
        Some(AlStatusCode::DC_SYNC_IO_ERROR) => &SYNC,
        Some(code) if code.explain().class == CodeClass::Timing => &SYNC,
        Some(_) | None => &LEFT,
    }
}

fn condition(
    view: &View<'_>,
    device: &Device,
    page: &'static RulePage,
    error: &AlError,
    times: u32,
) -> Condition {
    let model = view.model;
    let place = Place::device(model.network, device.id);
    let meaning = error.code.map(|code| code.value.explain());
    let cause = cause(model, device, page, error);
    let mut condition = Condition::new(page, place, cause, error.status.at)
        .confidence(if meaning.is_some() { 0.8 } else { 0.6 })
        .confirmed(error.status.at)
        .about([Symptom::StateLost(device.id)])
        .explaining([
            Symptom::WorkingCounter(device.id),
            Symptom::Emergency(device.id),
            Symptom::InputsStill(device.id),
        ]);
    condition = with_alternatives(condition, device, page, meaning.map(|meaning| meaning.class));
    if page.code == "T400" {
        // What it refuses on its way back is more of the same.
        condition = condition.explaining([Symptom::StateLost(device.id)]);
        condition.evidence.extend(counted(device));
        if let Some(proposal) = nearer_reference::advice(model) {
            condition = condition.advise(proposal);
        }
    }
    if let Some(ended) = over(view, device, error) {
        condition = condition.ended(ended);
    }
    if was_left_over(model, error)
        && let Some(acknowledged) = error.ended
    {
        condition.severity = Severity::Info;
        let text = "it stood before anything was asked of the SubDevice: left over from an earlier run, \
                    and acknowledged";
        condition = condition.shown_by(Evidence::host(Some(acknowledged), text));
    }
    for evidence in evidence(device, error, meaning, times) {
        condition = condition.shown_by(evidence);
    }
    match meaning {
        Some(meaning) => {
            for action in meaning.actions {
                condition = condition.advise(*action);
            }
        }
        None => {
            let text = "nobody has read its AL status code (0x0134), which says why";
            condition = condition
                .shown_by(Evidence::host(Some(error.status.at), text))
                .advise("Read AL status code (0x0134) of this SubDevice: it says why.")
                .advise("Request the states one by one and note at which step the error comes.");
        }
    }
    condition
}

/// The most likely cause of an error.
fn cause(
    model: &NetworkModel,
    device: &Device,
    page: &'static RulePage,
    error: &AlError,
) -> FaultName {
    let class = error.code.map(|code| code.value.explain().class);
    match page.code {
        // The code itself blames what was configured.
        "S200" if class == Some(CodeClass::Configuration) => FaultName::ConfigMismatch,
        "S200" if has_no_values(model, device, error) => FaultName::FirmwareFault,
        "S200" => FaultName::InitRefused,
        "S202" => FaultName::WatchdogStarved,
        "T400" => out_of_step(device, error),
        _ if error.code.is_none() && error.may_be_watchdog() => FaultName::WatchdogStarved,
        _ => FaultName::FirmwareFault,
    }
}

/// A condition with the other causes that its cause is taken for; `class` is that of the AL status code, where one was
/// read.
fn with_alternatives(
    condition: Condition,
    device: &Device,
    page: &'static RulePage,
    class: Option<CodeClass>,
) -> Condition {
    match (condition.cause, class) {
        (FaultName::ConfigMismatch, _) => condition.or(FaultName::InitRefused, 0.15),
        (FaultName::FirmwareFault, _) if page.code == "S200" => {
            condition.confidence(0.6).or(FaultName::InitRefused, 0.25)
        }
        (FaultName::InitRefused, Some(CodeClass::Timing)) => {
            condition.or(FaultName::SyncLost, 0.15)
        }
        (FaultName::InitRefused, _) => condition.or(FaultName::FirmwareFault, 0.1),
        (FaultName::WatchdogStarved, None) => condition
            .confidence(0.4)
            .or(FaultName::SyncLost, 0.15)
            .or(FaultName::FirmwareFault, 0.15)
            .or(FaultName::InitRefused, 0.1)
            .or_at(FaultName::HostJitter, Place::Host, 0.05),
        (FaultName::WatchdogStarved, _) => {
            condition.or_at(FaultName::HostJitter, Place::Host, 0.1).or(FaultName::LateFrames, 0.05)
        }
        (FaultName::SyncLost, _) => {
            condition.or_at(FaultName::HostJitter, Place::Host, 0.1).or(FaultName::ClockDrift, 0.05)
        }
        (FaultName::CycleTooFast, _) => {
            let is_counted = exceeded(device).is_some();
            let (sure, other) = if is_counted { (0.9, 0.03) } else { (0.6, 0.12) };
            condition
                .confidence(sure)
                .or(FaultName::FirmwareFault, other)
                .or(FaultName::ClockDrift, other)
                .or_at(FaultName::HostJitter, Place::Host, 0.03)
        }
        _ => condition.or(FaultName::ConfigMismatch, 0.1),
    }
}

/// Whether a SubDevice refuses because its own application gives no values, or takes none though they are sent.
fn has_no_values(model: &NetworkModel, device: &Device, error: &AlError) -> bool {
    let has_outputs = || {
        model.cyclic.iter().any(|cyclic| {
            let mut owners = model.owners(cyclic);
            owners.any(|owner| owner.device == device.id && owner.writes)
        })
    };
    match error.code.map(|code| code.value) {
        Some(AlStatusCode::NO_VALID_INPUTS) => true,
        Some(AlStatusCode::NO_VALID_OUTPUTS | AlStatusCode::NO_VALID_INPUTS_AND_OUTPUTS) => {
            has_outputs()
        }
        Some(_) | None => false,
    }
}

/// Why a SubDevice that keeps step lost it: by its own code its SYNC signals do not come, or it is not done
/// in time, with outputs that come too late or work that takes too long. What can be seen elsewhere (frames
/// that come unevenly, clocks that go astray) is told by rules of its own, beneath which this hangs.
fn out_of_step(device: &Device, error: &AlError) -> FaultName {
    let is_late = error.code.is_some_and(|code| code.value == AlStatusCode::SYNCHRONIZATION_ERROR);
    let missed_only = exceeded(device).is_none()
        && device
            .sync_counts
            .iter()
            .any(|((_, subindex), seen)| *subindex == EVENT_MISSED && seen.value > 0);
    if is_late && !missed_only { FaultName::CycleTooFast } else { FaultName::SyncLost }
}

/// How often it was not done with a cycle when the next began, where it counts that.
pub(super) fn exceeded(device: &Device) -> Option<u16> {
    let counts = device.sync_counts.iter();
    let exceeded = counts.filter(|((_, subindex), _)| *subindex == CYCLE_EXCEEDED);
    exceeded.map(|(_, seen)| seen.value).max().filter(|count| *count > 0)
}

/// What it counts of its cycles.
fn counted(device: &Device) -> impl Iterator<Item = Evidence> {
    device.sync_counts.iter().filter(|(_, seen)| seen.value > 0).map(|((index, subindex), seen)| {
        let what = match *subindex {
            EVENT_MISSED => "outputs or inputs that did not come before their SYNC",
            CYCLE_EXCEEDED => "cycles that began before the last was done",
            _ => "outputs that came too shortly before their SYNC",
        };
        let text = format!("0x{index:04X}:{subindex:02}: {} {what}", seen.value);
        Evidence::frame(seen.at, seen.frame.unwrap_or(0), text)
    })
}

/// When it was over. An acknowledged error is not: the MainDevice acknowledges and tries again, so only
/// a SubDevice that gets where it should be, or that nobody asks any more, is well.
fn over(view: &View<'_>, device: &Device, error: &AlError) -> Option<Instant> {
    let ended = error.ended?;
    let wanted = match error.requested.and_then(|requested| requested.value.state()) {
        Some(state) if !error.had_arrived => Some(state),
        Some(_) | None => error.from,
    };
    let is_there = !device.al.has_error() && device.al.state() >= wanted;
    let reached = device.al.status.filter(|status| is_there && status.at >= error.status.at);
    match reached {
        Some(status) => Some(status.at),
        None => (view.now.since(ended.min(view.now)) >= GIVEN_UP).then_some(ended),
    }
}

fn evidence(
    device: &Device,
    error: &AlError,
    meaning: Option<StatusCode>,
    times: u32,
) -> Vec<Evidence> {
    let mut list = Vec::new();
    let from = error.from.map_or("an unknown state", AlState::name);
    let now = match error.status.value.state() {
        state if state.bits() == 0 => "a state that nobody told".to_owned(),
        state => state.to_string(),
    };
    let again = if times > 1 { format!(", {times} times by now") } else { String::new() };
    let text = match error.requested.and_then(|requested| requested.value.state()) {
        Some(wanted) if !error.had_arrived => {
            format!("AL status: {now} with error, {wanted} was asked for{again}")
        }
        Some(_) | None => format!("AL status: {now} with error, before it was in {from}{again}"),
    };
    let before = error.from.map(|state| u64::from(state.bits()));
    let after = Some(u64::from(error.status.value.0));
    list.push(Evidence::register(device.id, AL_STATUS, &error.status, text).values(before, after));
    if let (Some(code), Some(meaning)) = (error.code, meaning) {
        let text =
            format!("AL status code 0x{:04X}: {}. {}", code.value.0, meaning.name, meaning.cause);
        let value = Some(u64::from(code.value.0));
        let shown = Evidence::register(device.id, AL_STATUS_CODE, &code, text);
        list.push(shown.values(None, value));
    }
    if let Some(requested) = error.requested.filter(|_| !error.had_arrived) {
        let text = format!("AL control: {} asked for", requested.value);
        let value = Some(u64::from(requested.value.bits()));
        let shown = Evidence::register(device.id, AL_CONTROL, &requested, text);
        list.push(shown.values(None, value));
    }
    list
}
