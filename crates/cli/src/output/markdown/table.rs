//! Tables of a page: columns that share the width, or one row after the other.

use super::{Inline, faint_words};
use crate::output::paint::{Paint, columns};
use crate::output::wrap::wrapped;

/// Columns between two columns.
const BETWEEN: usize = 2;
/// Text in a column that is narrower is hard to read.
const READABLE: usize = 16;

/// The cells of a row with their headings, the empty ones left out.
pub(super) fn named_cells<'a>(
    head: &'a [Inline],
    row: &'a [Inline],
) -> impl Iterator<Item = (String, &'a Inline)> {
    let named = head.iter().map(Inline::plain).zip(row);
    named.filter(|(_, cell)| !cell.is_empty())
}

/// The table as lines of at most `width` columns.
pub(super) fn render(
    head: &[Inline],
    rows: &[Vec<Inline>],
    indent: &str,
    paint: Paint,
    width: usize,
) -> String {
    let room = width.saturating_sub(columns(indent) + BETWEEN * head.len().saturating_sub(1));
    match widths(head, rows, room) {
        Some(widths) => in_columns(head, rows, indent, paint, &widths),
        None => row_by_row(head, rows, indent, paint, width),
    }
}

/// Widths of the columns, so that all of them fit; `None` when they cannot.
fn widths(head: &[Inline], rows: &[Vec<Inline>], room: usize) -> Option<Vec<usize>> {
    let cells = |column: usize| {
        let of_rows = rows.iter().filter_map(move |row| row.get(column));
        head.get(column).into_iter().chain(of_rows).map(Inline::plain)
    };
    let count = head.len();
    let whole: Vec<usize> =
        (0..count).map(|at| cells(at).map(|cell| columns(&cell)).max().unwrap_or(0)).collect();
    let longest = |cell: String| cell.split_whitespace().map(columns).max().unwrap_or(0);
    let least: Vec<usize> = (0..count)
        .map(|at| cells(at).map(longest).max().unwrap_or(0).max(whole[at].min(READABLE)))
        .collect();
    if least.iter().sum::<usize>() > room {
        return None;
    }
    // Narrow columns get what they need; the wide ones share what is left evenly.
    let share = |limit: usize| -> Vec<usize> {
        whole.iter().zip(&least).map(|(whole, least)| (*whole).min(limit).max(*least)).collect()
    };
    let most = whole.iter().copied().max().unwrap_or(0);
    (0..=most).rev().map(share).find(|widths| widths.iter().sum::<usize>() <= room)
}

fn in_columns(
    head: &[Inline],
    rows: &[Vec<Inline>],
    indent: &str,
    paint: Paint,
    widths: &[usize],
) -> String {
    let head: Vec<String> = head.iter().map(|cell| faint_words(&cell.plain(), paint)).collect();
    let body = rows.iter().map(|row| row.iter().map(|cell| cell.painted(paint)).collect());
    let mut text = String::new();
    for row in std::iter::once(head).chain(body) {
        let cells: Vec<Vec<String>> = row
            .iter()
            .zip(widths)
            .map(|(cell, width)| wrapped("", cell, *width).lines().map(str::to_owned).collect())
            .collect();
        for line in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
            let mut written = indent.to_owned();
            for (cell, width) in cells.iter().zip(widths) {
                let piece = cell.get(line).map_or("", String::as_str);
                written.push_str(piece);
                written.push_str(&" ".repeat((*width).saturating_sub(columns(piece)) + BETWEEN));
            }
            text.push_str(written.trim_end());
            text.push('\n');
        }
    }
    text
}

/// Each row as a line of its short cells, and one line for each of the others.
fn row_by_row(
    head: &[Inline],
    rows: &[Vec<Inline>],
    indent: &str,
    paint: Paint,
    width: usize,
) -> String {
    let mut text = String::new();
    for row in rows {
        let cells = || named_cells(head, row);
        let is_short = |cell: &Inline| columns(&cell.plain()) <= READABLE;
        let short: Vec<String> = cells()
            .filter(|(_, cell)| is_short(cell))
            .map(|(name, cell)| format!("{} {}", faint_words(&name, paint), cell.painted(paint)))
            .collect();
        let mut indent = indent.to_owned();
        if !short.is_empty() {
            text.push_str(&wrapped(&indent, &short.join(", "), width));
            indent.push_str("  ");
        }
        for (name, cell) in cells().filter(|(_, cell)| !is_short(cell)) {
            let name = faint_words(&format!("{name}:"), paint);
            text.push_str(&wrapped(&indent, &format!("{name} {}", cell.painted(paint)), width));
        }
    }
    text
}
