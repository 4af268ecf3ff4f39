//! A slice of the score: floors below which the diagnosis must not fall, and that it can be measured again.

use std::collections::BTreeMap;

use linesman_config::fault::FaultName;
use linesman_lab::score::set_trial::SetOutcome;
use linesman_lab::score::{Perturbation, ScoreOptions, Tally, run_case};

#[test]
fn a_slice_of_the_score_stays_above_its_floors() {
    let options = ScoreOptions::default();
    let mut tally = Tally::new(options);
    for seed in 1..21 {
        tally.add(&run_case(seed, &options));
    }
    let report = tally.report();
    assert_eq!(report.cases, 20);
    assert!(report.effective_cases >= 12, "{}", report.effective_cases);
    assert!(report.healthy_runs >= 14, "{}", report.healthy_runs);
    let said: Vec<String> = report.wrong.iter().map(|wrong| format!("{wrong:?}")).collect();
    let said = said.join("\n");
    assert_eq!(report.false_alarms, 0, "{:?}", report.healthy.alarms);
    assert!(report.place_at_1_set >= 0.65, "{}\n{said}", report.place_at_1_set);
    assert!(report.cause_at_1_set >= 0.55, "{}\n{said}", report.cause_at_1_set);
    assert!(report.place_at_1_set > report.baseline.place_at_1 + 0.2, "{said}");
}

#[test]
fn cases_that_were_once_judged_wrongly_are_judged_right() {
    let options = ScoreOptions::default();
    let cases = [
        (30_000_000, "a link that stays open when the one before it is mended"),
        (30_000_466, "damage within a SubDevice, and frames that are late by 5 % of the cycle"),
        (223_384_000_048, "a dip of 0.6 ms on a line whose links need three seconds"),
        (223_384_000_150, "frames vanish in a line of 155 with a long cycle"),
        (223_384_000_158, "so many uneven frames that the first are not kept one by one"),
        (981_271_127_104, "a burst of copies in a ring that the computer drops"),
    ];
    for (seed, what) in cases {
        let mut tally = Tally::new(options);
        tally.add(&run_case(seed, &options));
        let report = tally.report();
        assert_eq!(report.effective_cases, 1, "{what}");
        assert!(report.wrong.is_empty(), "{what}: {:?}", report.wrong);
    }
}

#[test]
fn what_one_look_cannot_tell_apart_is_mended_by_the_exchange_after_the_second() {
    let fault = Some(FaultName::DeviceOff);
    let options = ScoreOptions { fault, tries_repairs: true, ..ScoreOptions::default() };
    let cases = (1..9).map(|seed| run_case(seed, &options));
    let faults: Vec<_> = cases.flat_map(|case| case.faults).collect();
    let mended: Vec<_> =
        faults.iter().filter_map(|fault| fault.repair).map(|trial| trial.mended_by).collect();
    // A dead SubDevice looks like an open link to it, until another cable was no help.
    assert!(mended.contains(&Some(2)), "{mended:?}");
    assert!(mended.iter().all(Option::is_some), "{mended:?}");
}

#[test]
fn a_seed_is_judged_the_same_each_time() {
    let options = ScoreOptions::default();
    for seed in 1..4 {
        let (one, again) = (run_case(seed, &options), run_case(seed, &options));
        assert_eq!(format!("{one:?}"), format!("{again:?}"));
    }
}

#[test]
fn a_recording_is_judged_without_the_live_diagnosis() {
    let options = ScoreOptions { capture_only: true, ..ScoreOptions::default() };
    let case = run_case(4, &options);
    assert!(case.faults.iter().all(|fault| fault.live.is_none()), "{case:?}");
}

#[test]
fn a_healthy_line_that_is_disturbed_is_not_accused() {
    let options = ScoreOptions { healthy: true, ..ScoreOptions::default() };
    for seed in 1..16 {
        let case = run_case(seed, &options);
        assert_eq!(case.unplayable, None, "{}", case.replay());
        let [live, recorded] = case.healthy.unwrap().map(|said| said.alarms);
        assert!(live.is_empty() && recorded.is_empty(), "seed {seed}: {live:?} {recorded:?}");
    }
}

#[test]
fn false_alarms_of_recordings_stand_beside_the_live_ones() {
    for capture_only in [false, true] {
        let options = ScoreOptions { healthy: true, capture_only, ..ScoreOptions::default() };
        let mut case = run_case(3, &options);
        let [live, recorded] = case.healthy.as_mut().unwrap();
        live.alarms.push("H110 of the live one".to_owned());
        recorded.alarms.push("H110 of the recording".to_owned());
        recorded.notes.push("X505 of the recording".to_owned());
        let mut tally = Tally::new(options);
        tally.add(&case);
        let report = tally.report().healthy;
        let recorded =
            ["seed 3: H110 of the recording", "seed 3: X505 of the recording"].map(str::to_owned);
        match capture_only {
            false => {
                assert_eq!(report.alarms, ["seed 3: H110 of the live one"]);
                assert_eq!(report.alarms_capture, recorded);
            }
            // Then they are the ones that are judged, and told once.
            true => {
                assert_eq!(report.alarms, recorded);
                assert!(report.alarms_capture.is_empty(), "{:?}", report.alarms_capture);
            }
        }
    }
}

#[test]
fn a_perturbed_plant_is_judged_like_any_other() {
    for perturb in Perturbation::ALL {
        let options = ScoreOptions { perturb: Some(perturb), ..ScoreOptions::default() };
        let mut tally = Tally::new(options);
        for seed in 1..7 {
            tally.add(&run_case(seed, &options));
        }
        let report = tally.report();
        assert_eq!(report.perturbed.as_deref(), Some(perturb.name()));
        assert!(report.effective_cases >= 3, "{perturb}: {:?}", report.unplayable);
    }
}

#[test]
fn a_cause_that_a_set_admits_leaves_the_same_frames_on_drawn_lines() {
    let mut tried = BTreeMap::new();
    for fault in [
        FaultName::DeviceOff,
        FaultName::EbusOverload,
        FaultName::NicDamaged,
        FaultName::ReceiverDamaged,
    ] {
        let options =
            ScoreOptions { fault: Some(fault), proves_sets: true, ..ScoreOptions::default() };
        for seed in 1..7 {
            let case = run_case(seed, &options);
            for trial in case.faults.iter().filter_map(|fault| fault.set_trial.as_ref()) {
                let is_same = matches!(trial.outcome, SetOutcome::Same(1_000..));
                assert!(is_same, "{}: {trial:?}", case.replay());
                *tried.entry(trial.set.clone()).or_insert(0) += 1;
            }
        }
    }
    assert!(tried.values().sum::<u32>() > 8 && tried.len() > 2, "{tried:?}");
}
