//! Number of effects of a fault: what the truth log says of it, less what no observer could ever
//! see.

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use linesman_proto::topology::End;
use linesman_sim::device::SoftwareFault;
use linesman_sim::segment_file::{FaultEntry, Value};
use linesman_sim::truth::{Effect, Entry, FaultRecord, Place};

use super::disturb::JITTER;
use crate::lab::Lab;

/// How often a fault has acted; 0 where it left no trace.
pub(super) fn effects(lab: &Lab, record: &FaultRecord) -> u64 {
    if record.first_effect.is_none() || is_traceless(lab, record) {
        return 0;
    }
    // A symbol that was hit inside a frame is one hit, though it spoils the frame, too.
    let hits = record.symbol_errors.max(record.frames_spoiled);
    let outages = record.links_lost.div_ceil(2).max(record.supplies_lost);
    // What is lost behind an open link is no hit of its own.
    let lost = if hits + outages == 0 { record.frames_lost } else { 0 };
    [hits, outages, lost, record.frames_sent, record.frames_delayed, 1]
        .into_iter()
        .max()
        .unwrap_or(1)
}

/// Frames that are late by this part of the cycle cost nobody his step (SYN-31).
const HARMLESS: f64 = 0.2;

/// True if frames were late by no more than those of disturbed healthy lines, and nobody lost one or his step.
pub(super) fn is_harmless(
    lab: &Lab,
    record: &FaultRecord,
    entry: &FaultEntry,
    cycle: Span,
) -> bool {
    let late_us = late_us(entry).filter(|_| {
        matches!(record.name, FaultName::HostJitter | FaultName::LateFrames)
            && record.frames_lost == 0
            && lab.not_up().next().is_none()
    });
    late_us.is_some_and(|late_us| late_us * 1e3 < cycle.as_nanos() as f64 * JITTER.1)
}

/// Lateness of frames that a fault causes, in µs.
fn late_us(entry: &FaultEntry) -> Option<f64> {
    let value = ["late_us", "delay_us"].into_iter().find_map(|key| entry.parameters.get(key));
    value.and_then(Value::as_number)
}

/// True if a fault did so little that a note is the right answer: it cost one frame at most, or made frames late where
/// nobody keeps step, or by less than matters to whoever does. Symbols that nobody counts do not count here.
pub(super) fn is_bearable(
    lab: &Lab,
    record: &FaultRecord,
    entry: &FaultEntry,
    cycle: Option<Span>,
) -> bool {
    if matches!(record.name, FaultName::HostJitter | FaultName::LateFrames) {
        let late_us = late_us(entry).unwrap_or(f64::MAX);
        let harms = |cycle: Span| late_us * 1e3 >= cycle.as_nanos() as f64 * HARMLESS;
        return record.frames_lost == 0 && !cycle.is_some_and(harms);
    }
    let into_card = of_fault(lab, record).filter(|one| is_symbol_into_card(*one)).count() as u64;
    let hits = record.symbol_errors.saturating_sub(into_card).max(record.frames_spoiled);
    let frames = hits.max(record.frames_lost).max(record.frames_delayed);
    frames <= 1 && record.links_lost == 0 && record.supplies_lost == 0
}

/// Whether nothing that it did could be seen by anybody.
///
/// A symbol that is hit between two frames on the way into a card is counted nowhere: cards count damaged
/// frames, and there is none. And that a device *would* refuse a step, or *would* go by wrong settings, is no
/// effect: it is one when the device is on its way up and does not get there.
fn is_traceless(lab: &Lab, record: &FaultRecord) -> bool {
    // What went beyond the log counts in any case.
    if record.frames_spoiled + record.frames_lost > 0 {
        return false;
    }
    let mut of_fault = of_fault(lab, record).peekable();
    let is_up = |id: DeviceId| !lab.not_up().any(|other| other == id);
    of_fault.peek().is_some()
        && of_fault.all(|(place, effect)| match (effect, place) {
            _ if is_symbol_into_card((place, effect)) => true,
            (
                Effect::Misbehaves(
                    SoftwareFault::Mismatch(_)
                    | SoftwareFault::FrozenApplication
                    | SoftwareFault::DeafToRequests,
                ),
                Place::Device(id),
            ) => record.is_active() && is_up(*id),
            (_, _) => false,
        })
}

/// What the log says of a fault.
fn of_fault<'l>(
    lab: &'l Lab,
    record: &FaultRecord,
) -> impl Iterator<Item = (&'l Place, &'l Effect)> {
    let fault = record.id;
    lab.truth().entries().iter().filter_map(move |entry| match entry {
        Entry::Effect { fault: Some(id), place, effect, .. } if *id == fault => {
            Some((place, effect))
        }
        Entry::Effect { .. } | Entry::Begin { .. } | Entry::End { .. } => None,
    })
}

/// A symbol that is hit on the way into a card: no card counts it.
fn is_symbol_into_card((place, effect): (&Place, &Effect)) -> bool {
    matches!((effect, place), (Effect::SymbolError, Place::Direction(_, End::MainDevice(_))))
}

#[cfg(test)]
mod tests {
    use linesman_proto::time::Instant;
    use linesman_sim::segment_file::SegmentFile;

    use super::*;
    use crate::options::LabOptions;
    use crate::verdict::proof::LINE;

    fn played(entry: &FaultEntry) -> (Lab, FaultRecord) {
        let file = SegmentFile::parse(LINE).unwrap();
        let mut lab = Lab::new(&file, LabOptions::default()).unwrap();
        lab.run_until(Instant::from_nanos(3_000_000_000)).unwrap();
        let id = lab.inject(entry).unwrap();
        lab.run_until(Instant::from_nanos(3_300_000_000)).unwrap();
        let record = lab.truth().fault(id).unwrap().clone();
        (lab, record)
    }

    #[test]
    fn hits_between_frames_count_unless_nobody_counts_them() {
        let card = FaultEntry::new(FaultName::NicDamaged).at("maindevice");
        let card = |part: &str| card.clone().with("part", part).with("hits_per_s", 10.0);
        let (lab, record) = played(&card("receiver"));
        assert!(
            record.symbol_errors > 0 && record.frames_spoiled == 0,
            "between frames: {record:?}"
        );
        assert_eq!(effects(&lab, &record), 0, "no card counts them");
        assert!(is_bearable(&lab, &record, &card("receiver"), None));
        let (lab, record) = played(&card("transmitter"));
        assert_eq!(effects(&lab, &record), record.symbol_errors, "the first SubDevice does");
        assert!(record.symbol_errors > 1);
        assert!(!is_bearable(&lab, &record, &card("transmitter"), None));
    }
}
