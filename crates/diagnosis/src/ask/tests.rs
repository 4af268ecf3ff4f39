//! Questions beside a MainDevice of a cycle of 2 ms and three SubDevices, all made by hand.

pub(crate) mod frame;

use linesman_proto::address::Network;
use linesman_proto::command::Command;
use linesman_proto::ethernet::{ASKING_SOURCE, MacAddress, Wrapping, locate};
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};

use self::frame::{Frame, Made, lrw};
use super::*;
use crate::coverage::InputKind;
use crate::observe::{Direction, FrameSeen};
use crate::{Engine, Setup};

const SOEM: MacAddress = MacAddress([1; 6]);
const ETHERCRAB: MacAddress = MacAddress([0x10; 6]);
const CYCLE: Span = Span::ms(2);
const TRIP: Span = Span::us(100);
const WKC: u16 = 4;

/// A SubDevice: its station address, its registers up to 0x03FF.
struct Stub {
    station: u16,
    registers: Vec<u8>,
    takes_udp: bool,
}

/// The computer of the MainDevice, with the line behind its card.
struct Bench {
    now: Instant,
    source: MacAddress,
    engine: Engine,
    asker: Asker,
    devices: Vec<Stub>,
    wkc: u16,
    cycle: Span,
    /// Whether the next frame of the MainDevice gets lost.
    loses: Box<dyn FnMut(u64, bool) -> bool>,
    cycles: u64,
    questions: Vec<(Instant, Vec<u8>)>,
    news: Vec<News>,
    direction: [Direction; 2],
}

impl Bench {
    fn new(source: MacAddress) -> Self {
        let setup = AskSetup { per_s: 20, is_forced: false, keeps_on: false };
        let devices = (0..3).map(|position| {
            let mut registers = vec![0; 0x400];
            let station: u16 = 0x1001 + position;
            registers[0x0010..0x0012].copy_from_slice(&station.to_le_bytes());
            registers[0x0130] = 8;
            Stub { station, registers, takes_udp: true }
        });
        Self {
            now: Instant::ZERO,
            source,
            engine: Engine::new(Setup {
                input: InputKind::Listened,
                probes: true,
                ..Setup::default()
            }),
            asker: Asker::new(setup),
            devices: devices.collect(),
            wkc: WKC,
            cycle: CYCLE,
            loses: Box::new(|_, _| false),
            cycles: 0,
            questions: Vec::new(),
            news: Vec::new(),
            direction: [Direction::Sent, Direction::Received],
        }
    }

    fn with(source: MacAddress, setup: AskSetup) -> Self {
        Self { asker: Asker::new(setup), ..Self::new(source) }
    }

    /// Cycles of the MainDevice, with whatever is asked between them.
    fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            let begin = self.now;
            let mut made: Vec<Made<'_>> = vec![lrw(0, &[0; 4])];
            if self.cycles.is_multiple_of(25) {
                made.push((Command::Brd, 0, 0x0130, &[0; 2], 0));
            }
            self.exchange(&made);
            self.cycles += 1;
            let end = begin + self.cycle;
            while self.now < end {
                self.poll();
                self.now += Span::us(50);
            }
            self.now = end;
        }
    }

    /// A frame of the MainDevice, and what comes back.
    fn exchange(&mut self, made: &[Made<'_>]) {
        // SOEM alone has so few indexes.
        let indexes = if self.source == SOEM { 16 } else { 256 };
        let frame = Frame::from(self.source, (self.cycles % indexes) as u8, made);
        self.show(&frame.0, self.direction[0]);
        let was_asked = self.questions.last().is_some_and(|(at, _)| self.now.since(*at) < CYCLE);
        let is_lost = (self.loses)(self.cycles, was_asked);
        self.now += TRIP;
        if !is_lost {
            let back = self.answered(frame.0);
            self.show(&back, self.direction[1]);
        }
    }

    fn poll(&mut self) {
        let mut buffer = [0; 256];
        let model = self.engine.model(Network(0)).unwrap();
        let len = self.asker.poll_transmit(self.now, model, &mut buffer);
        let next = self.asker.poll_timeout();
        assert!(
            next.is_none_or(|next| next > self.now),
            "it would be looked at without end: {next:?}"
        );
        self.news.extend(self.asker.poll_news());
        let Some(len) = len else { return };
        let bytes = buffer[..len].to_vec();
        self.questions.push((self.now, bytes.clone()));
        self.show(&bytes, Direction::Sent);
        self.now += TRIP;
        let back = self.answered(bytes);
        self.show(&back, Direction::Received);
    }

    fn show(&mut self, bytes: &[u8], direction: Direction) {
        let seen = FrameSeen {
            network: Network(0),
            path: None,
            direction,
            time: self.now,
            number: self.now.as_nanos() / 1_000,
            fcs: None,
            truncated: false,
            probe: None,
            bytes,
        };
        self.engine.handle_frame(&seen);
        self.asker.handle_frame(&seen);
    }

    /// The frame as the line gives it back.
    fn answered(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        let is_udp = locate(&bytes).is_some_and(|(wrapping, _)| wrapping == Wrapping::Udp);
        bytes[6] |= 0x02;
        let found: Vec<(usize, u8, u16, u16, usize)> = FrameView::parse(&bytes)
            .unwrap()
            .datagrams()
            .map(Result::unwrap)
            .map(|one| (one.data_range().start, one.code(), one.adp(), one.ado().0, one.data_len()))
            .collect();
        for (at, code, adp, ado, len) in found {
            let (mut wkc, mut adp) = (0, adp);
            for device in self.devices.iter().filter(|device| device.takes_udp || !is_udp) {
                let is_meant = match code {
                    1 => adp == 0,
                    4 => adp == device.station,
                    7 => true,
                    _ => false,
                };
                if is_meant {
                    wkc += 1;
                    let from = usize::from(ado);
                    for (byte, register) in
                        bytes[at..at + len].iter_mut().zip(&device.registers[from..])
                    {
                        *byte |= register;
                    }
                }
                adp = adp.wrapping_add(u16::from(matches!(code, 1 | 7)));
            }
            let wkc = if code == 12 { self.wkc } else { wkc };
            if code != 12 {
                bytes[at - 8..at - 6].copy_from_slice(&adp.to_le_bytes());
            }
            bytes[at + len..at + len + 2].copy_from_slice(&wkc.to_le_bytes());
        }
        bytes
    }

    fn state(&self) -> AskingState {
        self.asker.report(self.now).state
    }

    fn reason(&self) -> String {
        self.asker.report(self.now).reason.unwrap_or_default()
    }
}

/// Cycles in so many seconds.
const fn seconds(seconds: u64) -> u64 {
    seconds * 500
}

#[test]
fn subdevices_are_asked_in_udp_once_the_main_device_is_known() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(2) - 10);
    assert_eq!((bench.questions.len(), bench.state()), (0, AskingState::Learning));
    bench.run(seconds(3));
    assert_eq!(bench.news, [News::Begun(Carrier::Udp)]);
    let report = bench.asker.report(bench.now);
    assert_eq!((report.state, report.devices.0), (AskingState::Asking, 3), "{report:?}");
    assert!((58..=62).contains(&report.questions.0), "20 a second: {report:?}");
    assert_eq!(report.questions, report.answered);
    for (_, bytes) in &bench.questions {
        assert_eq!(locate(bytes).unwrap().0, Wrapping::Udp);
        let view = FrameView::parse(bytes).unwrap();
        assert_eq!(view.source(), ASKING_SOURCE);
        assert!(!ASKING_SOURCE.is_marked(), "else its return could not be told from it");
        for datagram in view.datagrams().map(Result::unwrap) {
            let effect = datagram.command().unwrap().effect();
            assert!(effect.reads && !effect.writes, "{datagram:?}");
        }
    }
}

#[test]
fn questions_leave_in_gaps_at_the_rate_that_was_wished() {
    let setup = AskSetup { per_s: 100, is_forced: false, keeps_on: false };
    let mut bench = Bench::with(SOEM, setup);
    bench.run(seconds(4));
    let times: Vec<Instant> = bench.questions.iter().map(|(at, _)| *at).collect();
    assert!(times.len() > 150, "{}", times.len());
    assert!(times.windows(2).all(|two| two[1].since(two[0]) >= Span::ms(10)));
    for at in times {
        let phase = at.as_nanos() % CYCLE.as_nanos();
        assert!((100_000..=1_900_000).contains(&phase), "{phase}");
    }
}

#[test]
fn answers_are_evidence_and_questions_are_no_frames_of_the_main_device() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    bench.devices[1].registers[0x0300..0x0302].copy_from_slice(&[5, 7]);
    bench.run(seconds(2));
    bench.engine.note_asking(bench.asker.report(bench.now));
    bench.engine.finish(bench.now, true);
    let model = bench.engine.model(Network(0)).unwrap();
    assert_eq!(model.traffic.recording.frames(), 2 * bench.cycles, "its own frames, out and back");
    assert_eq!(model.traffic.requests.senders().len(), 1, "no second MainDevice");
    assert!(model.devices.iter().all(|device| device.dl.first.is_some()));
    assert!(model.devices.iter().all(|device| device.counters.is_known()));
    let diagnosis = bench.engine.diagnosis();
    let main = diagnosis.main_device.unwrap();
    assert!(main.never_reads.is_empty(), "the line was read: {main:?}");
    assert_eq!(diagnosis.asking.unwrap().state, AskingState::Asking);
    let rise = model.devices[1].counters.last_rise();
    assert!(rise.is_some(), "the counters of the second have risen");
}

#[test]
fn main_device_elsewhere_or_of_a_kind_that_minds_is_refused() {
    let mut bench = Bench::new(SOEM);
    bench.direction = [Direction::Unknown; 2];
    bench.run(20);
    assert_eq!(bench.news, [News::Ended(EndReason::Refused(AskRefusal::Elsewhere))]);
    // The computer that plays the line.
    let mut bench = Bench::new(SOEM);
    bench.direction = [Direction::Received, Direction::Sent];
    bench.run(20);
    assert_eq!(bench.news, [News::Ended(EndReason::Refused(AskRefusal::Elsewhere))]);
    let mut bench = Bench::new(MacAddress([0, 1, 2, 3, 4, 5]));
    bench.run(seconds(3));
    assert_eq!(bench.news, [News::Ended(EndReason::Refused(AskRefusal::Unrecognised))]);
    let mut bench = Bench::new(ETHERCRAB);
    bench.run(seconds(3));
    let kind = AskRefusal::Kind(crate::main_device::MainDeviceKind::Ethercrab);
    assert_eq!(bench.news, [News::Ended(EndReason::Refused(kind))]);
    assert!(bench.questions.is_empty());
    let setup = AskSetup { per_s: 20, is_forced: true, keeps_on: false };
    let mut bench = Bench::with(ETHERCRAB, setup);
    bench.run(seconds(3));
    assert_eq!(bench.state(), AskingState::Asking);
}

#[test]
fn main_device_of_a_ring_is_refused() {
    let mut bench = Bench::new(SOEM);
    // On one of its cards come in the frames that the other one has sent.
    bench.direction[1] = Direction::Sent;
    let other = MacAddress([1, 1, 4, 4, 1, 1]);
    for cycle in 0..20 {
        let frame = Frame::from(SOEM, cycle % 16, &[lrw(0, &[0; 4])]);
        bench.show(&frame.0, Direction::Sent);
        bench.now += TRIP;
        let back = Frame::from(other, cycle % 16, &[lrw(0, &[0; 4])]).returned(&[WKC]);
        bench.show(&back.0, Direction::Received);
        bench.now += CYCLE;
        bench.poll();
    }
    assert_eq!(bench.news, [News::Ended(EndReason::Refused(AskRefusal::Ring))]);
}

#[test]
fn subdevice_that_does_not_take_udp_ends_it_or_has_plain_frames_sent() {
    let mut bench = Bench::new(SOEM);
    bench.devices[2].takes_udp = false;
    bench.run(seconds(4));
    assert_eq!(bench.news, [News::Begun(Carrier::Plain { first_index: 0x80 })]);
    let (_, last) = bench.questions.last().unwrap();
    assert_eq!(locate(last).unwrap().0, Wrapping::Raw);
    let index = FrameView::parse(last).unwrap().datagrams().next().unwrap().unwrap().index();
    assert!(index >= 0x80, "{index}");
    bench.engine.finish(bench.now, true);
    let model = bench.engine.model(Network(0)).unwrap();
    assert!(model.devices.iter().all(|device| device.silent.is_none()), "nobody is taken for away");

    let mut bench = Bench::new(MacAddress([0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF]));
    bench.devices[2].takes_udp = false;
    bench.run(seconds(4));
    let [News::Ended(over @ EndReason::NoCarrier { answered: 2, present: 3, .. })] =
        &bench.news[..]
    else {
        panic!("{:?}", bench.news)
    };
    assert!(over.reason().contains("2 of 3 SubDevices"), "{}", over.reason());
    assert_eq!(bench.questions.len(), 3);
}

#[test]
fn falling_working_counter_ends_the_questions_for_good() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    bench.wkc = WKC - 1;
    bench.run(5);
    let asked = bench.questions.len();
    bench.wkc = WKC;
    bench.run(seconds(3));
    assert_eq!(bench.questions.len(), asked);
    assert_eq!(bench.state(), AskingState::Stopped);
    assert!(bench.reason().contains("fell from 4 to 3"), "{}", bench.reason());
    bench.engine.note_asking(bench.asker.report(bench.now));
    let gaps = bench.engine.diagnosis().coverage.subjects.into_iter().flat_map(|one| one.gaps);
    let told = gaps.filter(|gap| gap.text.contains("no question was asked after")).count();
    assert_eq!(told, 2, "error counters and link status");
}

#[test]
fn trouble_that_no_question_was_near_is_waited_out_where_that_is_wished() {
    let setup = AskSetup { per_s: 5, is_forced: false, keeps_on: true };
    let mut bench = Bench::with(SOEM, setup);
    bench.run(seconds(3));
    // The latest question is long gone.
    while bench.now.since(bench.questions.last().unwrap().0) < Span::ms(50) {
        bench.run(1);
    }
    bench.wkc = WKC - 1;
    bench.run(5);
    let asked = bench.questions.len();
    assert_eq!(bench.state(), AskingState::Learning);
    bench.run(seconds(1));
    assert_eq!(bench.questions.len(), asked, "it is watched anew");
    bench.run(seconds(3));
    assert!(bench.questions.len() > asked);
    assert!(bench.news.iter().any(|news| matches!(news, News::Again(_))), "{:?}", bench.news);
}

#[test]
fn frames_lost_near_questions_alone_end_them() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    let mut lost = false;
    bench.loses = Box::new(move |_, was_asked| was_asked && !std::mem::replace(&mut lost, true));
    bench.run(seconds(2));
    assert_eq!(bench.state(), AskingState::Stopped, "{:?}", bench.asker.report(bench.now));
    assert!(bench.reason().contains("1 of its"), "{}", bench.reason());
}

#[test]
fn frames_lost_everywhere_are_the_line_and_go_on_being_asked_about() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    bench.loses = Box::new(|cycle, _| ((cycle * 2_654_435_761) >> 7).is_multiple_of(17));
    bench.run(seconds(6));
    let report = bench.asker.report(bench.now);
    assert_eq!(report.state, AskingState::Asking, "{report:?}");
    assert!(report.others.lost.0 > 100 && report.near.lost.0 > 2, "{report:?}");
}

#[test]
fn order_that_was_not_given_before_and_a_longer_cycle_are_signs() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    bench.exchange(&[(Command::Fpwr, 0x1002, 0x0120, &[0x12, 0], 0)]);
    bench.run(2);
    assert!(bench.reason().contains("writes to 0x0120"), "{}", bench.reason());

    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    bench.cycle = Span::us(2_500);
    bench.run(seconds(1));
    assert!(bench.reason().contains("its cycle grew"), "{}", bench.reason());
    assert_eq!(bench.state(), AskingState::Stopped);
}

#[test]
fn nothing_is_asked_once_the_main_device_has_gone() {
    let mut bench = Bench::new(SOEM);
    bench.run(seconds(3));
    let asked = bench.questions.len();
    bench.now += Span::ms(150);
    for _ in 0..1_000 {
        bench.poll();
        bench.now += Span::ms(1);
    }
    assert_eq!(bench.questions.len(), asked);
    assert!(bench.reason().contains("nobody drives"), "{}", bench.reason());
}

#[test]
fn main_device_that_still_sets_up_is_waited_for() {
    let mut bench = Bench::new(SOEM);
    for _ in 0..30 {
        bench.run(50);
        bench.exchange(&[(Command::Fpwr, 0x1002, 0x0800, &[0; 8], 0)]);
    }
    assert_eq!((bench.state(), bench.questions.len()), (AskingState::Learning, 0));
    bench.run(seconds(3));
    assert_eq!(bench.state(), AskingState::Asking);
}
