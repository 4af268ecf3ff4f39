//! Summary of what was understood of a pasted text, and what not: told before the diagnosis of it.

use linesman_diagnosis::report::Understood;

use super::finding::Writer;
use super::quantity::count;
use crate::output::wrapped;

/// So many lines that were not understood are shown.
const SHOWN: usize = 5;
/// So many numbers of lines are named.
const NAMED: usize = 12;

/// What was understood, what not, and what was assumed.
pub(crate) fn write(understood: &Understood, writer: &Writer<'_>) -> String {
    let paint = writer.paint;
    let mut text = String::new();
    for (at, block) in understood.blocks.iter().enumerate() {
        let head = if at == 0 { paint.bold("understood") } else { " ".repeat(10) };
        let lines = match block.from == block.to {
            true => format!("line {}", block.from),
            false => format!("lines {}-{}", block.from, block.to),
        };
        text.push_str(&wrapped(
            &format!("{head}  "),
            &format!("{lines}: {}", block.what),
            writer.width,
        ));
    }
    for assumed in &understood.assumed {
        text.push_str(&wrapped(
            &format!("{}     ", paint.warning("assumed")),
            assumed,
            writer.width,
        ));
    }
    let ignored = understood.ignored_count;
    if ignored > 0 {
        let numbers: Vec<String> =
            understood.ignored.iter().take(NAMED).map(|line| line.line.to_string()).collect();
        let more = if ignored > numbers.len() { ", …" } else { "" };
        let words = format!("{}: {}{more}", count(ignored as u64, "line"), numbers.join(", "));
        text.push_str(&wrapped(
            &format!("{}  ", paint.warning("not understood")),
            &words,
            writer.width,
        ));
        for line in understood.ignored.iter().take(SHOWN) {
            let shown = format!("{}: \"{}\"", line.line, line.text);
            text.push_str(&paint.faint(&wrapped("  ", &shown, writer.width)));
        }
    }
    text.push('\n');
    text
}
