//! Parts of real captures: what begins late or ends early has no error that the whole does not have.

#![allow(clippy::disallowed_methods, reason = "tests read files")]

use std::cell::Cell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::support::{read_some_of_capture, real_captures};
use linesman_diagnosis::report::{Diagnosis, Severity};

/// Cuts at so many places, evenly over the frames.
const CUTS: usize = 12;

/// All capture files, by name.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_capture = |path: &PathBuf| {
        let end = path.extension().and_then(|end| end.to_str());
        end.is_some_and(|end| ["pcap", "pcapng", "cap"].contains(&end))
    };
    let mut files: Vec<PathBuf> = entries.filter(is_capture).collect();
    files.sort();
    files
}

/// The frames from the one to the other, as if nobody had recorded more.
fn part(path: &Path, from: usize, to: usize) -> (Diagnosis, usize) {
    let count = Cell::new(0);
    let engine = read_some_of_capture(path, |_| {
        let number = count.replace(count.get() + 1);
        (from..to).contains(&number)
    });
    (engine.diagnosis(), count.get())
}

fn errors(diagnosis: &Diagnosis) -> BTreeSet<String> {
    let all = diagnosis.findings.iter().filter(|one| one.severity == Severity::Error);
    all.map(|one| one.code.clone()).collect()
}

#[test]
fn no_beginning_and_no_end_of_a_real_capture_has_an_error_of_its_own() {
    let Some(folder) = real_captures() else { return };
    let mut wrong = Vec::new();
    for path in files(&folder) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (whole, count) = part(&path, 0, usize::MAX);
        let known = errors(&whole);
        for cut in (1..CUTS).map(|cut| count * cut / CUTS) {
            for (from, to) in [(0, cut), (cut, count)] {
                let (diagnosis, _) = part(&path, from, to);
                if !errors(&diagnosis).is_subset(&known) {
                    let said = errors(&diagnosis);
                    wrong.push(format!("{name}, {from} to {to}: {said:?}, whole {known:?}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} parts:\n{}", wrong.len(), wrong.join("\n"));
}
