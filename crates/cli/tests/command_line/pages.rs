//! The generated pages of `docs/` say what the program says. `LINESMAN_WRITE_PAGES=1 cargo test -p
//! linesman-cli --test command_line pages` writes them anew.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::{Setup, rule};
use linesman_proto::port::Port;
use linesman_sim::device::library;
use linesman_sim::fault::{KINDS, Shape, manual};
use linesman_sim::hardware::PortKind;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

/// The pages by their path within `docs/`.
fn pages() -> BTreeMap<String, String> {
    let mut pages = BTreeMap::new();
    let mut index = String::from(
        "# Findings\n\nA page per rule; `linesman explain CODE` shows it too. Generated from the heads \
         of the rules' files.\n\n| code | name | usually | class | page |\n|---|---|---|---|---|\n",
    );
    for page in rule::catalogue() {
        let manual = page.manual();
        let file = manual_file(&manual);
        writeln!(
            index,
            "| {} | {} | {} | {} | [{file}]({file}) |",
            page.code,
            page.name,
            word(&page.severity),
            word(&page.class)
        )
        .unwrap();
        pages.insert(format!("findings/{file}"), headed(&manual));
    }
    pages.insert("findings/README.md".to_owned(), index);
    pages.insert("guide/faults.md".to_owned(), faults());
    pages.insert("guide/devices.md".to_owned(), devices());
    pages.insert("guide/segment-file.md".to_owned(), crate::support::segment_file_page::page());
    pages
}

/// What is said of all faults.
const FAULTS_HEAD: &str = "# Faults of a virtual segment\n\n\
Generated from the fault catalogue. A fault is put into a segment file as a `[[fault]]`, or onto a line that runs \
with `linesman fault SOCKET inject KIND --at PLACE KEY=VALUE …`. Each takes its `kind`, a place, the parameters of \
its kind, and when it comes:\n\n\
| key | meaning |\n|---|---|\n\
| `from_ms` | when it begins, in ms since the start of the run; at once unless said, and always at once with `linesman fault` |\n\
| `to_ms` | when it is over for good; it lasts unless said |\n\
| `for_ms` | how long it stays each time |\n\
| `at_ms` | it comes at this time, or at each of a list, in ms after its begin: `at_ms = [0, 500, 900]` |\n\
| `every_ms` | it comes again and again, from one begin to the next |\n\
| `random` | it comes by chance, by the segment's seed: `{ mean_ms = 500.0, for_ms = 20.0 }`, the mean pause and the mean stay |\n\
| `times` | how often it comes at most |\n\
| `burst` | each time it comes, it comes several times in quick succession: `{ count = 3, every_ms = 40.0 }` |\n\n\
At most one of `at_ms`, `every_ms` and `random`; with each of them `for_ms` says how long it stays. A parameter of the \
same name belongs to the kind. Places are links `K1.C-B3.A` (or one end of them), directions `K1.C>B3.A`, devices by \
name, and cards. What each fault leaves on the wires is played in `scenarios/physics-*.md`.\n";

/// A word as JSON has it.
fn word<T: serde::Serialize>(value: &T) -> String {
    serde_json::to_value(value).unwrap().as_str().unwrap().to_owned()
}

/// A rule's file name from the title of its manual.
fn manual_file(manual: &str) -> String {
    let title = manual.lines().next().unwrap_or_default();
    let letters = title.to_lowercase();
    let words: Vec<&str> =
        letters.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    format!("{}.md", words.join("-"))
}

/// A manual with its first line as heading.
fn headed(manual: &str) -> String {
    let manual = manual.trim_end();
    if manual.starts_with('#') { format!("{manual}\n") } else { format!("# {manual}\n") }
}

fn faults() -> String {
    let mut text = String::from(FAULTS_HEAD);
    for kind in KINDS {
        let place = kind.place.allowed();
        write!(text, "\n## {}\n\n{}\n\n", kind.name, kind.name.meaning()).unwrap();
        let page = manual(kind.name);
        if !page.is_empty() {
            writeln!(text, "{}\n", page.trim_end()).unwrap();
        }
        writeln!(text, "Place: {place}.").unwrap();
        if !kind.parameters.is_empty() {
            text.push_str("\n| parameter | range | unless said | meaning |\n|---|---|---|---|\n");
        }
        for parameter in kind.parameters {
            let (range, default) = shape(parameter.shape);
            let (key, meaning) = (parameter.key, parameter.meaning);
            writeln!(text, "| `{key}` | {range} | {default} | {meaning} |").unwrap();
        }
    }
    text
}

fn shape(shape: Shape) -> (String, String) {
    let or_nothing = |default: Option<String>| default.unwrap_or_else(|| "nothing".to_owned());
    match shape {
        Shape::Number { low, high, default } => {
            (format!("{low} to {high}"), or_nothing(default.map(|number| number.to_string())))
        }
        Shape::Whole { low, high, default } => (
            format!("{low} to {high}, whole"),
            or_nothing(default.map(|number| number.to_string())),
        ),
        Shape::Word { words } => (words.join(", "), words[0].to_owned()),
        Shape::Text => ("text".to_owned(), "nothing".to_owned()),
    }
}

fn devices() -> String {
    let mut text = String::from(
        "# Devices of the library\n\nGenerated from the library: what `type` of a `[[device]]` may \
         say, and what its ports are: Ethernet takes a cable, E-bus a neighbour on the terminal bus. \
         A device of several controllers has a line for each, and those behind the first are called \
         `NAME/2`, `NAME/3` where a place is named.\n\n| type | what it is | port A | B | C | D |\n\
         |---|---|---|---|---|---|\n",
    );
    for kind in library::types() {
        for (part, ports) in kind.ports().enumerate() {
            let (name, title) = if part == 0 { (kind.name(), kind.title()) } else { ("", "") };
            write!(text, "| {name} | {title} |").unwrap();
            for port in Port::ALL {
                let what = match ports[port] {
                    PortKind::Absent => "",
                    PortKind::Ebus => "E-bus",
                    PortKind::Mii => "Ethernet",
                };
                write!(text, " {what} |").unwrap();
            }
            text.push('\n');
        }
    }
    text
}

#[test]
fn the_pages_are_up_to_date() {
    let write = std::env::var_os("LINESMAN_WRITE_PAGES").is_some();
    let mut stale = Vec::new();
    for (name, text) in pages() {
        let path = docs().join(&name);
        if write {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, &text).unwrap();
        }
        if std::fs::read_to_string(&path).ok().as_ref() != Some(&text) {
            stale.push(name);
        }
    }
    assert!(
        stale.is_empty(),
        "{stale:?}: run `LINESMAN_WRITE_PAGES=1 cargo test -p linesman-cli --test command_line pages`"
    );
}

/// What stands between "```toml" and "```" in a page of the guide.
fn examples(page: &str) -> Vec<String> {
    let text = std::fs::read_to_string(docs().join("guide").join(page)).unwrap();
    let blocks = text.split("```toml\n").skip(1);
    blocks.map(|block| block.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn segment_files_of_the_guide_can_be_built() {
    for page in ["segment-file.md", "virtual-segment.md"] {
        let examples = examples(page);
        assert!(!examples.is_empty(), "{page} has no example");
        for example in examples {
            let file = SegmentFile::parse(&example)
                .unwrap_or_else(|error| panic!("{page}: {error}\n{example}"));
            Segment::build(&file).unwrap_or_else(|error| panic!("{page}: {error}\n{example}"));
        }
    }
}

#[test]
fn every_key_of_the_segment_file_is_explained() {
    let page = crate::support::segment_file_page::page();
    let schema = serde_json::to_value(schemars::schema_for!(SegmentFile)).unwrap();
    let mut tables = vec![&schema];
    tables.extend(schema["$defs"].as_object().unwrap().values());
    let mut keys = 0;
    for key in tables.iter().filter_map(|table| table["properties"].as_object()).flatten() {
        let row = page.lines().find(|line| line.starts_with(&format!("| `{}` |", key.0)));
        let row = row.unwrap_or_else(|| panic!("`{}` is missing", key.0));
        let meaning = row.trim_end_matches(" |").rsplit(" | ").next().unwrap();
        assert!(meaning.len() > 8, "`{}` has no meaning: {row}", key.0);
        keys += 1;
    }
    assert!(keys > 20, "{keys} keys");
}

#[test]
fn every_key_of_observation_files_is_explained() {
    let page = std::fs::read_to_string(docs().join("guide/observations.md")).unwrap();
    let schema = serde_json::to_value(schemars::schema_for!(ObservationFile)).unwrap();
    let mut tables = vec![&schema];
    tables.extend(schema["$defs"].as_object().unwrap().values());
    let keys = tables.iter().filter_map(|table| table["properties"].as_object()).flatten();
    let is_missing = |key: &&String| {
        let as_value = page.lines().any(|line| line.starts_with(&format!("{key} = ")));
        !page.contains(&format!("`{}`", key.to_lowercase()))
            && !as_value
            && key.as_str() != "closes_at"
    };
    let missing: Vec<&String> = keys.map(|(key, _)| key).filter(is_missing).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn observation_files_of_the_guide_can_be_judged() {
    let page = std::fs::read_to_string(docs().join("guide/observations.md")).unwrap();
    let files: Vec<&str> =
        page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(files.len() >= 4);
    for text in files {
        let file = ObservationFile::parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let diagnosis = file.diagnosis(Setup::default());
        assert!(!diagnosis.findings.is_empty(), "each shows something:\n{text}");
    }
}
