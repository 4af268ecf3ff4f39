//! Comparison of two captures of a line, such as before and after a repair.

use std::collections::{BTreeMap, BTreeSet};

use linesman_diagnosis::report::{Diagnosis, FindingReport, PlaceReport};
use serde::{Deserialize, Serialize};

use crate::network::devices::SurveyedDevice;
use crate::network::report::CaptureReport;

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.capture-comparison/1";
/// Times that differ by less, in percent, are the same.
const SAME_PERCENT: u64 = 2;

/// Differences between two captures.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ComparisonReport {
    /// `linesman.capture-comparison/1`.
    pub schema: String,
    /// Name and version of the program.
    pub tool: String,
    /// The first capture.
    pub before: String,
    /// The second capture.
    pub after: String,
    /// Differences in the order network, SubDevices, frames, findings.
    pub changes: Vec<ChangeReport>,
}

/// Something that differs.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ChangeReport {
    /// What: `SubDevices`, `state`, `lost frames`, `finding`.
    pub what: String,
    /// Number of the SubDevice in the capture that has it; `null` for the network.
    pub no: Option<u32>,
    /// Place of a finding.
    pub place: Option<PlaceReport>,
    /// In the first capture; `null` where it is not in it.
    pub before: Option<String>,
    /// In the second capture; `null` where it is not in it.
    pub after: Option<String>,
    /// Which of the two is the better one.
    pub tendency: Tendency,
}

/// Which of two captures is the better one.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Tendency {
    /// The second one.
    Better,
    /// The first one.
    Worse,
    /// They differ, and that says nothing of better or worse.
    Other,
}

/// A capture with its diagnosis.
pub type JudgedCapture<'a> = (&'a CaptureReport, &'a Diagnosis);

/// Differences between two captures.
#[must_use]
pub fn compare(before: JudgedCapture<'_>, after: JudgedCapture<'_>) -> ComparisonReport {
    let mut changes = Changes::default();
    network(&mut changes, before, after);
    devices(&mut changes, before.0, after.0);
    frames(&mut changes, before.0, after.0);
    findings(&mut changes, before.1, after.1);
    ComparisonReport {
        schema: SCHEMA.to_owned(),
        tool: after.0.tool.clone(),
        before: before.0.source.clone(),
        after: after.0.source.clone(),
        changes: changes.0,
    }
}

#[derive(Default)]
struct Changes(Vec<ChangeReport>);

impl Changes {
    fn push(
        &mut self,
        what: &str,
        no: Option<u32>,
        values: (Option<String>, Option<String>),
        tendency: Tendency,
    ) {
        if values.0 != values.1 {
            let (before, after) = values;
            let what = what.to_owned();
            self.0.push(ChangeReport { what, no, place: None, before, after, tendency });
        }
    }

    /// A number of which fewer are better.
    fn count(&mut self, what: &str, no: Option<u32>, before: u64, after: u64) {
        let tendency = if after < before { Tendency::Better } else { Tendency::Worse };
        self.push(what, no, (Some(before.to_string()), Some(after.to_string())), tendency);
    }
}

fn network(changes: &mut Changes, before: JudgedCapture<'_>, after: JudgedCapture<'_>) {
    let word = |one: &Diagnosis| format!("{:?}", one.verdict).to_lowercase();
    changes.push("verdict", None, (Some(word(before.1)), Some(word(after.1))), Tendency::Other);
    let (one, other) = (&before.0.network, &after.0.network);
    let counts = (Some(one.devices.0.to_string()), Some(other.devices.0.to_string()));
    let tendency = match one.devices.cmp(&other.devices) {
        std::cmp::Ordering::Less => Tendency::Better,
        std::cmp::Ordering::Equal | std::cmp::Ordering::Greater => Tendency::Worse,
    };
    changes.push("SubDevices", None, counts, tendency);
    let clock = |one: &CaptureReport| {
        let clock = one.network.reference_clock.as_ref()?;
        Some(format!("SubDevice {}, {} take part", clock.no?, clock.takes_part))
    };
    changes.push("reference clock", None, (clock(before.0), clock(after.0)), Tendency::Other);
}

fn devices(changes: &mut Changes, before: &CaptureReport, after: &CaptureReport) {
    let keys = |one: &CaptureReport| one.devices.iter().map(DeviceKey::of).collect::<Vec<_>>();
    let pairs = pair(&keys(before), &keys(after));
    let partner: BTreeMap<usize, usize> = pairs.iter().copied().collect();
    for (index, device) in before.devices.iter().enumerate() {
        match partner.get(&index) {
            Some(other) => device_changes(changes, device, &after.devices[*other]),
            None => {
                let no = Some(device.about.no);
                changes.push("SubDevice", no, (Some(called(device)), None), Tendency::Other);
            }
        }
    }
    let known: BTreeSet<usize> = partner.values().copied().collect();
    for (index, device) in after.devices.iter().enumerate() {
        if !known.contains(&index) {
            let no = Some(device.about.no);
            changes.push("SubDevice", no, (None, Some(called(device))), Tendency::Other);
        }
    }
    let rises = |one: &CaptureReport| -> BTreeMap<(u32, String), u64> {
        let counters = one.counters.iter().flat_map(|device| {
            device.counters.iter().map(|counter| {
                let port =
                    counter.port.as_ref().map_or_else(String::new, |it| format!(", port {it}"));
                ((device.no, format!("{}{port}", counter.name)), counter.rose.0)
            })
        });
        counters.collect()
    };
    let now_called: BTreeMap<u32, u32> = pairs
        .iter()
        .map(|(one, other)| (before.devices[*one].about.no, after.devices[*other].about.no))
        .collect();
    let (one, other) = (rises(before), rises(after));
    for ((no, name), rose) in &one {
        let Some(now_no) = now_called.get(no) else { continue };
        // What was not read after the repair says nothing.
        if let Some(now) = other.get(&(*now_no, name.clone())) {
            changes.count(&format!("rise of {name}"), Some(*no), *rose, *now);
        }
    }
}

/// Facts by which a SubDevice is found again in another capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct DeviceKey {
    no: u32,
    vendor: Option<u32>,
    product: Option<u32>,
    /// The serial number; 0 is none.
    serial: Option<u32>,
}

impl DeviceKey {
    fn of(device: &SurveyedDevice) -> Self {
        let about = &device.about;
        Self {
            no: about.no,
            vendor: about.vendor_id,
            product: about.product_code,
            serial: about.serial.filter(|serial| *serial != 0),
        }
    }

    /// True if nothing that both captures have read tells them apart.
    fn may_be(&self, other: &Self) -> bool {
        let agree = |one: Option<u32>, other: Option<u32>| {
            one.zip(other).is_none_or(|(one, other)| one == other)
        };
        agree(self.vendor, other.vendor)
            && agree(self.product, other.product)
            && agree(self.serial, other.serial)
    }

    /// Identity by which it is known wherever it is.
    fn unique(&self) -> Option<(Option<u32>, Option<u32>, u32)> {
        self.serial.map(|serial| (self.vendor, self.product, serial))
    }
}

/// Which SubDevices of two captures are the same, by their indexes: those whose number stayed and whose identity may have,
/// then those whose identity with serial number is found elsewhere, then those of one number, of which one was
/// exchanged. Station addresses do not count: another MainDevice gives others.
fn pair(before: &[DeviceKey], after: &[DeviceKey]) -> Vec<(usize, usize)> {
    let numbered = after.iter().enumerate();
    let by_no: BTreeMap<u32, usize> = numbered.clone().map(|(at, key)| (key.no, at)).collect();
    let unique = numbered.rev().filter_map(|(at, key)| Some((key.unique()?, at)));
    let by_identity: BTreeMap<_, usize> = unique.collect();
    let of_no = |one: &DeviceKey| by_no.get(&one.no).copied();
    let (mut found, mut taken) = (vec![None; before.len()], vec![false; after.len()]);
    let mut step = |find: &dyn Fn(&DeviceKey) -> Option<usize>| {
        for (one, found) in before.iter().zip(&mut found).filter(|(_, found)| found.is_none()) {
            *found = find(one).filter(|other| !taken[*other]);
            found.iter().for_each(|other: &usize| taken[*other] = true);
        }
    };
    step(&|one| of_no(one).filter(|other| one.may_be(&after[*other])));
    step(&|one| by_identity.get(&one.unique()?).copied());
    step(&of_no);
    let indexed = found.into_iter().enumerate();
    indexed.filter_map(|(index, other)| Some((index, other?))).collect()
}

/// Name of a SubDevice that only one capture has.
fn called(device: &SurveyedDevice) -> String {
    let kind = device.about.type_name.as_deref().or(device.described_as.as_deref());
    kind.unwrap_or("not identified").to_owned()
}

fn device_changes(changes: &mut Changes, before: &SurveyedDevice, after: &SurveyedDevice) {
    let no = Some(before.about.no);
    let number = |value: Option<u32>| value.map(|value| format!("0x{value:08X}"));
    let (one, other) = (&before.about, &after.about);
    // What only one of them has read differs in knowledge, not on the line.
    let mut both = |what: &str, values: (Option<String>, Option<String>), tendency| {
        if values.0.is_some() && values.1.is_some() {
            changes.push(what, no, values, tendency);
        }
    };
    let other_way = Tendency::Other;
    both("number", (Some(one.no.to_string()), Some(other.no.to_string())), other_way);
    both("vendor", (number(one.vendor_id), number(other.vendor_id)), other_way);
    both("product", (number(one.product_code), number(other.product_code)), other_way);
    both("revision", (number(one.revision), number(other.revision)), other_way);
    let serial = |value: Option<u32>| value.map(|value| value.to_string());
    both("serial number", (serial(one.serial), serial(other.serial)), other_way);
    let station = |value: Option<u16>| value.map(|value| format!("0x{value:04X}"));
    both("station address", (station(one.station), station(other.station)), other_way);
    let is_up = rank(other.state.as_deref()) > rank(one.state.as_deref());
    let tendency = if is_up { Tendency::Better } else { Tendency::Worse };
    both("last state", (one.state.clone(), other.state.clone()), tendency);
    let code = |value: Option<u16>| {
        Some(value.map_or_else(|| "none".to_owned(), |it| format!("0x{it:04X}")))
    };
    let is_gone = other.al_status_code.is_none();
    let tendency = if is_gone { Tendency::Better } else { Tendency::Worse };
    both("AL status code", (code(one.al_status_code), code(other.al_status_code)), tendency);
}

fn rank(state: Option<&str>) -> usize {
    let states = ["INIT", "BOOT", "PREOP", "SAFEOP", "OP"];
    states.iter().position(|one| Some(*one) == state).map_or(0, |at| at + 1)
}

fn frames(changes: &mut Changes, before: &CaptureReport, after: &CaptureReport) {
    let lost = |one: &CaptureReport| (one.recording.lost.0, one.recording.damaged.0);
    let (one, other) = (lost(before), lost(after));
    changes.count("lost frames", None, one.0, other.0);
    changes.count("damaged frames", None, one.1, other.1);
    let misses = |one: &CaptureReport| -> u64 {
        // One datagram may be in several kinds of frames, each of which tells all its misses.
        let mut told = BTreeSet::new();
        let datagrams = one.cyclic.iter().flat_map(|frame| &frame.datagrams);
        let once = datagrams.filter(|one| told.insert((&one.command, one.logical, one.len)));
        once.flat_map(|one| &one.misses).map(|miss| miss.count.0).sum()
    };
    changes.count("working counters too low", None, misses(before), misses(after));
    let refused = |one: &CaptureReport| {
        let is_refused = |it: &&crate::dialogue::TransferReport| {
            it.outcome == crate::dialogue::TransferOutcome::Refused
        };
        one.transfers.iter().filter(is_refused).count() as u64
    };
    changes.count("refused mailbox transfers", None, refused(before), refused(after));
    let cycle = |one: &CaptureReport| one.tasks.first().map(|task| task.cycle_ns.0);
    times(changes, "cycle of the fastest task", cycle(before), cycle(after));
    let response = |one: &CaptureReport| one.timing.response.map(|it| it.median_ns.0);
    times(changes, "usual response time", response(before), response(after));
    changes.count("late frames", None, before.timing.late.0, after.timing.late.0);
}

fn times(changes: &mut Changes, what: &str, before: Option<u64>, after: Option<u64>) {
    let is_same = match (before, after) {
        (Some(one), Some(other)) => one.abs_diff(other) * 100 <= one.max(other) * SAME_PERCENT,
        (one, other) => one == other,
    };
    if !is_same {
        let text = |ns: Option<u64>| ns.map(|ns| format!("{ns} ns"));
        changes.push(what, None, (text(before), text(after)), Tendency::Other);
    }
}

fn findings(changes: &mut Changes, before: &Diagnosis, after: &Diagnosis) {
    let is_same = |one: &FindingReport, other: &FindingReport| {
        one.code == other.code && one.place == other.place && one.cause == other.cause
    };
    let text = |one: &FindingReport| Some(format!("{} {}, {}", one.code, one.name, one.cause));
    for gone in &before.findings {
        if !after.findings.iter().any(|one| is_same(one, gone)) {
            changes.push("finding", None, (text(gone), None), Tendency::Better);
            changes.0.last_mut().into_iter().for_each(|one| one.place = Some(gone.place.clone()));
        }
    }
    for new in &after.findings {
        if !before.findings.iter().any(|one| is_same(one, new)) {
            changes.push("finding", None, (None, text(new)), Tendency::Worse);
            changes.0.last_mut().into_iter().for_each(|one| one.place = Some(new.place.clone()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(no: u32, product: u32, serial: u32) -> DeviceKey {
        let serial = Some(serial).filter(|serial| *serial != 0);
        DeviceKey { no, vendor: Some(2), product: Some(product), serial }
    }

    #[test]
    fn subdevices_behind_one_that_was_put_in_are_found_by_their_serial_numbers() {
        let before = [key(1, 1100, 11), key(2, 1008, 12), key(3, 2008, 13)];
        let after = [key(1, 1100, 11), key(2, 3104, 99), key(3, 1008, 12), key(4, 2008, 13)];
        assert_eq!(pair(&before, &after), [(0, 0), (1, 2), (2, 3)]);
    }

    #[test]
    fn exchanged_one_is_compared_with_the_one_that_was_in_its_place() {
        let before = [key(1, 1100, 11), key(2, 1008, 12)];
        let after = [key(1, 1100, 11), key(2, 1008, 77)];
        assert_eq!(pair(&before, &after), [(0, 0), (1, 1)]);
        let other_type = [key(1, 1100, 11), key(2, 2008, 0)];
        assert_eq!(pair(&before, &other_type), [(0, 0), (1, 1)]);
    }

    #[test]
    fn equal_ones_without_serial_numbers_stay_with_their_numbers() {
        let line = [key(1, 1100, 0), key(2, 1008, 0), key(3, 1008, 0)];
        assert_eq!(pair(&line, &line[..2]), [(0, 0), (1, 1)]);
        let unknown = DeviceKey { no: 2, vendor: None, product: None, serial: None };
        assert_eq!(pair(&line, &[line[0], unknown]), [(0, 0), (1, 1)]);
    }

    #[test]
    fn two_that_changed_places_are_told_by_their_serial_numbers() {
        let before = [key(1, 1008, 5), key(2, 1008, 6)];
        let after = [key(1, 1008, 6), key(2, 1008, 5)];
        assert_eq!(pair(&before, &after), [(0, 1), (1, 0)]);
    }
}
