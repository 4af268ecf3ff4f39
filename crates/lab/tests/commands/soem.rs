//! The habit of SOEM, held against recordings of SOEM on the same line.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "a test says where recordings are, and which it left out"
)]

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use linesman_config::fault::FaultName;
use linesman_diagnosis::main_device::{Certainty, MainDeviceKind};
use linesman_diagnosis::observe::Direction;
use linesman_lab::habit::Habit;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_link::capture::CaptureReader;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameView;
use linesman_proto::time::Span;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

/// The line of the recordings.
const LINE: &str = r#"
name = "a"
device = [
    { name = "K", type = "EK1100", on = "maindevice" },
    { name = "DI", type = "EL1008", on = "K.B" },
    { name = "DO", type = "EL2008", on = "DI.B" },
    { name = "AI", type = "EL3102", on = "DO.B" },
    { name = "AO", type = "EL4102", on = "AI.B" },
]
"#;
/// SubDevices on it.
const COUNT: usize = 5;
/// The cycle of the recordings.
const CYCLE: Span = Span::ms(4);
/// The source address of SOEM's frames.
const SOURCE: MacAddress = MacAddress([1; 6]);

/// Command, address, register, length.
type Asked = (Command, u16, u16, usize);

/// Requests of a frame, with the data that each sends.
type Frame = Vec<(Asked, Vec<u8>)>;

/// Frames in order.
type Sent = Vec<Frame>;

/// A recording of SOEM; `None`, said aloud, when it is not there.
fn recorded(name: &str) -> Option<Sent> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(root.to_owned());
    let path = PathBuf::from(format!("{data}/foreign/{name}.pcapng.gz"));
    if !path.exists() {
        eprintln!("SKIPPED: no {}; set LINESMAN_DATA", path.display());
        return None;
    }
    let mut reader = CaptureReader::open(path).unwrap();
    let mut sent = Sent::new();
    while let Some(frame) = reader.next_frame() {
        let view = FrameView::parse(frame.bytes).unwrap();
        if view.source() == SOURCE {
            sent.push(requests(&view));
        }
    }
    Some(sent)
}

fn requests(view: &FrameView<'_>) -> Frame {
    let datagrams = view.datagrams().map_while(Result::ok);
    let request = |datagram: linesman_proto::frame::Datagram<'_>| {
        let (command, len) = (datagram.command().unwrap(), datagram.data_len());
        let asked = match command.addressing() {
            Addressing::Logical => (command, 0, 0, len),
            Addressing::Station
            | Addressing::Position
            | Addressing::Broadcast
            | Addressing::None => (command, datagram.adp(), datagram.ado().0, len),
        };
        (asked, datagram.data().to_vec())
    };
    datagrams.map(request).collect()
}

/// The same line in the lab, driven by the habit, and what it sends.
fn lab() -> (Lab, Arc<Mutex<Sent>>) {
    let file = SegmentFile::parse(LINE).unwrap();
    let options =
        LabOptions { habit: Habit::Soem, project: false, cycle: CYCLE, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).unwrap();
    let sent = Arc::new(Mutex::new(Sent::new()));
    let taken = Arc::clone(&sent);
    lab.set_tap(Box::new(move |frame| {
        if frame.direction == Direction::Sent {
            let view = FrameView::parse(frame.bytes).unwrap();
            assert_eq!(view.source(), SOURCE);
            taken.lock().unwrap().push(requests(&view));
        }
    }));
    lab.wait_up(Span::s(20)).unwrap();
    (lab, sent)
}

/// What was asked, with the data that were written but times and numbers of messages; what is asked again at once counts
/// once, as it depends on how long the other side takes.
fn asked<'a>(frames: impl IntoIterator<Item = &'a Frame>) -> Vec<Frame> {
    let written = |(asked, data): &(Asked, Vec<u8>)| {
        let (command, _, register, _) = *asked;
        let mut data = data.clone();
        match register {
            0x0920 | 0x0928 => data.clear(),
            _ if !command.effect().writes => data.clear(),
            0x1000.. => data[5] &= 0x0F,
            _ => {}
        }
        (*asked, data)
    };
    let frames = frames.into_iter();
    let mut asked: Vec<Frame> = frames.map(|frame| frame.iter().map(written).collect()).collect();
    asked.dedup();
    asked
}

fn is(frame: &Frame, wanted: Asked) -> bool {
    matches!(&frame[..], [(one, _)] if *one == wanted)
}

/// Finding SubDevices up to the request of PREOP of the last; mapping process data and setting clocks up to the first
/// exchange.
fn start_up(sent: &Sent) -> [Vec<Frame>; 2] {
    let first = |wanted| sent.iter().position(|frame| is(frame, wanted)).unwrap();
    let last = 0x1000 + COUNT as u16;
    let found = first((Command::Fpwr, last, 0x0120, 2));
    let mut behind = sent.iter().skip(found);
    let state = (Command::Fprd, 0x1001, 0x0130, 6);
    let from = found + behind.position(|frame| is(frame, state)).unwrap();
    let to = sent.iter().position(|frame| frame[0].0.0 == Command::Lrw).unwrap();
    // The program of the recordings had read EEPROMs before it mapped, and so had taken them already.
    let is_taking = |frame: &&Frame| frame[0].0.2 != 0x0500;
    [asked(&sent[..=found]), asked(sent[from..to].iter().filter(is_taking))]
}

/// What was sent beside process data and looks at the states of all.
fn beside(sent: &Sent) -> Vec<Frame> {
    let is_look = |frame: &Frame| {
        frame[0].0.0 == Command::Lrw || frame.len() > 1 || is(frame, (Command::Brd, 0, 0x0130, 2))
    };
    asked(sent.iter().filter(|frame| !is_look(frame)))
}

/// Where two lists part, with what was before.
fn assert_same(ours: &[Frame], recorded: &[Frame]) {
    let same = ours.iter().zip(recorded).take_while(|(a, b)| a == b).count();
    let show = |list: &[Frame]| {
        let shown = list.iter().skip(same.saturating_sub(2)).take(5);
        shown.map(|frame| format!("{frame:04X?}")).collect::<Vec<_>>().join("\n  ")
    };
    assert!(
        same == ours.len() && same == recorded.len(),
        "part at {same} of {} and {}\nours:\n  {}\nrecorded:\n  {}",
        ours.len(),
        recorded.len(),
        show(ours),
        show(recorded)
    );
}

#[test]
fn start_up_asks_what_recorded_soem_asked_in_the_same_order() {
    let Some(recorded) = recorded("soem-link-open-early") else { return };
    let (_, sent) = lab();
    let ours = start_up(&sent.lock().unwrap());
    for (ours, recorded) in ours.iter().zip(start_up(&recorded)) {
        assert_same(ours, &recorded);
    }
}

#[test]
fn process_data_have_the_format_of_recorded_soem() {
    let Some(recorded) = recorded("soem-link-open-late") else { return };
    let (mut lab, sent) = lab();
    sent.lock().unwrap().clear();
    lab.run_until(lab.now() + Span::s(1)).unwrap();
    let shapes = |sent: &Sent| {
        let cyclic = sent.iter().filter(|frame| frame[0].0.0 == Command::Lrw);
        let mut shapes: Vec<Vec<Asked>> =
            cyclic.map(|frame| frame.iter().map(|(asked, _)| *asked).collect()).collect();
        shapes.dedup();
        shapes
    };
    let sent = sent.lock().unwrap();
    assert_eq!(shapes(&sent), shapes(&recorded));
    let states = sent.iter().filter(|frame| is(frame, (Command::Brd, 0, 0x0130, 2))).count();
    let cyclic = sent.iter().filter(|frame| frame[0].0.0 == Command::Lrw).count();
    assert!((15..=21).contains(&states) && (245..=251).contains(&cyclic), "{states}, {cyclic}");
    assert_eq!(states + cyclic, sent.len(), "nothing else is asked while all is well");
}

/// What is sent while a fault acts for so long, and until two seconds after it.
fn sent_about(entry: &FaultEntry, lasts: Span) -> (Lab, Sent) {
    let (mut lab, sent) = lab();
    lab.run_until(lab.now() + Span::ms(300)).unwrap();
    sent.lock().unwrap().clear();
    let id = lab.inject(entry).unwrap();
    lab.run_until(lab.now() + lasts).unwrap();
    lab.heal(id);
    lab.run_until(lab.now() + Span::s(2)).unwrap();
    assert!(lab.is_up(), "{:?}", lab.not_up().collect::<Vec<_>>());
    let sent = sent.lock().unwrap().clone();
    (lab, sent)
}

#[test]
fn sub_device_without_power_for_3_s_is_brought_back_as_recorded_soem_did() {
    let Some(recorded) = recorded("device-off") else { return };
    let (_, ours) = sent_about(&FaultEntry::new(FaultName::DeviceOff).device("AO"), Span::s(3));
    // From the last look at its place on: how often its EEPROM is still busy depends on when it is asked.
    let last_look = |sent: &Sent| {
        let beside = beside(sent);
        let look = (Command::Aprd, 0xFFFC, 0x0010, 2);
        let from = beside.iter().rposition(|frame| is(frame, look)).unwrap();
        beside[from..].to_vec()
    };
    let (ours, recorded) = (last_look(&ours), last_look(&recorded));
    assert!(ours.len() > 30, "{ours:?}");
    assert_same(&ours, &recorded);
}

#[test]
fn sub_devices_behind_an_open_link_are_brought_back_as_recorded_soem_did() {
    let Some(recorded) = recorded("soem-link-open-late") else { return };
    let (_, ours) = sent_about(&FaultEntry::new(FaultName::LinkOpen).at("DO.B-AI.A"), Span::s(3));
    let writes = |sent: &Sent| {
        let mut beside = beside(sent);
        beside.retain(|frame| frame[0].0.0 == Command::Fpwr);
        beside
    };
    let (ours, recorded) = (writes(&ours), writes(&recorded));
    assert_eq!(ours.len(), 2, "an error is acknowledged, OP is asked for: {ours:?}");
    assert_same(&ours, &recorded);
}

#[test]
fn diagnosis_recognises_the_habit_as_soem() {
    let (mut lab, _) = lab();
    lab.run_until(lab.now() + Span::s(1)).unwrap();
    let diagnosis = lab.diagnosis();
    let kind = diagnosis.main_device.unwrap();
    assert_eq!(kind.kind, MainDeviceKind::Soem);
    assert_eq!(kind.certainty, Certainty::Likely);
}

/// A ring of three couplers, and a cable of it.
const RING: &str = r#"
name = "ring"
device = [
    { name = "K1", type = "EK1100", on = "maindevice" },
    { name = "T1", type = "EL2008", on = "K1.B" },
    { name = "K2", type = "EK1100", on = "K1.C" },
    { name = "T2", type = "EL1008", on = "K2.B" },
    { name = "K3", type = "EK1100", on = "K2.C" },
    { name = "T3", type = "EL3102", on = "K3.B" },
]

[ring]
closes_at = "K3.C"
"#;

#[test]
fn open_ring_is_closed_by_frames_of_both_cards() {
    let file = SegmentFile::parse(RING).unwrap();
    let options = LabOptions { habit: Habit::Soem, project: false, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).unwrap();
    lab.wait_up(Span::s(20)).unwrap();
    lab.inject(&FaultEntry::new(FaultName::RingOpen).at("K1.C-K2.A")).unwrap();
    for _ in 0..10 {
        lab.run_until(lab.now() + Span::ms(200)).unwrap();
        assert!(lab.is_up(), "watchdogs would have stopped outputs: {:?}", lab.not_up().next());
    }
}

#[test]
fn line_without_sub_devices_is_tried_again_each_second() {
    let file = SegmentFile::parse(LINE).unwrap();
    let options = LabOptions { habit: Habit::Soem, project: false, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).unwrap();
    let open = FaultEntry::new(FaultName::LinkOpen).at("maindevice-K.A");
    let id = lab.inject(&open).unwrap();
    lab.run_until(lab.now() + Span::s(3)).unwrap();
    assert!(!lab.is_up());
    lab.heal(id);
    lab.wait_up(Span::s(5)).unwrap();
}
