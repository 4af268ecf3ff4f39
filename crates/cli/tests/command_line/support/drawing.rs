//! Drawings as lists of elements, and the segments that are drawn.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use std::fmt::Write as _;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// An element of a drawing, with the text of its title and its own.
#[derive(Debug, Default)]
pub(crate) struct Element {
    /// Its name.
    pub(crate) name: String,
    /// Of it itself.
    attributes: Vec<(String, String)>,
    /// The text of its title.
    pub(crate) title: String,
    /// Its own text.
    pub(crate) text: String,
}

impl Element {
    fn of(start: &BytesStart<'_>) -> Self {
        let attributes = start.attributes().map(|attribute| {
            let attribute = attribute.unwrap();
            (attribute.key.as_ref().to_owned(), attribute.value.to_string())
        });
        Self {
            name: start.name().as_ref().to_owned(),
            attributes: attributes.collect(),
            title: String::new(),
            text: String::new(),
        }
    }

    /// An attribute; empty where there is none.
    pub(crate) fn get(&self, key: &str) -> &str {
        self.attributes.iter().find(|(name, _)| name == key).map_or("", |(_, value)| value.as_str())
    }

    /// Whether it has a style class.
    pub(crate) fn has_class(&self, class: &str) -> bool {
        self.get("class").split(' ').any(|one| one == class)
    }
}

/// All elements of a well-formed drawing.
pub(crate) fn elements(svg: &str) -> Vec<Element> {
    let mut reader = Reader::from_str(svg);
    let (mut all, mut open): (Vec<Element>, Vec<usize>) = (Vec::new(), Vec::new());
    loop {
        match reader.read_event().unwrap() {
            Event::Start(start) => {
                open.push(all.len());
                all.push(Element::of(&start));
            }
            Event::Empty(start) => all.push(Element::of(&start)),
            Event::Text(text) => {
                if let [.., parent, title] = open[..]
                    && all[title].name == "title"
                {
                    all[parent].title.push_str(&text);
                } else if let Some(element) = open.last() {
                    all[*element].text.push_str(&text);
                }
            }
            Event::End(_) => {
                open.pop().unwrap();
            }
            Event::Eof => break,
            Event::Decl(_) | Event::Comment(_) | Event::GeneralRef(_) => {}
            other @ (Event::CData(_) | Event::PI(_) | Event::DocType(_)) => {
                panic!("{other:?} in a drawing")
            }
        }
    }
    assert!(open.is_empty(), "elements are left open");
    all
}

/// A segment of so many SubDevices in a line.
pub(crate) fn line(len: usize) -> String {
    let mut text = "name = \"plant\"\n".to_owned();
    for no in 1..=len {
        let on = if no == 1 { "maindevice".to_owned() } else { format!("B{}.B", no - 1) };
        writeln!(text, "[[device]]\nname = \"B{no}\"\ntype = \"EP2308-0001\"\non = \"{on}\"")
            .unwrap();
    }
    text
}

/// Couplers one behind another, each with terminals.
pub(crate) fn tree(couplers: usize, terminals: usize) -> String {
    let mut text = "name = \"plant\"\n".to_owned();
    for coupler in 1..=couplers {
        let on = if coupler == 1 { "maindevice".to_owned() } else { format!("K{}.C", coupler - 1) };
        writeln!(text, "[[device]]\nname = \"K{coupler}\"\ntype = \"EK1100\"\non = \"{on}\"")
            .unwrap();
        let mut on = format!("K{coupler}.B");
        for terminal in 1..=terminals {
            let name = format!("K{coupler}T{terminal}");
            writeln!(text, "[[device]]\nname = \"{name}\"\ntype = \"EL1008\"\non = \"{on}\"")
                .unwrap();
            on = format!("{name}.B");
        }
    }
    text
}

/// A junction with a branch at each port.
pub(crate) fn star() -> String {
    let mut text =
        "name = \"plant\"\n[[device]]\nname = \"J\"\ntype = \"CU1124\"\non = \"maindevice\"\n"
            .to_owned();
    for port in ["B", "C", "D"] {
        for no in 1..=4 {
            let on = if no == 1 { format!("J.{port}") } else { format!("{port}{}.B", no - 1) };
            let name = format!("{port}{no}");
            writeln!(text, "[[device]]\nname = \"{name}\"\ntype = \"EP2308-0001\"\non = \"{on}\"")
                .unwrap();
        }
    }
    text
}
