//! Tables of text: columns as wide as they need to be, narrower ones where the terminal is.

use super::Paint;
use super::paint::columns;
use super::wrap::lines;

/// Columns between two cells.
const GAP: usize = 2;
/// Columns by which the second line of a row is indented, where one line does not do.
const INDENT: usize = 4;
/// Narrowest column that a cell is broken to.
const NARROWEST: usize = 12;

/// A table that is being filled.
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    limit: Option<usize>,
}

impl Table {
    /// A table with these headings.
    pub(crate) fn new(headings: &[&str], paint: Paint) -> Self {
        let headings = headings.iter().map(|heading| paint.faint(heading)).collect();
        Self { rows: vec![headings], limit: paint.limit() }
    }

    /// Adds a row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The text, each row ended. Where a row is too long for the terminal, the longest cells are
    /// broken into lines; where that does not do, the last columns stand in lines of their own.
    pub(crate) fn render(&self) -> String {
        let natural = self.widths(columns);
        let Some(limit) = self.limit.filter(|limit| sum(&natural) > *limit) else {
            return self.lines_of(&[Band { from: 0, indent: 0, widths: natural }]);
        };
        let least = self.least(&natural);
        self.lines_of(&bands(&natural, &least, limit))
    }

    /// For each column the largest of what its cells are measured to be.
    fn widths(&self, measure: impl Fn(&str) -> usize) -> Vec<usize> {
        let count = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cells = |column: usize| self.rows.iter().filter_map(move |row| row.get(column));
        let width = |column| cells(column).map(|cell| measure(cell)).max().unwrap_or(0);
        (0..count).map(width).collect()
    }

    /// How narrow each column may become: its longest word stays whole.
    fn least(&self, natural: &[usize]) -> Vec<usize> {
        let longest = |cell: &str| cell.split_whitespace().map(columns).max().unwrap_or(0);
        let words = self.widths(longest);
        words.iter().zip(natural).map(|(word, all)| (*word).max(NARROWEST.min(*all))).collect()
    }

    fn lines_of(&self, bands: &[Band]) -> String {
        let mut text = String::new();
        for row in &self.rows {
            for band in bands {
                let cells = row.iter().skip(band.from).zip(&band.widths);
                let broken: Vec<(Vec<String>, usize)> =
                    cells.map(|(cell, width)| (lines(cell, *width), *width)).collect();
                let height = broken.iter().map(|(lines, _)| lines.len()).max().unwrap_or(0);
                // What a row has nothing to say about takes no line.
                let is_empty =
                    broken.iter().flat_map(|(lines, _)| lines).all(|line| line.is_empty());
                if is_empty && band.from > 0 {
                    continue;
                }
                for at in 0..height.max(1) {
                    let mut line = " ".repeat(band.indent);
                    for (lines, width) in &broken {
                        let cell = lines.get(at).map_or("", String::as_str);
                        line.push_str(cell);
                        line.push_str(&" ".repeat(width.saturating_sub(columns(cell)) + GAP));
                    }
                    text.push_str(line.trim_end());
                    text.push('\n');
                }
            }
        }
        text
    }
}

/// Columns of a table that stand in one line.
struct Band {
    /// The first of them.
    from: usize,
    indent: usize,
    widths: Vec<usize>,
}

/// Columns that a line of cells takes.
fn sum(widths: &[usize]) -> usize {
    widths.iter().sum::<usize>() + GAP * widths.len().saturating_sub(1)
}

/// As many columns in each line as fit there when their cells are broken, one at least.
fn bands(natural: &[usize], least: &[usize], limit: usize) -> Vec<Band> {
    let mut bands = Vec::new();
    let mut from = 0;
    while from < natural.len() {
        let indent = if from == 0 { 0 } else { INDENT };
        let room = limit.saturating_sub(indent);
        let fits = |to: &usize| sum(&least[from..*to]) <= room;
        let to = (from + 1..=natural.len()).take_while(fits).last().unwrap_or(from + 1);
        let widths = narrowed(&natural[from..to], &least[from..to], room);
        bands.push(Band { from, indent, widths });
        from = to;
    }
    bands
}

/// The widest columns give way first, until all fit or cannot become narrower.
fn narrowed(natural: &[usize], least: &[usize], room: usize) -> Vec<usize> {
    let mut widths = natural.to_vec();
    while sum(&widths) > room {
        let may_give = |at: &usize| widths[*at] > least[*at];
        let widest = (0..widths.len()).filter(may_give).max_by_key(|at| widths[*at]);
        let Some(at) = widest else { break };
        widths[at] -= 1;
    }
    widths
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(limit: Option<usize>) -> Table {
        let paint = Paint::PLAIN.with_limit(limit);
        let mut table = Table::new(&["no", "name", "what is to be said of it"], paint);
        let cells =
            |no: &str, name: &str, text: &str| [no.to_owned(), name.to_owned(), text.to_owned()];
        table.row(cells("1", "K1", "the first of them, with a few words"));
        table.row(cells("12", "µ", ""));
        table
    }

    #[test]
    fn columns_line_up() {
        let expected = "\
no  name  what is to be said of it
1   K1    the first of them, with a few words
12  µ
";
        assert_eq!(table(None).render(), expected);
        assert_eq!(table(Some(80)).render(), expected);
    }

    #[test]
    fn long_cells_are_broken_where_the_terminal_is_narrow() {
        let expected = "\
no  name  what is to be said
          of it
1   K1    the first of them,
          with a few words
12  µ
";
        assert_eq!(table(Some(29)).render(), expected);
    }

    #[test]
    fn columns_that_do_not_fit_stand_in_lines_of_their_own() {
        let expected = "\
no  name
    what is to be
    said of it
1   K1
    the first of
    them, with a
    few words
12  µ
";
        assert_eq!(table(Some(18)).render(), expected);
    }

    #[test]
    fn colours_are_kept_when_a_cell_is_broken() {
        let mut table = Table::new(&["a"], Paint::PLAIN.with_limit(Some(13)));
        table.row(["\x1b[1;31mone two three four\x1b[0m".to_owned()]);
        let expected = "a\n\x1b[1;31mone two three\x1b[0m\n\x1b[1;31mfour\x1b[0m\n";
        assert_eq!(table.render(), expected);
    }
}
