//! Collection of the facts of all blocks into one observation.

mod roster;
mod timeline;

use std::collections::BTreeMap;

use linesman_config::attachment::Attachment;
use linesman_proto::address::Path;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::state::DeviceState;

use self::roster::Roster;
use self::timeline::Timeline;
use super::fact::{Block, FactKind, Format, SubDeviceFact, SubDeviceRef};
use super::wiring::{self, Hints};
use super::{Understood, UnderstoodBlock, ethtool};
use crate::model::reported::WiringBasis;
use crate::observation_file::{
    Address, Count, ObservationFile, ObservedAbort, ObservedDevice, ObservedEmergency,
    ObservedMainDevice, ObservedWorkingCounter, ReadDevice, ReadPort, Reading, Word,
};

/// All blocks as one observation, with what was assumed for it.
pub(super) fn gather(
    blocks: &[Block],
    understood: &mut Understood,
) -> (ObservationFile, Vec<String>) {
    for block in blocks {
        let named = block
            .shell
            .as_deref()
            .and_then(ethtool::interface)
            .filter(|_| block.format == Format::Ethtool);
        let what = match named {
            Some(name) => format!("{} of {name}", block.what),
            None => block.what.clone(),
        };
        understood.blocks.push(UnderstoodBlock { what, from: block.from, to: block.to });
    }
    let mut assumed = Vec::new();
    let roster = Roster::of(blocks, &mut assumed);
    let timeline = Timeline::of(blocks, &mut assumed);
    let kind = blocks.iter().find_map(|block| block.kind).unwrap_or_default();
    let mut gatherer = Gatherer {
        file: ObservationFile { kind, ..ObservationFile::default() },
        reads: vec![ReadDevice::default(); roster.len()],
        roster,
        added: zeros(blocks),
        interrupted: BTreeMap::new(),
        readings: Vec::new(),
    };
    gatherer.collect(blocks, &timeline);
    let mut file = gatherer.finish(&timeline, &mut assumed);
    if file.project().tree().is_err() {
        // What a text says of neighbours may be impossible.
        line_in_order(&mut file);
        file.wiring = WiringBasis::Order;
        assumed.push(
            "the wiring that the text tells is impossible: assumed a line in order".to_owned(),
        );
    }
    (file, assumed)
}

struct Gatherer {
    file: ObservationFile,
    roster: Roster,
    /// What is known in the end of each SubDevice.
    reads: Vec<ReadDevice>,
    /// What logs have counted so far.
    added: ObservedMainDevice,
    /// Stretches that are gone: from whom to whom.
    interrupted: BTreeMap<usize, usize>,
    /// Readings with their time before the end, in seconds.
    readings: Vec<(f64, Reading)>,
}

/// When something was read.
#[derive(Clone, Copy, PartialEq, Debug)]
enum ReadTime {
    /// In the end.
    Last,
    /// So many seconds before the end.
    Before(f64),
}

impl Gatherer {
    fn collect(&mut self, blocks: &[Block], timeline: &Timeline) {
        // What the card sends counts only where nobody knows better.
        let knows_sent =
            blocks.iter().any(|block| matches!(block.format, Format::IghMaster | Format::Frames));
        for (index, block) in blocks.iter().enumerate() {
            for (number, fact) in block.facts.iter().enumerate() {
                let when = timeline.when(blocks, index, number);
                let mut what = fact.what.clone();
                if let (FactKind::Main(main), Format::Ethtool, true) =
                    (&mut what, block.format, knows_sent)
                {
                    (main.sent, main.send_errors) = (None, None);
                }
                self.take(what, when, timeline);
            }
        }
    }

    fn take(&mut self, what: FactKind, when: ReadTime, timeline: &Timeline) {
        match what {
            FactKind::SubDeviceFact(..) => {}
            FactKind::Read(whom, read) => {
                if let Some(index) = self.roster.find(&whom) {
                    self.read(index, *read, when);
                }
            }
            FactKind::Main(main) => self.main(*main, when),
            FactKind::Added(main) => {
                add(&mut self.added, &main);
                let main = self.added.clone();
                self.main(main, when);
            }
            FactKind::WorkingCounter(mut counter, whom) => {
                let labels =
                    whom.iter().filter_map(|whom| Some(self.roster.label(self.roster.find(whom)?)));
                counter.devices = labels.collect();
                counter.devices.dedup();
                self.counter(*counter, when);
            }
            FactKind::Emergency { whom, code, register, data } => {
                let Some(index) = self.roster.find(&whom) else { return };
                let (at, at_s) = timeline.time(when);
                let device = self.roster.label(index);
                let code = Some(Word(code));
                self.file.emergencies.push(ObservedEmergency {
                    device,
                    code,
                    register,
                    data,
                    at,
                    at_s,
                });
            }
            FactKind::Abort { whom, index, subindex, code } => {
                let Some(at_device) = self.roster.find(&whom) else { return };
                let (at, at_s) = timeline.time(when);
                let device = self.roster.label(at_device);
                let (index, code) = (Some(Word(index)), Some(Address(code)));
                self.file.aborts.push(ObservedAbort { device, index, subindex, code, at, at_s });
            }
            FactKind::Interrupted { from, to, is_back } => {
                let (Some(from), Some(to)) = (self.roster.find(&from), self.roster.find(&to))
                else {
                    return;
                };
                let to = match is_back {
                    true => self.interrupted.remove(&from).unwrap_or(to).max(to),
                    false => *self.interrupted.entry(from).insert_entry(to.max(from)).get(),
                };
                for index in from..=to {
                    let read = match is_back {
                        // It was heard, and nobody says more.
                        true => ReadDevice { al_code: Some(Word(0)), ..ReadDevice::default() },
                        false => ReadDevice {
                            state: Some("INIT NO_COMM".to_owned()),
                            ..ReadDevice::default()
                        },
                    };
                    self.read(index, read, when);
                }
            }
        }
    }

    fn read(&mut self, index: usize, read: ReadDevice, when: ReadTime) {
        match when {
            ReadTime::Last => {
                if let Some(into) = self.reads.get_mut(index) {
                    merge(into, read);
                }
            }
            ReadTime::Before(seconds) => {
                let no = u32::try_from(index + 1).ok();
                let devices = vec![ReadDevice { no, ..read }];
                self.readings.push((seconds, Reading { devices, ..Reading::default() }));
            }
        }
    }

    fn main(&mut self, main: ObservedMainDevice, when: ReadTime) {
        match when {
            ReadTime::Last => merge_main(self.file.maindevice.get_or_insert_default(), main),
            ReadTime::Before(seconds) => {
                let maindevice = Some(main);
                self.readings.push((seconds, Reading { maindevice, ..Reading::default() }));
            }
        }
    }

    fn counter(&mut self, counter: ObservedWorkingCounter, when: ReadTime) {
        match when {
            ReadTime::Last => self.file.working_counters.push(counter),
            ReadTime::Before(seconds) => {
                let working_counters = vec![counter];
                self.readings.push((seconds, Reading { working_counters, ..Reading::default() }));
            }
        }
    }

    fn finish(mut self, timeline: &Timeline, assumed: &mut Vec<String>) -> ObservationFile {
        self.readings.sort_by(|(one, _), (other, _)| other.total_cmp(one));
        for (seconds, mut reading) in std::mem::take(&mut self.readings) {
            (reading.at, reading.at_s) = timeline.time(ReadTime::Before(seconds));
            self.file.readings.push(reading);
        }
        let has_times = !self.file.readings.is_empty()
            || self.file.emergencies.iter().any(|one| one.at.is_some() || one.at_s.is_some());
        if has_times {
            (self.file.at, self.file.at_s) = timeline.time(ReadTime::Last);
        }
        self.file.times_are_assumed = timeline.is_assumed();
        let mut latest: BTreeMap<u32, &str> = BTreeMap::new();
        for read in self.file.readings.iter().flat_map(|reading| &reading.devices) {
            if let (Some(no), Some(state)) = (read.no, &read.state) {
                latest.insert(no, state);
            }
        }
        let hints: Vec<Hints> = self
            .roster
            .devices()
            .iter()
            .enumerate()
            .map(|(index, about)| self.hints(index, about, &latest))
            .collect();
        let (places, basis) = wiring::places(&hints);
        self.file.wiring = basis;
        match basis {
            WiringBasis::Told => {}
            WiringBasis::Types => assumed.push(
                "the wiring is not told: assumed from the order of the list and the types (terminals side by side, \
                 couplers by their sockets)"
                    .to_owned(),
            ),
            WiringBasis::Order => assumed.push(
                "the wiring is not told: assumed a line in order, each behind port B of the one before".to_owned(),
            ),
        }
        let labels: Vec<String> =
            (0..self.roster.len()).map(|index| self.roster.label(index)).collect();
        let reads = std::mem::take(&mut self.reads);
        for ((index, (above, entry)), read) in places.into_iter().enumerate().zip(reads) {
            let on = match above {
                None => Attachment::MainDevice(Path::A),
                Some((before, port)) => Attachment::Device { name: labels[before].clone(), port },
            };
            let mut device = ObservedDevice::at(on);
            device.no = u32::try_from(index + 1).ok();
            device.entry = entry.to_string();
            device.name = self.roster.name(index);
            fill(&mut device, &self.roster.devices()[index], read);
            self.file.devices.push(device);
        }
        self.file
    }

    /// What tells of the place of a SubDevice. `latest` is the last state that a reading has of each.
    fn hints(&self, index: usize, about: &SubDeviceFact, latest: &BTreeMap<u32, &str>) -> Hints {
        let own = self.reads.get(index).and_then(|read| read.state.as_deref());
        let earlier = || latest.get(&u32::try_from(index + 1).ok()?).copied();
        let state: Option<DeviceState> = own.or_else(earlier).and_then(|text| text.parse().ok());
        let told = self.reads.get(index).map(|read| read.ports.all()).unwrap_or_default();
        let missing = PortMap::from_fn(|port| {
            let flagged = state.is_some_and(|state| {
                state.contains(DeviceState::MISSING_LINK) && state.ports()[port]
            });
            flagged || told[port].as_ref().is_some_and(|port| port.link == Some(false))
        });
        Hints {
            type_name: about.type_name.clone(),
            answers: state.map(|state| !state.contains(DeviceState::NOT_PRESENT)),
            missing,
            open: about.open,
            neighbours: about.neighbours,
        }
    }
}

/// What a text says of a SubDevice, as an observation file has it.
fn fill(device: &mut ObservedDevice, about: &SubDeviceFact, read: ReadDevice) {
    device.type_name = about.type_name.clone().unwrap_or_default();
    device.station = about.station;
    device.vendor_id = about.vendor_id;
    device.product_code = about.product_code;
    device.revision = about.revision;
    device.serial = about.serial;
    device.delay_ns = about.delay_ns;
    device.state = read.state;
    device.al_code = read.al_code;
    device.processing_unit = read.processing_unit;
    device.crc = read.crc;
    device.state_changes = read.state_changes;
    device.absences = read.absences;
    device.configuration_failed = read.configuration_failed;
    device.clock_failed = read.clock_failed;
    for (port, told) in read.ports.all().iter() {
        *device.ports.port_mut(port) = told.as_ref().map(ReadPort::observed);
    }
}

/// Takes over what a later text says.
fn merge(into: &mut ReadDevice, from: ReadDevice) {
    fn take<T>(into: &mut Option<T>, from: Option<T>) {
        if from.is_some() {
            *into = from;
        }
    }
    take(&mut into.state, from.state);
    take(&mut into.al_code, from.al_code);
    take(&mut into.processing_unit, from.processing_unit);
    take(&mut into.crc, from.crc);
    take(&mut into.state_changes, from.state_changes);
    take(&mut into.absences, from.absences);
    take(&mut into.configuration_failed, from.configuration_failed);
    take(&mut into.clock_failed, from.clock_failed);
    for (port, told) in from.ports.all().iter() {
        let Some(told) = told else { continue };
        let into = into.port_mut(port);
        take(&mut into.link, told.link);
        take(&mut into.open, told.open);
        take(&mut into.communication, told.communication);
        take(&mut into.rx, told.rx);
        take(&mut into.frame, told.frame);
        take(&mut into.physical, told.physical);
        take(&mut into.forwarded, told.forwarded);
        take(&mut into.lost_link, told.lost_link);
        into.total |= told.total;
    }
}

/// Takes over what another text says of the MainDevice; what was told first counts.
fn merge_main(into: &mut ObservedMainDevice, from: ObservedMainDevice) {
    fn take<T>(into: &mut Option<T>, from: Option<T>) {
        if into.is_none() {
            *into = from;
        }
    }
    let ObservedMainDevice {
        link,
        sent,
        lost,
        lost_per_s,
        late,
        late_cycles,
        timed_out,
        unmatched,
        skipped,
        corrupted,
        crc,
        drops,
        send_errors,
        cycle_us,
        answering,
        ring_open,
        states,
    } = from;
    take(&mut into.link, link);
    take(&mut into.sent, sent);
    take(&mut into.lost, lost);
    take(&mut into.lost_per_s, lost_per_s);
    take(&mut into.late, late);
    take(&mut into.late_cycles, late_cycles);
    take(&mut into.timed_out, timed_out);
    take(&mut into.unmatched, unmatched);
    take(&mut into.skipped, skipped);
    take(&mut into.corrupted, corrupted);
    take(&mut into.crc, crc);
    take(&mut into.drops, drops);
    take(&mut into.send_errors, send_errors);
    take(&mut into.cycle_us, cycle_us);
    take(&mut into.answering, answering);
    take(&mut into.ring_open, ring_open);
    take(&mut into.states, states);
}

/// What logs count at all, at 0: a log begins so with its first line, and nothing of it is taken for history.
fn zeros(blocks: &[Block]) -> ObservedMainDevice {
    let mut zeros = ObservedMainDevice::default();
    for what in blocks.iter().flat_map(|block| &block.facts).map(|fact| &fact.what) {
        if let FactKind::Added(main) = what {
            add(&mut zeros, main);
        }
    }
    let slots = [
        &mut zeros.timed_out,
        &mut zeros.unmatched,
        &mut zeros.skipped,
        &mut zeros.corrupted,
        &mut zeros.lost,
    ];
    slots.into_iter().flatten().for_each(|slot| *slot = Count(0));
    zeros
}

/// Adds what a log counted since the last line.
fn add(into: &mut ObservedMainDevice, more: &ObservedMainDevice) {
    let slots = [
        (&mut into.timed_out, more.timed_out),
        (&mut into.unmatched, more.unmatched),
        (&mut into.skipped, more.skipped),
        (&mut into.corrupted, more.corrupted),
        (&mut into.lost, more.lost),
    ];
    for (slot, more) in slots {
        if let Some(Count(more)) = more {
            *slot = Some(Count(slot.map_or(0, |Count(known)| known).saturating_add(more)));
        }
    }
}

/// A line in order, each behind port B of the one before.
fn line_in_order(file: &mut ObservationFile) {
    let labels: Vec<String> = file.devices.iter().map(ObservedDevice::label).collect();
    for (index, device) in file.devices.iter_mut().enumerate() {
        device.on = match index.checked_sub(1) {
            None => Attachment::MainDevice(Path::A),
            Some(before) => Attachment::Device { name: labels[before].clone(), port: Port::B },
        };
        device.entry = Port::A.to_string();
    }
}

/// Whom a fact is about.
fn whom(what: &FactKind) -> impl Iterator<Item = &SubDeviceRef> {
    let (one, other) = match what {
        FactKind::SubDeviceFact(whom, _)
        | FactKind::Read(whom, _)
        | FactKind::Emergency { whom, .. }
        | FactKind::Abort { whom, .. } => (Some(whom), None),
        FactKind::Interrupted { from, to, .. } => (Some(from), Some(to)),
        FactKind::Main(_) | FactKind::Added(_) | FactKind::WorkingCounter(..) => (None, None),
    };
    [one, other].into_iter().flatten()
}
