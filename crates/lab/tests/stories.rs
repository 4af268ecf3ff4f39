//! All stories of `scenarios/` come out as they are told.

#![allow(clippy::disallowed_methods, reason = "stories are files of the project")]

use std::fs;
use std::path::PathBuf;

use linesman_lab::story::{Story, play};

fn scenarios() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

#[test]
fn every_story_comes_out_as_it_is_told() {
    let only = std::env::var("STORY").ok();
    let only = only.as_deref();
    let mut files: Vec<PathBuf> = fs::read_dir(scenarios())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .filter(|path| only.is_none_or(|only| path.to_string_lossy().contains(only)))
        .collect();
    files.sort();
    assert!(files.len() >= 12 || only.is_some(), "only {} stories found", files.len());
    let mut failed = Vec::new();
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        let story =
            Story::parse(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let load = |name: &str| {
            fs::read_to_string(scenarios().join(name)).map_err(|error| format!("{name}: {error}"))
        };
        let report = play(&story, load);
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
