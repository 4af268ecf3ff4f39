//! The steps that use the product as its user does: demo, stories, swarm.

use std::path::PathBuf;

use anyhow::Result;

use super::cargo::cargo;
use super::{Context, Outcome};

/// The release binary.
pub(super) fn binary(context: &Context<'_>) -> PathBuf {
    context.target.join("release/linesman")
}

/// Builds it; what follows needs it.
pub(super) fn release(context: &Context<'_>) -> Result<Outcome> {
    let ran = context
        .command("release", cargo(), &["build", "--release", "--package=linesman-cli"])
        .run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    let ran = context.command("version", binary(context), &["--version"]).limit(10).run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    Ok(Outcome::Passed { count: 0, note: ran.output.trim().to_owned() })
}

/// Builds the binary unless the step before has just done so.
pub(super) fn built(context: &Context<'_>) -> Result<Option<Outcome>> {
    match release(context)? {
        Outcome::Passed { .. } => Ok(None),
        failed @ (Outcome::Failed { .. } | Outcome::Skipped(_)) => Ok(Some(failed)),
    }
}

/// Draws plants, breaks them, and holds the verdict against the truth.
pub(super) fn demo(context: &Context<'_>) -> Result<Outcome> {
    if let Some(failed) = built(context)? {
        return Ok(failed);
    }
    let mut failed = Vec::new();
    let mut why = String::new();
    for seed in 1..=context.options.demo_seeds {
        let arguments = ["demo", "--seed", &seed.to_string()];
        let log = format!("demo-{seed}");
        let ran = context.command(&log, binary(context), &arguments).limit(120).run()?;
        if !ran.success() {
            failed.push(seed);
            why = ran.explain();
        }
    }
    let count = context.options.demo_seeds - failed.len() as u64;
    if failed.is_empty() {
        return Ok(Outcome::Passed { count, note: "plants, seeds from 1".into() });
    }
    Ok(Outcome::Failed { count, why: format!("seeds {failed:?}; {why}") })
}

/// Every story in `scenarios/`.
pub(super) fn stories(context: &Context<'_>) -> Result<Outcome> {
    if let Some(failed) = built(context)? {
        return Ok(failed);
    }
    let mut stories = Vec::new();
    for entry in std::fs::read_dir(context.root.join("scenarios"))? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".md") && name != "README.md" {
            stories.push(name);
        }
    }
    stories.sort();
    // Stories about devices from their makers' files need those.
    if context.data.is_none() {
        let needs_data = |name: &String| {
            let text = std::fs::read_to_string(context.root.join("scenarios").join(name));
            text.is_ok_and(|text| text.contains("$LINESMAN_DATA/"))
        };
        for name in stories.extract_if(.., |name| needs_data(name)) {
            let line = format!("SKIPPED: scenarios/{name}: no device data; set LINESMAN_DATA");
            eprintln!("{line}");
            context.note_skip(&line);
        }
    }
    let mut failed = Vec::new();
    let mut why = String::new();
    for name in &stories {
        let path = format!("scenarios/{name}");
        let log = format!("story-{}", name.trim_end_matches(".md"));
        let ran =
            context.command(&log, binary(context), &["lab", "run", &path]).limit(120).run()?;
        if !ran.success() {
            failed.push(name.as_str());
            why = ran.explain();
        }
    }
    let count = (stories.len() - failed.len()) as u64;
    match (stories.is_empty(), failed.is_empty()) {
        (true, _) => Ok(Outcome::Failed { count, why: "no story in scenarios/".into() }),
        (false, true) => Ok(Outcome::Passed { count, note: "stories".into() }),
        (false, false) => {
            Ok(Outcome::Failed { count, why: format!("{}; {why}", failed.join(", ")) })
        }
    }
}

/// Many seeded runs with conditions that must hold in each.
pub(super) fn swarm(context: &Context<'_>) -> Result<Outcome> {
    if let Some(failed) = built(context)? {
        return Ok(failed);
    }
    let seeds = context.options.swarm_seeds;
    let range = format!("0..{seeds}");
    let ran = context
        .command("swarm", binary(context), &["lab", "swarm", "--seeds", &range])
        .limit(900)
        .run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    let last = ran.output.lines().rev().find(|line| !line.trim().is_empty());
    let last = last.unwrap_or_default().trim();
    Ok(Outcome::Passed { count: seeds, note: format!("seeds; {last}") })
}

/// Single faults of which cause and place must be right, of 100, causes that no evidence can tell
/// apart counted: the upper end of the 95 % interval must reach it. The seeds differ with each commit;
/// where 97 of 100 are right, 200 seeds of chance miss it once in some thousand commits.
const SCORE_FLOOR: &str = "95";

/// How often the diagnosis is right, on seeds that belong to this commit alone.
pub(super) fn score(context: &Context<'_>) -> Result<Outcome> {
    if let Some(failed) = built(context)? {
        return Ok(failed);
    }
    let seeds = context.options.score_seeds;
    let fresh = seeds.to_string();
    let arguments = ["lab", "score", "--fresh", &fresh, "--floor", SCORE_FLOOR, "--no-repairs"];
    let ran = context.command("score", binary(context), &arguments).limit(1_800).run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    let live = ran.output.lines().find(|line| line.starts_with("live "));
    let shares = live.unwrap_or_default().split_whitespace().skip(1).step_by(2);
    let names = ["place", "cause", "place with sets", "cause with sets"];
    let shares: Vec<String> =
        names.iter().zip(shares).map(|(name, share)| format!("{name} {share} %")).collect();
    Ok(Outcome::Passed { count: seeds, note: format!("seeds; {}", shares.join(", ")) })
}
