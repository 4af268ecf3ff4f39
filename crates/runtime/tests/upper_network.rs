//! Networks of one run, the second of which begins in the time and the phase of the first.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::sync::mpsc::sync_channel;
use std::thread;

use linesman_config::fault::FaultName;
use linesman_config::project::{ClockChoice, Project, TimeChoice};
use linesman_diagnosis::HostObservation;
use linesman_link::error::LinkError;
use linesman_maindevice::Options;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::command::Command;
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::report::RunReport;
use linesman_runtime::run::{
    Idle, NOTES, NetworkPlace, PlanSource, RunControls, SessionOptions, run, scan,
};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{FrameSink, Pace, SegmentTransport, TimeShare, Transport};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

const CYCLE: i64 = 1_000_000;
/// Silence of the upper network at first.
const SILENT_NS: u64 = 40_000_000_000;
const LASTS: Span = Span::s(75);

/// Times of a reference clock: when a cyclic frame left that hands its time round, and what its register showed then.
type SeenTimes = Vec<(u64, i64)>;

/// A line whose reference clock is looked at beside the MainDevice, as a probe at its pins would.
struct WatchedLine {
    line: SegmentTransport,
    seen: SeenTimes,
}

impl Transport for WatchedLine {
    type Error = LinkError;

    fn options(&self) -> Options {
        self.line.options()
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        self.line.receive(now, intake)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        // By the auto-increment address: those of the cycle.
        let hands_round = |one: Datagram<'_>| {
            one.command() == Some(Command::Armw) && one.ado() == SYSTEM_TIME.address
        };
        if FrameView::parse(frame).unwrap().datagrams().flatten().any(hands_round) {
            let now = self.line.now();
            let shown = self.line.segment().controller(DeviceId(0)).unwrap().system_time(now);
            self.seen.push((now.as_nanos(), shown as i64));
        }
        self.line.send(path, frame)
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        self.line.look_at_host(now, tell)
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        self.line.wait(deadline)
    }

    fn note_late(&mut self, late: Span) {
        self.line.note_late(late);
    }
}

/// A coupler that is so many ppm fast, and two terminals with SYNC0.
fn plant(ppm: f64, fault: Option<FaultEntry>) -> SegmentFile {
    let mut file = SegmentFile::in_a_row(
        "network",
        3,
        &[("K1", "EK1100"), ("O1", "EL4102"), ("I1", "EL3102")],
    );
    for (device, ppm) in file.devices.iter_mut().zip([ppm, 25.0, 10.0]) {
        device.clock_ppm = Some(ppm);
    }
    file.faults = fault.into_iter().collect();
    file
}

/// The project of a line that is whole.
fn scanned(file: &SegmentFile) -> Project {
    let segment = Segment::build(file).unwrap();
    let wiring = Wiring::of(&segment, &file.project().unwrap());
    let mut line = SegmentTransport::new(segment, wiring, false, Pace::Free).unwrap();
    let inventory = scan(&mut line, Span::s(10), &Stop::default()).unwrap();
    Project::from_inventory("network", &inventory)
}

/// Runs both networks, the first of which is silent at first: times that frames brought, and the reports.
fn both(below: Option<TimeChoice>) -> [(SeenTimes, RunReport); 2] {
    let silent = FaultEntry::new(FaultName::LinkOpen).at("maindevice-K1.A");
    let silent = silent.from_to(0.0, Some(SILENT_NS as f64 / 1e6));
    let files = [plant(-40.0, Some(silent)), plant(35.0, None)];
    let names = ["upper", "local"].map(str::to_owned);
    let (places, shares) = (NetworkPlace::of(&names), TimeShare::of(2));
    let threads: Vec<_> = files
        .into_iter()
        .zip(places)
        .zip(shares)
        .zip([None, below])
        .map(|(((file, place), share), time)| {
            thread::spawn(move || {
                let mut project = scanned(&SegmentFile { faults: Vec::new(), ..file.clone() });
                project.network.time_source = time;
                let choice = ClockChoice::default();
                let leads = ClockChoice { assign_activate: Some(0), reference: true, ..choice };
                let clocks = [leads, ClockChoice::default(), ClockChoice::default()];
                for (device, clock) in project.devices.iter_mut().zip(clocks) {
                    device.clock = Some(clock);
                }
                let plan = project.plan(&mut |_| Ok(None)).unwrap();
                let segment = Segment::build(&file).unwrap();
                let wiring = Wiring::of(&segment, &file.project().unwrap());
                let mut line = SegmentTransport::new(segment, wiring, false, Pace::Free).unwrap();
                line.share_time(share);
                let mut line = WatchedLine { line, seen: Vec::new() };
                let options = SessionOptions {
                    on: file.name.clone(),
                    leave: AlState::Init,
                    lasts: Some(LASTS),
                    real_time: None,
                    allowed_misses: None,
                    hold: false,
                    diagnose: None,
                    group: Some(place),
                };
                let (stop, (notes, _told)) = (Stop::default(), sync_channel(NOTES));
                let beside = RunControls::new(&stop, notes);
                let wanted = PlanSource::Plan(Box::new(plan));
                let ended = run(&mut line, wanted, Idle, &options, beside).unwrap();
                (line.seen, ended.report)
            })
        })
        .collect();
    let ended: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
    ended.try_into().unwrap()
}

/// Least and most distance of a local network from its upper one in the last 10 s, in ns, by what frames brought; and most
/// of its distance from a multiple of the cycle.
fn apart(upper: &[(u64, i64)], local: &[(u64, i64)]) -> (i64, i64, i64) {
    let from = LASTS.saturating_sub(Span::s(10)).as_nanos();
    let (mut least, mut most, mut phase) = (i64::MAX, i64::MIN, 0);
    let mut upper = upper.iter().peekable();
    let mut compared = 0;
    for (left_at, shown) in local.iter().filter(|(left_at, _)| *left_at >= from) {
        let mut before = None;
        while let Some(one) = upper.next_if(|(at, _)| at <= left_at) {
            before = Some(one);
        }
        let Some((at, time)) = before else { continue };
        // Within a cycle 40 ppm are 40 ns.
        let ahead = (shown - *left_at as i64) - (time - *at as i64);
        (least, most) = (least.min(ahead), most.max(ahead));
        let off = shown.rem_euclid(CYCLE);
        phase = phase.max(off.min(CYCLE - off));
        compared += 1;
    }
    assert!(compared > 5_000, "{compared} frames were compared");
    (least, most, phase)
}

/// Distance of the local network from the upper one with its first frame from this time on, in ns.
fn ahead_at(upper: &[(u64, i64)], local: &[(u64, i64)], from: u64) -> i64 {
    let (left_at, shown) = local.iter().find(|(at, _)| *at >= from).unwrap();
    let (at, time) = upper.iter().rfind(|(at, _)| at <= left_at).unwrap();
    (shown - *left_at as i64) - (time - *at as i64)
}

// S0 L909-943: the local network is in the time of the upper one, and its cycle in its phase. The upper one is there long after
// the local one.
// proves: DC-18
#[test]
fn local_network_of_a_run_begins_in_the_time_and_the_phase_of_the_upper_one() {
    let [(upper, _), (local, report)] = both(Some(TimeChoice::UpperNetwork));
    let begun = local.first().unwrap().0;
    assert!(begun > SILENT_NS && begun < SILENT_NS + 5_000_000_000, "begun at {begun} ns");
    assert!(report.settled, "all SubDevices of the local network are in OP");
    let (least, most, phase) = apart(&upper, &local);
    assert!(least > -500 && most < 500, "{least} to {most} ns ahead of the upper network");
    assert!(phase < 5_000, "{phase} ns off a multiple of the cycle");
    // From its first second on, not only at the end.
    let ahead = ahead_at(&upper, &local, begun + 1_000_000_000);
    assert!(ahead.abs() < 5_000, "{ahead} ns after one second");
    assert_eq!(report.group.unwrap().lead.as_deref(), Some("upper"));
}

#[test]
fn local_network_that_does_not_wait_begins_in_a_time_of_its_own() {
    let [(upper, _), (local, _)] = both(None);
    assert!(local.first().unwrap().0 < 5_000_000_000);
    let of_upper = upper.iter().find(|(at, _)| *at > SILENT_NS + 2_000_000_000).unwrap();
    let ahead = ahead_at(&upper, &local, of_upper.0);
    // One that waits is within 5 us then.
    assert!(ahead.abs() > 10_000, "{ahead} ns when the time of the upper network was known");
}
