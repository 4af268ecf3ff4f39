//! Two sessions in one process drive two networks, in turns, by nothing but frames, times and events.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use linesman_config::fault::FaultName;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_diagnosis::{Engine, InputKind, Setup};
use linesman_maindevice::{MainDevice, Options};
use linesman_proto::address::Network;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_session::segment_line::SegmentLine;
use linesman_session::{Idle, MakePlan, PlanRun, PlanSource, RunEvent, Session};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

struct Machine {
    line: SegmentLine,
    session: Session<PlanRun<Idle, Engine>>,
    codes: Vec<String>,
}

impl Machine {
    fn new(name: &str, devices: &[(&str, &str)]) -> Self {
        let segment = Segment::build(&SegmentFile::in_a_row(name, 1, devices)).unwrap();
        let line = SegmentLine::new(segment, false);
        let main = MainDevice::new(Network::default(), line.options(Options::default()));
        let setup = Setup {
            input: InputKind::Driven,
            host_counters: true,
            probes: true,
            ..Setup::default()
        };
        let make: MakePlan = Box::new(|inventory| {
            let planned = inventory.planned(AlState::Op);
            Plan::build(&planned, inventory.tree().clone(), &PlanOptions::default())
                .map_err(|error| error.to_string())
        });
        let run = PlanRun::new(Some(PlanSource::Found(make)), Idle, Engine::new(setup), false);
        Self { line, session: Session::new(main, run), codes: Vec::new() }
    }

    fn due(&self) -> Instant {
        let session = self.session.poll_timeout();
        session.map_or(self.line.poll_timeout(), |at| at.min(self.line.poll_timeout()))
    }

    /// Does what is due at this time.
    fn step(&mut self, now: Instant) {
        let Self { line, session, codes } = self;
        line.advance(now);
        line.receive(&mut session.intake(now));
        line.look_at_host(true, &mut |observation| session.handle_host(observation));
        session.handle_timeout(now);
        while session.poll_transmit(now, |path, frame| line.send(path, frame)).is_some() {}
        while let Some(event) = session.hooks_mut().poll_event() {
            if let RunEvent::Finding(event) = event {
                codes.push(event.finding.code);
            }
        }
    }

    fn devices(&self) -> usize {
        self.session.hooks().plan().map_or(0, |plan| plan.devices.len())
    }
}

/// Lets each network do what is due, whichever is first, until this time.
fn run(machines: &mut [Machine; 2], until: Instant) {
    loop {
        let next = machines.iter_mut().min_by_key(|machine| machine.due()).unwrap();
        let due = next.due();
        if due > until {
            return;
        }
        next.step(due);
    }
}

#[test]
fn a_fault_of_one_network_is_found_there_and_the_other_runs_on() {
    let press = Machine::new("press", &[("K1", "EK1100"), ("I1", "EL1008"), ("O1", "EL2008")]);
    let saw = Machine::new("saw", &[("K1", "EK1100"), ("O1", "EL2008")]);
    let mut machines = [press, saw];
    // The first turn is nobody's by time: a session begins when it is called.
    machines.iter_mut().for_each(|machine| machine.step(Instant::ZERO));
    let broken = Instant::ZERO + Span::s(1);
    run(&mut machines, broken);
    for (machine, devices) in machines.iter().zip([3, 2]) {
        assert_eq!(machine.devices(), devices);
        assert!(machine.session.hooks().reached_at().is_some(), "all in OP");
        assert_eq!(machine.codes, Vec::<String>::new());
    }
    let open = FaultEntry::new(FaultName::LinkOpen).at("I1.B-O1.A");
    machines[0].line.segment_mut().inject(broken, &open).unwrap();
    run(&mut machines, broken + Span::s(2));
    let [press, saw] = &machines;
    assert!(press.codes.contains(&"H101".to_owned()), "{:?}", press.codes);
    assert_eq!(saw.codes, Vec::<String>::new());
    let statistics = saw.session.main().statistics();
    assert_eq!(statistics.working_counter_errors, 0);
    assert!(statistics.cycles > 1_000, "{}", statistics.cycles);
}
