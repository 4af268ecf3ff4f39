//! XML, element by element: only the one that is being looked at is held in memory.
//!
//! A file may be hostile: depth, number of elements and length of texts are bounded, entities are
//! never expanded but for the five of XML itself.

use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::error::EsiError;
use super::value;

/// Deepest nesting; real files have 12.
const DEPTH: usize = 64;
/// Most elements of a file; the largest files of vendors have some 2 million.
const ELEMENTS: usize = 16_000_000;
/// Most attributes of an element.
const ATTRIBUTES: usize = 64;
/// Longest text of an element or attribute, in bytes.
const TEXT: usize = 1 << 20;
/// Elements whose content says nothing about the device: pictures and addresses of web pages.
const IGNORED: [&str; 7] = [
    "ImageData16x14",
    "ImageFile16x14",
    "Image16x14",
    "Bmp16x14",
    "Image",
    "URL",
    "VendorSpecificData",
];

/// An element with everything in it.
#[derive(Clone, Default, Debug)]
pub(crate) struct Element {
    pub(crate) name: String,
    /// Where it begins, from 1.
    pub(crate) line: u32,
    attributes: Vec<(String, String)>,
    text: String,
    pub(crate) children: Vec<Element>,
}

impl Element {
    /// Its text, without white space around it.
    pub(crate) fn text(&self) -> &str {
        self.text.trim()
    }

    /// An attribute, without white space around it.
    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        self.raw(name).map(str::trim)
    }

    /// An attribute as it is written.
    pub(crate) fn raw(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The first child of this name.
    pub(crate) fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.name == name)
    }

    /// All children of this name.
    pub(crate) fn children<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// The child at the end of a path such as `Info/Electrical`.
    pub(crate) fn at(&self, path: &str) -> Option<&Self> {
        path.split('/').try_fold(self, |element, name| element.child(name))
    }

    /// The text of a child; empty when it is not there.
    pub(crate) fn child_text(&self, name: &str) -> &str {
        self.child(name).map_or("", Self::text)
    }

    pub(crate) fn error(&self, reason: impl Into<String>) -> EsiError {
        EsiError::new(self.line, &self.name, reason)
    }

    /// Its text as a number.
    pub(crate) fn number<T: TryFrom<i64>>(&self) -> Result<T, EsiError> {
        value::number(self.text()).map_err(|reason| self.error(reason))
    }

    /// The text of a child as a number; `None` when it is not there or empty.
    pub(crate) fn child_number<T: TryFrom<i64>>(&self, name: &str) -> Result<Option<T>, EsiError> {
        let child = self.child(name).filter(|child| !child.text().is_empty());
        child.map(Self::number).transpose().map_err(|error| error.within(&self.name))
    }

    /// An attribute as a number; `None` when it is not there or empty.
    pub(crate) fn attribute_number<T: TryFrom<i64>>(
        &self,
        name: &str,
    ) -> Result<Option<T>, EsiError> {
        let text = self.attribute(name).filter(|text| !text.is_empty());
        let wrong = |reason| EsiError::new(self.line, &format!("{}@{name}", self.name), reason);
        text.map(|text| value::number(text).map_err(wrong)).transpose()
    }

    /// An attribute as yes or no; no when it is not there.
    pub(crate) fn flag(&self, name: &str) -> Result<bool, EsiError> {
        let Some(text) = self.attribute(name) else { return Ok(false) };
        value::flag(text)
            .map_err(|reason| EsiError::new(self.line, &format!("{}@{name}", self.name), reason))
    }

    /// The text in the language of `locale` (1033 is English), else that without a language, else the
    /// first.
    pub(crate) fn in_language<'a>(&'a self, name: &'a str, locale: &str) -> &'a str {
        let all = || self.children(name);
        let wanted = all().find(|child| child.attribute("LcId") == Some(locale));
        let plain = || all().find(|child| child.attribute("LcId").is_none());
        wanted.or_else(plain).or_else(|| all().next()).map_or("", Self::text)
    }
}

/// Takes an element with the names of what is around it.
pub(crate) type Found<'a> = dyn FnMut(&[String], Element) -> Result<(), EsiError> + 'a;

/// Whether an element that lies in this range of the text is passed over unread; with the names of what is
/// around it, its own last.
pub(crate) type Skip<'a> = dyn Fn(&[String], Range<usize>) -> bool + 'a;

/// Goes through a file. Elements whose path is in `containers` are only walked through; every other
/// one within them is handed to `found`, with the names of what is around it.
pub(crate) fn walk(
    text: &str,
    containers: &dyn Fn(&[String]) -> bool,
    found: &mut Found<'_>,
) -> Result<(), EsiError> {
    walk_some(text, containers, None, found)
}

/// The same, passing over elements that `skip` has no use for.
pub(crate) fn walk_some(
    text: &str,
    containers: &dyn Fn(&[String]) -> bool,
    skip: Option<&Skip<'_>>,
    found: &mut Found<'_>,
) -> Result<(), EsiError> {
    let mut reader = Reader::from_str(text);
    reader.config_mut().expand_empty_elements = true;
    let mut source = XmlSource { reader, text, counted: 0, line: 1, elements: 0 };
    let mut path: Vec<String> = Vec::new();
    let mut seen = false;
    loop {
        match source.next()? {
            Event::Start(start) => {
                let element = source.open(&start)?;
                if seen && path.is_empty() {
                    return Err(element.error("a second root element"));
                }
                seen = true;
                path.push(element.name.clone());
                if !containers(&path) {
                    let passed = match skip {
                        Some(skip) => source.pass(&start, &|range| skip(&path, range))?,
                        None => false,
                    };
                    path.pop();
                    if passed {
                        continue;
                    }
                    let whole = source.fill(element, path.len())?;
                    found(&path, whole)?;
                }
            }
            Event::End(_) => {
                path.pop();
            }
            Event::Eof => {
                if let Some(open) = path.last() {
                    return Err(EsiError::new(source.line, open, "the file ends within it"));
                }
                return Ok(());
            }
            Event::Text(_)
            | Event::CData(_)
            | Event::Comment(_)
            | Event::Decl(_)
            | Event::PI(_)
            | Event::DocType(_)
            | Event::GeneralRef(_)
            | Event::Empty(_) => {}
        }
    }
}

struct XmlSource<'a> {
    reader: Reader<&'a [u8]>,
    text: &'a str,
    /// Bytes whose lines have been counted.
    counted: usize,
    line: u32,
    elements: usize,
}

impl<'a> XmlSource<'a> {
    fn next(&mut self) -> Result<Event<'a>, EsiError> {
        let from = usize::try_from(self.reader.buffer_position()).unwrap_or(usize::MAX);
        self.count_to(from);
        let event = self.reader.read_event();
        event.map_err(|error| self.broken(&error))
    }

    /// What is wrong where the reader stands.
    fn broken(&self, error: &quick_xml::Error) -> EsiError {
        use quick_xml::errors::{Error, SyntaxError};
        // All syntax errors but one are that the input ends before something.
        let open = match error {
            Error::Syntax(open) if *open != SyntaxError::InvalidBangMarkup => Some(open),
            Error::Syntax(_)
            | Error::Io(_)
            | Error::IllFormed(_)
            | Error::InvalidAttr(_)
            | Error::Encoding(_)
            | Error::Escape(_)
            | Error::Namespace(_) => None,
        };
        let reason = match open {
            Some(open) => format!("the file ends within a tag or comment: {open}"),
            None => error.to_string(),
        };
        EsiError::new(self.line, "XML", reason)
    }

    fn count_to(&mut self, to: usize) {
        let bytes = self.text.as_bytes();
        let to = to.min(bytes.len());
        if let Some(passed) = bytes.get(self.counted..to) {
            self.line += passed.iter().filter(|byte| **byte == b'\n').count() as u32;
            self.counted = to;
        }
    }

    /// Passes over the element that begins here, if `skip` says so of where it lies.
    fn pass(
        &mut self,
        start: &BytesStart<'_>,
        skip: &dyn Fn(Range<usize>) -> bool,
    ) -> Result<bool, EsiError> {
        let before = self.reader.clone();
        let span = self.reader.read_to_end(start.name());
        let span = span.map_err(|error| self.broken(&error))?;
        let at = |position: u64| usize::try_from(position).unwrap_or(usize::MAX);
        if skip(at(span.start)..at(span.end)) {
            return Ok(true);
        }
        self.reader = before;
        Ok(false)
    }

    /// The element that begins here, still empty.
    fn open(&mut self, start: &BytesStart<'_>) -> Result<Element, EsiError> {
        self.elements += 1;
        let name = local(start.name().as_ref());
        let error = |reason: String| EsiError::new(self.line, &name, reason);
        if self.elements > ELEMENTS {
            return Err(error(format!("more than {ELEMENTS} elements")));
        }
        let mut attributes = Vec::new();
        for attribute in start.attributes().with_checks(false) {
            let attribute = attribute.map_err(|wrong| error(wrong.to_string()))?;
            if attributes.len() >= ATTRIBUTES {
                return Err(error(format!("more than {ATTRIBUTES} attributes")));
            }
            let value = attribute
                .normalized_value(quick_xml::XmlVersion::Implicit1_0)
                .map_err(|wrong| error(wrong.to_string()))?;
            if value.len() > TEXT {
                return Err(error(format!("an attribute of more than {TEXT} bytes")));
            }
            attributes.push((local(attribute.key.as_ref()), value.into_owned()));
        }
        Ok(Element { name, line: self.line, attributes, ..Element::default() })
    }

    /// Everything up to the end of an element.
    fn fill(&mut self, root: Element, depth: usize) -> Result<Element, EsiError> {
        let mut open = vec![root];
        loop {
            let event = self.next()?;
            let Some(top) = open.last_mut() else {
                return Err(EsiError::new(self.line, "XML", "no element is open"));
            };
            let ignored = IGNORED.contains(&top.name.as_str());
            match event {
                Event::Start(start) => {
                    let element = self.open(&start)?;
                    if depth + open.len() >= DEPTH {
                        return Err(element.error(format!("nested deeper than {DEPTH} elements")));
                    }
                    open.push(element);
                }
                Event::End(_) => {
                    let done = open.pop().unwrap_or_default();
                    match open.last_mut() {
                        Some(_) if IGNORED.contains(&done.name.as_str()) => {}
                        Some(outer) => outer.children.push(done),
                        None => return Ok(done),
                    }
                }
                Event::Text(text) if !ignored => append(top, &text.xml10_content())?,
                Event::CData(text) if !ignored => append(top, &text.xml10_content())?,
                Event::GeneralRef(reference) if !ignored => {
                    let letter = match reference.resolve_char_ref() {
                        Ok(Some(letter)) => letter.to_string(),
                        Ok(None) => predefined(&reference)
                            .ok_or_else(|| top.error("an entity that XML does not know"))?,
                        Err(error) => return Err(top.error(error.to_string())),
                    };
                    append(top, &letter)?;
                }
                Event::Eof => return Err(top.error("the file ends within it")),
                Event::Text(_)
                | Event::CData(_)
                | Event::GeneralRef(_)
                | Event::Comment(_)
                | Event::Decl(_)
                | Event::PI(_)
                | Event::DocType(_)
                | Event::Empty(_) => {}
            }
        }
    }
}

/// A name without its namespace prefix.
fn local(name: &str) -> String {
    name.rsplit(':').next().unwrap_or(name).to_owned()
}

fn append(element: &mut Element, text: &str) -> Result<(), EsiError> {
    if element.text.len() + text.len() > TEXT {
        return Err(element.error(format!("a text of more than {TEXT} bytes")));
    }
    element.text.push_str(text);
    Ok(())
}

fn predefined(name: &str) -> Option<String> {
    let letter = match name {
        "amp" => "&",
        "lt" => "<",
        "gt" => ">",
        "apos" => "'",
        "quot" => "\"",
        _ => return None,
    };
    Some(letter.to_owned())
}
