//! Process data against frames made by hand: two SubDevices, one byte each way.

use linesman_config::identity::RevisionRule;
use linesman_config::plan::{DeviceSettings, PlanOptions, PlannedDevice};
use linesman_config::profile::{DeviceProfile, ProcessSyncManager};
use linesman_proto::address::{DeviceId, Path, RegisterAddress, StationAddress};
use linesman_proto::ethernet::{MacAddress, SOURCE_MARK};
use linesman_proto::port::Port;
use linesman_proto::register::SmControl;
use linesman_proto::time::Span;
use linesman_proto::topology::{SeenController, derive};

use super::*;
use crate::exchange::Received;
use crate::supervisor::Found;

fn device() -> PlannedDevice {
    let manager = |index, direction, start| ProcessSyncManager {
        index,
        direction,
        start: RegisterAddress(start),
        len: 1,
        control: SmControl::OUTPUTS,
        is_virtual: false,
    };
    PlannedDevice {
        name: "both ways".to_owned(),
        station: StationAddress(0x1001),
        identity: linesman_proto::sii::Identity::default(),
        revision_rule: RevisionRule::Any,
        profile: DeviceProfile {
            process: vec![
                manager(0, Direction::Outputs, 0x0F00),
                manager(1, Direction::Inputs, 0x1000),
            ],
            ..DeviceProfile::default()
        },
        target: AlState::Op,
        start_up: Vec::new(),
        settings: DeviceSettings::default(),
    }
}

struct Fixture {
    cyclic: Cyclic,
    line: Arc<Mutex<Line>>,
    exchange: Exchange,
    statistics: Statistics,
    events: Vec<Event>,
    now: Instant,
}

impl Fixture {
    fn new() -> Self {
        let seen =
            [SeenController::open_at(&[Port::A, Port::B]), SeenController::open_at(&[Port::A])];
        let tree = derive(&seen).unwrap();
        let plan = Plan::build(&[device(), device()], tree, &PlanOptions::default()).unwrap();
        let plan = Arc::new(plan);
        let line = Arc::new(Mutex::new(Line::new(&plan)));
        let sources = [MacAddress([0, 0, 0, 0, 0, 1]), MacAddress([0, 0, 0, 0, 0, 2])];
        Self {
            cyclic: Cyclic::new(plan, Arc::clone(&line), Instant::ZERO),
            line,
            exchange: Exchange::new(sources, false, Span::ms(10)),
            statistics: Statistics::default(),
            events: Vec::new(),
            now: Instant::ZERO,
        }
    }

    fn reach(&mut self, id: u32) {
        let mut line = lock(&self.line);
        line.set_found(DeviceId(id), Found::There { restarted: false });
        line.set_reached(DeviceId(id), AlState::Op);
    }

    /// One cycle: the frame as it is sent, and what comes back with these inputs and this counter.
    fn cycle(&mut self, inputs: [u8; 2], wkc: u8) -> Vec<u8> {
        self.cyclic.refresh();
        assert!(self.cyclic.send_due(self.now, &mut self.exchange, &mut self.statistics));
        self.now += Span::ms(1);
        let mut buffer = vec![0; 1514];
        let (transmit, _) = self.exchange.poll_transmit(self.now, &mut buffer).unwrap();
        let sent = buffer[..transmit.len].to_vec();
        let mut back = sent.clone();
        back[6] |= SOURCE_MARK;
        // Two outputs from byte 26 on, two inputs behind them, then the counter.
        back[28..30].copy_from_slice(&inputs);
        back[30] = wkc;
        let Received::Complete(slot) = self.exchange.receive(Path::A, &back) else { panic!() };
        let (reply, events) = (&self.exchange.slot(slot).reply, &mut self.events);
        self.cyclic.received(0, 0, reply, &mut self.statistics, &mut |event| events.push(event));
        sent
    }
}

#[test]
fn outputs_go_out_and_what_is_read_is_sent_as_zero() {
    let mut fixture = Fixture::new();
    fixture.cyclic.outputs.copy_from_slice(&[0x11, 0x22]);
    fixture.cyclic.inputs.copy_from_slice(&[0x33, 0x44]);
    let sent = fixture.cycle([0, 0], 0);
    assert_eq!(sent[16], Command::Lrw.code());
    assert_eq!(sent[26..30], [0x11, 0x22, 0, 0]);
}

// proves: FRM-17
#[test]
fn inputs_are_taken_over_only_when_the_counter_fits() {
    let mut fixture = Fixture::new();
    fixture.reach(0);
    fixture.reach(1);
    fixture.cycle([1, 2], 6);
    assert_eq!(fixture.cyclic.inputs, [1, 2]);
    for _ in 0..5 {
        fixture.cycle([7, 8], 3);
    }
    assert_eq!(fixture.cyclic.inputs, [1, 2]);
    assert_eq!(fixture.statistics.working_counter_errors, 5);
    let [Event::WorkingCounter { expected, received, .. }] = fixture.events[..] else {
        panic!("told once: {:?}", fixture.events)
    };
    assert_eq!((expected, received), (WorkingCounter(6), WorkingCounter(3)));
    fixture.cycle([3, 4], 6);
    assert_eq!(fixture.cyclic.inputs, [3, 4]);
    assert!(matches!(fixture.events[1..], [Event::WorkingCounterGood { .. }]));
}

#[test]
fn more_than_there_are_is_no_better_than_less() {
    let mut fixture = Fixture::new();
    fixture.reach(0);
    fixture.reach(1);
    fixture.cycle([1, 2], 9);
    assert_eq!(fixture.cyclic.inputs, [0, 0]);
    assert_eq!(fixture.statistics.working_counter_errors, 1);
}

#[test]
fn inputs_of_one_flow_while_the_other_is_on_its_way() {
    let mut fixture = Fixture::new();
    fixture.reach(0);
    lock(&fixture.line).set_found(DeviceId(1), Found::There { restarted: true });
    for wkc in [3, 5, 6] {
        fixture.cycle([wkc, 0x55], wkc);
        assert_eq!(fixture.cyclic.inputs, [wkc, 0], "working counter {wkc}");
    }
    fixture.cycle([0x77, 0], 2);
    assert_eq!(fixture.cyclic.inputs, [6, 0]);
    assert_eq!(fixture.statistics.working_counter_errors, 1);
}

#[test]
fn cycles_slept_through_are_left_out_on_the_grid() {
    let mut fixture = Fixture::new();
    fixture.cycle([0, 0], 0);
    assert_eq!(fixture.cyclic.poll_timeout(), Some(Instant::ZERO + Span::ms(1)));
    fixture.now = Instant::ZERO + Span::us(4_300);
    fixture.cycle([0, 0], 0);
    assert_eq!(fixture.statistics.cycles_missed, 3);
    assert_eq!(fixture.cyclic.poll_timeout(), Some(Instant::ZERO + Span::ms(5)));
}
