//! Working counters over all readings, and who shares in them.

use std::collections::BTreeMap;

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::register::FmmuConfig;

use super::super::{Address, Count, LogicalCommand, ObservationFile, ObservedWorkingCounter};
use super::TimedReading;
use crate::model::{Cyclic, NetworkModel, Ordered, Seen};

/// Logical addresses of datagrams of which none is given: nobody uses them.
const NOWHERE: u32 = 0xF000_0000;
/// Distance of those.
const APART: u32 = 0x1000;
/// FMMUs of a file have numbers that no controller has.
const FIRST_FMMU: usize = 128;

/// Records the working counters of each step.
pub(super) fn teach(file: &ObservationFile, model: &mut NetworkModel, steps: &[TimedReading<'_>]) {
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    // What any reading expects of a datagram; the file itself first.
    let mut expected: BTreeMap<String, u16> = BTreeMap::new();
    let told = file.working_counters.iter().enumerate();
    let read = steps.iter().flat_map(|step| &step.counters).map(|(index, told)| (*index, *told));
    for (index, told) in told.chain(read) {
        if let Some(count) = told.expected {
            expected.entry(told.key(index)).or_insert(count);
        }
    }
    for step in steps {
        for (index, told) in &step.counters {
            let key = told.key(*index);
            let expected = expected.get(&key).copied().or_else(|| told.computed());
            let Some(first) = expected.or(told.received) else { continue };
            let at = *known.entry(key.clone()).or_insert_with(|| {
                let number = model.cyclic.len();
                let start = match told.address {
                    Some(Address(address)) => LogicalAddress(address),
                    None => LogicalAddress(NOWHERE + APART * (number as u32 % 0xFFFF)),
                };
                let seen = Seen::new(first, step.at, None);
                let len = told.length.unwrap_or(1);
                let mut cyclic = Cyclic::new(told.command.command(), start, len, seen, None);
                cyclic.name = told.address.is_none().then(|| key.clone()).or(told.name.clone());
                model.cyclic.push(cyclic);
                number
            });
            share(file, model, at, told);
            let Some(cyclic) = model.cyclic.get_mut(at) else { continue };
            if let Some(expected) = expected {
                model.reported.expected.insert(cyclic.label(), expected);
            }
            let Some(received) = told.received else { continue };
            cyclic.wkc.record(Seen::new(received, step.at, None), || Ordered::No);
            if let Some(Count(count)) = told.count {
                cyclic.wkc.add_to_deficit(count.saturating_sub(1));
            }
        }
    }
}

/// Notes who shares in a datagram, as its FMMUs would.
fn share(
    file: &ObservationFile,
    model: &mut NetworkModel,
    at: usize,
    told: &ObservedWorkingCounter,
) {
    let Some(cyclic) = model.cyclic.get(at) else { return };
    let (start, len) = (cyclic.start, cyclic.len);
    let Ok(number) = u8::try_from(FIRST_FMMU + at) else { return };
    let mut shares: BTreeMap<usize, (bool, bool)> = BTreeMap::new();
    let find = |name: &String| file.find(name);
    for index in told.inputs.iter().filter_map(find) {
        shares.entry(index).or_default().0 = true;
    }
    for index in told.outputs.iter().filter_map(find) {
        shares.entry(index).or_default().1 = true;
    }
    for index in told.devices.iter().filter_map(find) {
        shares.entry(index).or_insert(match told.command {
            LogicalCommand::Lrd => (true, false),
            LogicalCommand::Lwr => (false, true),
            LogicalCommand::Lrw => (true, true),
        });
    }
    for (index, (reads, writes)) in shares {
        let whole = FmmuConfig::inputs(start, len, RegisterAddress(0));
        let fmmu = FmmuConfig { reads, writes, ..whole };
        if let Some(device) = model.devices.get_mut(index) {
            device.fmmus.insert(number, fmmu);
        }
    }
}

impl ObservedWorkingCounter {
    /// What is expected by who shares in it, where each of them is told.
    fn computed(&self) -> Option<u16> {
        if !self.devices.is_empty() || (self.inputs.is_empty() && self.outputs.is_empty()) {
            return None;
        }
        let command = self.command.command();
        let share = |name: &String| {
            command.increment(self.inputs.contains(name), self.outputs.contains(name))
        };
        let outputs_alone = self.outputs.iter().filter(|name| !self.inputs.contains(name));
        Some(self.inputs.iter().chain(outputs_alone).map(share).fold(0, u16::saturating_add))
    }

    /// All SubDevices that it names.
    pub(in super::super) fn owners(&self) -> impl Iterator<Item = &str> {
        self.devices.iter().chain(&self.inputs).chain(&self.outputs).map(String::as_str)
    }
}
