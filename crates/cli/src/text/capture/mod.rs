//! What a capture shows, as text: one section after the other, each left out where there is nothing to say.

mod cyclic;
mod devices;
mod dialogue;
mod network;
mod ring;

use linesman_capture::CaptureReport;
use linesman_proto::topology::Tree;

use super::names::Names;
use crate::output::Paint;

/// Most entries of a long list, unless all are wanted.
const MOST: usize = 24;

/// Form in which a report is written.
pub(crate) struct CaptureWriter<'a> {
    /// The report.
    pub(crate) report: &'a CaptureReport,
    /// Names of the SubDevices.
    pub(crate) names: &'a Names,
    /// Colour.
    pub(crate) paint: Paint,
    /// Columns.
    pub(crate) width: usize,
    /// True if long lists are written to their end.
    pub(crate) is_whole: bool,
}

impl CaptureWriter<'_> {
    /// The whole report; `tree` is the wiring, where it is known.
    pub(crate) fn write(&self, tree: Option<&Tree>) -> String {
        let sections = [
            self.head(),
            self.devices(),
            self.wiring(tree),
            self.ring(),
            self.set_up(),
            self.clocks(),
            self.frames(),
            self.jitter(),
            self.image(),
            self.entries(),
            self.states(),
            self.transfers(),
            self.sii(),
            self.counters(),
            self.commands(),
            self.unknown(),
        ];
        let told: Vec<String> = sections.into_iter().filter(|text| !text.is_empty()).collect();
        told.join("\n")
    }

    /// A heading with what belongs to it; nothing without.
    fn section(&self, heading: &str, body: &str) -> String {
        match body.is_empty() {
            true => String::new(),
            false => format!("{}\n{body}", self.paint.bold(heading)),
        }
    }

    /// How many of a long list are written, and the line that says how many are not.
    fn shown(&self, len: usize, what: &str) -> (usize, String) {
        if self.is_whole || len <= MOST {
            return (len, String::new());
        }
        let left = len - MOST;
        (MOST, self.paint.faint(&format!("and {left} more {what}: --all")) + "\n")
    }

    /// A SubDevice by its number, else by the address that a datagram names.
    fn whom(&self, no: Option<u32>, station: Option<u16>, position_no: Option<u32>) -> String {
        match (no, station, position_no) {
            (Some(no), _, _) => self.names.device(no),
            (None, Some(station), _) => format!("0x{station:04X}"),
            (None, None, Some(position)) => format!("position {position}"),
            (None, None, None) => "all".to_owned(),
        }
    }
}

/// Numbers in a row, stretches of them by their ends: `1-4, 7`.
fn numbers(all: &[u32]) -> String {
    let mut parts: Vec<(u32, u32)> = Vec::new();
    for no in all {
        match parts.last_mut() {
            Some((_, last)) if *last + 1 == *no => *last = *no,
            Some(_) | None => parts.push((*no, *no)),
        }
    }
    let part = |(first, last): &(u32, u32)| match first == last {
        true => first.to_string(),
        false => format!("{first}-{last}"),
    };
    parts.iter().map(part).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_a_row_are_told_by_their_ends() {
        assert_eq!(numbers(&[]), "");
        assert_eq!(numbers(&[3]), "3");
        assert_eq!(numbers(&[1, 2, 3, 5, 7, 8]), "1-3, 5, 7-8");
    }
}
