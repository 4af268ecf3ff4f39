//! Error counters of one SubDevice over all readings.

use std::collections::BTreeMap;

use linesman_proto::port::PortMap;
use linesman_proto::register::{ErrorCounter, ErrorCounters};
use linesman_proto::time::Instant;

use super::super::{Count, EarlierPort, ObservedDevice, ObservedPort};
use super::device::Values;
use crate::model::Device;

/// Readings of some counters.
type CounterReadings = Vec<(ErrorCounter, u64)>;

/// Records earlier and present values. Where nothing says what a counter was before, and it was read but
/// once, it is taken for 0, and may be old.
pub(super) fn teach(
    observed: &ObservedDevice,
    device: &mut Device,
    values: &[(Instant, Values)],
    totals: bool,
) {
    let read: Vec<(Instant, CounterReadings)> =
        values.iter().map(|(at, read)| (*at, counts(read))).collect();
    let before: BTreeMap<ErrorCounter, u64> = earlier(observed).into_iter().collect();
    let mut times: BTreeMap<ErrorCounter, (u32, u64)> = BTreeMap::new();
    for (counter, value) in read.iter().flat_map(|(_, counts)| counts) {
        let (times, largest) = times.entry(*counter).or_default();
        (*times, *largest) = (*times + 1, (*largest).max(*value));
    }
    let is_added_up = PortMap::from_fn(|port| {
        values.iter().any(|(_, read)| read.ports[port].as_ref().is_some_and(|port| port.total))
    });
    let is_total = |counter: &ErrorCounter| {
        let largest =
            times.get(counter).map(|(_, largest)| *largest).max(before.get(counter).copied());
        let is_told = counter.port().is_some_and(|port| is_added_up[port]);
        totals || is_told || largest > Some(u64::from(u8::MAX))
    };
    let mut begin = CounterReadings::new();
    let mut may_be_old = Vec::new();
    for (counter, (times, _)) in &times {
        match before.get(counter) {
            Some(before) => begin.push((*counter, *before)),
            None if *times == 1 => {
                begin.push((*counter, 0));
                may_be_old.push(*counter);
            }
            None => {}
        }
    }
    for (at, counts) in std::iter::once((Instant::ZERO, begin)).chain(read) {
        let (wide, narrow): (CounterReadings, CounterReadings) =
            counts.into_iter().partition(|(counter, _)| is_total(counter));
        device.counters.record_totals(&wide, at, None);
        let mut registers = ErrorCounters::default();
        for (counter, value) in narrow {
            *registers.slot(counter) = u8::try_from(value).ok();
        }
        device.counters.record_counters(&registers, at, None);
    }
    for counter in may_be_old {
        device.counters.note_may_be_old(counter);
    }
}

fn counts(read: &Values) -> CounterReadings {
    if read.is_absent() {
        return CounterReadings::new();
    }
    let present = |port: &ObservedPort| port.counters();
    let ports = PortMap::from_fn(|port| read.ports[port].as_ref().map(present));
    let unit = read.processing_unit.map(|count| (ErrorCounter::ProcessingUnit, count));
    of_ports(&ports).into_iter().chain(unit).collect()
}

fn earlier(observed: &ObservedDevice) -> CounterReadings {
    let inner = observed.ports.all();
    let outer = observed.before.as_ref().map(|before| before.ports.all()).unwrap_or_default();
    let ports = PortMap::from_fn(|port| {
        let inner = inner[port].as_ref().and_then(|port| port.before.clone());
        inner.or_else(|| outer[port].clone())
    });
    let unit = observed.before.as_ref().and_then(|before| before.processing_unit);
    let unit = unit.map(|Count(count)| (ErrorCounter::ProcessingUnit, count));
    of_ports(&ports).into_iter().chain(unit).collect()
}

fn of_ports(ports: &PortMap<Option<EarlierPort>>) -> CounterReadings {
    let mut found = CounterReadings::new();
    for (port, counters) in ports.iter() {
        let Some(counters) = counters else { continue };
        let of_port = [
            ErrorCounter::InvalidFrame(port),
            ErrorCounter::PhysicalLayer(port),
            ErrorCounter::Forwarded(port),
            ErrorCounter::LostLink(port),
        ];
        let counts = of_port.into_iter().zip(counters.counts());
        found.extend(counts.filter_map(|(counter, count)| Some((counter, count?))));
    }
    found
}
