//! Intake of a frame: its kind, its network, and the counts it adds to.

use linesman_proto::frame::{FrameError, FrameView};
use linesman_proto::time::Instant;

use super::network_watch::NetworkWatch;
use crate::model::Seen;
use crate::observe::{Direction, Fingerprint, FrameSeen, PairingOutcome, companion, question};

/// Takes a frame at `now`.
pub(super) fn take(watched: &mut NetworkWatch, frame: &FrameSeen<'_>, now: Instant) {
    watched.model.now = now;
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
    let NetworkWatch { model, learner, pairing, .. } = watched;
    let traffic = &mut model.traffic;
    let view = match parsed {
        Ok(view) => view,
        Err(FrameError::OtherType { .. }) => {
            traffic.recording.record_without_datagrams();
            return;
        }
        Err(FrameError::NotEtherCat { .. } | FrameError::CutOff { .. }) => {
            let kind = frame.bytes.get(12..14).map_or(0, |at| u16::from_be_bytes([at[0], at[1]]));
            let seen = Seen::new(kind, frame.time, Some(frame.number));
            if traffic.foreign.record(seen, frame.direction == Direction::Received) {
                model.touch();
            }
            return;
        }
    };
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
    let print = Fingerprint::of(&view);
    if print.is_cut && frame.truncated {
        traffic.recording.record_cut();
    }
    let outcome = pairing.take(frame, &view, print, &mut |exchange| learner.learn(model, exchange));
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
