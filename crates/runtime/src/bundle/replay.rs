//! Replay of a bundle: its inputs, shown to a diagnosis in the order in which they were seen.

use std::io::Cursor;

use linesman_diagnosis::{Direction, Engine, FrameSeen, Setup};
use linesman_link::capture::{CaptureError, CaptureReader, CapturedFrame, FrameDirection};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::{Network, Path};
use linesman_proto::time::Instant;

use super::archive::{Bundle, since};

impl Bundle {
    /// What an engine is told before it judges the bundle: the same as the one that has judged the run.
    #[must_use]
    pub fn setup(&self) -> Setup {
        let manifest = &self.manifest;
        Setup {
            project: self.project.clone(),
            exchange: manifest.exchange.planned(),
            input: manifest.input,
            host_counters: manifest.host_counters,
            // Nobody reads what it asks for; what was read stands among the frames.
            probes: manifest.probes,
            active: manifest.active,
            source: self.name.display().to_string(),
            start: manifest.start.clone(),
            clock: manifest.clock.clone(),
            tap_places: Vec::new(),
            exchanges: Vec::new(),
        }
    }

    /// The date of the run's time 0.
    #[must_use]
    pub fn start(&self) -> UnixTime {
        UnixTime::from_nanos(i128::from(self.manifest.start_unix_ns.0))
    }

    /// Shows frames and observations to an engine made of [`setup`](Self::setup), and ends its input. After each of them
    /// `after` may look at it. Gives whether the frames could be read to their end, and when the bundle ends.
    ///
    /// # Errors
    /// When `frames.pcapng` is no capture.
    pub fn replay(
        &self,
        engine: &mut Engine,
        mut after: impl FnMut(&mut Engine),
    ) -> Result<(bool, Instant), CaptureError> {
        let mut reader =
            CaptureReader::from_source(self.name.clone(), Cursor::new(self.frames.clone()))?;
        let mut lines = self.observations.iter().peekable();
        let mut written = 0;
        let mut last = Instant::ZERO;
        while reader.advance() {
            while let Some(line) = lines.next_if(|line| line.after_frame.0 <= written) {
                line.show(engine);
                after(engine);
            }
            let Some(captured) = reader.frame() else { break };
            written += 1;
            let path = card(&reader, &captured);
            let time = since(self.start(), captured.time);
            let seen = seen(&captured, path, time, written);
            if engine.poll_timeout().is_some_and(|due| due <= time) {
                engine.handle_timeout(time);
            }
            engine.handle_frame(&seen);
            last = last.max(time);
            while engine.poll_probe().is_some() {}
            after(engine);
        }
        for line in lines {
            line.show(engine);
        }
        let is_complete = reader.end().is_none_or(|end| end.complete());
        let end = last.max(Instant::from_nanos(self.manifest.end_ns.0));
        engine.handle_timeout(end);
        engine.finish(end, is_complete);
        after(engine);
        Ok((is_complete, end))
    }
}

/// The card that has seen a frame, as the recorder describes its interfaces.
pub(super) fn card(reader: &CaptureReader, captured: &CapturedFrame<'_>) -> Option<Path> {
    let interface = reader.interfaces().get(captured.interface.0 as usize)?;
    match interface.description.as_deref()? {
        "card A" => Some(Path::A),
        "card B" => Some(Path::B),
        _ => None,
    }
}

fn seen<'a>(
    captured: &CapturedFrame<'a>,
    path: Option<Path>,
    time: Instant,
    number: u64,
) -> FrameSeen<'a> {
    FrameSeen {
        network: Network::default(),
        path,
        direction: match captured.direction {
            FrameDirection::Outgoing => Direction::Sent,
            FrameDirection::Incoming => Direction::Received,
            FrameDirection::Unknown => Direction::Unknown,
        },
        time,
        number,
        fcs: captured.fcs,
        probe: None,
        truncated: captured.truncated,
        bytes: captured.bytes,
    }
}
