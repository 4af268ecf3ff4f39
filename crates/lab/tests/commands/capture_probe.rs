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

// proves: WS-06
#[test]
fn reference_clock_behind_the_last_port_is_not_said_to_be_silent() {
    // System time is distributed by FRMW, which all clocks count: also those before the probe.
    let healthy = run_probe_case(910_722, ProbeKind::Recording);
    assert_eq!(healthy.outcome, ProbeOutcome::Quiet, "{healthy:#?}");
    let beyond = run_probe_case(910_720, ProbeKind::Recording);
    assert_eq!(beyond.outcome, ProbeOutcome::NotSeen, "{beyond:#?}");
}

// proves: WS-06
#[test]
fn link_of_the_maindevice_that_flaps_is_named_although_who_starved_is_set_up_again() {
    let report = run_probe_case(910_261, ProbeKind::Recording);
    assert!(matches!(report.outcome, ProbeOutcome::Right(2..=4)), "{report:#?}");
    assert!(report.said.iter().any(|said| said.starts_with("X513")), "{report:#?}");
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
