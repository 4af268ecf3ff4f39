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
            traffic.frames += 1;
            traffic.without_datagrams += 1;
            return;
        }
        Err(FrameError::NotEtherCat { .. } | FrameError::CutOff { .. }) => {
            let kind = frame.bytes.get(12..14).map_or(0, |at| u16::from_be_bytes([at[0], at[1]]));
            let seen = Seen::new(kind, frame.time, Some(frame.number));
            if traffic.record_foreign(seen, frame.direction == Direction::Received) {
                model.touch();
            }
            return;
        }
    };
    traffic.record_frame(frame.time);
    traffic.truncated += u64::from(frame.truncated);
    traffic.direction_known |= frame.direction != Direction::Unknown;
    if frame.fcs == Some(false) {
        // Its bytes prove nothing, and the MainDevice's card drops it: the request stays open.
        traffic.damaged.add(1, frame.time);
        let seen = Seen::new((), frame.time, Some(frame.number));
        traffic.first_damaged.get_or_insert(seen);
        model.touch();
        return;
    }
    if let Some(processed) = companion::processed(&view) {
        traffic.record_companion(Seen::new(processed, frame.time, Some(frame.number)));
        return;
    }
    let print = Fingerprint::of(&view);
    traffic.cut_short += u64::from(print.is_cut && !frame.truncated);
    traffic.datagrams_cut += u64::from(print.is_cut && frame.truncated);
    let outcome = pairing.take(frame, &view, print, &mut |exchange| learner.learn(model, exchange));
    let (mistaken, unrecorded) = (pairing.take_mistaken(), pairing.take_unrecorded());
    let traffic = &mut model.traffic;
    traffic.doubled += pairing.take_doubled();
    traffic.note_unrecorded(unrecorded, frame.time);
    if mistaken > 0 {
        traffic.sent = traffic.sent.saturating_sub(mistaken);
        traffic.returned += mistaken;
        traffic.returned_alone += mistaken;
        traffic.senders = pairing.senders().to_vec();
    }
    let has_other_senders = pairing.senders_changed();
    if has_other_senders {
        traffic.senders = pairing.senders().to_vec();
    }
    if matches!(outcome, PairingOutcome::Request | PairingOutcome::ReturnAlone) {
        model.habits.take(&view, frame.time, outcome == PairingOutcome::Request);
    }
    let traffic = &mut model.traffic;
    match outcome {
        PairingOutcome::Request | PairingOutcome::RequestCopy => traffic.sent += 1,
        PairingOutcome::Return | PairingOutcome::ReturnAlone => {
            traffic.returned_alone += u64::from(outcome == PairingOutcome::ReturnAlone);
            traffic.record_returned(frame.time, frame.number);
        }
        PairingOutcome::Duplicate => traffic.duplicates += 1,
    }
    if has_other_senders {
        model.touch();
    }
}
