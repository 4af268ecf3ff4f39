//! What a running MainDevice tells, in words.

use linesman_config::identity;
use linesman_maindevice::Event;

use super::names::Names;
use super::quantity::count;

/// An event in one line; `None` for what only programs want to know: answers that somebody asked for,
/// counters and links, which the diagnosis looks at.
#[allow(clippy::wildcard_enum_match_arm, reason = "answers are told by whoever asked")]
pub(crate) fn words(event: &Event, names: &Names) -> Option<String> {
    let who = |id: &linesman_proto::address::DeviceId| names.device(id.no());
    Some(match event {
        Event::DeviceState { id, status, code } if status.error() => {
            format!("{} is in {status}: {code}", who(id))
        }
        Event::DeviceState { id, status, .. } => format!("{} is in {status}", who(id)),
        Event::AllReached => "all SubDevices are where they shall be".to_owned(),
        Event::Refused { id, to, status, code, .. } => {
            format!("{} refuses to enter {to}, is in {status}: {code}", who(id))
        }
        Event::StepTimedOut { id, to, status, .. } => {
            format!("{} was asked to enter {to} and is still in {status}; its time is up", who(id))
        }
        Event::DeviceLost { id } => format!("{} does not answer", who(id)),
        Event::DeviceBack { id, restarted: true } => {
            format!("{} answers again; it was without power", who(id))
        }
        Event::DeviceBack { id, restarted: false } => format!("{} answers again", who(id)),
        Event::WrongDevice { id, mismatch, expected, found } => format!(
            "{}: another {mismatch}: expected {}, found {}",
            who(id),
            identity::text(expected),
            identity::text(found)
        ),
        Event::UnplannedDevice { position, found } => {
            format!(
                "a SubDevice that the plan does not have at position {position}: {}",
                identity::text(found)
            )
        }
        Event::Responding { before, now } => {
            format!("{now} SubDevices answer, before it were {before}")
        }
        Event::Ring { intact: true } => "the ring is closed".to_owned(),
        Event::Ring { intact: false } => "the ring is open".to_owned(),
        Event::WorkingCounter { task, frame, datagram, expected, received } => format!(
            "working counter {received}, expected {expected} (task {task}, frame {frame}, datagram \
             {datagram})"
        ),
        Event::WorkingCounterGood { task, frame, datagram } => {
            format!("working counter good again (task {task}, frame {frame}, datagram {datagram})")
        }
        Event::CyclicFramesLost { task } => {
            format!("cyclic frames of task {task} do not come back")
        }
        Event::CyclicFramesBack { task, lost } => {
            format!("cyclic frames of task {task} come back; lost: {}", count(*lost, "frame"))
        }
        Event::OutputsWithheld { task } => format!(
            "the application is late: outputs of task {task} are withheld, watchdogs will expire"
        ),
        Event::OutputsResumed { task } => {
            format!("the application is back: outputs of task {task} are sent again")
        }
        Event::Emergency { id, emergency } => format!("{}: {emergency:?}", who(id)),
        _ => return None,
    })
}
