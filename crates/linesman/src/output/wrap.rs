//! Long text in lines.

use super::paint::columns;

/// `text` in lines of at most `width` columns: `first` stands before the first line, as many
/// spaces before the others. Words longer than a line stay whole.
pub(crate) fn wrapped(first: &str, text: &str, width: usize) -> String {
    let indent = " ".repeat(columns(first));
    let mut result = first.to_owned();
    let mut column = columns(first);
    let mut begun = false;
    for word in text.split_whitespace() {
        let len = columns(word);
        if begun && column + 1 + len > width {
            result.push('\n');
            result.push_str(&indent);
            column = indent.len();
        } else if begun {
            result.push(' ');
            column += 1;
        }
        result.push_str(word);
        column += len;
        begun = true;
    }
    result.truncate(result.trim_end().len());
    result.push('\n');
    result
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
}
