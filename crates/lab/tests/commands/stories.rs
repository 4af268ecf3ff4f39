//! All stories of `scenarios/` come out as they are told.

#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a test reads files")]

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use linesman_lab::story::{Asserts, Expectation, SegmentText, Step, Story, What, play};
use linesman_sim::fault::KINDS;
use linesman_sim::segment_file::{DescriptionFiles, FaultEntry, SegmentFile};

fn scenarios() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

fn stories() -> Vec<PathBuf> {
    let entries = fs::read_dir(scenarios()).unwrap().map(|entry| entry.unwrap().path());
    let is_story = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    let mut files: Vec<PathBuf> = entries.filter(is_story).collect();
    files.sort();
    files
}

/// What stands for the directory of device data in a story.
const DATA: &str = "$LINESMAN_DATA/";

/// Files beside the stories, and device data.
struct Beside;

impl DescriptionFiles for Beside {
    fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        let path = match name.strip_prefix(DATA) {
            Some(rest) => data().join(rest),
            None => scenarios().join(name),
        };
        fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))
    }
}

fn data() -> PathBuf {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("LINESMAN_DATA").map_or_else(beside, PathBuf::from)
}

/// Each kind of fault has a story that looks at what it leaves on the segment itself: counters, links,
/// states, working counters, frames.
#[test]
fn every_kind_of_fault_has_a_physics_story() {
    let mut told = BTreeSet::new();
    for path in stories().iter().filter(|path| path.to_string_lossy().contains("/physics-")) {
        let story = Story::parse(&fs::read_to_string(path).unwrap()).unwrap();
        let SegmentText::Inline(segment) = &story.segment else { continue };
        let built_in =
            SegmentFile::parse_with(segment, &Beside).map_or(Vec::new(), |file| file.faults);
        let mut open: BTreeSet<String> = built_in.into_iter().map(|fault| fault.kind).collect();
        for step in &story.steps {
            match &step.step {
                Step::Inject { entry, .. } => {
                    open.insert(toml::from_str::<FaultEntry>(entry).unwrap().kind);
                }
                // Only what was looked at behind it counts as told.
                Step::Expect { what: Expectation::Assertion(_), .. } => told.append(&mut open),
                Step::Wait
                | Step::Heal(_)
                | Step::Unplug(_)
                | Step::Plug { .. }
                | Step::Write { .. }
                | Step::Expect { .. } => {}
            }
        }
    }
    let names = KINDS.iter().map(|kind| kind.name.name());
    let missing: Vec<&str> = names.filter(|name| !told.contains(*name)).collect();
    assert_eq!(missing, Vec::<&str>::new(), "have no story in scenarios/physics-*.md");
}

/// Stories of the segment alone say so, and all others name cause and place of what they tell, or expect that nothing is said.
#[test]
fn every_story_of_the_diagnosis_expects_cause_and_place() {
    let mut vague = Vec::new();
    for path in stories() {
        let story = Story::parse(&fs::read_to_string(&path).unwrap()).unwrap();
        if story.front.asserts == Asserts::Segment {
            continue;
        }
        let expectations = || {
            story.steps.iter().filter_map(|step| {
                if let Step::Expect { what, .. } = &step.step { Some(what) } else { None }
            })
        };
        let names_both = expectations().any(|what| {
            matches!(
                what,
                Expectation::Finding { what: What::Cause(_), place: Some(_) }
                    | Expectation::Candidate { .. }
            )
        });
        let is_silent = !expectations().any(|what| {
            matches!(
                what,
                Expectation::Verdict(_) | Expectation::Finding { .. } | Expectation::Findings(1..)
            )
        });
        let says_so = expectations()
            .any(|what| matches!(what, Expectation::NoFinding(None) | Expectation::Healthy));
        if !(names_both || is_silent && says_so) {
            vague.push(path.file_name().unwrap().to_string_lossy().into_owned());
        }
    }
    assert!(vague.is_empty(), "no cause with its place is expected in {vague:?}");
}

#[test]
fn every_story_comes_out_as_it_is_told() {
    let only = std::env::var("STORY").ok();
    let only = only.as_deref();
    let mut files = stories();
    files.retain(|path| only.is_none_or(|only| path.to_string_lossy().contains(only)));
    assert!(files.len() >= 12 || only.is_some(), "only {} stories found", files.len());
    let mut failed = Vec::new();
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        if text.contains(DATA) && !data().is_dir() {
            eprintln!("SKIPPED: {}: no device data; set LINESMAN_DATA", file.display());
            continue;
        }
        let story =
            Story::parse(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let report = play(&story, &Beside);
        if !report.held() {
            failed.push(format!("{}: {report}", file.file_name().unwrap().to_string_lossy()));
        }
    }
    assert!(
        failed.is_empty(),
        "{} of {} stories:\n{}",
        failed.len(),
        files.len(),
        failed.join("\n")
    );
}
