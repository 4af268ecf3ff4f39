//! Active search by closing ports for a moment: it finds where frames vanish, and nothing of it
//! stays.

use std::sync::{Arc, Mutex};

use linesman_config::fault::FaultName;
use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_diagnosis::{Engine, Setup};
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_lab::verdict::{Claim, Site};
use linesman_proto::address::{DeviceId, Path, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::time::Span;
use linesman_proto::topology::End;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

const PLANT: &str = r#"
name = "press"
device = [
    { name = "K1", type = "EK1100", on = "maindevice", cable_m = 5.0 },
    { name = "T1", type = "EL2008", on = "K1.B" },
    { name = "T2", type = "EL1008", on = "T1.B" },
    { name = "K2", type = "EK1100", on = "K1.C", cable_m = 20.0 },
    { name = "T3", type = "EL1008", on = "K2.B" },
    { name = "K3", type = "EK1100", on = "K2.C", cable_m = 9.0 },
    { name = "T4", type = "EL2004", on = "K3.B" },
]
"#;
const K1: u32 = 0;
const K2: u32 = 3;
const K3: u32 = 5;

fn up() -> Lab {
    let file: SegmentFile = toml::from_str(PLANT).unwrap();
    let mut lab = Lab::new(&file, LabOptions { active: true, ..LabOptions::default() }).unwrap();
    lab.wait_up(Span::s(10)).unwrap();
    run(&mut lab, 1_500);
    lab
}

fn run(lab: &mut Lab, ms: u64) {
    lab.run_until(lab.now() + Span::ms(ms)).unwrap();
}

/// DL control and what is about it of every controller, and who is closed though it has a link.
fn registers(lab: &Lab) -> (Vec<Vec<u8>>, usize) {
    let controllers = || lab.segment().devices().filter_map(|id| lab.segment().controller(id));
    let bytes = |start: u16| (start..start + 4).map(RegisterAddress);
    let control =
        controllers().map(|one| bytes(0x0100).map(|address| one.register(address)).collect());
    let closed = controllers().flat_map(|one| {
        let status = one.dl_status();
        Port::ALL.map(|port| status.port_state(port))
    });
    let closed = closed.filter(|state| state.link && !state.is_active()).count();
    (control.collect(), closed)
}

fn hole(from: u32, to: u32) -> Site {
    Site::Link {
        a: End::Controller(DeviceId(from), Port::C),
        b: Some(End::Controller(DeviceId(to), Port::A)),
        way: None,
    }
}

fn first_link() -> Site {
    let a = End::MainDevice(Path::A);
    Site::Link { a, b: Some(End::Controller(DeviceId(K1), Port::A)), way: None }
}

// proves: JCT-07 partial: on a virtual segment
#[test]
fn a_false_link_is_found_by_closing_ports_and_all_registers_are_as_before() {
    let mut lab = up();
    let before = registers(&lab);
    let false_link = FaultEntry::new(FaultName::FalseLink).at("K1.C-K2.A".to_owned());
    let fault = lab.inject(&false_link).unwrap();
    run(&mut lab, 2_500);
    let said = lab.diagnosis();
    let claim = Claim::of(&said.findings[0]);
    assert_eq!((claim.cause, claim.site), (FaultName::FalseLink, hole(K1, K2)));
    assert!(said.findings[0].evidence.iter().any(|one| one.text.contains("closed for a moment")));
    lab.heal(fault);
    run(&mut lab, 3_000);
    assert_eq!(registers(&lab), before);
}

/// The same from the recording alone, which knows neither directions nor the card's link; not while nobody
/// searches.
#[test]
fn a_recording_of_the_search_names_the_same_link() {
    for (at, active, site, is_known_later) in [
        ("K1.C-K2.A", true, Some(hole(K1, K2)), true),
        ("K2.C>K3.A", true, Some(hole(K2, K3)), true),
        ("K1.C-K2.A", false, None, false),
        // Nothing helps against a hole before the first SubDevice, nor against a cable that is out there; but with
        // that nobody searches. When it is over the card may as well have taken no frames.
        ("maindevice-K1.A", true, Some(first_link()), false),
    ] {
        let file: SegmentFile = toml::from_str(PLANT).unwrap();
        let mut lab = Lab::new(&file, LabOptions { active, ..LabOptions::default() }).unwrap();
        let recording = Arc::new(Mutex::new(Engine::new(Setup::default())));
        let reader = Arc::clone(&recording);
        lab.set_recorder(Box::new(move |seen| {
            let frame = FrameSeen { path: None, direction: Direction::Unknown, ..*seen };
            reader.lock().unwrap().handle_frame(&frame);
        }));
        lab.wait_up(Span::s(10)).unwrap();
        run(&mut lab, 1_500);
        let fault = lab.inject(&FaultEntry::new(FaultName::FalseLink).at(at.to_owned())).unwrap();
        run(&mut lab, 2_500);
        let said = |lab: &Lab| {
            let mut engine = recording.lock().unwrap().clone();
            engine.finish(lab.now(), true);
            let claim = Claim::of(&engine.diagnosis().findings[0]);
            (claim.cause, claim.site)
        };
        let expected = site.map(|site| (FaultName::FalseLink, site));
        match expected {
            Some(expected) => assert_eq!(said(&lab), expected, "{at}, while it lasts"),
            None => assert_ne!(said(&lab).0, FaultName::FalseLink, "{at}, while it lasts"),
        }
        lab.heal(fault);
        run(&mut lab, 3_000);
        if let Some(expected) = expected.filter(|_| is_known_later) {
            assert_eq!(said(&lab), expected, "{at}, when it is over");
        }
    }
}

/// In a ring the frames of card A are followed. A hole in both directions takes those of card B, too; one in one
/// direction, or in a branch, lets them come round untouched.
#[test]
fn a_false_link_of_a_ring_is_found_as_well() {
    let ring = format!("{PLANT}\n[ring]\ncloses_at = \"K3.C\"\n");
    for (at, from, to) in [("K1.C-K2.A", K1, K2), ("K2.C>K3.A", K2, K3)] {
        let file: SegmentFile = toml::from_str(&ring).unwrap();
        let options = LabOptions { active: true, ..LabOptions::default() };
        let mut lab = Lab::new(&file, options).unwrap();
        lab.wait_up(Span::s(10)).unwrap();
        run(&mut lab, 1_500);
        let before = registers(&lab);
        let fault = lab.inject(&FaultEntry::new(FaultName::FalseLink).at(at.to_owned())).unwrap();
        run(&mut lab, 2_500);
        let said = lab.diagnosis();
        let claim = Claim::of(&said.findings[0]);
        assert_eq!((claim.cause, claim.site), (FaultName::FalseLink, hole(from, to)), "{at}");
        lab.heal(fault);
        run(&mut lab, 3_000);
        assert_eq!(registers(&lab), before, "{at}");
    }
}

#[test]
fn a_search_that_is_cut_off_in_the_middle_leaves_nothing_either() {
    let mut lab = up();
    let before = registers(&lab);
    let false_link = FaultEntry::new(FaultName::FalseLink).at("K2.C>K3.A".to_owned());
    let fault = lab.inject(&false_link).unwrap();
    let began = lab.run_while(Span::s(2), Span::ms(1), |lab| registers(lab).1 > before.1).unwrap();
    assert!(began, "no port was closed");
    // Whoever closed it does not reach it any more.
    let pulled = FaultEntry::new(FaultName::LinkOpen).at("maindevice-K1.A".to_owned());
    let pulled = lab.inject(&pulled).unwrap();
    run(&mut lab, 1_200);
    let (control, _) = registers(&lab);
    assert_eq!(control, before.0);
    lab.heal(pulled);
    lab.heal(fault);
    run(&mut lab, 4_000);
    assert_eq!(registers(&lab), before);
}

#[test]
fn nothing_is_closed_unless_it_was_allowed_nor_while_frames_come_back() {
    let file: SegmentFile = toml::from_str(PLANT).unwrap();
    for (active, kind, at) in [
        (false, FaultName::FalseLink, "K1.C-K2.A"),
        (true, FaultName::LinkOpen, "K1.C-K2.A"),
        (true, FaultName::LinkOpen, "maindevice-K1.A"),
    ] {
        let mut lab = Lab::new(&file, LabOptions { active, ..LabOptions::default() }).unwrap();
        lab.wait_up(Span::s(10)).unwrap();
        run(&mut lab, 1_500);
        let closed = registers(&lab).1;
        lab.inject(&FaultEntry::new(kind).at(at.to_owned())).unwrap();
        let is_closed = |lab: &Lab| registers(lab).1 > closed;
        assert!(!lab.run_while(Span::s(2), Span::ms(1), is_closed).unwrap(), "{kind} at {at}");
    }
}

/// A hole that goes by itself in the middle of a search lets frames come back as a closed port does: only what
/// vanishes again when the port is open tells.
#[test]
fn a_hole_that_goes_by_itself_is_not_placed_for_sure_where_it_was_not() {
    for lasts in (105..400).step_by(20) {
        let mut lab = up();
        let fault = FaultEntry::new(FaultName::FalseLink).at("K2.C>K3.A".to_owned());
        let fault = lab.inject(&fault).unwrap();
        run(&mut lab, lasts);
        lab.heal(fault);
        run(&mut lab, 4_000);
        let said = lab.diagnosis();
        let sure = said.findings.iter().filter(|finding| finding.confidence > 0.55);
        for finding in sure {
            let claim = Claim::of(finding);
            let is_there = claim.site == hole(K2, K3) || claim.site == Site::Network;
            assert!(
                is_there,
                "after {lasts} ms: {} {} at {}",
                finding.code, claim.cause, claim.site
            );
        }
    }
}

/// Where frames are lost at random, single ones come through: that a port is closed when one does says nothing.
#[test]
fn frames_that_are_lost_at_random_lead_no_search_astray() {
    for hits in [300_u32, 500, 700, 900] {
        let mut lab = up();
        let from = lab.now().as_nanos() as f64 / 1e6 + 1.0;
        let card = FaultEntry::new(FaultName::NicDamaged)
            .at("maindevice".to_owned())
            .with("part", "receiver")
            .with("hits", hits)
            .from_to(from, Some(from + 1_000.0));
        lab.inject(&card).unwrap();
        run(&mut lab, 4_000);
        let said = lab.diagnosis();
        let first = Claim::of(&said.findings[0]);
        let is_near =
            matches!(first.site, Site::Host | Site::Network) || first.site == first_link();
        let is_last_hop = matches!(first.site, Site::Link { a: End::MainDevice(_), .. });
        assert!(is_near || is_last_hop, "{hits} hits: {} at {}", first.cause, first.site);
    }
}
