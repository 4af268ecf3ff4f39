//! Process data against frames made by hand: two SubDevices, one byte each way.

use linesman_config::identity::RevisionRule;
use linesman_config::plan::{DeviceSettings, OnWrongCounter, PlanOptions, PlannedDevice};
use linesman_config::profile::{DeviceProfile, ProcessSyncManager};
use linesman_proto::address::{DeviceId, Path, RegisterAddress, StationAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::{MacAddress, SOURCE_MARK};
use linesman_proto::port::Port;
use linesman_proto::register::SmControl;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::{SeenController, derive};

use super::*;
use crate::event::Event;
use crate::exchange::Received;
use crate::statistics::Statistics;
use crate::supervisor::Reachability;

fn device() -> PlannedDevice {
    let manager = |index, direction, start| ProcessSyncManager {
        index,
        direction,
        start: RegisterAddress(start),
        len: 1,
        control: SmControl::OUTPUTS,
        is_virtual: false,
        bits: 0,
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
    device_table: Arc<Mutex<DeviceTable>>,
    exchange: Exchange,
    statistics: Statistics,
    events: Vec<Event>,
    now: Instant,
    /// What comes back is taken as what comes otherwise than nearly always.
    long_way: bool,
}

impl Fixture {
    fn new() -> Self {
        Self::of(&[device(), device()], None)
    }

    fn of(devices: &[PlannedDevice; 2], allowed: Option<u32>) -> Self {
        Self::with(devices, allowed, |_| {})
    }

    fn with(
        devices: &[PlannedDevice; 2],
        allowed: Option<u32>,
        change: impl FnOnce(&mut Plan),
    ) -> Self {
        let seen =
            [SeenController::open_at(&[Port::A, Port::B]), SeenController::open_at(&[Port::A])];
        let tree = derive(&seen).unwrap();
        let mut plan = Plan::build(devices, tree, &PlanOptions::default()).unwrap();
        change(&mut plan);
        let plan = Arc::new(plan);
        let device_table = Arc::new(Mutex::new(DeviceTable::new(&plan)));
        let sources = [MacAddress([0, 0, 0, 0, 0, 1]), MacAddress([0, 0, 0, 0, 0, 2])];
        let mut exchange = Exchange::new(sources, false, Span::ms(10));
        let cyclic =
            Cyclic::new(plan, Arc::clone(&device_table), &mut exchange, allowed, Instant::ZERO);
        Self {
            cyclic,
            device_table,
            exchange,
            statistics: Statistics::default(),
            events: Vec::new(),
            now: Instant::ZERO,
            long_way: false,
        }
    }

    fn reach(&mut self, id: u32) {
        let mut device_table = lock(&self.device_table);
        device_table.set_found(DeviceId(id), Reachability::There { restarted: false });
        device_table.set_reached(DeviceId(id), AlState::Op);
    }

    /// One cycle: the frame as it is sent, and what comes back with these inputs and this counter.
    fn cycle(&mut self, inputs: [u8; 2], wkc: u8) -> Vec<u8> {
        let sent = self.send();
        self.answer(&sent, inputs, wkc);
        sent
    }

    /// A frame comes back.
    fn answer(&mut self, sent: &[u8], inputs: [u8; 2], wkc: u8) {
        let mut back = sent.to_vec();
        back[6] |= SOURCE_MARK;
        // Two outputs from byte 26 on, two inputs behind them, then the counter.
        back[28..30].copy_from_slice(&inputs);
        back[30] = wkc;
        let (events, statistics) = (&mut self.events, &mut self.statistics);
        let emit = &mut |event| events.push(event);
        if !self.long_way {
            let exchange = &mut self.exchange;
            assert!(self.cyclic.receive(self.now, &back, exchange, statistics, emit));
            return;
        }
        let Received::Complete(slot) = self.exchange.receive(self.now, Path::A, &back) else {
            panic!()
        };
        let withheld = self.exchange.slot(slot).withheld;
        self.cyclic.received(self.now, 0, withheld, &back, statistics, emit);
    }

    /// A cycle begins; the frame as it is sent.
    fn send(&mut self) -> Vec<u8> {
        assert!(self.cyclic.due() <= self.now);
        let sent = self.send_one().unwrap();
        assert_eq!(self.send_one(), None, "one frame a cycle");
        self.now += Span::ms(1);
        sent
    }

    /// A frame that is due, as it is sent.
    fn send_one(&mut self) -> Option<Vec<u8>> {
        self.cyclic.refresh();
        if !self.cyclic.is_due(self.now) {
            return None;
        }
        let events = &mut self.events;
        let emit = &mut |event| events.push(event);
        let statistics = &mut self.statistics;
        let mut buffer = vec![0; 1514];
        let exchange = &mut self.exchange;
        let len = self.cyclic.send_next(self.now, exchange, statistics, emit, &mut buffer)?;
        Some(buffer[..len].to_vec())
    }

    /// The frame that is out does not come back.
    fn lose(&mut self) {
        let slot = self.exchange.expire(self.now + Span::ms(1)).unwrap();
        assert_eq!(self.exchange.slot(slot).state, crate::exchange::SlotState::GivenUp);
        let events = &mut self.events;
        self.cyclic.lost(0, &mut |event| events.push(event));
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
    lock(&fixture.device_table).set_found(DeviceId(1), Reachability::There { restarted: true });
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
    assert_eq!(fixture.cyclic.due(), Instant::ZERO + Span::ms(1));
    fixture.now = Instant::ZERO + Span::us(4_300);
    fixture.cycle([0, 0], 0);
    assert_eq!(fixture.statistics.cycles_missed, 3);
    assert_eq!(fixture.cyclic.due(), Instant::ZERO + Span::ms(5));
}

// proves: FRM-18 partial: per SubDevice
#[test]
fn inputs_are_cleared_where_that_was_chosen() {
    let mut clearing = device();
    clearing.settings.on_wrong_counter = OnWrongCounter::Clear;
    let mut fixture = Fixture::of(&[device(), clearing], None);
    fixture.reach(0);
    fixture.reach(1);
    fixture.cycle([1, 2], 6);
    fixture.cycle([7, 8], 3);
    assert_eq!(fixture.cyclic.inputs, [1, 0], "a wrong counter");
    fixture.cycle([3, 4], 6);
    assert_eq!(fixture.cyclic.inputs, [3, 4]);
    fixture.send();
    fixture.lose();
    assert_eq!(fixture.cyclic.inputs, [3, 0], "a lost frame");
    fixture.cycle([5, 6], 6);
    lock(&fixture.device_table).set_found(DeviceId(1), Reachability::Lost);
    fixture.cycle([7, 8], 3);
    assert_eq!(fixture.cyclic.inputs, [7, 0], "known to be gone");
}

#[test]
fn data_tell_how_old_they_are() {
    let mut fixture = Fixture::new();
    let quality = |fixture: &Fixture, id| {
        let Quality { valid, updated_at } = fixture.cyclic.quality(DeviceId(id));
        (valid, updated_at.map(|at| at.as_nanos() / 1_000_000))
    };
    assert_eq!(quality(&fixture, 0), (false, None));
    fixture.reach(0);
    fixture.reach(1);
    assert_eq!(quality(&fixture, 0), (false, None), "nothing has come yet");
    fixture.cycle([1, 2], 6);
    assert_eq!([quality(&fixture, 0), quality(&fixture, 1)], [(true, Some(1)); 2]);
    fixture.cycle([1, 2], 5);
    assert_eq!([quality(&fixture, 0), quality(&fixture, 1)], [(false, Some(1)); 2]);
    lock(&fixture.device_table).set_found(DeviceId(1), Reachability::Lost);
    fixture.cycle([1, 2], 3);
    assert_eq!(quality(&fixture, 0), (true, Some(3)));
    assert_eq!(quality(&fixture, 1), (false, Some(1)), "as old as when it was seen last");
    fixture.reach(1);
    assert_eq!(quality(&fixture, 1), (false, Some(1)), "back, but not heard yet");
    fixture.cycle([1, 2], 6);
    assert_eq!(quality(&fixture, 1), (true, Some(4)));
    fixture.send();
    fixture.lose();
    assert_eq!(quality(&fixture, 1), (false, Some(4)));
}

// proves: PLC-02
#[test]
fn each_of_fifteen_datagrams_has_a_bit_and_the_whole_frame_the_last() {
    let bits: Vec<u16> = (0..15).map(FrameStatus::bit).collect();
    assert_eq!((bits[0], bits[14]), (0x0001, 0x4000));
    assert_eq!(bits.iter().fold(0, |all, bit| all ^ bit), 0x7FFF);
    assert_eq!((FrameStatus::WHOLE, FrameStatus::bit(15)), (0x8000, 0));
}

// proves: PLC-02 partial: of one datagram
#[test]
fn each_frame_tells_how_it_went() {
    let mut fixture = Fixture::new();
    fixture.reach(0);
    fixture.reach(1);
    let status = |fixture: &Fixture| fixture.cyclic.frame_status(0, 0).unwrap();
    fixture.cycle([1, 2], 6);
    let good = status(&fixture);
    assert_eq!((good.wrong_counter, good.not_sent), (0, 0));
    fixture.cycle([1, 2], 3);
    assert_eq!(status(&fixture).wrong_counter, 0x0001);
    assert_eq!(status(&fixture).input_toggle & 1, good.input_toggle & 1, "nothing new");
    fixture.cycle([1, 2], 6);
    assert_ne!(status(&fixture).input_toggle & 1, good.input_toggle & 1);
    fixture.send();
    fixture.lose();
    assert_eq!(status(&fixture).wrong_counter, FrameStatus::WHOLE);
}

#[test]
fn a_cycle_is_exchanged_when_its_last_frame_is_back() {
    let mut fixture = Fixture::with(&[device(), device()], None, |plan| {
        let frame = plan.tasks[0].frames[0].clone();
        plan.tasks[0].frames.push(frame);
    });
    // The answer to the first one may be there before the second one leaves.
    for last in [false, true] {
        let sent = fixture.send_one().unwrap();
        let mut back = sent.clone();
        back[6] |= SOURCE_MARK;
        let (now, statistics) = (fixture.now, &mut fixture.statistics);
        let exchange = &mut fixture.exchange;
        assert_eq!(exchange.awaited(&back).map(|one| one.frame), Some(u32::from(last)));
        assert!(fixture.cyclic.receive(now, &back, exchange, statistics, &mut |_| {}));
        assert_eq!(fixture.cyclic.take_exchanged(0), last);
    }
    assert_eq!(fixture.send_one(), None);
}

#[test]
fn a_frame_for_which_all_slots_are_taken_is_left_out_and_counted() {
    let mut fixture = Fixture::new();
    for _ in 0..256 {
        fixture.send();
    }
    assert_eq!((fixture.send_one(), fixture.statistics.cyclic_unsent), (None, 1));
    assert_eq!(fixture.cyclic.frame_status(0, 0).unwrap().not_sent, FrameStatus::WHOLE);
    assert!(fixture.cyclic.due() > fixture.now, "it is not tried again in this cycle");
    fixture.now += Span::ms(1);
    fixture.lose();
    fixture.send();
    assert_eq!(fixture.statistics.cyclic_unsent, 1);
    assert_eq!(fixture.cyclic.frame_status(0, 0).unwrap().not_sent, 0);
}

#[test]
fn outputs_of_a_late_application_are_not_sent_again_and_inputs_go_on() {
    let mut fixture = Fixture::of(&[device(), device()], Some(1));
    fixture.reach(0);
    fixture.reach(1);
    assert_eq!(fixture.cycle([0, 0], 6)[16], Command::Lrw.code(), "it has not begun yet");
    fixture.cyclic.outputs.copy_from_slice(&[0x11, 0x22]);
    fixture.cyclic.give_outputs(None);
    for _ in 0..2 {
        assert_eq!(fixture.cycle([1, 2], 6)[26..28], [0x11, 0x22], "one miss is allowed");
    }
    let late = fixture.cycle([3, 4], 2);
    assert_eq!((late[16], &late[26..30]), (Command::Lrd.code(), &[0; 4][..]));
    assert_eq!(fixture.cyclic.inputs, [3, 4]);
    assert_eq!(fixture.cyclic.frame_status(0, 0).unwrap().not_sent, 0x0001);
    assert_eq!(fixture.statistics.working_counter_errors, 0);
    let Statistics { deadlines_missed, cycles_withheld, .. } = fixture.statistics;
    assert_eq!((deadlines_missed, cycles_withheld), (2, 1));
    fixture.cyclic.give_outputs(Some(0));
    let back = fixture.cycle([5, 6], 6);
    assert_eq!((back[16], &back[26..28]), (Command::Lrw.code(), &[0x11, 0x22][..]));
    let told = |event: &Event| {
        matches!(event, Event::OutputsWithheld { .. } | Event::OutputsResumed { .. })
    };
    assert_eq!(fixture.events.iter().filter(|event| told(event)).count(), 2);
}

#[test]
fn the_short_way_does_what_the_long_way_does() {
    let all = |long_way: bool| {
        let mut fixture = Fixture::of(&[device(), device()], Some(1));
        fixture.long_way = long_way;
        fixture.reach(0);
        fixture.reach(1);
        let mut seen = Vec::new();
        for cycle in 0..40_u8 {
            if cycle % 7 < 5 {
                fixture.cyclic.outputs.copy_from_slice(&[cycle, !cycle]);
                fixture.cyclic.give_outputs(None);
            }
            match cycle {
                20 => {
                    lock(&fixture.device_table).set_found(DeviceId(1), Reachability::Lost);
                }
                30 => {
                    fixture.reach(1);
                }
                _ => {}
            }
            if matches!(cycle, 10..14) {
                fixture.send();
                fixture.lose();
            } else {
                let sent = fixture.send();
                let (each, wrong) =
                    (if sent[16] == Command::Lrw.code() { 3 } else { 1 }, cycle % 9 == 8);
                let wkc = if matches!(cycle, 20..30) { each } else { 2 * each } + u8::from(wrong);
                fixture.answer(&sent, [cycle, cycle + 1], wkc);
            }
            let quality = [0, 1].map(|id| fixture.cyclic.quality(DeviceId(id)));
            let status = fixture.cyclic.frame_status(0, 0).unwrap();
            let exchanged = fixture.cyclic.take_exchanged(0);
            let inputs = fixture.cyclic.inputs.clone();
            seen.push(format!("{quality:?} {status:?} {exchanged} {inputs:?}"));
        }
        (seen, fixture.statistics, format!("{:?}", fixture.events))
    };
    let (short, long) = (all(false), all(true));
    assert_eq!(short, long);
    assert!(short.1.working_counter_errors > 0 && short.1.cycles_withheld > 0);
}
