//! `demo` and `lab`: what they print, and what their exit status says.

use std::path::Path;

use tempfile::TempDir;

use crate::support::linesman;

#[test]
fn a_demo_draws_breaks_judges_and_heals() {
    let run = linesman(["demo", "--seed", "5"]);
    let text = &run.stdout;
    assert!(text.contains("Demo 5: a virtual line of"), "{}", run.all());
    let rows = text.lines().filter(|line| line.contains('─')).count();
    assert!(rows >= 25, "{rows} SubDevices are drawn: {text}");
    assert!(text.contains("All in OP after"), "{text}");
    let faults = text.matches("\n  injected ").count();
    assert!(faults >= 4, "{faults} faults: {text}");
    assert_eq!(text.matches("\n  verdict ").count(), faults);
    assert_eq!(text.matches("\n  healed ").count(), faults);
    let right = text.matches("RIGHT").count();
    let wrong = text.matches("WRONG").count();
    assert_eq!((run.status, wrong, right), (0, 0, faults), "{text}");
}

#[test]
fn the_same_seed_is_the_same_demo() {
    let [one, other] = [(); 2].map(|()| linesman(["demo", "--seed", "6"]).stdout);
    assert_eq!(one, other);
    assert_ne!(one, linesman(["demo", "--seed", "7"]).stdout);
}

#[test]
fn a_story_says_line_by_line_what_held() {
    let story = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/cut-cable.md");
    let run = linesman(["lab".as_ref(), "run".as_ref(), story.as_os_str()]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("ok   line"), "{}", run.stdout);
    assert!(run.stdout.ends_with("1 of 1 story held.\n"), "{}", run.stdout);
    let run = linesman(["lab", "run", "missing.md"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("missing.md"), "{}", run.stderr);
}

#[test]
fn a_swarm_counts_what_it_checked() {
    let run = linesman(["lab", "swarm", "--seeds", "1..3"]);
    let last = run.stdout.lines().last().unwrap_or_default();
    assert!(last.starts_with("2 seeds run, "), "{}", run.all());
    assert!(last.contains("working counters checked"), "{last}");
    assert_eq!(run.status, i32::from(run.stdout.contains("FAIL")), "{}", run.stdout);
    let run = linesman(["lab", "swarm", "--seeds", "3..3"]);
    assert_eq!(run.status, 2);
}

#[test]
fn parts_of_a_score_add_up_to_the_same_bytes_as_one_run() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let whole = linesman(["lab", "score", "--seeds", "1..7", "--json"]);
    assert_eq!(whole.status, 0, "{}", whole.all());
    for (range, name) in [("1..4", "a.json"), ("4..6", "b.json"), ("6..7", "c.json")] {
        let run = linesman(["lab", "score", "--seeds", range, "--part", &file(name)]);
        assert_eq!(run.status, 0, "{}", run.all());
    }
    let [a, b, c] = ["a.json", "b.json", "c.json"].map(file);
    let merged = linesman(["lab", "merge", &c, &a, &b, "--json"]);
    assert_eq!((merged.status, &merged.stdout), (0, &whole.stdout), "{}", merged.stderr);

    let run = linesman(["lab", "merge", &a, &c]);
    assert_eq!(run.status, 2);
    assert!(
        run.stderr.contains("ends before seed 4, the next begins with seed 6"),
        "{}",
        run.stderr
    );
    let run = linesman(["lab", "score", "--seeds", "1..2", "--part", &a]);
    assert_eq!(run.status, 2, "a part is not overwritten: {}", run.all());
    std::fs::write(&b, "{}").unwrap();
    let run = linesman(["lab", "merge", &a, &b, &c]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("b.json"), "{}", run.stderr);
}

#[test]
fn parts_of_a_swarm_add_up_to_the_same_bytes_as_one_run() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let whole = linesman(["lab", "swarm", "--seeds", "1..6"]);
    for (range, name) in [("1..3", "a.json"), ("3..6", "b.json")] {
        let run = linesman(["lab", "swarm", "--seeds", range, "--part", &file(name)]);
        assert!(run.stderr.is_empty(), "{}", run.all());
    }
    let [a, b] = ["a.json", "b.json"].map(file);
    let merged = linesman(["lab", "merge", &b, &a]);
    assert_eq!((merged.status, &merged.stdout), (whole.status, &whole.stdout), "{}", merged.stderr);
    let run = linesman(["lab", "merge", &a, &b, "--json"]);
    assert_eq!(run.status, 2, "{}", run.all());
    let run = linesman(["lab", "swarm", "--seeds", "1..3", "--part", &a]);
    assert_eq!(run.status, 2, "a part is not overwritten: {}", run.all());
    // A part of a score is none of a swarm.
    let score = file("score.json");
    let run = linesman(["lab", "score", "--seeds", "6..7", "--part", &score]);
    assert_eq!(run.status, 0, "{}", run.all());
    let run = linesman(["lab", "merge", &a, &score]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("score.json"), "{}", run.stderr);
}

#[test]
fn a_score_below_its_floor_exits_with_1_and_fresh_seeds_belong_to_the_commit() {
    let run = linesman(["lab", "score", "--fresh", "2", "--healthy", "--floor", "50"]);
    // Without a fault no fault is found.
    assert_eq!(run.status, 1, "{}", run.all());
    assert!(run.stderr.contains("expected at least 50 %"), "{}", run.stderr);
    let seeds = run.stdout.lines().next().unwrap_or_default();
    let first: u64 =
        seeds.trim_start_matches("Seeds ").split("..").next().unwrap().parse().unwrap();
    assert!(first >= 1_000_000_000, "{seeds}");
    let run = linesman(["lab", "score", "--fresh", "2", "--seeds", "1..2"]);
    assert_eq!(run.status, 2, "{}", run.all());
}

#[test]
fn healthy_lines_run_as_long_as_it_is_said() {
    let run = linesman(["lab", "score", "--healthy", "--for", "30s", "--seeds", "1..3", "--json"]);
    assert_eq!(run.status, 0, "{}", run.all());
    let hours = run.json()["healthy"]["line_hours"].as_f64().unwrap();
    assert!(hours * 3_600.0 >= 60.0, "{hours}");
}

// Of these lines the cable at the card is cut, or the first SubDevice, at which both cards of a ring hang in one, loses its supply: the recording has one
// request that did not come back, and no frame after it.
#[test]
fn recording_that_ends_in_stillness_names_the_cable_at_the_card() {
    for seed in [4_400_000_023_u64, 4_400_000_152, 4_400_000_165] {
        let seeds = format!("{seed}..{}", seed + 1);
        let run = linesman(["lab", "score", "--seeds", &seeds, "--list", "--no-repairs"]);
        assert_eq!(run.status, 0, "{}", run.all());
        assert!(!run.stdout.contains("wrong place"), "{}", run.all());
    }
}
