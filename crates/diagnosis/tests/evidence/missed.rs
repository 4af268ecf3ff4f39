//! Frames that passed and were not shown to the diagnosis: part of its verdict, and no loss on the line.

use crate::support::plant::{codes, plant};
use crate::support::text;
use linesman_diagnosis::coverage::Reason;
use linesman_proto::address::Network;
use linesman_proto::time::Instant;

#[test]
fn missed_frames_are_a_gap_and_their_requests_are_not_lost_frames() {
    let mut whole = plant();
    let before = whole.report();
    assert_eq!(before.network.lost.0, 0, "{}", text(&before));

    let mut plant = plant();
    // Requests go out; their returns and more are not shown.
    plant.lost_cycles(3);
    let at = Instant::from_nanos(plant.script.now);
    plant.script.engine.handle_missed(Network(0), 40, at);
    plant.next += 40_000_000;
    plant.time += 40_000_000;
    plant.cycles(300);
    let coverage = plant.script.engine.coverage();
    let gap = coverage.essential_gaps().find(|gap| gap.reason == Reason::FramesMissed).unwrap();
    assert!(gap.text.contains("missed 40 of "), "{}", gap.text);
    assert!(!gap.next_step.is_empty());
    let report = plant.report();
    assert_eq!((report.network.lost.0, codes(&report)), (0, codes(&before)), "{}", text(&report));
    assert!(!coverage.suffices(), "such a line is never called healthy");
}
