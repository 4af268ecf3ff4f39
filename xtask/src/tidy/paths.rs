//! Files and folders that `CONTRIBUTING.md` names are there.

use crate::files::TextFile;

/// The document that is checked.
const GUIDE: &str = "CONTRIBUTING.md";

/// Beginnings of paths from the root.
const FOLDERS: &[&str] = &["crates/", "docs/", "fuzz/", "interop/", "scenarios/", "xtask/"];

/// Paths between backticks that nothing has.
pub(super) fn check(files: &[TextFile], broken: &mut Vec<String>) {
    let Some(guide) = files.iter().find(|file| file.path == GUIDE) else {
        broken.push(format!("{GUIDE}: it is not there"));
        return;
    };
    for (number, line) in guide.text.lines().enumerate() {
        // Every second piece stands between backticks.
        for path in line.split('`').skip(1).step_by(2).filter(|quoted| is_path(quoted)) {
            let is_there = |file: &TextFile| match file.path.strip_prefix(path) {
                Some(rest) => rest.is_empty() || path.ends_with('/') || rest.starts_with('/'),
                None => false,
            };
            if !files.iter().any(is_there) {
                broken.push(format!("{GUIDE}:{}: there is no {path}", number + 1));
            }
        }
    }
}

/// A path that stands for itself: `scenarios/physics-NAME.md` is a pattern.
fn is_path(quoted: &str) -> bool {
    let is_pattern = quoted.contains([' ', '*']) || quoted.contains("NAME");
    !is_pattern && FOLDERS.iter().any(|folder| quoted.starts_with(folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_are_not_there_are_found() {
        let guide = "A file `crates/a/src/b.rs`, a folder `crates/a/src/` or `crates/a`.\n\
                     `scenarios/physics-NAME.md`, `cargo test`; `crates/a/src/c.rs`, `crates/a/s`.\n";
        let files = [TextFile::new(GUIDE, guide), TextFile::new("crates/a/src/b.rs", "")];
        let mut broken = Vec::new();
        check(&files, &mut broken);
        assert_eq!(
            broken,
            [
                format!("{GUIDE}:2: there is no crates/a/src/c.rs"),
                format!("{GUIDE}:2: there is no crates/a/s"),
            ]
        );
    }
}
