//! Builder of blocks from the events of the parser.

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use super::{Block, Inline, Style};

/// The blocks of a page in Markdown, an empty line between any two of the outermost.
pub(crate) fn parse(markdown: &str) -> Vec<Block> {
    let mut builder = Builder { open: vec![Open::Blocks(Vec::new())], ..Builder::default() };
    for event in Parser::new_ext(markdown, Options::ENABLE_TABLES) {
        builder.take(event);
    }
    let mut blocks = Vec::new();
    for block in builder.finish() {
        if !blocks.is_empty() {
            blocks.push(Block::Gap);
        }
        blocks.push(block);
    }
    blocks
}

/// An element that has begun and not ended.
enum Open {
    /// Blocks of the page, or of a point.
    Blocks(Vec<Block>),
    /// Points of a list.
    List(Option<u64>, Vec<Vec<Block>>),
    /// Rows of a table; the first is its headings.
    Table(Vec<Vec<Inline>>),
}

#[derive(Default)]
struct Builder {
    open: Vec<Open>,
    /// The text that is being gathered.
    inline: Inline,
    /// Number of strong or emphasised stretches around it.
    strong: usize,
    /// Lines of code are being gathered.
    in_code: bool,
}

impl Builder {
    #[expect(
        clippy::wildcard_enum_match_arm,
        reason = "what pages do not use is shown as its text"
    )]
    fn take(&mut self, event: Event<'_>) {
        match event {
            Event::Start(tag) => self.start(&tag),
            Event::End(tag) => self.end(tag),
            Event::Text(text) => {
                let style = if self.strong > 0 { Style::Strong } else { Style::Plain };
                self.inline.push(style, &text);
            }
            Event::Code(text) => self.inline.push(Style::Code, &text),
            Event::SoftBreak | Event::HardBreak => self.inline.push(Style::Plain, " "),
            Event::Html(text) | Event::InlineHtml(text) => self.inline.push(Style::Plain, &text),
            _ => {}
        }
    }

    #[expect(
        clippy::wildcard_enum_match_arm,
        reason = "what pages do not use is shown as its text"
    )]
    fn start(&mut self, tag: &Tag<'_>) {
        match tag {
            Tag::Strong | Tag::Emphasis => self.strong += 1,
            Tag::List(first) => {
                self.flush();
                self.open.push(Open::List(*first, Vec::new()));
            }
            Tag::Item => self.open.push(Open::Blocks(Vec::new())),
            Tag::Table(_) => {
                self.flush();
                self.open.push(Open::Table(Vec::new()));
            }
            Tag::TableHead | Tag::TableRow => {
                if let Some(Open::Table(rows)) = self.open.last_mut() {
                    rows.push(Vec::new());
                }
            }
            Tag::CodeBlock(_) => {
                self.flush();
                self.in_code = true;
            }
            Tag::Link { .. } => {}
            _ => self.flush(),
        }
    }

    #[expect(
        clippy::wildcard_enum_match_arm,
        reason = "what pages do not use is shown as its text"
    )]
    fn end(&mut self, tag: TagEnd) {
        match tag {
            TagEnd::Strong | TagEnd::Emphasis => self.strong = self.strong.saturating_sub(1),
            TagEnd::Heading(_) => {
                let words = std::mem::take(&mut self.inline);
                self.add(Block::Heading(words));
            }
            TagEnd::CodeBlock => {
                let code = std::mem::take(&mut self.inline).plain();
                self.in_code = false;
                self.add(Block::Code(code));
            }
            TagEnd::TableCell => {
                let cell = std::mem::take(&mut self.inline);
                if let Some(Open::Table(rows)) = self.open.last_mut()
                    && let Some(row) = rows.last_mut()
                {
                    row.push(cell);
                }
            }
            TagEnd::TableHead | TagEnd::TableRow | TagEnd::Link => {}
            TagEnd::Item | TagEnd::List(_) | TagEnd::Table => self.close(),
            _ => self.flush(),
        }
    }

    /// Ends the innermost of what has begun.
    fn close(&mut self) {
        self.flush();
        match self.open.pop() {
            Some(Open::Blocks(item)) => {
                if let Some(Open::List(_, items)) = self.open.last_mut() {
                    items.push(item);
                }
            }
            Some(Open::List(first, items)) => self.add(Block::List(first, items)),
            Some(Open::Table(mut rows)) if !rows.is_empty() => {
                let head = rows.remove(0);
                self.add(Block::Table(head, rows));
            }
            Some(Open::Table(_)) | None => {}
        }
    }

    /// Makes a paragraph of the text gathered so far.
    fn flush(&mut self) {
        if self.in_code {
            return;
        }
        let words = std::mem::take(&mut self.inline);
        if !words.is_empty() {
            self.add(Block::Paragraph(words));
        }
    }

    fn add(&mut self, block: Block) {
        if let Some(Open::Blocks(blocks)) = self.open.last_mut() {
            blocks.push(block);
        }
    }

    fn finish(mut self) -> Vec<Block> {
        self.flush();
        match self.open.pop() {
            Some(Open::Blocks(blocks)) => blocks,
            Some(Open::List(..) | Open::Table(_)) | None => Vec::new(),
        }
    }
}
