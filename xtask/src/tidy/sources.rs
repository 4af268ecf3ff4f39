//! References to sources have a key in `docs/SOURCES.md`: a heading with the name that the reference uses.

use std::collections::BTreeSet;

use super::code;
use crate::files::TextFile;

/// The file with the keys.
const KEYS: &str = "docs/SOURCES.md";

/// Publishers whose documents have numbers: what stands in front of the number.
const PUBLISHERS: &[&str] = &["ETG.", "IEEE ", "IEC ", "ISO ", "RFC ", "CiA ", "NAMUR "];

/// References without a key.
pub(super) fn check(files: &[TextFile], broken: &mut Vec<String>) {
    let Some(sources) = files.iter().find(|file| file.path == KEYS) else {
        broken.push(format!("{KEYS}: it is not there"));
        return;
    };
    let keys: BTreeSet<&str> = sources.text.lines().filter_map(key).collect();
    for file in files.iter().filter(|file| is_checked(&file.path)) {
        let mut fenced = false;
        for (number, line) in file.text.lines().enumerate() {
            fenced ^= file.path.ends_with(".md") && line.trim_start().starts_with("```");
            for reference in references(&file.path, line, fenced) {
                if !keys.contains(reference.as_str()) {
                    let at = format!("{}:{}", file.path, number + 1);
                    broken.push(format!("{at}: the source {reference} has no key in {KEYS}"));
                }
            }
        }
    }
}

/// The key that a heading is.
fn key(line: &str) -> Option<&str> {
    line.strip_prefix("### ").map(str::trim)
}

/// Code and documents; not the keys themselves and not the bad examples of the tests below.
fn is_checked(path: &str) -> bool {
    let kinds = [".rs", ".md", ".toml", ".py"];
    let own = [KEYS, "xtask/src/tidy/sources.rs"];
    kinds.iter().any(|kind| path.ends_with(kind)) && !own.contains(&path)
}

/// The keys that a line refers to.
fn references(path: &str, line: &str, fenced: bool) -> Vec<String> {
    let mut found = Vec::new();
    for publisher in PUBLISHERS {
        let numbers = line.match_indices(publisher).filter_map(|(at, _)| {
            let begins = !line[..at].ends_with(|letter: char| letter.is_ascii_alphanumeric());
            document(&line[at + publisher.len()..]).filter(|_| begins)
        });
        found.extend(numbers.map(|number| format!("{publisher}{number}")));
    }
    let prose = prose(path, line, fenced);
    found.extend(sheets(prose).map(str::to_owned));
    if prose.match_indices("facts").any(|(at, word)| is_section(&prose[at + word.len()..])) {
        found.push("facts".to_owned());
    }
    if has_word(prose, "SSC") {
        found.push("SSC".to_owned());
    }
    found
}

/// The number of a document, such as `1000.4` or `61800-7-201`.
fn document(rest: &str) -> Option<&str> {
    let is_part = |letter: char| letter.is_ascii_digit() || letter == '.' || letter == '-';
    let end = rest.find(|letter| !is_part(letter)).unwrap_or(rest.len());
    Some(rest[..end].trim_end_matches(['.', '-'])).filter(|number| !number.is_empty())
}

/// What a line says in words: comments of Rust and Python, Markdown outside of code, and the column of references in the
/// register table, whose texts begin with the name of the source.
fn prose<'a>(path: &str, line: &'a str, fenced: bool) -> &'a str {
    if path.ends_with(".rs") {
        let (code, comment) = code::split_comment(line);
        let quoted = code.rsplit('"').nth(1).filter(|text| names_chapter(text));
        return quoted.unwrap_or(comment);
    }
    match path.ends_with(".md") {
        true if fenced => "",
        true => line,
        false => line.split_once('#').map_or("", |(_, comment)| comment),
    }
}

/// A text such as `S2 2.4.3`.
fn names_chapter(text: &str) -> bool {
    let chapter = text.strip_prefix('S').and_then(|rest| rest.split_once(' '));
    chapter.is_some_and(|(sheet, chapter)| {
        sheet.parse::<u8>().is_ok() && chapter.starts_with(|letter: char| letter.is_ascii_digit())
    })
}

/// Words that are `S` and a digit.
fn sheets(text: &str) -> impl Iterator<Item = &str> {
    // Names of devices are put into backticks or are part of a longer name.
    let words =
        text.split(|letter: char| !(letter.is_ascii_alphanumeric() || "_-`.\"".contains(letter)));
    words.map(|word| word.trim_matches('.')).filter(|word| {
        word.len() == 2 && word.starts_with('S') && word.ends_with(|end: char| end.is_ascii_digit())
    })
}

/// What follows the word is a section or the name of a file: `3.5`, `` ` 2 ``, `, 2.10`, `/esc.md`, ` on redundancy`.
fn is_section(rest: &str) -> bool {
    let rest = rest.trim_start_matches(['`', ',']);
    rest.strip_prefix(' ').is_some_and(|rest| {
        rest.starts_with(|letter: char| letter.is_ascii_digit()) || rest.starts_with("on ")
    }) || rest.starts_with('/')
}

fn has_word(text: &str, word: &str) -> bool {
    text.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_').any(|is| is == word)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken(path: &str, text: &str) -> Vec<String> {
        let keys = "# Sources\n\n### S2\n\nThe data sheet.\n\n### ETG.1000.4\n\n### facts\n";
        let files = [TextFile::new(KEYS, keys), TextFile::new(path, text)];
        let mut broken = Vec::new();
        check(&files, &mut broken);
        broken
    }

    #[test]
    fn references_with_a_key_pass() {
        for text in [
            "//! Reference: S2 2.4.1; ETG.1000.4 §6.1.2.\n",
            "register(\"AL status\", 0x0130, 2, Read, Read, \"S2 2.5.2\")\n",
            "// (`facts` 3.1)\n",
        ] {
            assert_eq!(broken("crates/a/src/b.rs", text), Vec::<String>::new(), "{text}");
        }
    }

    #[test]
    fn reference_without_a_key_is_found() {
        for (path, text, source) in [
            ("crates/a/src/b.rs", "//! Reference: S7 2.4.1.\n", "S7"),
            ("crates/a/src/b.rs", "register(1, \"S9 2.5.2\")\n", "S9"),
            ("crates/a/src/b.rs", ".fact(\"see\", \"ETG.1020, table 3\")\n", "ETG.1020"),
            ("docs/a.md", "as in ETG.1000.5 and S2\n", "ETG.1000.5"),
            ("docs/a.md", "by RFC 3339.\n", "RFC 3339"),
            ("crates/a/src/b.rs", "/// As the SSC does.\n", "SSC"),
        ] {
            let expected = format!("{path}:1: the source {source} has no key in {KEYS}");
            assert_eq!(broken(path, text), [expected]);
        }
    }

    #[test]
    fn devices_called_like_a_sheet_are_no_references() {
        assert_eq!(broken("scenarios/a.md", "```segment\nK1 > S1\n```\n"), Vec::<String>::new());
        assert_eq!(broken("crates/a/tests/b.rs", "let star = [(\"S1\", \"D\")];\n"), [""; 0]);
        assert_eq!(broken("docs/a.md", "the drive `S1` and S1.B\n"), [""; 0]);
    }
}
