//! A slice of the cases with a capture probe: the true place is in each range, and no range is wider than it need be.

use linesman_lab::score::capture_probe::{ProbeOutcome, run_probe_case};

// proves: WS-06
#[test]
fn probe_alone_places_damage_in_drawn_plants() {
    let (mut right, mut quiet) = (0, 0);
    for seed in 1..25 {
        let report = run_probe_case(seed);
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
    let (one, again) = (run_probe_case(3), run_probe_case(3));
    assert_eq!(format!("{one:?}"), format!("{again:?}"));
}
