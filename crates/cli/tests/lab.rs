//! `demo` and `lab`: what they print, and what their exit status says.

mod support;

use std::path::Path;

use support::linesman;

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
