//! Execution of the requests to a running segment.

use linesman_config::attachment::Attachment;
use linesman_proto::time::Instant;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::{FaultId, FaultRecord};

use super::message::{Answer, FAULTS_SCHEMA, FaultState, Faults, Request};
use super::signals;
use crate::names::Names;
use crate::serve::Server;

/// Does what was asked at `now` and tells how it is then.
pub(crate) fn apply(now: Instant, request: &Request, server: &mut Server) -> Answer {
    let (segment, wiring) = server.parts();
    match request {
        Request::Inject { fault, for_ms } => {
            let error = inject(now, (**fault).clone(), *for_ms, segment).err();
            faults(error, segment)
        }
        Request::Heal { no } => {
            let error = heal(now, *no, segment).err();
            faults(error, segment)
        }
        Request::Unplug { name } => {
            let error = segment.unplug(now, name).err();
            faults(error.map(|error| error.to_string()), segment)
        }
        Request::Plug { name, on } => {
            let error = plug(now, name, on.as_deref(), segment).err();
            faults(error, segment)
        }
        Request::List => faults(None, segment),
        Request::Status => Answer::Status(Box::new(server.status())),
        Request::Signals => Answer::Signals(signals::table(None, segment, wiring)),
        Request::Set { input, value } => {
            let error = signals::hold(input, *value, segment, wiring).err();
            Answer::Signals(signals::table(error, segment, wiring))
        }
        Request::Release { input } => {
            let error = signals::release(input.as_deref(), segment, wiring).err();
            Answer::Signals(signals::table(error, segment, wiring))
        }
        Request::Events { .. } => Answer::Events,
    }
}

fn inject(
    now: Instant,
    mut fault: FaultEntry,
    for_ms: Option<f64>,
    segment: &mut Segment,
) -> Result<(), String> {
    if for_ms.is_some_and(|ms| !(ms > 0.0 && ms < 1e12)) {
        return Err("for how long: expected a number of ms above 0".to_owned());
    }
    // Times of the segment, which began before the request.
    let now_ms = now.as_nanos() as f64 / 1e6;
    fault.from_ms = for_ms.map(|_| now_ms);
    fault.to_ms = for_ms.map(|ms| now_ms + ms);
    // Its schedule counts from its begin, which is now.
    segment.inject(now, &fault).map(drop).map_err(|error| error.to_string())
}

fn plug(now: Instant, name: &str, on: Option<&str>, segment: &mut Segment) -> Result<(), String> {
    let on = match on {
        Some(text) => Some(text.parse::<Attachment>().map_err(|error| error.to_string())?),
        None => None,
    };
    segment.plug(now, name, on.as_ref()).map_err(|error| error.to_string())
}

fn heal(now: Instant, no: Option<u32>, segment: &mut Segment) -> Result<(), String> {
    let count = segment.truth().faults().len() as u32;
    let healed = match no {
        None => 0..count,
        Some(no) if (1..=count).contains(&no) => no - 1..no,
        Some(no) => return Err(format!("there is no fault {no}, there are {count}")),
    };
    for fault in healed {
        segment.heal(now, FaultId(fault));
    }
    Ok(())
}

fn faults(error: Option<String>, segment: &Segment) -> Answer {
    let names = Names::of(segment);
    let state = |fault: &FaultRecord| FaultState {
        no: fault.id.0 + 1,
        name: fault.name,
        places: fault.places.iter().map(|place| names.place(place)).collect(),
        began_ns: fault.began.map(Instant::as_nanos),
        ended_ns: fault.ended.map(Instant::as_nanos),
        frames_spoiled: fault.frames_spoiled,
        frames_lost: fault.frames_lost,
    };
    let faults = segment.truth().faults().iter().map(state).collect();
    Answer::Faults(Faults { schema: FAULTS_SCHEMA.to_owned(), error, faults })
}
