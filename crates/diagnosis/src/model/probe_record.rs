//! Record of a capture probe: where between its ports frames became bad, were lost, or turned back.

use linesman_proto::time::Instant;

use super::Tally;
use crate::observe::capture_probe::{DamageMark, Passage, PortOrder, ProbePort, Sight};

/// Frames between two ports of a probe that follow each other on the way of the frames.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ProbeSection {
    /// The port by which frames came in undamaged; `None` for the MainDevice.
    pub from: Option<u8>,
    /// The port to which they came, or were to come.
    pub to: u8,
    /// Frames that came damaged, before any controller has found them bad.
    pub fresh: ProbeTally,
    /// Frames that came damaged and marked by a controller.
    pub marked: ProbeTally,
    /// Frames that did not come, nor anywhere behind.
    pub lost: ProbeTally,
    /// Frames that came past the port behind without having been here: they turned back before.
    pub turned: ProbeTally,
}

/// A count, with the frame that showed it first.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct ProbeTally {
    /// Number of frames, and their times.
    pub frames: Tally,
    /// The number of the first copy.
    pub first: Option<u64>,
}

impl ProbeTally {
    fn add(&mut self, at: Instant, number: u64) {
        self.frames.add(1, at);
        self.first.get_or_insert(number);
    }
}

/// Record of a capture probe.
#[derive(Clone, Default, Debug)]
pub struct ProbeRecord {
    /// Frames that passed.
    pub passages: u64,
    /// Its ports in the order in which frames pass them.
    pub order: PortOrder,
    sections: Vec<ProbeSection>,
}

impl ProbeRecord {
    /// Sections in which something happened to frames.
    #[must_use]
    pub fn sections(&self) -> &[ProbeSection] {
        &self.sections
    }

    /// The first port on the way of the frames if it sits inside the line, behind some SubDevice or nobody knows where:
    /// what does not come there may have been lost before, or not have been sent.
    #[must_use]
    pub fn inside(&self) -> Option<u8> {
        let first = self.order.ports().first().filter(|_| self.order.len() > 1)?;
        (self.order.before(first.number) != Some(0)).then_some(first.number)
    }

    /// A port.
    #[must_use]
    pub fn port(&self, number: u8) -> Option<&ProbePort> {
        self.order.port(number)
    }

    /// Takes a frame that was to pass the ports `expected`; true if something happened to it.
    pub(crate) fn note(&mut self, passage: &Passage, expected: &[u8], order: &PortOrder) -> bool {
        self.passages += 1;
        let came = |port: u8| passage.at(port);
        let is_new = self.order.len() != order.len() || self.passages % 64 == 1;
        let mut before: Option<&Sight> = None;
        let mut missing: Vec<u8> = Vec::new();
        let mut found = false;
        for port in expected.iter().copied() {
            let Some(sight) = came(port) else {
                missing.push(port);
                continue;
            };
            let from = before.map(|sight| sight.port);
            if let (Some(first), true) = (missing.first(), before.is_some()) {
                let section = self.section(from, *first);
                section.turned.add(sight.time, sight.number);
                found = true;
            }
            missing.clear();
            if let Some(mark) = sight.damage {
                let section = self.section(from, port);
                match mark {
                    DamageMark::Fresh => section.fresh.add(sight.time, sight.number),
                    DamageMark::Marked => section.marked.add(sight.time, sight.number),
                }
                self.take_order(order);
                // What becomes of it behind follows from that.
                return true;
            }
            before = Some(sight);
        }
        if let (Some(first), Some(before), false) = (missing.first(), before, passage.is_cut_off) {
            self.section(Some(before.port), *first).lost.add(before.time, before.number);
            found = true;
        }
        if found || is_new {
            self.take_order(order);
        }
        found
    }

    /// Takes the ports as they stand.
    pub(crate) fn take_order(&mut self, order: &PortOrder) {
        self.order.clone_from(order);
    }

    fn section(&mut self, from: Option<u8>, to: u8) -> &mut ProbeSection {
        let known = self.sections.iter().position(|one| one.from == from && one.to == to);
        let index = known.unwrap_or_else(|| {
            let none = ProbeTally::default();
            let (fresh, marked, lost, turned) = (none, none, none, none);
            self.sections.push(ProbeSection { from, to, fresh, marked, lost, turned });
            self.sections.len() - 1
        });
        &mut self.sections[index]
    }
}
