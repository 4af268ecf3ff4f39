//! The step that runs the swarm beside each habit of other MainDevices: nothing may break, and the diagnosis, which
//! only listens, may name no more places where no fault is than it does today.

use std::collections::BTreeSet;

use anyhow::Result;

use super::product::{binary, built};
use super::{Context, Outcome};

/// Seeds of each habit.
const SEEDS: &str = "0..40";
/// How many that are.
const COUNT: usize = 40;
/// How long one habit may take, in seconds.
const LIMIT: u64 = 60;

/// Habits, and how many findings of their swarm name a place without a fault. A number may only fall: the step says when
/// one can be lowered.
const WRONG_PLACES: [(&str, usize); 6] = [
    ("process-data", 11),
    ("states", 4),
    ("links", 3),
    ("counters", 2),
    ("clearing", 4),
    ("soem", 6),
];

/// How the swarm marks a finding whose place has no fault.
const WRONG_PLACE: &str = " has no fault there";
/// What is at the beginning of each thing that a seed has violated.
const VIOLATION: &str = "       at ";

/// A swarm beside each habit.
pub(super) fn run(context: &Context<'_>) -> Result<Outcome> {
    if let Some(failed) = built(context)? {
        return Ok(failed);
    }
    let (mut count, mut failures, mut notes) = (0, Vec::new(), Vec::new());
    for (habit, most) in WRONG_PLACES {
        let log = format!("habits-{habit}");
        let arguments = ["lab", "swarm", "--seeds", SEEDS, "--habit", habit];
        let ran = context.command(&log, binary(context), &arguments).limit(LIMIT).run()?;
        let swarm = Swarm::read(&ran.output);
        match swarm.judge(most) {
            Ok(note) => {
                count += COUNT as u64;
                notes.extend(note.map(|note| format!("{habit}: {note}")));
            }
            Err(why) => failures.push(format!("{habit}: {why}; {}", ran.status_line())),
        }
    }
    if !failures.is_empty() {
        return Ok(Outcome::Failed { count, why: failures.join("\n") });
    }
    notes.insert(0, format!("seeds beside {} habits", WRONG_PLACES.len()));
    Ok(Outcome::Passed { count, note: notes.join("; ") })
}

/// What a swarm printed.
#[derive(Default)]
struct Swarm {
    /// It came to its end with all seeds.
    is_complete: bool,
    /// Findings at places without a fault, each with its seed.
    wrong_places: BTreeSet<String>,
    /// Anything else that must not be.
    broken: Vec<String>,
}

impl Swarm {
    fn read(output: &str) -> Self {
        let mut swarm = Self::default();
        let mut seed = "";
        for line in output.lines() {
            if let Some((_, rest)) = line.split_once(" seed ") {
                seed = rest.split_whitespace().next().unwrap_or_default();
            }
            swarm.is_complete |= line.starts_with(&format!("{COUNT} seeds run,"));
            let Some(violation) = line.strip_prefix(VIOLATION) else { continue };
            let finding = violation.split_once(" s: ").map_or(violation, |(_, finding)| finding);
            match finding.split_once(WRONG_PLACE) {
                Some((finding, _)) => {
                    swarm.wrong_places.insert(format!("seed {seed}: {finding}"));
                }
                None => swarm.broken.push(format!("seed {seed}: {finding}")),
            }
        }
        swarm
    }

    /// Whether it is as good as it was: a note when it is better, else what is worse.
    fn judge(&self, most: usize) -> Result<Option<String>, String> {
        if let Some(broken) = self.broken.first() {
            return Err(format!("{} violations, the first: {broken}", self.broken.len()));
        }
        if !self.is_complete {
            return Err("the swarm did not come to its end".to_owned());
        }
        let wrong = self.wrong_places.len();
        if wrong > most {
            let all: Vec<&str> = self.wrong_places.iter().map(String::as_str).collect();
            return Err(format!(
                "{wrong} findings at places without a fault, at most {most} before: {}",
                all.join(", ")
            ));
        }
        Ok((wrong < most).then(|| format!("lower WRONG_PLACES to {wrong}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAILED: &str = "\
ok   seed    3   10 SubDevices  device-off in T2
FAIL seed    4   17 SubDevices  link-open at T2.B-T3.A | device-off in T12
       at 4.654000 s: F3 H102 device-off at 4 has no fault there (opened at 0.39 s); injected so far: link-open
       at 8.842000 s: F3 H102 device-off at 4 has no fault there (opened at 0.39 s); injected so far: link-open
       at 8.842000 s: F4 H102 device-off at 5 has no fault there (opened at 0.39 s); injected so far: link-open
       again: linesman lab swarm --seeds 4..5 --habit soem
40 seeds run, 1 failed; in 40 a fault had an effect.
";

    #[test]
    fn findings_at_wrong_places_are_counted_once_each() {
        let swarm = Swarm::read(FAILED);
        assert_eq!(swarm.judge(2), Ok(None));
        assert_eq!(swarm.judge(3), Ok(Some("lower WRONG_PLACES to 2".to_owned())));
        let why = swarm.judge(1).unwrap_err();
        assert!(why.contains("seed 4: F4 H102 device-off at 5"), "{why}");
    }

    #[test]
    fn broken_invariant_or_missing_end_fails_whatever_the_count() {
        let broken = FAILED.replace(
            "       again",
            "       at 9.0 s: T3 is still in SAFEOP 10 s after the fault was healed\n       again",
        );
        let why = Swarm::read(&broken).judge(9).unwrap_err();
        assert!(why.contains("T3 is still in SAFEOP"), "{why}");
        let cut = FAILED.replace("40 seeds run", "thread 'main' panicked");
        assert!(Swarm::read(&cut).judge(9).unwrap_err().contains("end"));
    }
}
