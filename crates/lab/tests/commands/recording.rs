//! A recording holds what a capture tool on the computer of the MainDevice is shown, and no more.

use std::sync::{Arc, Mutex};

use linesman_config::fault::FaultName;
use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_diagnosis::{Engine, Setup};
use linesman_lab::lab::{Lab, Tap};
use linesman_lab::options::LabOptions;
use linesman_lab::verdict::{Claim, Site};
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

const PLANT: &str = r#"
name = "press"
device = [
    { name = "K1", type = "EK1100", on = "maindevice", cable_m = 5.0 },
    { name = "T1", type = "EL2008", on = "K1.B" },
    { name = "T2", type = "EL1008", on = "T1.B" },
]
"#;

type Noted = Arc<Mutex<Vec<(Direction, Instant, Vec<u8>)>>>;

/// A line that is up, what its MainDevice sends and gets, and what is recorded of it.
fn up() -> (Lab, Noted, Noted) {
    up_as(PLANT)
}

fn up_as(plant: &str) -> (Lab, Noted, Noted) {
    let file: SegmentFile = toml::from_str(plant).unwrap();
    let mut lab = Lab::new(&file, LabOptions::default()).unwrap();
    let note = |into: &Noted| -> Tap {
        let into = Arc::clone(into);
        Box::new(move |frame| {
            into.lock().unwrap().push((frame.direction, frame.time, frame.bytes.to_vec()));
        })
    };
    let (made, recorded) = (Noted::default(), Noted::default());
    lab.set_tap(note(&made));
    lab.set_recorder(note(&recorded));
    lab.wait_up(Span::s(10)).unwrap();
    run(&mut lab, 200);
    assert_eq!(*made.lock().unwrap(), *recorded.lock().unwrap(), "as long as nothing is wrong");
    (lab, made, recorded)
}

fn run(lab: &mut Lab, ms: u64) {
    lab.run_until(lab.now() + Span::ms(ms)).unwrap();
}

/// Frames of a direction, with their times, from an instant on.
fn of(noted: &Noted, direction: Direction, from: Instant) -> Vec<(Instant, Vec<u8>)> {
    let all = noted.lock().unwrap();
    let fits = all.iter().filter(|(way, at, _)| *way == direction && *at >= from);
    fits.map(|(_, at, bytes)| (*at, bytes.clone())).collect()
}

#[test]
fn what_the_card_does_not_take_is_in_no_recording() {
    let (mut lab, made, recorded) = up();
    let from = lab.now();
    let starved = FaultEntry::new(FaultName::WatchdogStarved).at("maindevice".to_owned());
    lab.inject(&starved.with("pause_ms", 100.0)).unwrap();
    run(&mut lab, 90);
    let (made_first, shown_first) =
        (of(&made, Direction::Sent, from), of(&recorded, Direction::Sent, from));
    assert!(made_first.len() > 40, "{} frames", made_first.len());
    assert!(shown_first.len() <= 2, "{} of {} frames", shown_first.len(), made_first.len());
    run(&mut lab, 500);
    assert!(of(&recorded, Direction::Sent, from).len() > 200, "it sends again");
    assert_eq!(of(&made, Direction::Received, from), of(&recorded, Direction::Received, from));
}

#[test]
fn without_a_carrier_nothing_is_recorded_and_a_cable_that_takes_all_is_seen() {
    let (mut lab, _, recorded) = up();
    // So soon after a change of the link the kernel would hear of the next one a second later.
    run(&mut lab, 1_500);
    let from = lab.now();
    let open = FaultEntry::new(FaultName::LinkOpen).at("maindevice-K1.A".to_owned());
    let open = lab.inject(&open).unwrap();
    run(&mut lab, 500);
    let shown = of(&recorded, Direction::Sent, from).len();
    // Until the loss of the link is noticed, after a millisecond; none if nothing was due in it.
    assert!(shown <= 4, "{shown} frames");
    lab.heal(open);
    lab.run_while(Span::s(10), Span::ms(10), Lab::is_up).unwrap();
    let from = lab.now();
    let hole = FaultEntry::new(FaultName::FalseLink).at("maindevice-K1.A".to_owned());
    lab.inject(&hole).unwrap();
    run(&mut lab, 500);
    assert!(of(&recorded, Direction::Sent, from).len() > 100);
}

/// The computer keeps a frame back before it comes to the card, where it is shown; the card keeps it back behind
/// that.
#[test]
fn a_frame_is_recorded_when_it_comes_to_the_card() {
    let late = |name, key: &str, other: &str| {
        let (mut lab, made, recorded) = up();
        let from = lab.now();
        let entry = FaultEntry::new(name).at("maindevice".to_owned());
        lab.inject(&entry.with(key, 300.0).with(other, 300.0)).unwrap();
        run(&mut lab, 100);
        let (made, shown) =
            (of(&made, Direction::Sent, from), of(&recorded, Direction::Sent, from));
        let pairs = made.iter().zip(&shown);
        let later = pairs.inspect(|(made, shown)| assert_eq!(made.1, shown.1));
        later.filter(|(made, shown)| shown.0 > made.0 + Span::us(20)).count()
    };
    assert!(late(FaultName::HostJitter, "delay_us", "delays_per_s") > 10);
    assert_eq!(late(FaultName::LateFrames, "late_us", "least_us"), 0);
}

/// What is said of the recording of a line with a fault that lasts so long, when all is well again.
fn said(fault: FaultEntry, lasts_ms: u64) -> (FaultName, Site) {
    said_of(PLANT, fault, lasts_ms)
}

fn said_of(plant: &str, fault: FaultEntry, lasts_ms: u64) -> (FaultName, Site) {
    let (mut lab, _, recorded) = up_as(plant);
    run(&mut lab, 2_000);
    let fault = lab.inject(&fault).unwrap();
    run(&mut lab, lasts_ms);
    lab.heal(fault);
    lab.run_while(Span::s(10), Span::ms(20), Lab::is_up).unwrap();
    run(&mut lab, 2_500);
    let mut engine = Engine::new(Setup::default());
    for (nth, (_, time, bytes)) in (1..).zip(&*recorded.lock().unwrap()) {
        engine.handle_frame(&FrameSeen {
            network: Network(0),
            path: None,
            direction: Direction::Unknown,
            time: *time,
            number: nth,
            fcs: None,
            truncated: false,
            probe: None,
            bytes,
        });
    }
    engine.finish(Instant::ZERO, true);
    let claim = Claim::of(&engine.diagnosis().findings[0]);
    (claim.cause, claim.site)
}

/// In a ring the copy of the second card comes round untouched, and before the first card has sent its own if the
/// computer keeps that back. Nobody has failed to answer.
#[test]
fn a_copy_that_is_late_in_a_ring_is_no_fault_of_a_subdevice() {
    let ring = format!("{PLANT}\n[ring]\ncloses_at = \"K1.C\"\n");
    let late = FaultEntry::new(FaultName::HostJitter).at("maindevice".to_owned());
    let (cause, site) = said_of(&ring, late.with("delay_us", 600.0).with("hits", 18), 2_000);
    assert_eq!((cause, site), (FaultName::HostJitter, Site::Host));
}

/// While the card has no link nothing is recorded. How long that was tells a supply that failed from one that
/// dipped, and frames that are sent again and do not come back tell that the link was up too early.
#[test]
fn the_time_without_frames_belongs_to_what_is_said_of_the_first_cable() {
    let off = FaultEntry::new(FaultName::DeviceOff).device("K1".to_owned());
    assert_eq!(said(off, 3_000), (FaultName::DeviceOff, Site::Device(DeviceId(0))));
    let early = FaultEntry::new(FaultName::EarlyLink).at("maindevice-K1.A".to_owned());
    let a = End::MainDevice(Path::A);
    let b = Some(End::Controller(DeviceId(0), Port::A));
    let early = said(early.with("blind_ms", 66.0).with("down_ms", 63.0), 2_500);
    assert_eq!(early, (FaultName::EarlyLink, Site::Link { a, b, way: None }));
}
