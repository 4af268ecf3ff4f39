//! Recordings beside a diagnosis: a capture file of all that is seen, and bundles of findings.

use std::path::Path;

use linesman_diagnosis::Engine;
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::Instant;
use linesman_runtime::record::Recorder;

use super::DiagnosisRun;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::version;

impl DiagnosisRun {
    /// Begins to record bundles, where that was asked for. `start` is the date of the run's time 0.
    pub(super) fn begin_bundles(
        &mut self,
        start: UnixTime,
        names: &[String],
    ) -> Result<(), Failure> {
        self.recording = self.bundles.recording(start, names)?;
        Ok(())
    }

    /// Everything up to `now` was shown to the diagnosis.
    pub(super) fn turn_bundles(&mut self, now: Instant, engine: &Engine, output: &mut Output) {
        let told = !self.json;
        if let Some(recording) = &mut self.recording {
            recording.turn(now, engine, told, output);
        }
    }

    /// The diagnosis has ended: what is to be in a bundle is written.
    pub(super) fn end_bundles(&mut self, at: Instant, engine: &Engine, output: &mut Output) {
        let told = !self.json;
        if let Some(mut recording) = self.recording.take() {
            recording.finish(at, engine, told, output);
        }
    }

    /// Begins the recording, where that was asked for. `start` is the date of the run's time 0.
    pub(super) fn recorder(
        &self,
        start: UnixTime,
        names: &[String],
    ) -> Result<Option<Recorder>, Failure> {
        let Some(path) = &self.record else { return Ok(None) };
        files::refuse_to_overwrite(path)?;
        let recorder = Recorder::create(path, &version::tool(), start, names);
        recorder.map(Some).map_err(|error| files::in_file(path, &error))
    }

    /// Says at once that the recording has come to an end before the line was judged.
    pub(super) fn look_at_recording(&mut self, recorder: Option<&Recorder>, output: &Output) {
        let fault = recorder.and_then(Recorder::fault);
        if let (Some(fault), Some(path), false) = (fault, &self.record, self.recording_failed) {
            self.recording_failed = true;
            output.fail(&unrecorded(path, fault));
        }
    }

    /// Ends the recording, of a look that lasted until `at`.
    pub(super) fn end_recording(&self, recorder: Option<Recorder>, at: Instant, output: &Output) {
        let (Some(recorder), Some(path)) = (recorder, &self.record) else { return };
        if let Err(error) = recorder.finish(at)
            && !self.recording_failed
        {
            output.fail(&unrecorded(path, &error));
        }
    }
}

/// Why a recording is not whole.
fn unrecorded(path: &Path, error: &dyn std::error::Error) -> Failure {
    let reason = format!("{}: recording the line: {error}", path.display());
    Failure::new(reason, "make room there, leave the file where it is, and record anew")
}
