//! Recorder in memory: the frames of a run, and what the computer observed of its cards.

use std::sync::{Arc, Mutex, PoisonError};

use linesman_diagnosis::observe::{Direction, FrameSeen, HostObservation};
use linesman_proto::address::Path;
use linesman_proto::time::Instant;

/// A frame of a recording.
#[derive(Clone, Debug)]
pub struct RecordedFrame {
    /// When it passed the card.
    pub time: Instant,
    /// The card that it left by or arrived at.
    pub path: Option<Path>,
    /// Whether it left by it.
    pub is_sent: bool,
    /// Whether its frame check sequence is right, where that is known.
    pub fcs: Option<bool>,
    /// From the destination address on, without frame check sequence.
    pub bytes: Vec<u8>,
}

/// All that a listener on the cards of the MainDevice is shown.
#[derive(Clone, Default, Debug)]
pub(super) struct Recording {
    pub(super) frames: Vec<RecordedFrame>,
    /// Observations of the host, each with the number of frames before it.
    pub(super) host: Vec<(usize, HostObservation)>,
}

/// A recording that is being made.
pub(super) type SharedRecording = Arc<Mutex<Recording>>;

/// Takes one frame down.
pub(super) fn take_down(shared_recording: &SharedRecording, seen: &FrameSeen<'_>) {
    shared_recording.lock().unwrap_or_else(PoisonError::into_inner).frames.push(RecordedFrame {
        time: seen.time,
        path: seen.path,
        is_sent: seen.direction == Direction::Sent,
        fcs: seen.fcs,
        bytes: seen.bytes.to_vec(),
    });
}

/// Takes an observation of the host down.
pub(super) fn take_down_host(shared_recording: &SharedRecording, seen: &HostObservation) {
    let mut recording = shared_recording.lock().unwrap_or_else(PoisonError::into_inner);
    let before = recording.frames.len();
    recording.host.push((before, *seen));
}
