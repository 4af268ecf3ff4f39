//! A slice of the cases with a capture probe: the true place is in each range, and no range is wider than it need be.

use linesman_lab::score::capture_probe::{ProbeKind, ProbeOutcome, run_probe_case};

// proves: WS-06
#[test]
fn probe_alone_places_damage_in_drawn_plants() {
    let (mut right, mut quiet) = (0, 0);
    for seed in 1..25 {
        let report = run_probe_case(seed, ProbeKind::Recording);
        match &report.outcome {
            ProbeOutcome::Right(_) => right += 1,
            ProbeOutcome::Quiet => quiet += 1,
            ProbeOutcome::NotSeen | ProbeOutcome::NotPlayed(_) => {}
            ProbeOutcome::Wrong(_) | ProbeOutcome::FalseAlarm => panic!("{report:#?}"),
        }
    }
    assert!(right >= 10 && quiet >= 1, "{right} right, {quiet} quiet");
}

#[test]
fn case_with_a_probe_is_judged_the_same_each_time() {
    let (one, again) =
        (run_probe_case(3, ProbeKind::Recording), run_probe_case(3, ProbeKind::Recording));
    assert_eq!(format!("{one:?}"), format!("{again:?}"));
}

// proves: WS-06
#[test]
fn tap_of_which_the_links_are_told_places_damage_in_drawn_plants() {
    let (mut right, mut quiet) = (0, 0);
    for seed in 1..25 {
        let report = run_probe_case(seed, ProbeKind::Tap);
        match &report.outcome {
            ProbeOutcome::Right(_) => right += 1,
            ProbeOutcome::Quiet => quiet += 1,
            ProbeOutcome::NotSeen | ProbeOutcome::NotPlayed(_) => {}
            ProbeOutcome::Wrong(_) | ProbeOutcome::FalseAlarm => panic!("{report:#?}"),
        }
    }
    assert!(right >= 6 && quiet >= 1, "{right} right, {quiet} quiet");
}
