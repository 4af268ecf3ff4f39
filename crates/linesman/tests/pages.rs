//! The generated pages of `docs/` say what the program says. `LINESMAN_WRITE_PAGES=1 cargo test -p
//! linesman --test pages` writes them anew.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use linesman_diagnosis::rule;
use linesman_proto::port::Port;
use linesman_sim::device::library;
use linesman_sim::fault::{KINDS, PlaceRule, Shape};
use linesman_sim::hardware::PortKind;

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
    pages
}

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
    let mut text = String::from(
        "# Faults of a virtual segment\n\nGenerated from the fault catalogue. Every `[[fault]]` takes \
         `kind`, a place, `from_ms` (at once unless said), `to_ms` (it lasts unless said), and the \
         parameters of its kind.\n",
    );
    for kind in KINDS {
        let place = match kind.place {
            PlaceRule::Link => "`at`: a link, `K1.C-B3.A`",
            PlaceRule::Lines => "`at`: a link `K1.C-B3.A`, or one direction of it `K1.C>B3.A`",
            PlaceRule::ManyLines => {
                "`at`: a link `K1.C-B3.A`, one direction of it `K1.C>B3.A`, or a list of those"
            }
            PlaceRule::Line => "`at`: one direction of a link, `K1.C>B3.A`",
            PlaceRule::Device => "`device`",
            PlaceRule::Feed => "`device`, one that feeds the E-bus",
            PlaceRule::Pair => "`devices`, a list of two",
            PlaceRule::Processor => "`device`, one with a processor",
            PlaceRule::Mailbox => "`device`, one with a mailbox",
            PlaceRule::DeviceOrCard => {
                "`device`; or `at`: a card, `maindevice` (unless said) or `maindevice.B`"
            }
            PlaceRule::Devices => "`device`, or `devices` with a list",
            PlaceRule::Card => "`at`: a card, `maindevice` (unless said) or `maindevice.B`",
        };
        write!(text, "\n## {}\n\n{}\n\nPlace: {place}.\n", kind.name, kind.name.meaning()).unwrap();
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
        "{stale:?}: run `LINESMAN_WRITE_PAGES=1 cargo test -p linesman --test pages`"
    );
}
