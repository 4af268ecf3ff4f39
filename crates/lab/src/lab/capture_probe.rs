//! Capture probe in the segment of the lab.

use linesman_sim::segment::{ProbeFrame, ProbePlaceError};

use super::Lab;

impl Lab {
    /// Loops a capture probe into links ([`Segment::loop_in_probe`](linesman_sim::segment::Segment::loop_in_probe)).
    ///
    /// # Errors
    /// [`ProbePlaceError`] names the place that is none.
    pub fn loop_in_probe(&mut self, places: &[String]) -> Result<(), ProbePlaceError> {
        self.line.segment_mut().loop_in_probe(places)
    }

    /// The next frame that the capture probe has seen; its bytes replace those in `buffer`.
    pub fn poll_probe_frame(&mut self, buffer: &mut Vec<u8>) -> Option<ProbeFrame> {
        self.line.segment_mut().poll_probe_frame(buffer)
    }
}
