//! Session of a MainDevice of others: what [`Session`](linesman_session::Session) is for ours.

use std::convert::Infallible;

use linesman_diagnosis::Direction;
use linesman_proto::address::Path;
use linesman_proto::time::Instant;
use linesman_session::DiagnosisInput;
use linesman_session::frame::{FRAME_ROOM, FrameSummary};
use linesman_session::transport::{FrameSink, RxFrame, Transport};

use super::diagnosis::LabDiagnosis;
use crate::soem::Soem;

/// A MainDevice of others on a line.
pub(super) struct OtherSession {
    pub(super) soem: Soem,
    buffer: Vec<u8>,
    frames: u64,
}

impl OtherSession {
    pub(super) fn new(soem: Soem) -> Self {
        Self { soem, buffer: vec![0; FRAME_ROOM], frames: 0 }
    }

    /// As [`Session::take_in`](linesman_session::Session::take_in).
    pub(super) fn take_in<L: Transport<Error = Infallible>>(
        &mut self,
        now: Instant,
        line: &mut L,
        shown: &mut LabDiagnosis,
    ) {
        let Ok(_) = line.receive(now, &mut OtherIntake { session: self, shown, now });
        let Ok(()) = line.look_at_host(now, &mut |observation| shown.host(observation));
        self.soem.handle_timeout(now);
        shown.turn(now);
    }

    /// As [`Session::handle_frame`](linesman_session::Session::handle_frame), of a frame that has just come.
    pub(super) fn handle_frame(
        &mut self,
        now: Instant,
        path: Path,
        frame: &[u8],
        shown: &mut LabDiagnosis,
    ) {
        self.frames += 1;
        shown.frame(&summary(self.frames, path, Direction::Received, now).seen(frame));
        self.soem.handle_frame(now, path, frame);
    }

    /// As [`Session::send`](linesman_session::Session::send).
    pub(super) fn send<L: Transport<Error = Infallible>>(
        &mut self,
        now: Instant,
        line: &mut L,
        shown: &mut LabDiagnosis,
    ) {
        while let Some(sent) = self.soem.poll_transmit(now, &mut self.buffer) {
            let frame = &self.buffer[..sent.len];
            self.frames += 1;
            shown.frame(&summary(self.frames, sent.path, Direction::Sent, now).seen(frame));
            let Ok(()) = line.send(sent.path, frame);
        }
    }
}

const fn summary(number: u64, path: Path, direction: Direction, time: Instant) -> FrameSummary {
    FrameSummary { time, number, path: Some(path), direction, truncated: false }
}

struct OtherIntake<'a> {
    session: &'a mut OtherSession,
    shown: &'a mut LabDiagnosis,
    now: Instant,
}

impl FrameSink for OtherIntake<'_> {
    fn room(&mut self) -> &mut [u8] {
        &mut self.session.buffer
    }

    fn frame_received(&mut self, received: RxFrame) {
        let RxFrame { at, path, len, .. } = received;
        let OtherSession { soem, buffer, frames } = &mut *self.session;
        let Some(frame) = buffer.get(..len) else { return };
        *frames += 1;
        self.shown.frame(&summary(*frames, path, Direction::Received, at).seen(frame));
        soem.handle_frame(at.max(self.now), path, frame);
    }
}
