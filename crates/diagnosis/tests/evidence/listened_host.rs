//! Counters of the MainDevice's card, as a listener on its computer has them: damage on the last way, frames that were
//! dropped, a link that went; and a tap, at which they are about the tap.

use crate::support::script::{Script, fprd, lrw};
use crate::support::text;
use linesman_diagnosis::coverage::InputKind;
use linesman_diagnosis::report::{Diagnosis, PlaceReport};
use linesman_diagnosis::{HostEvent, HostObservation, Setup};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::Instant;

/// A listener that joins late: process data and states, and counters that somebody reads.
fn joined(is_local: bool) -> Script {
    let mut script = Script::with(Setup { input: InputKind::Listened, ..Setup::default() });
    script.is_live = true;
    if is_local {
        script.engine.watch_host();
    }
    script.scan(3);
    for station in 0x1001..=0x1003 {
        script.exchange(&[fprd(station, 0x0130, &[8, 0, 0, 0, 0, 0])]);
    }
    cycles(&mut script, 3_000, 0);
    script
}

/// Process data; one of so many frames is lost. Counters are read between them.
fn cycles(script: &mut Script, count: u64, one_lost_of: u64) {
    for number in 1..=count {
        if one_lost_of > 0 && number.is_multiple_of(one_lost_of) {
            script.vanish(&[lrw(0x1000, 4, 3)]);
        } else {
            script.exchange(&[lrw(0x1000, 4, 3)]);
        }
        if number.is_multiple_of(50) {
            for station in 0x1001..=0x1003 {
                script.exchange(&[fprd(station, 0x0300, &[0; 20])]);
            }
        }
    }
}

fn host(script: &mut Script, what: HostEvent) {
    let time = Instant::from_nanos(script.now);
    script.engine.handle_host(&HostObservation {
        network: Network::default(),
        path: Path::A,
        time,
        what,
    });
}

fn report(script: &mut Script) -> Diagnosis {
    script.finish();
    script.engine.diagnosis()
}

fn first(report: &Diagnosis) -> (&str, &PlaceReport, &str) {
    let finding = report.findings.first().unwrap_or_else(|| panic!("{}", text(report)));
    (finding.code.as_str(), &finding.place, finding.cause.name())
}

#[test]
fn damaged_frames_at_the_card_are_damage_on_the_last_way() {
    let mut script = joined(true);
    for _ in 0..20 {
        cycles(&mut script, 200, 50);
        host(&mut script, HostEvent::CardErrors { crc: 4, other: 0 });
    }
    cycles(&mut script, 200, 0);
    let report = report(&mut script);
    let (_, place, _) = first(&report);
    let PlaceReport::Link { a, .. } = place else { panic!("{}", text(&report)) };
    assert_eq!(a.no, 0, "the link to the card: {}", text(&report));
}

#[test]
fn frames_that_the_card_drops_are_this_computer() {
    let mut script = joined(true);
    for _ in 0..20 {
        cycles(&mut script, 200, 50);
        host(&mut script, HostEvent::CardDrops(4));
    }
    cycles(&mut script, 200, 0);
    let report = report(&mut script);
    assert_eq!(first(&report), ("X510", &PlaceReport::Host, "host-drops"), "{}", text(&report));
}

#[test]
fn link_that_the_card_lost_is_the_first_one_though_the_wiring_is_not_known() {
    let mut script = Script::with(Setup { input: InputKind::Listened, ..Setup::default() });
    script.is_live = true;
    script.engine.watch_host();
    cycles(&mut script, 500, 0);
    host(&mut script, HostEvent::Carrier(true));
    cycles(&mut script, 500, 0);
    host(&mut script, HostEvent::Carrier(false));
    script.now += 500_000_000;
    host(&mut script, HostEvent::SendFailures(50));
    script.now += 500_000_000;
    host(&mut script, HostEvent::Carrier(true));
    cycles(&mut script, 500, 0);
    let report = report(&mut script);
    let (code, place, cause) = first(&report);
    assert_eq!((code, cause), ("H101", "link-open"), "{}", text(&report));
    let PlaceReport::Link { a, b: None, .. } = place else { panic!("{}", text(&report)) };
    assert_eq!(a.no, 0);
    let below: Vec<_> = report.findings[0].consequences.iter().map(|one| &one.code).collect();
    assert_eq!(below, ["X512"], "{}", text(&report));
}

#[test]
fn silence_of_the_card_is_evidence_only_where_it_is_that_of_the_main_device() {
    for (is_local, known) in [(true, true), (false, false)] {
        let mut script = joined(is_local);
        cycles(&mut script, 1_000, 0);
        let report = report(&mut script);
        let subjects = report.coverage.subjects.iter();
        let gaps = subjects.flat_map(|subject| &subject.gaps);
        let unknown = gaps.filter(|gap| {
            gap.text.contains("its counters are not known")
                || gap.text.contains("card are not known")
        });
        assert_eq!(unknown.count() == 0, known, "{}", text(&report));
    }
}
