//! A MainDevice and a virtual segment in virtual time.

use linesman_config::inventory::Inventory;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

/// How long a frame waits before it leaves.
pub(crate) type LeavesAfter = Box<dyn Fn(&[u8]) -> Span>;

/// Frames that the bench itself drops or doubles on their way back, by their number.
pub(crate) type Tamper = Box<dyn FnMut(u64) -> Fate>;

/// What becomes of a frame that comes back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Fate {
    Arrives,
    Lost,
    Doubled,
    Late(Span),
    /// Another one comes with it, whose index nobody has given.
    Accompanied,
    /// All behind so many bytes is missing.
    Truncated(usize),
    /// A byte of it is replaced: an answer that lies.
    Garbled {
        at: usize,
        byte: u8,
    },
}

pub(crate) struct Bench {
    pub(crate) now: Instant,
    pub(crate) device: MainDevice,
    pub(crate) segment: Segment,
    pub(crate) events: Vec<(Instant, Event)>,
    pub(crate) tamper: Option<Tamper>,
    /// Whose process data are judged in each cycle, when its frames are back or given up.
    pub(crate) judged: Option<DeviceId>,
    /// Others that are judged together with it.
    pub(crate) judged_too: Vec<DeviceId>,
    /// How many cycles were judged, and in how many the data were not valid.
    pub(crate) cycles: u64,
    pub(crate) bad_cycles: u64,
    /// When that was.
    pub(crate) bad_at: Vec<Instant>,
    /// What crosses the cards, if anybody wants to know: by which card, whether it comes back, and the frame.
    pub(crate) crossed: Option<Vec<(Path, bool, Vec<u8>)>>,
    /// How long after it was given away a frame leaves the card: programs that run before it.
    pub(crate) leaves_after: Option<LeavesAfter>,
    arrivals: u64,
    delayed: Vec<(Instant, Path, Vec<u8>)>,
    leaving: Vec<(Instant, Path, Vec<u8>)>,
}

impl Bench {
    /// Has a request to the mailbox of a SubDevice done, and gives the data of the answer.
    pub(crate) fn ask_mailbox(
        &mut self,
        name: &str,
        request: MailboxRequest,
    ) -> Result<Vec<u8>, ServiceFailure> {
        let id = self.id(name);
        self.events.clear();
        self.device.serve(self.now, id, Service::Mailbox(request));
        assert!(self.run_until(Span::s(5), |event| matches!(event, Event::Served { .. })));
        match self.events.pop() {
            Some((_, Event::Served { result, .. })) => (*result).map(|answer| {
                let ServiceAnswer::Data(data) = answer else { panic!("{answer:?}") };
                data
            }),
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn new(toml: &str) -> Self {
        Self::with_options(toml, Options::default())
    }

    pub(crate) fn with_options(toml: &str, options: Options) -> Self {
        let file = SegmentFile::parse(toml).expect("segment file");
        Self::of(&file, options)
    }

    pub(crate) fn of(file: &SegmentFile, options: Options) -> Self {
        Self {
            now: Instant::ZERO,
            device: MainDevice::new(Network(0), options),
            segment: Segment::build(file).expect("segment"),
            events: Vec::new(),
            tamper: None,
            judged: None,
            judged_too: Vec::new(),
            cycles: 0,
            bad_cycles: 0,
            bad_at: Vec::new(),
            crossed: None,
            leaves_after: None,
            arrivals: 0,
            delayed: Vec::new(),
            leaving: Vec::new(),
        }
    }

    /// Runs until `done` says so of an event, at most until `limit` has passed.
    pub(crate) fn run_until(&mut self, limit: Span, mut done: impl FnMut(&Event) -> bool) -> bool {
        let end = self.now + limit;
        let mut buffer = vec![0; 1514];
        let mut arrival_buffer = Vec::new();
        loop {
            while let Some(transmit) = self.device.poll_transmit(self.now, &mut buffer) {
                let frame = &buffer[..transmit.len];
                let waits = self.leaves_after.as_ref().map_or(Span::ZERO, |after| after(frame));
                if waits > Span::ZERO {
                    let leaving = (transmit.at + waits, transmit.path, frame.to_vec());
                    self.leaving.push(leaving);
                    continue;
                }
                self.segment.handle_frame(transmit.at, transmit.path, frame);
                self.note(transmit.path, false, frame);
            }
            let mut finished = false;
            while let Some(event) = self.device.poll_event() {
                finished |= done(&event);
                self.events.push((self.now, event));
            }
            if finished {
                return true;
            }
            let delayed = self.delayed.iter().map(|(at, ..)| *at).min();
            let leaving = self.leaving.iter().map(|(at, ..)| *at).min();
            let next = [self.device.poll_timeout(), self.segment.poll_timeout(), delayed, leaving];
            let next = next.into_iter().flatten().min().unwrap_or(Instant::MAX);
            if next > end {
                self.now = end;
                self.segment.advance(end);
                return false;
            }
            self.now = self.now.max(next);
            self.segment.advance(self.now);
            while let Some(arrival) = self.segment.poll_arrival(&mut arrival_buffer) {
                assert!(arrival.at <= self.now, "{:?} arrives after {:?}", arrival.at, self.now);
                if arrival.intact {
                    self.arrive(arrival.path, &arrival_buffer);
                }
            }
            while let Some(due) = self.delayed.iter().position(|(at, ..)| *at <= self.now) {
                let (_, path, frame) = self.delayed.remove(due);
                self.device.handle_frame(self.now, path, &frame);
            }
            while let Some(due) = self.leaving.iter().position(|(at, ..)| *at <= self.now) {
                let (at, path, frame) = self.leaving.remove(due);
                self.segment.handle_frame(at, path, &frame);
                self.note(path, false, &frame);
            }
            self.judge();
            if self.device.poll_timeout().is_some_and(|at| at <= self.now) {
                self.device.handle_timeout(self.now);
                self.judge();
            }
        }
    }

    /// Looks at the process data as an application would, once a cycle.
    fn judge(&mut self) {
        if let Some(id) = self.judged
            && self.device.take_exchanged(0)
        {
            self.cycles += 1;
            let is_valid = |id: DeviceId| self.device.quality(id).valid;
            if !is_valid(id) || !self.judged_too.iter().all(|id| is_valid(*id)) {
                self.bad_cycles += 1;
                self.bad_at.push(self.now);
            }
        }
    }

    fn note(&mut self, path: Path, comes_back: bool, frame: &[u8]) {
        if let Some(crossed) = &mut self.crossed {
            crossed.push((path, comes_back, frame.to_vec()));
        }
    }

    fn arrive(&mut self, path: Path, frame: &[u8]) {
        self.note(path, true, frame);
        self.arrivals += 1;
        let fate = self.tamper.as_mut().map_or(Fate::Arrives, |tamper| tamper(self.arrivals));
        match fate {
            Fate::Arrives => self.device.handle_frame(self.now, path, frame),
            Fate::Lost => {}
            Fate::Doubled => {
                self.device.handle_frame(self.now, path, frame);
                self.device.handle_frame(self.now, path, frame);
            }
            Fate::Garbled { at, byte } => {
                let mut frame = frame.to_vec();
                let at = at % frame.len();
                frame[at] = byte;
                self.device.handle_frame(self.now, path, &frame);
            }
            Fate::Accompanied => {
                let mut stray = frame.to_vec();
                // The index byte of the first datagram; half of all numbers are not in use.
                stray[17] = stray[17].wrapping_add(128);
                self.device.handle_frame(self.now, path, &stray);
                self.device.handle_frame(self.now, path, frame);
            }
            Fate::Truncated(len) => {
                self.device.handle_frame(self.now, path, &frame[..len.min(frame.len())]);
            }
            Fate::Late(span) => self.delayed.push((self.now + span, path, frame.to_vec())),
        }
    }

    pub(crate) fn run_for(&mut self, span: Span) {
        self.run_until(span, |_| false);
    }

    pub(crate) fn scan(&mut self) -> Inventory {
        self.device.scan(self.now);
        let done = |event: &Event| matches!(event, Event::Scanned(_) | Event::ScanFailed(_));
        assert!(self.run_until(Span::s(20), done), "the scan does not end");
        match self.events.pop() {
            Some((_, Event::Scanned(inventory))) => *inventory,
            other => panic!("{other:?}"),
        }
    }

    /// Scans, plans everything to `target`, and starts.
    pub(crate) fn start(&mut self, target: AlState) -> Plan {
        let inventory = self.scan();
        let tree = inventory.tree().clone();
        let plan = Plan::build(&inventory.planned(target), tree, &PlanOptions::default());
        let plan = plan.expect("a plan");
        self.device.start(self.now, plan.clone());
        let done = |event: &Event| matches!(event, Event::AllReached);
        assert!(
            self.run_until(Span::s(30), done),
            "not all reach {target}; {:#?}",
            self.events.iter().rev().take(30).collect::<Vec<_>>()
        );
        plan
    }

    /// Number of a device by its name in the segment file.
    pub(crate) fn id(&self, name: &str) -> DeviceId {
        let found = self.segment.devices().find(|id| self.segment.name(*id) == name);
        found.unwrap_or_else(|| panic!("no {name}"))
    }

    pub(crate) fn state(&self, name: &str) -> String {
        let controller = self.segment.controller(self.id(name)).expect(name);
        controller.al_status().to_string()
    }
}
