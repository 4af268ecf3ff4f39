//! A recording played to a listener, as `diagnose listen:` hears a line.

use linesman_config::project::Project;
use linesman_diagnosis::observe::{Direction, FrameSeen, HostEvent, HostObservation};
use linesman_diagnosis::report::Diagnosis;
use linesman_diagnosis::{Engine, InputKind, Setup};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};

use super::super::recorder::{RecordedFrame, Recording};

/// The longest time between two looks at the clock.
const NAP: Span = Span::ms(100);

/// A listener on the cards of the MainDevice.
#[derive(Clone, Debug)]
pub(in crate::score) struct Listener<'a> {
    /// What is to be heard.
    pub(in crate::score) recording: &'a Recording,
    /// The project, if it is given.
    pub(in crate::score) project: Option<&'a Project>,
    /// Whether the computer tells what its cards have counted.
    pub(in crate::score) host_counters: bool,
}

impl Listener<'_> {
    /// The frames that are heard from `from` on, up to `until`.
    pub(in crate::score) fn hears(
        &self,
        from: Option<Instant>,
        until: Instant,
    ) -> std::ops::Range<usize> {
        let frames = &self.recording.frames;
        let first = from.map_or(0, |from| frames.partition_point(|frame| frame.time < from));
        first..frames.partition_point(|frame| frame.time <= until).max(first)
    }

    /// What it says at `until`, if it listens from `from` on, or from before the first frame. `None` when nothing was
    /// heard.
    pub(in crate::score) fn says(
        &self,
        from: Option<Instant>,
        until: Instant,
    ) -> Option<Diagnosis> {
        let range = self.hears(from, until);
        let mut hearing = ListenerRun {
            engine: None,
            // Who is there from before the first frame has been told of the link before, in vain.
            carriers: [None; 2],
            listens: Path::ALL.map(|path| {
                let mut frames = self.recording.frames.iter();
                frames.any(|frame| frame.path.unwrap_or(Path::A) == path)
            }),
            is_late: from.is_some(),
            sees_own: false,
            now: Instant::ZERO,
        };
        let mut host = self.recording.host.iter().peekable();
        for (frame, number) in self.recording.frames[range.clone()].iter().zip(1..) {
            let at = range.start + number - 1;
            while let Some((_, seen)) = host.next_if(|(before, _)| *before <= at) {
                hearing.observe(*seen, self.host_counters);
            }
            hearing.take(self, frame, number as u64);
        }
        for (_, seen) in host.take_while(|(_, seen)| seen.time <= until) {
            hearing.observe(*seen, self.host_counters);
        }
        let mut engine = hearing.engine?;
        engine.handle_timeout(until);
        engine.finish(until, true);
        Some(engine.diagnosis())
    }

    /// The diagnosis begins with the first frame.
    fn begin(&self, is_local: bool) -> Engine {
        Engine::new(Setup {
            project: self.project.cloned(),
            input: InputKind::Listened,
            host_counters: is_local && self.host_counters,
            clock: "virtual".to_owned(),
            ..Setup::default()
        })
    }
}

/// A listener at work.
struct ListenerRun {
    engine: Option<Engine>,
    /// Whether each card has a link, as far as that was observed.
    carriers: [Option<bool>; 2],
    /// On which cards it listens: those by which frames pass at any time.
    listens: [bool; 2],
    is_late: bool,
    /// Frames were seen that this computer has sent.
    sees_own: bool,
    now: Instant,
}

impl ListenerRun {
    fn take(&mut self, listener: &Listener<'_>, frame: &RecordedFrame, number: u64) {
        self.sees_own |= frame.is_sent;
        let direction = match frame.is_sent {
            true => Direction::Sent,
            false if self.sees_own => Direction::Received,
            false => Direction::Unknown,
        };
        let is_first = self.engine.is_none();
        let engine = self.engine.get_or_insert_with(|| listener.begin(frame.is_sent));
        while !is_first && self.now + NAP < frame.time {
            self.now += NAP;
            engine.handle_timeout(self.now);
        }
        self.now = self.now.max(frame.time);
        engine.handle_timeout(self.now);
        engine.handle_frame(&FrameSeen {
            network: Network(0),
            path: frame.path,
            direction,
            time: frame.time,
            number,
            fcs: frame.fcs,
            truncated: false,
            probe: None,
            bytes: &frame.bytes,
        });
        if is_first && self.is_late {
            // What the card is like is asked for when the first frames have been fetched.
            for path in Path::ALL {
                let Some(carrier) = self.carriers[path.index()] else { continue };
                let what = HostEvent::Carrier(carrier);
                let time = frame.time;
                engine.handle_host(&HostObservation { network: Network(0), path, time, what });
            }
        }
    }

    fn observe(&mut self, seen: HostObservation, host_counters: bool) {
        if !self.listens[seen.path.index()] {
            return;
        }
        if let HostEvent::Carrier(carrier) = seen.what {
            self.carriers[seen.path.index()] = Some(carrier);
        }
        let is_told = host_counters || matches!(seen.what, HostEvent::Carrier(_));
        if let Some(engine) = self.engine.as_mut().filter(|_| is_told) {
            engine.handle_host(&seen);
        }
    }
}
