//! Programs in the guide are those of the examples: `docs/guide/coming-from.md` has each between a line
//! `<!-- code: FILE REGION -->` and the end of its block. `LINESMAN_WRITE_PAGES=1` writes them there.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const BEGIN: &str = "<!-- code: ";

fn crate_folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The lines of a region of an example.
fn region(file: &str, name: &str) -> String {
    let path = crate_folder().join(file);
    let text = fs::read_to_string(&path).unwrap();
    let begin = format!("// region: {name}");
    let lines = text.lines().skip_while(|line| *line != begin).skip(1);
    let lines: Vec<&str> = lines.take_while(|line| *line != "// endregion").collect();
    assert!(!lines.is_empty(), "{}: no region {name}", path.display());
    lines.join("\n")
}

/// The page with the code of all regions, and how many it has.
fn with_code(page: &str) -> (String, usize) {
    let (mut lines, mut written, mut count) = (page.lines(), Vec::new(), 0);
    while let Some(line) = lines.next() {
        written.push(line.to_owned());
        let Some(of) = line.strip_prefix(BEGIN).and_then(|rest| rest.strip_suffix(" -->")) else {
            continue;
        };
        let (file, name) = of.split_once(' ').unwrap();
        assert_eq!(lines.next(), Some("```rust"), "the code of {of} begins behind it");
        lines.by_ref().find(|line| *line == "```").unwrap();
        written.push(format!("```rust\n{}\n```", region(file, name)));
        count += 1;
    }
    (written.join("\n") + "\n", count)
}

#[test]
fn programs_of_the_guide_are_those_of_the_examples() {
    let path = Path::new(&crate_folder()).join("../../docs/guide/coming-from.md");
    let page = fs::read_to_string(&path).unwrap();
    let (wanted, count) = with_code(&page);
    assert_eq!(count, 8);
    if std::env::var_os("LINESMAN_WRITE_PAGES").is_some() {
        fs::write(&path, wanted).unwrap();
    } else {
        let write = "LINESMAN_WRITE_PAGES=1 cargo test -p linesman --test guide";
        assert!(page == wanted, "{} is stale: run `{write}`", path.display());
    }
}

#[test]
fn pysoem_programs_of_the_guide_parse_and_use_names_that_there_are() {
    let page = crate_folder().join("../../docs/guide/coming-from.md");
    // Where pysoem is installed for interop, its Python checks the names, too.
    let python = std::env::var_os("LINESMAN_PYTHON").unwrap_or_else(|| "python3".into());
    let script = crate_folder().join("tests/pysoem_names.py");
    let Ok(run) = Command::new(&python).arg(script).arg(page).output() else {
        eprintln!("skipped: no {}", python.display());
        return;
    };
    let (said, error) =
        (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success() && said.starts_with("3 blocks"), "{said}{error}");
    eprint!("{said}");
}
