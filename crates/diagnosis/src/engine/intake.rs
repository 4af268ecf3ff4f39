//! Intake of a frame: its kind, its network, and the counts it adds to.

use linesman_proto::frame::{FrameError, FrameView};
use linesman_proto::time::Instant;

use super::network_watch::NetworkWatch;
use crate::model::{NetworkModel, Seen};
use crate::observe::capture_probe::ProbeOutput;
use crate::observe::{
    Direction, Exchange, Fingerprint, FrameSeen, PairingOutcome, companion, question,
};

/// Takes a frame at `now` as [`take`]; one that a capture probe has recorded as one copy of several.
pub(super) fn take_copy(
    watched: &mut NetworkWatch,
    frame: &FrameSeen<'_>,
    print: Option<&Fingerprint>,
    now: Instant,
    observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
) {
    let Some(record) = frame.probe else { return take(watched, frame, print, now, observe) };
    let mut probe = std::mem::take(&mut watched.capture_probe);
    probe.take(frame, record, &mut |output| take_output(watched, output, now, observe));
    watched.capture_probe = probe;
}

/// The input ends at `now`: copies that are under way are judged as far as they came.
pub(super) fn finish_copies(
    watched: &mut NetworkWatch,
    now: Instant,
    observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
) {
    let mut probe = std::mem::take(&mut watched.capture_probe);
    probe.finish(&mut |output| take_output(watched, output, now, observe));
    watched.model.capture_probe.take_order(probe.order());
    watched.capture_probe = probe;
}

fn take_output(
    watched: &mut NetworkWatch,
    output: ProbeOutput<'_>,
    now: Instant,
    observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
) {
    match output {
        ProbeOutput::Frame(seen) => {
            take(watched, &seen, None, now, observe);
        }
        ProbeOutput::Passed(passage, expected, order) => {
            if watched.model.capture_probe.note(passage, expected, order) {
                watched.model.touch();
            }
        }
    }
}

/// Takes a frame at `now`, and shows each exchange that it completes or settles once the model has learnt it.
pub(super) fn take(
    watched: &mut NetworkWatch,
    frame: &FrameSeen<'_>,
    print: Option<&Fingerprint>,
    now: Instant,
    observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
) {
    watched.model.now = now;
    watched.latest.begin();
    let parsed = FrameView::parse(frame.bytes);
    if let Ok(view) = &parsed
        && question::is_question(view)
    {
        // Damaged ones do not reach anybody.
        if frame.fcs != Some(false) {
            watched.take_question(frame, view);
        }
        return;
    }
    let NetworkWatch { model, learner, pairing, latest, .. } = watched;
    let view = match parsed {
        Ok(view) => view,
        Err(error) => return take_other(model, frame, error),
    };
    let traffic = &mut model.traffic;
    traffic.recording.record_frame(frame.time);
    if frame.direction != Direction::Unknown {
        traffic.recording.record_direction();
    }
    if frame.fcs == Some(false) {
        // Its bytes prove nothing, and the MainDevice's card drops it: the request stays open.
        traffic.losses.record_damaged(frame.time);
        model.touch();
        return;
    }
    if companion::processed(&view).is_some() {
        return;
    }
    let print = print.copied().unwrap_or_else(|| Fingerprint::of(&view));
    if print.is_cut && frame.truncated {
        traffic.recording.record_cut();
    }
    let outcome = pairing.take(frame, &view, print, &mut |exchange| {
        latest.note_exchange(exchange);
        learner.learn(model, exchange);
        observe(model, exchange);
    });
    latest.note_outcome(outcome);
    let (mistaken, unrecorded) = (pairing.take_mistaken(), pairing.take_unrecorded());
    let traffic = &mut model.traffic;
    traffic.returns.record_doubled(pairing.take_doubled());
    traffic.recording.record_unrecorded(unrecorded, frame.time);
    if mistaken > 0 {
        traffic.record_mistaken(mistaken);
        traffic.requests.set_senders(pairing.senders());
    }
    let has_other_senders = pairing.senders_changed();
    if has_other_senders {
        traffic.requests.set_senders(pairing.senders());
    }
    if matches!(outcome, PairingOutcome::Request | PairingOutcome::ReturnAlone) {
        model.habits.take(&view, frame.time, outcome == PairingOutcome::Request);
    }
    let traffic = &mut model.traffic;
    match outcome {
        PairingOutcome::Request | PairingOutcome::RequestCopy => traffic.requests.record(),
        PairingOutcome::Return | PairingOutcome::ReturnAlone => {
            if outcome == PairingOutcome::ReturnAlone {
                traffic.returns.record_alone();
            }
            traffic.record_returned(frame.time, frame.number);
        }
        PairingOutcome::Duplicate => {}
    }
    if has_other_senders {
        model.touch();
    }
}

/// Takes a frame without datagrams.
fn take_other(model: &mut NetworkModel, frame: &FrameSeen<'_>, error: FrameError) {
    match error {
        FrameError::OtherType { .. } => model.traffic.recording.record_without_datagrams(),
        FrameError::NotEtherCat { .. } | FrameError::CutOff { .. } => {
            let kind = frame.bytes.get(12..14).map_or(0, |at| u16::from_be_bytes([at[0], at[1]]));
            let seen = Seen::new(kind, frame.time, Some(frame.number));
            if model.traffic.foreign.record(seen, frame.direction == Direction::Received) {
                model.touch();
            }
        }
    }
}
