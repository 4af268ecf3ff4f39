//! The house rules that no other tool checks.

mod code;
mod paths;
mod registers;
mod sources;
mod type_names;

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result};
use code::TestFiles;
use toml::Table;

use crate::annotation;
use crate::files::{self, TextFile};
use crate::requirements::Requirements;

/// Lines of code in a Rust file, its unit tests not counted.
const CODE_LINES_MAX: usize = 480;
/// Lines of a Rust file with its unit tests.
const FILE_LINES_MAX: usize = 700;
/// Files that may be longer, and how long. A table may be; the others are to be split, and until
/// then must not grow beyond this.
const LONG_FILES: &[(&str, usize)] = &[("crates/proto/src/state/status_code/table.rs", 700)];

/// Words that speak of how the project came to be, or of one machine, instead of the project.
/// In halves, so that this list does not find itself.
const FORBIDDEN_WORDS: &[(&str, &str)] = &[
    ("work", "place"),
    ("arti", "factory"),
    ("T", "ODO"),
    ("FIX", "ME"),
    ("X", "XX"),
    ("LL", "M"),
];
/// The same for prose alone: code has its own good uses for them.
const FORBIDDEN_IN_PROSE: &[(&str, &str)] = &[("ses", "sions"), ("A", "I")];
/// Before "session" in prose: then it is no session of a MainDevice.
const OF_WORK: &[&str] =
    &["this", "last", "next", "previous", "earlier", "our", "every", "working"];
/// Beginnings of paths of one machine.
const FORBIDDEN_PATHS: &[(&str, &str)] =
    &[("/wo", "rk/"), ("/tmp/w", "t"), ("/tmp/br", "ief"), ("/ro", "ot/"), ("/ho", "me/")];

/// What each crate may depend on (ARCHITECTURE.md): a crate exists because of what it may not.
const MAY_DEPEND_ON: &[(&str, &[&str])] = &[
    ("proto", &[]),
    ("config", &["proto"]),
    ("maindevice", &["proto", "config"]),
    ("sim", &["proto", "config"]),
    ("diagnosis", &["proto", "config"]),
    ("capture", &["proto", "config", "diagnosis"]),
    ("session", &["proto", "config", "maindevice", "sim", "diagnosis"]),
    ("lab", &["proto", "config", "maindevice", "sim", "diagnosis", "session"]),
    ("link", &["proto"]),
    ("runtime", &["proto", "config", "maindevice", "sim", "diagnosis", "session", "link"]),
    (
        "linesman",
        &["proto", "config", "maindevice", "sim", "diagnosis", "session", "link", "runtime"],
    ),
    (
        "cli",
        &[
            "proto",
            "config",
            "maindevice",
            "sim",
            "diagnosis",
            "capture",
            "session",
            "lab",
            "link",
            "runtime",
            "linesman",
        ],
    ),
];

/// Checks all rules and prints what breaks them.
pub(crate) fn run(root: &Path) -> Result<bool> {
    let files = files::text_files(root)?;
    let mut broken = Vec::new();
    for file in &files {
        words(file, &mut broken);
        shape(file, &mut broken);
        if file.is_rust() {
            length(file, &mut broken);
            unsafety(file, &mut broken);
        }
    }
    crates(&files, &mut broken)?;
    annotations(root, &files, &mut broken)?;
    let tests = TestFiles::of(&files);
    sources::check(&files, &mut broken);
    paths::check(&files, &mut broken);
    registers::check(&files, &tests, &mut broken);
    type_names::check(&files, &tests, &mut broken)?;
    for line in &broken {
        println!("{line}");
    }
    println!("{} files, {} breaches of the house rules", files.len(), broken.len());
    Ok(broken.is_empty())
}

fn words(file: &TextFile, broken: &mut Vec<String>) {
    if file.path.ends_with("Cargo.lock") || file.path.starts_with("LICENSE") {
        return;
    }
    let prose = if file.path.ends_with(".md") { FORBIDDEN_IN_PROSE } else { &[] };
    let words = FORBIDDEN_WORDS.iter().chain(prose);
    let words: Vec<String> = words.map(|(a, b)| format!("{a}{b}")).collect();
    let paths: Vec<String> = FORBIDDEN_PATHS.iter().map(|(a, b)| format!("{a}{b}")).collect();
    for (number, line) in file.text.lines().enumerate() {
        let at = format!("{}:{}", file.path, number + 1);
        let split = || line.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_');
        let of_work = split().zip(split().skip(1)).find_map(|(before, word)| {
            let is_it = word.eq_ignore_ascii_case("session")
                && OF_WORK.iter().any(|one| one.eq_ignore_ascii_case(before));
            (is_it && !prose.is_empty()).then_some(word)
        });
        let found = split()
            .find(|word| words.iter().any(|forbidden| same_word(word, forbidden)))
            .or(of_work);
        if let Some(word) = found {
            broken.push(format!("{at}: the word {word:?} does not belong here"));
        }
        if let Some(path) = paths.iter().find(|path| line.contains(path.as_str())) {
            broken.push(format!("{at}: a path of one machine, {path:?}"));
        }
    }
}

/// Words in capitals must match as they are, the others in any case.
fn same_word(word: &str, forbidden: &str) -> bool {
    let as_is = forbidden.bytes().all(|byte| byte.is_ascii_uppercase());
    if as_is { word == forbidden } else { word.eq_ignore_ascii_case(forbidden) }
}

fn shape(file: &TextFile, broken: &mut Vec<String>) {
    if !file.text.is_empty() && !file.text.ends_with('\n') {
        broken.push(format!("{}: no newline at the end", file.path));
    }
    for (number, line) in file.text.lines().enumerate() {
        // Two spaces at the end are a line break in Markdown; better written as a paragraph.
        if line.ends_with([' ', '\t', '\r']) {
            broken.push(format!("{}:{}: white space at the end", file.path, number + 1));
        }
    }
}

fn length(file: &TextFile, broken: &mut Vec<String>) {
    let code = file.text.lines().take_while(|line| line.trim() != "#[cfg(test)]").count();
    let all = file.text.lines().count();
    let listed = LONG_FILES.iter().find(|(path, _)| *path == file.path);
    let code_max = listed.map_or(CODE_LINES_MAX, |(_, lines)| *lines);
    // A file of tests is one list of cases.
    let tests = file.path.contains("/tests/") || file.path.ends_with("/tests.rs");
    if !tests && code > code_max {
        broken.push(format!(
            "{}: {code} lines of code, at most {code_max}: one concept is one file",
            file.path
        ));
    } else if all > FILE_LINES_MAX {
        broken.push(format!("{}: {all} lines, at most {FILE_LINES_MAX}", file.path));
    }
    if !tests && !file.text.starts_with("//!") && !file.text.starts_with("#!") {
        broken.push(format!("{}: does not begin by saying what it is (`//!`)", file.path));
    }
}

fn unsafety(file: &TextFile, broken: &mut Vec<String>) {
    if file.path.starts_with("crates/link/") || file.path == "xtask/src/tidy.rs" {
        return;
    }
    for (number, line) in file.text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        let mut words = code.split(|letter: char| !letter.is_alphanumeric() && letter != '_');
        if words.any(|word| word == "unsafe") {
            broken.push(format!("{}:{}: `unsafe` outside of link", file.path, number + 1));
        }
    }
}

/// Each crate's manifest: description, lints of the house, and nothing it may not depend on.
fn crates(files: &[TextFile], broken: &mut Vec<String>) -> Result<()> {
    let manifests = files.iter().filter_map(|file| {
        let name = file.path.strip_prefix("crates/")?.strip_suffix("/Cargo.toml")?;
        Some((name, file))
    });
    for (name, file) in manifests {
        let manifest: Table = file.text.parse().with_context(|| file.path.clone())?;
        let package = manifest.get("package").and_then(|package| package.as_table());
        if package.is_none_or(|package| !package.contains_key("description")) {
            broken.push(format!("{}: no description", file.path));
        }
        if !manifest.contains_key("lints") {
            broken.push(format!("{}: does not take the lints of the workspace", file.path));
        }
        let Some((_, allowed)) = MAY_DEPEND_ON.iter().find(|(known, _)| *known == name) else {
            broken.push(format!("{}: a crate without a place in the house", file.path));
            continue;
        };
        let dependencies = manifest.get("dependencies").and_then(|table| table.as_table());
        for key in dependencies.into_iter().flat_map(|table| table.keys()) {
            let Some(other) = key.strip_prefix("linesman-") else { continue };
            if !allowed.contains(&other) {
                broken.push(format!("{}: {name} may not depend on {other}", file.path));
            }
        }
    }
    Ok(())
}

fn annotations(root: &Path, files: &[TextFile], broken: &mut Vec<String>) -> Result<()> {
    let requirements = Requirements::read(root)?;
    let ids: BTreeSet<&str> = requirements.ids();
    let (claims, errors) = annotation::claims(files);
    broken.extend(errors);
    for claim in claims.iter().filter(|claim| !ids.contains(claim.id.as_str())) {
        broken.push(format!("{}:{}: there is no row {}", claim.path, claim.line, claim.id));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(check: fn(&TextFile, &mut Vec<String>), path: &str, text: &str) -> usize {
        let mut broken = Vec::new();
        check(&TextFile::new(path, text), &mut broken);
        broken.len()
    }

    #[test]
    fn forbidden_words_are_whole_words() {
        let word = ["ses", "sion"].concat();
        assert_eq!(found(words, "a.md", &format!("in this {}.\n", word.to_uppercase())), 1);
        assert_eq!(found(words, "a.md", &format!("a {word} of a MainDevice\n")), 0);
        assert_eq!(found(words, "a.md", "obsession, procession\n"), 0);
        assert_eq!(found(words, "a.rs", &format!("let {word} = 1;\n")), 0, "code may");
        assert_eq!(found(words, "a.md", &["see /wo", "rk/x\n"].concat()), 1);
    }

    #[test]
    fn unsafe_is_for_link_alone() {
        let text = "unsafe { f() }\n";
        assert_eq!(found(unsafety, "crates/sim/src/a.rs", text), 1);
        assert_eq!(found(unsafety, "crates/link/src/a.rs", text), 0);
        assert_eq!(
            found(unsafety, "crates/sim/src/a.rs", "#![forbid(unsafe_code)] // unsafe\n"),
            0
        );
    }

    #[test]
    fn long_code_is_found_but_not_long_unit_tests() {
        let code = "//! a\n".to_owned() + &"a();\n".repeat(CODE_LINES_MAX);
        assert_eq!(found(length, "crates/a/src/b.rs", &code), 1);
        let tests = "//! a\n#[cfg(test)]\n".to_owned() + &"a();\n".repeat(CODE_LINES_MAX);
        assert_eq!(found(length, "crates/a/src/b.rs", &tests), 0);
        assert_eq!(found(length, "crates/a/src/b.rs", "fn a() {}\n"), 1);
    }

    #[test]
    fn cores_meet_only_in_frames() {
        let manifest = "[package]\ndescription = \"d\"\n[lints]\nworkspace = true\n\
                        [dependencies]\nlinesman-proto.workspace = true\n\
                        linesman-sim.workspace = true\n";
        let mut broken = Vec::new();
        crates(&[TextFile::new("crates/diagnosis/Cargo.toml", manifest)], &mut broken).unwrap();
        assert_eq!(broken, ["crates/diagnosis/Cargo.toml: diagnosis may not depend on sim"]);
    }
}
