//! Rust code as the checks read it: line by line, without tests, comments apart.
//!
//! It relies on rustfmt: what an item opens is closed by a line with the indentation of the item.

use std::collections::BTreeSet;

use crate::files::TextFile;

/// A line of code outside tests.
pub(super) struct Line<'a> {
    /// Counted from 1.
    pub(super) number: usize,
    /// What stands before a comment.
    pub(super) code: &'a str,
}

/// Files that are compiled for tests, benchmarks or examples alone.
pub(super) struct TestFiles {
    paths: BTreeSet<String>,
}

impl TestFiles {
    /// Finds the modules that are declared behind `#[cfg(test)]`.
    pub(super) fn of(files: &[TextFile]) -> Self {
        let mut paths = BTreeSet::new();
        for file in files.iter().filter(|file| file.is_rust()) {
            let mut is_test = false;
            for line in file.text.lines() {
                if let Some(name) = is_test.then(|| module(line)).flatten() {
                    paths.insert(folder_of_modules(&file.path) + name);
                }
                is_test = line.trim() == "#[cfg(test)]";
            }
        }
        Self { paths }
    }

    /// Tests only, by its folder or by the module that declares it or one above it.
    pub(super) fn contain(&self, path: &str) -> bool {
        let folders = ["/tests/", "/benches/", "/examples/"];
        if folders.iter().any(|folder| path.contains(folder)) || path.ends_with("/tests.rs") {
            return true;
        }
        let stem = path.strip_suffix(".rs").unwrap_or(path);
        let above = stem.match_indices('/').map(|(end, _)| &stem[..end]);
        above.chain([stem]).any(|module| self.paths.contains(module))
    }
}

/// The name of a module that is declared in a file of its own.
fn module(line: &str) -> Option<&str> {
    let declaration = line.trim().strip_suffix(';')?;
    let (visibility, name) = declaration.rsplit_once("mod ")?;
    let visible = visibility.is_empty() || visibility.starts_with("pub");
    (visible && !name.contains(' ')).then_some(name)
}

/// Where the modules are that a file declares, with `/` at the end.
fn folder_of_modules(path: &str) -> String {
    let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
    match name {
        "mod.rs" | "lib.rs" | "main.rs" => format!("{folder}/"),
        _ => format!("{}/", path.trim_end_matches(".rs")),
    }
}

/// Lines of a file that are neither in an item behind `#[cfg(test)]` nor comments as a whole.
pub(super) fn lines(text: &str) -> Vec<Line<'_>> {
    let mut found = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        if line.trim() == "#[cfg(test)]" {
            skip_item(&mut lines);
            continue;
        }
        let (code, _) = split_comment(line);
        if !code.trim().is_empty() {
            found.push(Line { number: number + 1, code });
        }
    }
    found
}

/// Goes behind the item that follows an attribute.
fn skip_item<'a>(lines: &mut impl Iterator<Item = (usize, &'a str)>) {
    let first = lines.by_ref().map(|(_, line)| line);
    let mut first = first.skip_while(|line| line.trim_start().starts_with(['#', '/']));
    let Some(first) = first.next() else { return };
    let (first, _) = split_comment(first);
    if first.trim_end().ends_with([';', '}', ',']) {
        return;
    }
    let indentation = first.len() - first.trim_start().len();
    for (_, line) in lines {
        let rest = line.trim_start();
        if line.len() - rest.len() == indentation && rest.starts_with(['}', ')', ']']) {
            return;
        }
    }
}

/// What stands before `//`, and what behind it.
pub(super) fn split_comment(line: &str) -> (&str, &str) {
    let mut quoted = false;
    let mut letters = line.char_indices().peekable();
    while let Some((at, letter)) = letters.next() {
        match letter {
            '\\' => {
                letters.next();
            }
            // A quotation mark as a character opens no text.
            '\'' if line[at..].starts_with("'\"'") => {
                letters.nth(1);
            }
            '"' => quoted = !quoted,
            '/' if !quoted && line[at..].starts_with("//") => {
                return (&line[..at], &line[at + 2..]);
            }
            _ => {}
        }
    }
    (line, "")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<usize> {
        lines(text).iter().map(|line| line.number).collect()
    }

    #[test]
    fn items_behind_cfg_test_are_left_out() {
        let text = "#[cfg(test)]\nmod tests;\nfn a() {}\n#[cfg(test)]\n#[allow(b)]\nfn b() {\n    \
                    c();\n}\n// no code\nfn d() {}\n";
        assert_eq!(numbers(text), [3, 10]);
    }

    #[test]
    fn comment_behind_code_is_cut_off_but_not_an_address_in_a_text() {
        assert_eq!(split_comment("a(); // b"), ("a(); ", " b"));
        assert_eq!(split_comment("a(\"http://b\");"), ("a(\"http://b\");", ""));
        assert_eq!(split_comment("a('\"'); // b"), ("a('\"'); ", " b"));
    }

    #[test]
    fn files_of_test_modules_are_test_files_with_all_below_them() {
        let declaring = |path: &str, text: &str| TextFile::new(path, text);
        let files = [
            declaring("crates/a/src/b.rs", "#[cfg(test)]\nmod rig;\nmod c;\n"),
            declaring("crates/a/src/d/mod.rs", "#[cfg(test)]\npub(crate) mod e;\n"),
        ];
        let tests = TestFiles::of(&files);
        assert!(tests.contain("crates/a/src/b/rig.rs"));
        assert!(tests.contain("crates/a/src/b/rig/more.rs"));
        assert!(tests.contain("crates/a/src/d/e.rs"));
        assert!(tests.contain("crates/a/tests/f.rs"));
        assert!(!tests.contain("crates/a/src/b/c.rs"));
    }
}
