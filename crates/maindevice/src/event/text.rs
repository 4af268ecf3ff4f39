//! Events in words: what is written to a log or a terminal.

use linesman_config::plan::IdentificationCheck;
use linesman_proto::address::DeviceId;
use linesman_proto::register::AlStatus;
use linesman_proto::state::{AlState, AlStatusCode};

use super::Event;

impl Event {
    /// What happened to a SubDevice's states, in one line or a few; nothing for all other events, which
    /// [`watch`](crate::watch) has words for.
    /// `name` gives the name of a SubDevice.
    ///
    /// A refused step is a pair of lines: where the SubDevice was to go and where it is, then what was
    /// read and what was expected.
    // Long for its number of events: one arm each, and all names of those that have no words here.
    #[must_use]
    pub fn state_lines(&self, name: impl Fn(DeviceId) -> String) -> Vec<String> {
        match self {
            Self::Refused { id, from, to, status, code } => {
                let reason = format!(", AL {code}");
                let action = code.explain().actions.first().copied();
                let mut lines = pair(&name(*id), *from, *to, *status, &reason);
                lines.extend(action.map(|action| format!("{}: {action}", name(*id))));
                lines
            }
            Self::StepTimedOut { id, from, to, status } => {
                pair(&name(*id), *from, *to, *status, ", no error reported: its time is up")
            }
            Self::StartUpFailed { id, to, status, command, error } => {
                let name = name(*id);
                let transition = command.transition;
                let mut lines = vec![
                    format!("{name}: {}", aborted(*to, *status)),
                    format!("{name}: {transition} failed at start-up command {command}: {error}"),
                ];
                if error.is_refusal() {
                    lines.push(format!("{name}: {START_UP_LIST}"));
                }
                lines
            }
            Self::WrongModule { id, to, status, slot, expected, found } => {
                let name = name(*id);
                let module = |ident: u32| match ident {
                    0 => "no module".to_owned(),
                    ident => format!("module 0x{ident:08X}"),
                };
                vec![
                    format!("{name}: {}", aborted(*to, *status)),
                    format!(
                        "{name}: slot {slot}: {} is there, {} is planned (object 0xF050:{slot:02X}); \
                         check the modules, or change `modules` in the project",
                        module(*found),
                        module(*expected)
                    ),
                ]
            }
            Self::CycleTooShort { id, to, status, cycle, shortest, object } => {
                let name = name(*id);
                vec![
                    format!("{name}: {}", aborted(*to, *status)),
                    format!(
                        "{name}: its SYNC0 is planned every {cycle}, and it needs {shortest} for a cycle ({object}); give \
                         it a slower task of its own (`[[task]]` with `cycle_us = {}` or longer, and `task` at the \
                         device), or a SYNC0 that comes only every few cycles (`sync0_cycle_us`)",
                        shortest.as_nanos().div_ceil(1_000)
                    ),
                ]
            }
            Self::ModulesUnread { id, to, status, error } => vec![
                format!("{}: {}", name(*id), aborted(*to, *status)),
                format!("{}: asking for its modules: {error}", name(*id)),
            ],
            Self::ClocksSet { reference } => {
                vec![format!("clocks set; station {reference} is the reference clock")]
            }
            Self::ClocksNotSet { error } => vec![format!("clocks not set: {error}")],
            Self::ClockOff { id, to, difference, limit, patience } => vec![format!(
                "{}: not taken to {to}: its clock is {difference} off the reference clock after \
                 {patience}, expected {limit} at most; check that cyclic frames carry the time of \
                 the reference clock, and the SubDevice's quartz (0x0932)",
                name(*id)
            )],
            Self::AbnormalState { id, from, status, code } => {
                let (name, to) = (name(*id), status.state());
                let reason = reason(*status, *code);
                let change = format!("{name}: abnormal state change (from {from} to {to}){reason}");
                let action = code.explain().actions.first().filter(|_| status.error());
                let action = action.map(|action| format!("{name}: {action}"));
                std::iter::once(change).chain(action).collect()
            }
            Self::TargetReached { id, state } => vec![format!("{}: {state} reached", name(*id))],
            Self::WrongDevice { id, mismatch, expected, found } => {
                let [expected, found] = [expected, found].map(linesman_config::identity::text);
                vec![format!(
                    "{}: another device is there: {mismatch} differs (expected {expected}; found \
                     {found}); it is left alone",
                    name(*id)
                )]
            }
            Self::AliasShared { id, alias, count } => vec![format!(
                "{}: {count} SubDevices answer to its alias {} ({alias}): none of them is taken. Do: give \
                 each an alias of its own (`linesman sii WHERE DEVICE alias N`)",
                name(*id),
                alias.0
            )],
            Self::WrongIdentification { id, check, found, belongs_to } => {
                vec![wrong_identification(&name, *id, *check, *found, *belongs_to)]
            }
            Self::IdentificationShared { id, check, count } => vec![format!(
                "{}: {count} SubDevices tell its number {} ({}): none that is new is taken. Do: give each a number of \
                 its own, at its selector or with `linesman sii WHERE DEVICE alias N`",
                name(*id),
                check.value,
                check.source
            )],
            Self::UnplannedDevice { position, found } => {
                let found = linesman_config::identity::text(found);
                vec![format!("position {position}: a device that is not planned ({found})")]
            }
            Self::ReadOnlyScanned(_)
            | Self::ReadOnlyScanFailed(_)
            | Self::Scanned(_)
            | Self::ScanFailed(_)
            | Self::DeviceState { .. }
            | Self::DeviceLost { .. }
            | Self::DeviceBack { .. }
            | Self::AllReached
            | Self::Responding { .. }
            | Self::Ring { .. }
            | Self::Counters { .. }
            | Self::CountersCleared { .. }
            | Self::Identified { .. }
            | Self::Links { .. }
            | Self::PortOpened { .. }
            | Self::GroupJoined { .. }
            | Self::GroupLeft { .. }
            | Self::GroupMisplaced { .. }
            | Self::ClockDifference { .. }
            | Self::ClockSet { .. }
            | Self::NetworkTime { .. }
            | Self::WorkingCounter { .. }
            | Self::WorkingCounterGood { .. }
            | Self::CyclicFramesLost { .. }
            | Self::CyclicFramesBack { .. }
            | Self::Emergency { .. }
            | Self::Mailbox { .. }
            | Self::FileProgress { .. }
            | Self::SdoUploaded { .. }
            | Self::SdoDownloaded { .. }
            | Self::Served { .. }
            | Self::Probed { .. }
            | Self::OutputsWithheld { .. }
            | Self::OutputsResumed { .. }
            | Self::OutputsLocked
            | Self::ResetBegun
            | Self::Stopped => Vec::new(),
        }
    }
}

/// Who tells another number than planned, and what to do.
fn wrong_identification(
    name: &impl Fn(DeviceId) -> String,
    id: DeviceId,
    check: IdentificationCheck,
    found: Option<u32>,
    belongs_to: Option<DeviceId>,
) -> String {
    let IdentificationCheck { source, value, compulsory } = check;
    let then = if compulsory { "it is kept in INIT" } else { "it is driven all the same" };
    let told = match (found, belongs_to) {
        (None, _) => "it tells none".to_owned(),
        (Some(found), None) => format!("found {found}"),
        (Some(found), Some(owner)) => {
            format!("found {found}, that of {}: they may be exchanged", name(owner))
        }
    };
    let action = match belongs_to {
        Some(_) => "plug each in at its own place, or exchange their numbers",
        None => "set the number at the device, or change `identification` in the project",
    };
    format!("{}: its {source} must be {value}, {told}; {then}. Do: {action}", name(id))
}

/// What to do about a start-up command that the SubDevice refuses.
const START_UP_LIST: &str = "Remove the command from the start-up list, or take the list of the connected \
     device's own description: it was probably made for another revision.";

fn aborted(to: AlState, status: AlStatus) -> String {
    format!("state change aborted (requested {to}, back to {})", status.state())
}

/// The two lines of a step that was not made.
fn pair(
    name: &str,
    from: Option<AlState>,
    to: AlState,
    status: AlStatus,
    reason: &str,
) -> Vec<String> {
    let step = match from {
        Some(from) => format!("{from} to {to}"),
        None => format!("change to {to}"),
    };
    let (read, expected) = (status.value(), AlStatus::new(to).value());
    vec![
        format!("{name}: {}", aborted(to, status)),
        format!("{name}: {step} failed, read 0x{read:04X}, expected 0x{expected:04X}{reason}"),
    ]
}

fn reason(status: AlStatus, code: AlStatusCode) -> String {
    if status.error() { format!(", AL {code}") } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(event: &Event) -> Vec<String> {
        event.state_lines(|id| format!("SubDevice {}", id.no()))
    }

    // proves: SW-02
    #[test]
    fn a_refused_step_is_the_pair_of_the_sources() {
        let event = Event::Refused {
            id: DeviceId(2),
            from: Some(AlState::Init),
            to: AlState::PreOp,
            status: AlStatus(0x0011),
            code: AlStatusCode(0x0014),
        };
        let lines = lines(&event);
        assert_eq!(
            lines[..2],
            [
                "SubDevice 3: state change aborted (requested PREOP, back to INIT)",
                "SubDevice 3: INIT to PREOP failed, read 0x0011, expected 0x0002, AL 0x0014 no valid \
                 firmware",
            ]
        );
        assert!(lines[2].len() > 20, "and what to do: {}", lines[2]);
    }

    #[test]
    fn leaving_a_state_on_its_own_is_abnormal() {
        let event = Event::AbnormalState {
            id: DeviceId(0),
            from: AlState::Op,
            status: AlStatus(0x0014),
            code: AlStatusCode(0x001B),
        };
        let lines = lines(&event);
        assert_eq!(
            lines[0],
            "SubDevice 1: abnormal state change (from OP to SAFEOP), AL 0x001B sync manager watchdog"
        );
        assert_eq!(lines.len(), 2, "and what to do: {lines:?}");
    }

    #[test]
    fn a_step_whose_time_is_up_says_what_was_read() {
        let event = Event::StepTimedOut {
            id: DeviceId(0),
            from: None,
            to: AlState::Init,
            status: AlStatus(0x0008),
        };
        let lines = lines(&event);
        assert!(lines[0].ends_with("(requested INIT, back to OP)"), "{lines:?}");
        assert!(
            lines[1].contains("change to INIT failed, read 0x0008, expected 0x0001"),
            "{lines:?}"
        );
    }
}
