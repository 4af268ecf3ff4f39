//! `cargo xtask check`: the checks that a small change needs, in a minute or two.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use toml::Table;

use super::{Context, Options, StepResult, cargo, dependencies, summary, take};

/// What counts as changed.
#[derive(Args)]
pub(crate) struct CheckOptions {
    /// Changed is what differs from this commit
    #[arg(long, value_name = "COMMIT")]
    since: Option<String>,
    /// Take these crates as changed, by their folders: `proto`, `xtask`
    #[arg(long, value_name = "CRATE", conflicts_with = "since")]
    only: Vec<String>,
}

/// Files outside the crates that tests of a crate read, or that are compiled into it; the first that fits counts.
const READ_BY: &[(&str, &[&str])] = &[
    ("scenarios/observations/", &["diagnosis", "cli"]),
    ("scenarios/", &["lab"]),
    ("docs/guide/", &["cli"]),
    ("docs/findings/", &["cli"]),
    ("docs/GLOSSARY.md", &["cli"]),
];

/// Files that every crate is built with.
const ALL_CRATES: &[&str] = &["Cargo.toml", "clippy.toml", ".cargo/config.toml"];

/// Checks what has changed; `false` when a step failed.
pub(crate) fn run(root: &Path, check: &CheckOptions) -> Result<bool> {
    let crates = Crates::read(root)?;
    let (changed, all_differ) = match check.only.as_slice() {
        [] => {
            let files = changed_files(root, check.since.as_deref())?;
            (crates.of_files(&files), all_differ(&files))
        }
        names => (crates.named(names)?, false),
    };
    // Installing takes longer than all the rest.
    let options = Options { no_install: true, ..Options::default() };
    let context = Context::new(root, &options)?;
    let mut rows = Vec::new();
    take("format", &mut rows, || cargo::format(&context));
    take("tidy", &mut rows, || cargo::tidy(&context));
    take("features", &mut rows, || cargo::features(&context));
    take("dependencies", &mut rows, || dependencies::run(&context));
    let dependents = crates.dependents(&changed);
    if all_differ {
        take("lints", &mut rows, || cargo::lints(&context));
    } else {
        // Each crate on its own: cargo then takes what it built the last time, whatever else has changed.
        for name in &changed {
            let package = package(name);
            take(&format!("lints {name}"), &mut rows, || cargo::lints_of(&context, &package));
        }
        if !dependents.is_empty() {
            take("dependents", &mut rows, || cargo::compile(&context, &dependents));
        }
    }
    for name in &changed {
        let package = package(name);
        take(&format!("tests {name}"), &mut rows, || cargo::tests_of(&context, &package));
    }
    let passed = summary(&rows);
    if all_differ {
        println!("\nall crates are built otherwise, and only those with changed files were tested");
    }
    report(&changed, &dependents, &rows);
    Ok(passed)
}

/// Says what was judged, and what was not.
fn report(changed: &BTreeSet<String>, dependents: &BTreeSet<String>, rows: &[StepResult]) {
    let list =
        |names: &BTreeSet<String>| names.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
    if changed.is_empty() {
        println!("\nno crate has changed");
    } else {
        println!("\nchanged: {}", list(changed));
    }
    if !dependents.is_empty() {
        println!("only compiled, not tested: {}", list(dependents));
    }
    if !rows.iter().any(StepResult::failed) {
        println!(
            "not checked: documentation, stories, demo, swarm, habits, fuzz, interop (cargo xtask test)"
        );
    }
}

/// The option by which cargo takes the crate in this folder.
fn package(folder: &str) -> String {
    match folder {
        "linesman" | "xtask" => format!("--package={folder}"),
        _ => format!("--package=linesman-{folder}"),
    }
}

/// Files that differ from a commit, and those that git does not know yet.
fn changed_files(root: &Path, since: Option<&str>) -> Result<Vec<String>> {
    let base = match since {
        Some(commit) => commit.to_owned(),
        None => shared_with_main(root)?,
    };
    let mut files = git(root, &["diff", "--name-only", "--no-renames", "-z", &base, "--"])?;
    files += &git(root, &["ls-files", "--others", "--exclude-standard", "-z"])?;
    Ok(files.split('\0').filter(|path| !path.is_empty()).map(str::to_owned).collect())
}

/// The last commit of `main` that HEAD goes back to; HEAD where there is no `main`.
fn shared_with_main(root: &Path) -> Result<String> {
    for main in ["main", "origin/main"] {
        if let Ok(commit) = git(root, &["merge-base", "HEAD", main]) {
            return Ok(commit.trim().to_owned());
        }
    }
    Ok(git(root, &["rev-parse", "HEAD"])?.trim().to_owned())
}

fn git(root: &Path, arguments: &[&str]) -> Result<String> {
    let output = Command::new("git")
        .args(arguments)
        .current_dir(root)
        .output()
        .context("start git, which says what has changed; or name crates with --only")?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!("`git {}`: {}", arguments.join(" "), said.trim());
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// A file with which all crates are built is among these.
fn all_differ(files: &[String]) -> bool {
    // A crate that takes another library changes the lock file with its manifest.
    let manifest = files.iter().any(|file| file.ends_with("/Cargo.toml"));
    let counts = |file: &str| ALL_CRATES.contains(&file) || (file == "Cargo.lock" && !manifest);
    files.iter().any(|file| counts(file))
}

/// The crates of the workspace by their folders, and on which others each depends.
struct Crates(BTreeMap<String, BTreeSet<String>>);

impl Crates {
    fn read(root: &Path) -> Result<Self> {
        let mut folders = vec![root.join("fuzz"), root.join("xtask")];
        for entry in std::fs::read_dir(root.join("crates")).context("crates")? {
            folders.push(entry?.path());
        }
        let mut crates = BTreeMap::new();
        for folder in folders {
            let manifest = folder.join("Cargo.toml");
            let Ok(text) = std::fs::read_to_string(&manifest) else { continue };
            let table = text.parse().with_context(|| manifest.display().to_string())?;
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            crates.insert(name, needs(&table));
        }
        Ok(Self(crates))
    }

    /// Those that changed with these files.
    fn of_files(&self, files: &[String]) -> BTreeSet<String> {
        files.iter().flat_map(|file| self.of_file(file)).collect()
    }

    fn of_file(&self, file: &str) -> Vec<String> {
        let path = file.strip_prefix("crates/").unwrap_or(file);
        let is_in_crate = path != file || ["fuzz/", "xtask/"].iter().any(|of| file.starts_with(of));
        if is_in_crate {
            let name = path.split('/').next().unwrap_or_default();
            // The folder of a crate that was removed is none.
            return self.0.get_key_value(name).map(|(name, _)| name.clone()).into_iter().collect();
        }
        let readers = READ_BY.iter().find(|(start, _)| file.starts_with(start));
        readers.into_iter().flat_map(|(_, crates)| *crates).map(|&name| name.to_owned()).collect()
    }

    fn named(&self, names: &[String]) -> Result<BTreeSet<String>> {
        if let Some(unknown) = names.iter().find(|name| !self.0.contains_key(*name)) {
            let all: Vec<&str> = self.0.keys().map(String::as_str).collect();
            bail!("there is no crate {unknown:?}; the crates are {}", all.join(", "));
        }
        Ok(names.iter().cloned().collect())
    }

    /// All that depend on the changed ones, also by way of others, and have not changed themselves.
    fn dependents(&self, changed: &BTreeSet<String>) -> BTreeSet<String> {
        let mut found = changed.clone();
        loop {
            let more = self.0.iter().filter(|(_, needs)| !needs.is_disjoint(&found));
            let more: BTreeSet<String> = more.map(|(name, _)| name.clone()).collect();
            if more.is_subset(&found) {
                return found.difference(changed).cloned().collect();
            }
            found.extend(more);
        }
    }
}

/// The crates of the workspace that a manifest asks for, by their folders.
fn needs(manifest: &Table) -> BTreeSet<String> {
    let tables = ["dependencies", "dev-dependencies"].iter().filter_map(|name| manifest.get(*name));
    let keys = tables.filter_map(|table| table.as_table()).flat_map(|table| table.keys());
    keys.filter_map(|key| key.strip_prefix("linesman-").map(str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    fn crates() -> Crates {
        let needs = [
            ("proto", &[][..]),
            ("sim", &["proto"]),
            ("lab", &["proto", "sim"]),
            ("cli", &["lab"]),
            ("xtask", &[]),
        ];
        Crates(needs.iter().map(|(name, needs)| ((*name).to_owned(), self::names(needs))).collect())
    }

    fn of(files: &[&str]) -> BTreeSet<String> {
        crates().of_files(&files.iter().map(|&file| file.to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn file_of_a_crate_or_read_by_its_tests_changes_that_crate() {
        assert_eq!(of(&["crates/sim/src/a.rs", "xtask/src/b.rs"]), names(&["sim", "xtask"]));
        assert_eq!(of(&["fuzz/src/a.rs"]), names(&[]), "no crate of this workspace");
        assert_eq!(of(&["scenarios/a.md", "docs/guide/b.md"]), names(&["lab", "cli"]));
        assert_eq!(of(&["README.md", "crates/gone/src/a.rs"]), names(&[]));
    }

    #[test]
    fn manifest_of_the_workspace_or_lock_file_alone_concerns_all_crates() {
        let all = |files: &[&str]| {
            all_differ(&files.iter().map(|&file| file.to_owned()).collect::<Vec<_>>())
        };
        assert!(all(&["Cargo.toml"]));
        assert!(all(&["Cargo.lock"]));
        assert!(!all(&["Cargo.lock", "crates/sim/Cargo.toml"]));
    }

    #[test]
    fn dependents_are_followed_to_the_end_without_the_changed_ones() {
        let dependents = |changed| crates().dependents(&names(changed));
        assert_eq!(dependents(&["sim"]), names(&["lab", "cli"]));
        assert_eq!(dependents(&["proto", "lab"]), names(&["cli", "sim"]));
        assert_eq!(dependents(&["xtask"]), names(&[]));
    }

    #[test]
    fn manifest_tells_what_a_crate_needs() {
        let manifest = "[dependencies]\nlinesman-proto.workspace = true\nserde = \"1\"\n\
                        [dev-dependencies]\nlinesman-sim.workspace = true\n";
        assert_eq!(needs(&manifest.parse().unwrap()), names(&["proto", "sim"]));
    }

    #[test]
    fn changed_files_are_those_of_the_branch_and_of_the_working_tree() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let write = |name: &str| std::fs::write(root.join(name), name).unwrap();
        let commit = |name: &str| {
            write(name);
            git(root, &["add", name]).unwrap();
            let who = ["-c", "user.name=a", "-c", "user.email=a@b"];
            git(root, &[&who[..], &["commit", "-qm", name]].concat()).unwrap();
        };
        git(root, &["init", "-q", "-b", "main"]).unwrap();
        commit("old");
        git(root, &["checkout", "-qb", "work"]).unwrap();
        commit("committed");
        write("new");
        assert_eq!(changed_files(root, None).unwrap(), ["committed", "new"]);
        assert_eq!(changed_files(root, Some("HEAD")).unwrap(), ["new"]);
        assert!(changed_files(root, Some("none")).is_err());
    }
}
