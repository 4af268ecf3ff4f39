//! Time at which frames of a task leave, what they carry, and what the program has seen by then:
//! before or after the program, and inputs ahead of both.

use std::cell::{Cell, RefCell};
use std::fs;
use std::path::Path as FilePath;
use std::rc::Rc;
use std::sync::mpsc::sync_channel;

use crate::support::linesman;
use linesman_config::inventory::Inventory;
use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::{IoAt, Plan, PlanOptions, ProcessAccess};
use linesman_config::project::Project;
use linesman_diagnosis::HostObservation;
use linesman_link::error::LinkError;
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::named_files::NamedFiles;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::{Application, Io, Next, PlanSource, RunControls, SessionOptions, run};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{FrameSink, RxFrame, Transport};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;
use tempfile::TempDir;

const CYCLE: Span = Span::ms(2);
/// Calls of the program, and those of them in which everything has long been up.
const CALLS: usize = 1_500;
const LAST: usize = 200;

/// Outputs, and inputs that they are wired to.
const PLANT: &str = r#"
name = "task"
seed = 3
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "O1"
type = "EL2008"
on = "I1.B"
"#;

/// A frame that left.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Departure {
    at: Instant,
    /// The byte of outputs that it carries.
    outputs: Option<u8>,
    /// Whether it fetches inputs.
    inputs: bool,
}

type Departures = Rc<RefCell<Vec<Departure>>>;

/// A segment whose clock the program moves on while it works, as a real one does.
struct Watched {
    segment: Segment,
    wiring: Wiring,
    clock: Rc<Cell<Instant>>,
    arrival: Vec<u8>,
    departures: Departures,
}

impl Watched {
    fn new(file: &SegmentFile) -> (Self, Rc<Cell<Instant>>, Departures) {
        let segment = Segment::build(file).unwrap();
        let wiring = Wiring::of(&segment, &file.project().unwrap());
        let clock = Rc::new(Cell::new(Instant::ZERO));
        let departures = Departures::default();
        let (same_clock, same) = (Rc::clone(&clock), Rc::clone(&departures));
        let line = Self { segment, wiring, clock, arrival: Vec::new(), departures };
        (line, same_clock, same)
    }
}

impl Transport for Watched {
    type Error = LinkError;

    fn options(&self) -> Options {
        Options::default().on_line(self.segment.tree().len(), self.segment.longest_way())
    }

    fn now(&self) -> Instant {
        self.clock.get()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        self.segment.advance(now);
        self.wiring.carry(self.segment.signals_mut());
        let mut count = 0;
        while let Some(came) = self.segment.poll_arrival(&mut self.arrival) {
            count += 1;
            let len = self.arrival.len();
            intake.room()[..len].copy_from_slice(&self.arrival);
            intake.frame_received(RxFrame { at: came.at, path: came.path, len, truncated: false });
        }
        Ok(count)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        let at = self.clock.get();
        let view = FrameView::parse(frame).expect("a frame of ours");
        let mut seen = Departure { at, outputs: None, inputs: false };
        for datagram in view.datagrams().map_while(Result::ok) {
            match datagram.command() {
                Some(Command::Lwr) => seen.outputs = datagram.data().first().copied(),
                Some(Command::Lrd) => seen.inputs = true,
                _ => {}
            }
        }
        if seen.outputs.is_some() || seen.inputs {
            self.departures.borrow_mut().push(seen);
        }
        self.segment.handle_frame(at, path, frame);
        Ok(())
    }

    fn look_at_host(
        &mut self,
        _: Instant,
        _: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        Ok(())
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        let due = self.segment.poll_timeout().map_or(deadline, |at| at.min(deadline));
        self.clock.set(self.clock.get().max(due));
        Ok(())
    }

    fn note_late(&mut self, _: Span) {}
}

/// A call of the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Call {
    begin: Instant,
    /// When its outputs were given.
    end: Instant,
    /// What it set.
    outputs: u8,
    /// What it saw.
    inputs: u8,
    /// Whether it is the second program, after the outputs.
    after: bool,
}

/// Counts, and takes a time that changes from call to call.
struct Program {
    clock: Rc<Cell<Instant>>,
    calls: Rc<RefCell<Vec<Call>>>,
    number: usize,
}

impl Program {
    /// Between 100 and 699 µs.
    fn takes(&self) -> Span {
        Span::us(100 + (self.number as u64 * 137) % 600)
    }

    fn note(&mut self, io: &mut Io<'_>, begin: Instant, after: bool) {
        let place = io.plan().unwrap().devices[1].inputs.start;
        let (end, inputs) = (self.clock.get(), io.inputs()[place]);
        let outputs = (self.number % 251) as u8;
        self.calls.borrow_mut().push(Call { begin, end, outputs, inputs, after });
    }
}

impl Application for Program {
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        self.number += 1;
        let begin = self.clock.get();
        self.clock.set(begin + self.takes());
        io.outputs_mut().fill((self.number % 251) as u8);
        self.note(io, begin, false);
        if self.number < CALLS { Next::Continue } else { Next::Stop }
    }

    fn after_outputs(&mut self, io: &mut Io<'_>) {
        self.note(io, self.clock.get(), true);
    }
}

/// Runs the program in a task; gives its last calls, and the frames that left meanwhile.
fn played(io_at: IoAt) -> (Vec<Call>, Vec<Departure>) {
    let (line, clock, departures) = Watched::new(&SegmentFile::parse(PLANT).unwrap());
    let calls = Rc::default();
    let program = Program { clock, calls: Rc::clone(&calls), number: 0 };
    let make = move |inventory: &Inventory| {
        let mut planned = inventory.planned(AlState::Op);
        for device in &mut planned {
            device.settings.access = ProcessAccess::Separate;
        }
        let task = TaskOptions { io_at, ..TaskOptions::new("task", CYCLE) };
        let options = PlanOptions { tasks: vec![task], ..PlanOptions::default() };
        Plan::build(&planned, inventory.tree().clone(), &options).map_err(|error| error.to_string())
    };
    drive(line, PlanSource::Found(Box::new(make)), program, None);
    let mut calls: Vec<Call> = calls.take();
    // The end sets outputs to zero.
    let end = calls.last().unwrap().begin;
    calls.drain(..calls.len() - LAST);
    let begin = calls[0].begin;
    let departures = departures.take();
    let meanwhile = departures.into_iter().filter(|one| one.at >= begin && one.at < end);
    (calls, meanwhile.collect())
}

fn drive(line: Watched, wanted: PlanSource, program: impl Application, lasts: Option<Span>) {
    let options = SessionOptions {
        on: "watched".to_owned(),
        leave: AlState::Init,
        lasts,
        real_time: None,
        allowed_misses: Some(2),
        hold: false,
        diagnose: None,
        group: None,
    };
    let (notes, _told) = sync_channel(1);
    let stop = Stop::default();
    let beside = RunControls::new(&stop, notes);
    let ended = run(line, wanted, program, &options, beside).unwrap();
    assert!(ended.error.is_none());
    let counts = ended.report.counts;
    assert_eq!((counts.cyclic_lost, counts.cycles_missed, counts.deadlines_missed), (0, 0, 0));
    assert!(ended.report.reached_ns.is_some());
}

/// When frames of a task for this purpose leave, where its project does not say.
fn usual_of(purpose: &str) -> IoAt {
    let text = format!("[[task]]\nname = \"task\"\ncycle_us = 1000\npurpose = \"{purpose}\"\n");
    let project = Project::parse(&text).expect("a project");
    project.tasks[0].options(&project.network).io_at
}

/// How long after the beginning of its cycle.
fn phase(at: Instant, begin: Instant) -> Span {
    Span::ns(at.since(begin).as_nanos() % CYCLE.as_nanos())
}

// S0 L312-323: at the begin of a task frames leave with its cycle, whatever the program takes, and carry
// what the call before has set.
// proves: SYN-13
#[test]
fn at_the_begin_of_a_task_frames_leave_in_the_beat_with_the_outputs_of_the_call_before() {
    let (calls, departures) = played(usual_of("motion"));
    let beat = departures[0].at;
    assert!(departures.len() >= LAST - 2, "{}", departures.len());
    for pair in departures.windows(2) {
        assert_eq!(pair[1].at.since(pair[0].at), CYCLE, "not one frame leaves off the beat");
    }
    for call in &calls[..LAST - 1] {
        assert!(!call.after, "there is no second program at the begin");
        let before = departures.iter().rev().find(|one| one.at < call.begin);
        let next = departures.iter().find(|one| one.at >= call.end).copied();
        // It runs when the frame is back, well within the cycle, and its outputs go with the next.
        if let Some(before) = before {
            assert!(call.begin.since(before.at) < Span::us(100), "{call:?} after {before:?}");
        }
        let Some(next) = next else { continue };
        assert_eq!(next.outputs, Some(call.outputs), "{call:?}, {next:?}");
        assert_eq!(phase(next.at, beat), Span::ZERO);
    }
}

// S0 L312-355: at the end of a task frames leave as soon as the program has returned, with what it has just
// set; a program that is marked so runs after they went out.
// proves: SYN-13
// proves: SYN-14
#[test]
fn at_the_end_of_a_task_frames_leave_when_the_program_returns_and_a_second_one_runs_after_them() {
    let (calls, departures) = played(usual_of("logic"));
    let programs: Vec<Call> = calls.iter().copied().filter(|call| !call.after).collect();
    let seconds: Vec<Call> = calls.iter().copied().filter(|call| call.after).collect();
    assert!(programs.len().abs_diff(seconds.len()) <= 1);
    for pair in programs.windows(2) {
        assert_eq!(pair[1].begin.since(pair[0].begin), CYCLE, "the program runs in the beat");
    }
    let mut delays = Vec::new();
    for call in &programs[..programs.len() - 1] {
        let frame = departures.iter().find(|one| one.at >= call.begin).unwrap();
        assert_eq!(frame.at, call.end, "it leaves when the program has returned: {call:?}");
        assert_eq!(frame.outputs, Some(call.outputs));
        delays.push(frame.at.since(call.begin));
        let second = seconds.iter().find(|one| one.begin >= call.begin).unwrap();
        assert!(second.begin > frame.at, "{second:?} after {frame:?}");
        assert!(second.begin.since(frame.at) < Span::us(100), "as soon as the frame is back");
        // It sees what the frame has brought; the first program of the next cycle sees the same.
        let next = programs.iter().find(|one| one.begin > call.begin).unwrap();
        assert_eq!(second.inputs, next.inputs);
    }
    // Frames jitter as the program does.
    assert!(
        delays.iter().max() > Some(&Span::us(650)) && delays.iter().min() < Some(&Span::us(150))
    );
}

/// How much earlier frames with inputs leave than those with outputs, in a project of the sources whose base
/// time and ticks are these.
fn ahead(folder: &FilePath, base_time_us: u32, pre_ticks: u32) -> Span {
    let path = format!("{}/tests/data/plan/separate-inputs.toml", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(path).unwrap();
    let text = text.replace("pre_ticks = 3", &format!("pre_ticks = {pre_ticks}"));
    let text = format!("[network]\nbase_time_us = {base_time_us}\n\n{text}").replacen(
        "name = \"separate-inputs\"",
        "",
        1,
    );
    let project = folder.join(format!("{base_time_us}-{pre_ticks}.toml"));
    fs::write(&project, format!("name = \"separate-inputs\"\n{text}")).unwrap();
    let segment = folder.join(format!("{base_time_us}-{pre_ticks}-segment.toml"));
    let made =
        linesman(["plan", project.to_str().unwrap(), "--segment", segment.to_str().unwrap()]);
    assert!(made.status <= 1, "{}", made.all());
    let text = fs::read_to_string(&segment).unwrap();
    let file = SegmentFile::parse_with(&text, &NamedFiles::of(&segment)).unwrap();
    let (line, _, departures) = Watched::new(&file);
    let plan = PlanFile::open(&project).unwrap().plan;
    let idle = linesman_runtime::run::Idle;
    drive(line, PlanSource::Plan(Box::new(plan)), idle, Some(Span::s(2)));
    let departures = departures.take();
    // The last half second of it.
    let end = departures.last().unwrap().at;
    let late = departures.iter().filter(|one| one.at + Span::ms(500) > end);
    let late: Vec<&Departure> = late.collect();
    let mut times = Vec::new();
    for outputs in late.iter().filter(|one| one.outputs.is_some()).skip(2) {
        assert!(!outputs.inputs, "outputs have a frame of their own");
        let before = late.iter().rev().find(|one| one.inputs && one.at <= outputs.at).unwrap();
        times.push(outputs.at.since(before.at));
    }
    assert!(times.len() > 30, "{}", times.len());
    assert!(times.iter().all(|time| *time == times[0]), "{times:?}");
    times[0]
}

// S0 L379-388: the fetch is a whole number of base ticks ahead; a smaller base time makes it finer.
// proves: SYN-16
#[test]
fn inputs_are_fetched_a_whole_number_of_base_ticks_ahead_of_the_task() {
    let folder = TempDir::new().unwrap();
    for (base_time_us, pre_ticks) in [(1_000, 3), (1_000, 1), (250, 3), (50, 7), (1_000, 0)] {
        let expected = Span::us(u64::from(base_time_us) * u64::from(pre_ticks));
        assert_eq!(ahead(folder.path(), base_time_us, pre_ticks), expected);
    }
}
