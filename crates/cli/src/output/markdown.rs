//! Markdown as text for people: parsed into blocks, wrapped to a width, without its marks.
//!
//! pulldown-cmark does the parsing. Headings, emphasis and code are painted where colour is on and
//! plain where not; tables get columns, or become a list of their rows where there is no room.

mod parse;
mod table;

use super::paint::{Paint, columns};
use super::wrap::wrapped;

pub(crate) use parse::parse;

/// Columns that the name of a fact takes.
const FACT: usize = 11;

/// A part of a page.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Block {
    /// A heading.
    Heading(Inline),
    /// A paragraph.
    Paragraph(Inline),
    /// A name with one thing behind it.
    Fact(String, Inline),
    /// A name with what belongs to it beneath.
    Section(String, Vec<Block>),
    /// A list; its points have numbers from this one on, or none.
    List(Option<u64>, Vec<Vec<Block>>),
    /// A table: its headings and its rows.
    Table(Vec<Inline>, Vec<Vec<Inline>>),
    /// Lines that stay as they are.
    Code(String),
    /// An empty line.
    Gap,
}

/// Text within a paragraph, a heading, a cell.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(crate) struct Inline(Vec<Span>);

/// A stretch of text in one style.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Span {
    style: Style,
    text: String,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Style {
    Plain,
    Strong,
    Code,
}

impl Inline {
    /// Text in which nothing but code between backticks is marked, as that of tables in the program.
    pub(crate) fn of(text: &str) -> Self {
        let is_paired = text.matches('`').count().is_multiple_of(2);
        let mut inline = Self::default();
        for (index, part) in text.split('`').enumerate() {
            let style = if is_paired && index % 2 == 1 { Style::Code } else { Style::Plain };
            inline.push(style, part);
        }
        inline
    }

    fn push(&mut self, style: Style, text: &str) {
        if text.is_empty() {
            return;
        }
        match self.0.last_mut() {
            Some(last) if last.style == style => last.text.push_str(text),
            Some(_) | None => self.0.push(Span { style, text: text.to_owned() }),
        }
    }

    fn is_empty(&self) -> bool {
        self.0.iter().all(|span| span.text.trim().is_empty())
    }

    /// Without any marks.
    pub(crate) fn plain(&self) -> String {
        self.0.iter().map(|span| span.text.as_str()).collect()
    }

    /// Each word painted for itself, so that lines can break between any two.
    fn painted(&self, paint: Paint) -> String {
        let mut text = String::new();
        for Span { style, text: words } in &self.0 {
            for piece in words.split_inclusive(char::is_whitespace) {
                let word = piece.trim_end();
                match style {
                    Style::Plain => text.push_str(word),
                    Style::Strong => text.push_str(&paint.bold(word)),
                    Style::Code => text.push_str(&paint.code(word)),
                }
                text.push_str(&piece[word.len()..]);
            }
        }
        text
    }
}

/// The blocks as text: lines of at most `width` columns that begin with `indent`. Words longer than
/// a line, and lines of code, stay whole.
pub(crate) fn render(blocks: &[Block], indent: &str, paint: Paint, width: usize) -> String {
    let mut text = String::new();
    for block in blocks {
        match block {
            Block::Heading(words) => {
                let words: Vec<String> = words.plain().split(' ').map(|w| paint.bold(w)).collect();
                text.push_str(&wrapped(indent, &words.join(" "), width));
            }
            Block::Paragraph(words) => {
                text.push_str(&wrapped(indent, &words.painted(paint), width));
            }
            Block::Fact(name, words) => {
                let space = " ".repeat(FACT.saturating_sub(columns(name) + 1).max(1));
                let head = format!("{indent}{}{space}", faint_words(&format!("{name}:"), paint));
                text.push_str(&wrapped(&head, &words.painted(paint), width));
            }
            Block::Section(name, inner) => {
                text.push_str(&wrapped(indent, &faint_words(&format!("{name}:"), paint), width));
                text.push_str(&render(inner, &format!("{indent}  "), paint, width));
            }
            Block::List(first, items) => {
                let last = first.map_or(0, |first| first + items.len() as u64);
                let room = last.to_string().len() + 1;
                for (index, item) in items.iter().enumerate() {
                    let mark = match first {
                        Some(first) => format!("{:>room$} ", format!("{}.", first + index as u64)),
                        None => "- ".to_owned(),
                    };
                    text.push_str(&point(&mark, item, indent, paint, width));
                }
            }
            Block::Table(head, rows) => {
                text.push_str(&table::render(head, rows, indent, paint, width));
            }
            Block::Code(lines) => {
                for line in lines.lines() {
                    text.push_str(format!("{indent}  {}", paint.code(line)).trim_end());
                    text.push('\n');
                }
            }
            Block::Gap => text.push('\n'),
        }
    }
    text
}

/// Each word painted for itself.
fn faint_words(words: &str, paint: Paint) -> String {
    words.split(' ').map(|word| paint.faint(word)).collect::<Vec<_>>().join(" ")
}

/// A point of a list: its mark, and behind it what belongs to it.
fn point(mark: &str, item: &[Block], indent: &str, paint: Paint, width: usize) -> String {
    let inner = format!("{indent}{}", " ".repeat(columns(mark)));
    let (first, rest) = match item.split_first() {
        Some((Block::Paragraph(words), rest)) => (words.painted(paint), rest),
        Some(_) | None => (String::new(), item),
    };
    let head = wrapped(&format!("{indent}{mark}"), &first, width);
    head + &render(rest, &inner, paint, width)
}

/// The blocks as plain lines for programs: one for each paragraph, point and row.
pub(crate) fn lines(blocks: &[Block]) -> Vec<String> {
    let mut lines = Vec::new();
    for block in blocks {
        match block {
            Block::Heading(words) | Block::Paragraph(words) => lines.push(words.plain()),
            Block::Fact(name, words) => lines.push(format!("{name}: {}", words.plain())),
            Block::Section(name, inner) => {
                lines.push(format!("{name}:"));
                lines.extend(self::lines(inner));
            }
            Block::List(_, items) => {
                lines.extend(items.iter().map(|item| self::lines(item).join("; ")));
            }
            Block::Table(head, rows) => lines.extend(rows.iter().map(|row| {
                let cells = table::named_cells(head, row);
                let cells = cells.map(|(name, cell)| format!("{name}: {}", cell.plain()));
                cells.collect::<Vec<_>>().join("; ")
            })),
            Block::Code(code) => lines.extend(code.lines().map(str::to_owned)),
            Block::Gap => {}
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(markdown: &str, width: usize) -> String {
        render(&parse(markdown), "", Paint::PLAIN, width)
    }

    #[test]
    fn marks_are_gone_and_lines_fit() {
        let page = "# Title\n\nOne **bold** paragraph with `code` that\ngoes on.\n\n* a point\n  of two \
                    lines\n* another, with [a link](page.md)\n\n1. first\n2. second\n\n```sh\nso does \
                    code\n```\n";
        let expected = "Title\n\nOne bold paragraph with\ncode that goes on.\n\n- a point of two lines\n- \
                        another, with a link\n\n1. first\n2. second\n\n  so does code\n";
        assert_eq!(shown(page, 24), expected);
    }

    #[test]
    fn points_within_points_are_indented() {
        let page = "1. one\n   * inner point\n   * inner\n2. two\n";
        assert_eq!(shown(page, 40), "1. one\n   - inner point\n   - inner\n2. two\n");
    }

    #[test]
    fn tables_have_columns_while_there_is_room() {
        let page = "| a | what it is |\n|---|---|\n| `x` | words that need room |\n| yy | few |\n";
        assert_eq!(shown(page, 40), "a   what it is\nx   words that need room\nyy  few\n");
        assert_eq!(shown(page, 20), "a   what it is\nx   words that need\n    room\nyy  few\n");
        let rows =
            "a x\n  what it\n  is:\n  words\n  that\n  need\n  room\na yy,\nwhat it\nis few\n";
        assert_eq!(shown(page, 9), rows);
    }

    #[test]
    fn colour_marks_words_and_takes_no_room() {
        let paint = Paint::for_stream(crate::cli::ColorChoice::Always, false);
        let text = render(&parse("**two words** and `x y`"), "", paint, 40);
        assert_eq!(
            text,
            "\x1b[1mtwo\x1b[0m \x1b[1mwords\x1b[0m and \x1b[36mx\x1b[0m \x1b[36my\x1b[0m\n"
        );
    }

    #[test]
    fn text_of_tables_keeps_what_is_no_code() {
        let inline = Inline::of("see `linesman reg WHERE` [0x0130], a*b and <INDEX>");
        assert_eq!(inline.plain(), "see linesman reg WHERE [0x0130], a*b and <INDEX>");
        assert_eq!(Inline::of("a lone ` stays").plain(), "a lone  stays");
        assert!(Inline::default().is_empty());
    }

    #[test]
    fn programs_get_a_line_for_each_point_and_row() {
        let page = "# T\n\n* a\n* b\n\n| h | i |\n|---|---|\n| 1 | 2 |\n";
        assert_eq!(lines(&parse(page)), ["T", "a", "b", "h: 1; i: 2"]);
    }
}
