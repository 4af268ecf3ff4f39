//! One reading of a word: a title, what kind of thing it is, and what is said about it.

use serde::Serialize;

use crate::output::markdown::{self, Block, Inline};
use crate::output::{Paint, wrapped};

/// The kind of thing that a word was read as.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Kind {
    /// A finding of the diagnosis.
    Finding,
    /// A cause, as findings and virtual segments name it.
    Fault,
    /// A number of register 0x0134.
    AlStatusCode,
    /// A number of an SDO abort.
    AbortCode,
    /// A register of a controller.
    Register,
    /// An object of CoE, or one of its entries.
    Object,
    /// A code of an emergency message.
    EmergencyCode,
    /// A state of the EtherCAT state machine.
    State,
    /// The state word that a control program sees of a SubDevice.
    DeviceState,
    /// The state word that a control program sees of the network.
    NetworkState,
    /// A datagram command.
    Command,
    /// A port of a controller.
    Port,
    /// A number of a refused file transfer.
    FoeError,
    /// A number of a refused access by SoE.
    SoeError,
    /// A return code of ADS.
    AdsCode,
    /// A number of a mailbox error reply.
    MailboxError,
    /// The bytes of a message: diagnosis message, emergency, mailbox message.
    Message,
    /// A code of a diagnosis message.
    DiagnosisCode,
    /// A number of a text of a diagnosis message.
    TextNumber,
    /// A value of a register, an object or a variable, read bit by bit.
    Value,
    /// A working counter and the one that was expected.
    WorkingCounter,
    /// An address of a SubDevice.
    StationAddress,
    /// A page of the guide.
    Topic,
    /// A word or message, of EtherCAT or of another tool.
    Word,
}

/// A title and what is said beneath it.
pub(super) struct Page {
    kind: Kind,
    title: String,
    blocks: Vec<Block>,
}

/// A page as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Reading {
    /// Its kind.
    kind: Kind,
    /// Its title.
    title: String,
    /// The parts of its page, in order.
    sections: Vec<Section>,
}

/// A part of what is said.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Section {
    /// Its heading, such as `do`; `null` for the text beneath the title.
    heading: Option<String>,
    /// Its text: one for each paragraph, point of a list, row of a table.
    lines: Vec<String>,
}

impl Page {
    pub(super) fn new(kind: Kind, title: impl Into<String>) -> Self {
        Self { kind, title: title.into(), blocks: Vec::new() }
    }

    /// Adds a paragraph.
    pub(super) fn text(mut self, text: impl AsRef<str>) -> Self {
        if !text.as_ref().is_empty() {
            self.blocks.push(Block::Paragraph(Inline::of(text.as_ref())));
        }
        self
    }

    /// Adds a name with one thing behind it; nothing for an empty one.
    pub(super) fn fact(mut self, name: &str, text: impl AsRef<str>) -> Self {
        if !text.as_ref().is_empty() {
            self.blocks.push(Block::Fact(name.to_owned(), Inline::of(text.as_ref())));
        }
        self
    }

    /// Puts a name with one thing behind it before all else.
    pub(super) fn note(mut self, name: &str, text: impl AsRef<str>) -> Self {
        self.blocks.insert(0, Block::Fact(name.to_owned(), Inline::of(text.as_ref())));
        self
    }

    /// Adds a list beneath a name; nothing for an empty one.
    pub(super) fn list(self, name: &str, items: impl IntoIterator<Item = String>) -> Self {
        self.named_list(name, None, items)
    }

    /// Adds what to do, in order.
    pub(super) fn steps(self, items: impl IntoIterator<Item = String>) -> Self {
        self.named_list("do", Some(1), items)
    }

    fn named_list(
        mut self,
        name: &str,
        first: Option<u64>,
        items: impl IntoIterator<Item = String>,
    ) -> Self {
        let items: Vec<Vec<Block>> =
            items.into_iter().map(|item| vec![Block::Paragraph(Inline::of(&item))]).collect();
        if !items.is_empty() {
            self.blocks.push(Block::Section(name.to_owned(), vec![Block::List(first, items)]));
        }
        self
    }

    /// Adds a text in Markdown, an empty line in front of it.
    pub(super) fn markdown(mut self, text: &str) -> Self {
        if !self.blocks.is_empty() {
            self.blocks.push(Block::Gap);
        }
        self.blocks.extend(markdown::parse(text));
        self
    }

    /// Its kind.
    pub(super) const fn kind(&self) -> Kind {
        self.kind
    }

    /// The title.
    pub(super) fn title(&self) -> &str {
        &self.title
    }

    /// As text.
    pub(super) fn render(&self, paint: Paint, width: usize) -> String {
        let words: Vec<String> = self.title.split(' ').map(|word| paint.bold(word)).collect();
        let title = wrapped("", &words.join(" "), width);
        title + &markdown::render(&self.blocks, "  ", paint, width)
    }

    /// As JSON.
    pub(super) fn reading(&self) -> Reading {
        let mut sections: Vec<Section> = Vec::new();
        let mut open = Section { heading: None, lines: Vec::new() };
        let mut close = |section: &mut Section, heading: Option<String>| {
            let done = std::mem::replace(section, Section { heading, lines: Vec::new() });
            if !done.lines.is_empty() {
                sections.push(done);
            }
        };
        for block in &self.blocks {
            let lines = markdown::lines(std::slice::from_ref(block));
            match block {
                Block::Heading(words) => close(&mut open, Some(words.plain())),
                Block::Fact(name, words) => {
                    close(&mut open, Some(name.clone()));
                    open.lines.push(words.plain());
                    close(&mut open, None);
                }
                Block::Section(name, inner) => {
                    close(&mut open, Some(name.clone()));
                    open.lines.extend(markdown::lines(inner));
                    close(&mut open, None);
                }
                Block::Paragraph(_)
                | Block::List(..)
                | Block::Table(..)
                | Block::Code(_)
                | Block::Gap => open.lines.extend(lines),
            }
        }
        close(&mut open, None);
        Reading { kind: self.kind, title: self.title.clone(), sections }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_text_and_sections() {
        let page = Page::new(Kind::Register, "T")
            .text("One paragraph.")
            .fact("class", "timing")
            .fact("only", "")
            .steps(["first".to_owned(), "second".to_owned()])
            .markdown("More.\n\n## Look\n\n* here\n");
        assert_eq!(
            page.render(Paint::PLAIN, 60),
            "T\n  One paragraph.\n  class:     timing\n  do:\n    1. first\n    2. second\n\n  More.\n\n  \
             Look\n\n  - here\n"
        );
        let reading = serde_json::to_value(page.reading()).unwrap();
        assert_eq!(
            reading,
            serde_json::json!({
                "kind": "register",
                "title": "T",
                "sections": [
                    { "heading": null, "lines": ["One paragraph."] },
                    { "heading": "class", "lines": ["timing"] },
                    { "heading": "do", "lines": ["first", "second"] },
                    { "heading": null, "lines": ["More."] },
                    { "heading": "Look", "lines": ["here"] },
                ]
            })
        );
    }
}
