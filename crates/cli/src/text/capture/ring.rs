//! Halves of an open ring.

use linesman_capture::network::ring::{HalfReport, OpenRingReport};

use super::{CaptureWriter, numbers};
use crate::text::quantity::{count, time};

impl CaptureWriter<'_> {
    /// Spells in which the ring was open, with who is in which half.
    pub(super) fn ring(&self) -> String {
        let Some(ring) = &self.report.ring else { return String::new() };
        let mut body = match ring.open.is_empty() {
            true => "two cards; never seen open\n".to_owned(),
            false => String::new(),
        };
        let (shown, more) = self.shown(ring.open.len(), "spells");
        ring.open.iter().take(shown).for_each(|open| body.push_str(&spell(open)));
        self.section("Ring", &(body + &more))
    }
}

fn spell(open: &OpenRingReport) -> String {
    let end = match open.ended_ns {
        Some(ended) => format!("{} (no longer so at {})", time(open.to_ns.0), time(ended.0)),
        None => "the end of the capture".to_owned(),
    };
    let before = open.after_ns.map(|after| format!(" (not yet at {})", time(after.0)));
    let (from, before) = (time(open.from_ns.0), before.unwrap_or_default());
    let unknown = match open.not_known.as_slice() {
        [] => String::new(),
        all => format!("  not known: SubDevice {}\n", numbers(all)),
    };
    let (a, b) = (half(&open.card_a), half(&open.card_b));
    format!("open from {from}{before} to {end}\n  card A: {a}\n  card B: {b}\n{unknown}")
}

/// Those of a half: `SubDevice 1-3 (3 answer broadcasts)`.
fn half(half: &HalfReport) -> String {
    let devices = match half.devices.as_slice() {
        [] => "nobody was asked by its address".to_owned(),
        all => format!("SubDevice {}", numbers(all)),
    };
    let broadcasts = half.count.map(|answers| {
        let verb = if answers == 1 { "answers" } else { "answer" };
        format!(" ({} {verb} broadcasts)", count(u64::from(answers), "SubDevice"))
    });
    devices + &broadcasts.unwrap_or_default()
}
