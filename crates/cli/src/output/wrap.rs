//! Long text in lines.

use super::paint::columns;

/// Where the text of a line hangs that is broken: behind its last gap of two spaces, if that is not
/// further to the right than this share of the line.
const HANG_SHARE: usize = 2;

/// `text` in lines of at most `width` columns: `first` stands before the first line, as many
/// spaces before the others. Words longer than a line stay whole.
pub(crate) fn wrapped(first: &str, text: &str, width: usize) -> String {
    let indent = columns(first);
    let mut result = first.to_owned();
    let mut filler = Filler::new(&mut result, indent, width, indent);
    text.split_whitespace().for_each(|word| filler.word(word));
    result.truncate(result.trim_end().len());
    result.push('\n');
    result
}

/// A text in lines of at most `width` columns, without their ends; what is coloured stays so. The spaces
/// that it begins with stand before each line.
pub(super) fn lines(text: &str, width: usize) -> Vec<String> {
    if columns(text) <= width {
        return vec![text.to_owned()];
    }
    let start = text.len() - text.trim_start_matches(' ').len();
    let broken = broken(text, start, start.min(width / HANG_SHARE), width);
    in_colour(broken.lines())
}

/// Each line of a text that is longer than `limit` broken at words. It goes on below its last column, as
/// far as one can be told by a gap of two spaces, else below its beginning.
pub(super) fn fitted(text: &str, limit: usize) -> String {
    let mut result = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let (content, end) = match line.strip_suffix('\n') {
            Some(content) => (content, "\n"),
            None => (line, ""),
        };
        if columns(content) <= limit {
            result.push_str(line);
            continue;
        }
        let (bytes, column) = hang(content, limit / HANG_SHARE);
        let broken = broken(content, bytes, column, limit);
        result.push_str(&in_colour(broken.lines()).join("\n"));
        result.push_str(end);
    }
    result
}

/// Behind the last gap of two spaces: its place in bytes and in columns, at most `most`.
fn hang(line: &str, most: usize) -> (usize, usize) {
    let start = line.len() - line.trim_start_matches(' ').len();
    let gaps = line.match_indices("  ").map(|(at, gap)| {
        let behind = at + gap.len();
        behind + line[behind..].len() - line[behind..].trim_start_matches(' ').len()
    });
    let at = |bytes: usize| (bytes, columns(&line[..bytes]));
    let fitting = gaps.map(at).filter(|(_, column)| *column <= most);
    fitting.last().unwrap_or_else(|| at(start))
}

/// `text`, whose first `kept` bytes stay as they are, in lines that go on below column `indent`.
fn broken(text: &str, kept: usize, indent: usize, width: usize) -> String {
    let (first, rest) = text.split_at(kept);
    let mut result = first.to_owned();
    let column = columns(first);
    let mut filler = Filler::new(&mut result, column, width, indent);
    // Spaces between words stay, as those of a column do.
    let mut spaces = 0;
    for part in rest.split(' ') {
        if part.is_empty() {
            spaces += 1;
            continue;
        }
        filler.spaced(part, std::mem::replace(&mut spaces, 1));
    }
    result
}

/// Fills lines with words.
struct Filler<'a> {
    text: &'a mut String,
    column: usize,
    width: usize,
    indent: usize,
    begun: bool,
}

impl<'a> Filler<'a> {
    fn new(text: &'a mut String, column: usize, width: usize, indent: usize) -> Self {
        Self { text, column, width, indent, begun: false }
    }

    fn word(&mut self, word: &str) {
        self.spaced(word, 1);
    }

    /// A word behind so many spaces.
    fn spaced(&mut self, word: &str, spaces: usize) {
        let len = columns(word);
        if self.begun && self.column + spaces + len > self.width {
            self.text.push('\n');
            self.text.push_str(&" ".repeat(self.indent));
            self.column = self.indent;
        } else if self.begun {
            self.text.push_str(&" ".repeat(spaces));
            self.column += spaces;
        }
        self.text.push_str(word);
        self.column += len;
        self.begun = true;
    }
}

/// Ends the colour of each line with it, and begins it again in the next.
fn in_colour<'a>(lines: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut colour = String::new();
    let each = |line: &'a str| {
        let content = line.trim_start_matches(' ');
        let indent = &line[..line.len() - content.len()];
        let before = std::mem::take(&mut colour);
        let last = content.rmatch_indices("\x1b[").next();
        colour = match last.and_then(|(at, _)| Some(&content[at..=at + content[at..].find('m')?])) {
            None => before.clone(),
            Some("\x1b[0m") => String::new(),
            Some(code) => code.to_owned(),
        };
        let end = if colour.is_empty() { "" } else { "\x1b[0m" };
        format!("{indent}{before}{content}{end}")
    };
    lines.map(each).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_at_words_and_hang() {
        assert_eq!(wrapped("- ", "one two three", 9), "- one two\n  three\n");
        assert_eq!(wrapped("", "unbreakable word", 4), "unbreakable\nword\n");
        assert_eq!(wrapped("- ", "", 9), "-\n");
    }

    #[test]
    fn lines_that_are_too_long_go_on_below_their_last_column() {
        let event = "  1.010 s  link-lost at a place that is far away\nshort  line\n";
        let expected = "  1.010 s  link-lost at\n           a place that\n           is far away\nshort  line\n";
        assert_eq!(fitted(event, 23), expected);
        assert_eq!(fitted("one two three", 8), "one two\nthree");
        assert_eq!(fitted("    one two three\n", 12), "    one two\n    three\n");
        // A gap far to the right is none of a column.
        assert_eq!(fitted("one two three  four", 14), "one two three\nfour");
    }

    #[test]
    fn colour_ends_with_each_line() {
        let expected = "\x1b[2mone two\x1b[0m\n\x1b[2mthree\x1b[0m\n";
        assert_eq!(fitted("\x1b[2mone two three\x1b[0m\n", 8), expected);
    }
}
