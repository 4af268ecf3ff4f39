//! Kinds of test: the proof letters of a row that a test can meet.
//!
//! The kind follows from where a test stands and from what it uses, so that it cannot be claimed of a test that
//! shows something else: U is a test that makes no segment, S one on a virtual segment, P one that reads a recording, V one
//! between processes over a virtual cable.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// The letters in the order of the requirements, without H: no test has hardware.
const LETTERS: [char; 4] = ['U', 'S', 'P', 'V'];
/// Crates whose tests of the public surface all make a segment.
const SEGMENT_CRATES: &[&str] = &["sim", "maindevice", "lab", "session"];
/// Uses by which a test of another crate makes a segment.
const SEGMENT: &[&str] = &[
    "sim:",
    "\"sim\"",
    "\"lab\"",
    "\"demo\"",
    "Running::",
    "Segment::",
    "SegmentFile::",
    "linesman::open(",
];
/// Uses by which a test reads a recording of real or virtual frames.
const RECORDING: &[&str] = &[".pcap", "/pcap", "\"pcap\"", "real_captures(", "captures("];
/// Uses by which frames of a file are written by hand.
const HAND_MADE: &[&str] = &["Pcap::"];
/// Uses by which a test of the command line has a cable between two processes.
const CABLE: &[&str] = &["beside_segment(", "type veth"];

/// Letters of U, S, P, V.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub(crate) struct Kinds(BTreeSet<char>);

impl Kinds {
    /// The letters of a text; `Err` is the first that is none.
    pub(crate) fn of(letters: &str) -> Result<Self, char> {
        let is_other = |letter: &char| !LETTERS.contains(letter) && !letter.is_whitespace();
        match letters.chars().find(is_other) {
            Some(other) => Err(other),
            None => Ok(Self(letters.chars().filter(|letter| !letter.is_whitespace()).collect())),
        }
    }

    pub(crate) fn contains(&self, letter: char) -> bool {
        self.0.contains(&letter)
    }

    /// The first letter that `other` has not.
    fn beyond(&self, other: &Self) -> Option<char> {
        self.0.difference(&other.0).next().copied()
    }
}

impl fmt::Display for Kinds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for letter in LETTERS.iter().filter(|letter| self.0.contains(letter)) {
            write!(f, "{letter}")?;
        }
        Ok(())
    }
}

/// What a test can show.
#[derive(Debug, Eq, PartialEq)]
pub(crate) struct Ability {
    /// What it shows unless its annotation says otherwise.
    usual: Kinds,
    /// What its annotation may say.
    possible: Kinds,
}

impl Ability {
    fn new(usual: &str, more: &str) -> Self {
        let set = |letters: &str| Kinds(letters.chars().collect());
        Self { usual: set(usual), possible: set(&format!("{usual}{more}")) }
    }

    /// Of a story: it runs on a virtual segment.
    pub(crate) fn of_story() -> Self {
        Self::new("S", "")
    }

    /// Of a check in `interop/`: programs on two ends of a virtual cable, one of which is the segment.
    pub(crate) fn of_interop() -> Self {
        Self::new("SV", "")
    }

    /// Of the Rust test `name` in the file at `path`.
    pub(crate) fn of_rust(path: &str, text: &str, name: &str) -> Self {
        let reach = reach(text, name);
        let uses = |words: &[&str]| words.iter().any(|word| reach.contains(word));
        let recording = if uses(RECORDING) && !uses(HAND_MADE) { "P" } else { "" };
        let mut parts = path.split('/').skip(1);
        let crate_name = parts.next().unwrap_or_default();
        if parts.next() != Some("tests") {
            return Self::new("U", recording);
        }
        if uses(CABLE) {
            return Self::new("SV", recording);
        }
        let makes_segment = SEGMENT_CRATES.contains(&crate_name) || uses(SEGMENT);
        Self::new(if makes_segment { "S" } else { "U" }, recording)
    }

    /// The kinds that an annotation claims, which may name none.
    pub(crate) fn claim(&self, named: &Kinds) -> Result<Kinds, String> {
        if named.0.is_empty() {
            return Ok(self.usual.clone());
        }
        match named.beyond(&self.possible) {
            None => Ok(named.clone()),
            Some(letter) => Err(format!(
                "a test of kind {letter} is claimed, but by its place and by what it uses this one can only be {}",
                self.possible
            )),
        }
    }
}

/// What a test does: its own text, and that of the functions and constants of its file that it uses.
fn reach(text: &str, test: &str) -> String {
    let items = items(text);
    let mut known: BTreeSet<&str> = BTreeSet::from([test]);
    let mut open = vec![test];
    let mut reached = String::new();
    while let Some(name) = open.pop() {
        for body in items.get(name).into_iter().flatten() {
            let used = items.keys().filter(|name| uses(body, name));
            open.extend(used.filter(|name| known.insert(name)));
            reached.push_str(body);
            reached.push('\n');
        }
    }
    reached
}

/// Whether a text calls this function, hands it on, or names this constant.
fn uses(text: &str, name: &str) -> bool {
    let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
    let is_constant = !name.contains(|letter: char| letter.is_lowercase());
    text.match_indices(name).any(|(at, _)| {
        let (before, after) = (&text[..at], &text[at + name.len()..]);
        let is_whole = !before.ends_with(is_part) && !after.starts_with(is_part);
        let is_handed_on = before.ends_with('(') && after.starts_with([')', ',']);
        is_whole && (is_constant || after.starts_with(['(', ':']) || is_handed_on)
    })
}

/// Functions and constants of a file by name, those of one name together; of text that rustfmt has formatted.
fn items(text: &str) -> BTreeMap<&str, Vec<String>> {
    let lines: Vec<&str> = text.lines().collect();
    let mut items: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for (index, line) in lines.iter().enumerate() {
        let Some(item) = SourceItem::at(line) else { continue };
        let length =
            lines[index..].iter().position(|line| item.ends_with(line)).map_or(1, |at| at + 1);
        let code = lines[index..index + length].iter().filter(|line| !is_comment(line));
        items.entry(item.name).or_default().push(code.copied().collect::<Vec<_>>().join("\n"));
    }
    items
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with("//")
}

/// The first line of a function or a constant.
struct SourceItem<'a> {
    name: &'a str,
    is_function: bool,
    /// The white space before it.
    indent: &'a str,
}

impl<'a> SourceItem<'a> {
    fn at(line: &'a str) -> Option<Self> {
        let start = line.trim_start();
        let indent = &line[..line.len() - start.len()];
        let start = match start.strip_prefix("pub") {
            Some(rest) => rest.split_once(' ')?.1,
            None => start,
        };
        let (is_function, rest) = match start.split_once(' ')? {
            ("fn", rest) => (true, rest),
            ("const" | "static", rest) => (false, rest),
            _ => return None,
        };
        let name = &rest[..rest.find(['(', '<', ':'])?];
        Some(Self { name, is_function, indent })
    }

    /// Whether this line, its first or a later one, is its last.
    fn ends_with(&self, line: &str) -> bool {
        match self.is_function {
            true => {
                line.strip_prefix(self.indent).is_some_and(|rest| rest == "}")
                    || line.contains(&format!("fn {}", self.name)) && line.ends_with('}')
            }
            false => line.ends_with(';'),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(path: &str, text: &str, named: &str) -> Result<String, String> {
        let ability = Ability::of_rust(path, text, "it_works");
        ability.claim(&Kinds::of(named).unwrap()).map(|kinds| kinds.to_string())
    }

    #[test]
    fn test_beside_the_code_is_a_unit_test() {
        let text = "fn it_works() {\n}\n";
        assert_eq!(kinds("crates/cli/src/a.rs", text, "").unwrap(), "U");
        let why = kinds("crates/cli/src/a.rs", text, "S").unwrap_err();
        assert!(why.contains("kind S") && why.ends_with("only be U"), "{why}");
    }

    #[test]
    fn test_that_uses_a_segment_through_helpers_is_no_unit_test() {
        let text = "const PLACE: &str =\n    \"sim:a.toml\";\n\
            impl Bench {\n    fn start(&self) {\n        run(PLACE);\n    }\n}\n\
            fn it_works() {\n    Bench.start();\n}\n";
        assert_eq!(kinds("crates/cli/tests/a.rs", text, "").unwrap(), "S");
        assert!(kinds("crates/cli/tests/a.rs", text, "U").is_err());
        let alone =
            "fn other() {\n    run(\"sim:a.toml\");\n}\nfn it_works() {\n    explain();\n}\n";
        assert_eq!(kinds("crates/cli/tests/a.rs", alone, "").unwrap(), "U");
        assert_eq!(kinds("crates/sim/tests/a.rs", alone, "").unwrap(), "S");
    }

    #[test]
    fn recording_is_claimed_by_name_and_only_where_one_is_read() {
        let text = "fn it_works() {\n    read(\"a.pcapng\");\n}\n";
        assert_eq!(kinds("crates/lab/tests/a.rs", text, "").unwrap(), "S");
        assert_eq!(kinds("crates/lab/tests/a.rs", text, "SP").unwrap(), "SP");
        assert!(kinds("crates/lab/tests/a.rs", "fn it_works() {}\n", "P").is_err());
        let by_hand = "fn it_works() {\n    write(\"a.pcap\", Pcap::new());\n}\n";
        assert!(kinds("crates/cli/tests/a.rs", by_hand, "P").is_err());
        let in_a_comment = "fn it_works() {\n    // No a.pcap is read.\n}\n";
        assert!(kinds("crates/cli/tests/a.rs", in_a_comment, "P").is_err());
    }

    #[test]
    fn only_tests_with_a_cable_are_between_processes() {
        let text = "fn it_works() {\n    beside_segment(\"\");\n}\n";
        assert_eq!(kinds("crates/cli/tests/a.rs", text, "").unwrap(), "SV");
        assert!(kinds("crates/cli/tests/a.rs", "fn it_works() {}\n", "V").is_err());
        let interop = Ability::of_interop();
        assert_eq!(interop.claim(&Kinds::of("V").unwrap()).unwrap().to_string(), "V");
        assert!(Ability::of_story().claim(&Kinds::of("V").unwrap()).is_err());
    }
}
