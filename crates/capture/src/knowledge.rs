//! Knowledge of the network behind a capture, gathered frame by frame by the diagnosis, for rows and expressions.

use std::collections::BTreeMap;

use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::report::FindingReport;
use linesman_diagnosis::{Diagnosis, Engine, FrameSeen, Setup};
use linesman_proto::address::{Network, Position};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::Datagram;
use linesman_proto::time::Instant;
use smallvec::{SmallVec, smallvec};

use crate::row::{CaptureRow, FrameWay};

/// The diagnosis beside a capture that is read, with what it says of the latest frame.
#[derive(Clone, Debug)]
pub struct Knowledge {
    engine: Engine,
    cycle: CycleStart,
}

/// The cycle of the process data.
#[derive(Clone, Copy, Default, Debug)]
struct CycleStart {
    /// Command, address and length of the datagram that begins it: the first that was sent.
    leader: Option<(u8, u32, usize)>,
    began: Option<Instant>,
}

impl Knowledge {
    /// Nothing is known yet.
    #[must_use]
    pub fn new(setup: Setup) -> Self {
        Self { engine: Engine::new(setup), cycle: CycleStart::default() }
    }

    /// Learns what a frame shows, without a row of it.
    pub fn learn(&mut self, seen: &FrameSeen<'_>) {
        self.engine.handle_frame(seen);
        while self.engine.poll_event().is_some() {}
    }

    /// Learns what a frame shows, and adds to its row what is known of it now.
    pub fn annotate(&mut self, seen: &FrameSeen<'_>, row: &mut CaptureRow<'_>) {
        self.learn(seen);
        if self.annotate_copy(seen, row) {
            return;
        }
        let Some(latest) = self.engine.latest_frame(seen.network) else { return };
        row.facts.way = match (latest.is_request(), latest.is_return()) {
            (true, _) => Some(FrameWay::Out),
            (_, true) => Some(FrameWay::Back),
            (false, false) => None,
        };
        if row.facts.way == Some(FrameWay::Out) {
            self.cycle.take(row);
        }
        row.facts.in_cycle = self.cycle.began.map(|began| row.frame.time.since(began));
        if !latest.is_return() {
            return;
        }
        let Some(model) = self.engine.model(seen.network) else { return };
        for (index, datagram) in row.datagrams.iter_mut().enumerate() {
            datagram.wkc_sum = latest.working_counter(index, datagram.datagram.wkc().0);
            if latest.is_whole() {
                datagram.expected_wkc = model.expected_wkc(&datagram.datagram);
            }
        }
    }

    /// Adds what is known of a copy at a port of a capture probe; false if it is none, or its frames do not pass several
    /// ports. The diagnosis takes a frame once it has passed all ports, so its latest frame is another one.
    fn annotate_copy(&mut self, seen: &FrameSeen<'_>, row: &mut CaptureRow<'_>) -> bool {
        let Some(port) = seen.probe.and_then(|record| record.port) else { return false };
        let Some(ports) = self.engine.probe_ports(seen.network) else { return false };
        if ports.port(port).is_none() {
            return false;
        }
        row.facts.way = ports.comes_back(port).map(|comes_back| match comes_back {
            true => FrameWay::Back,
            false => FrameWay::Out,
        });
        row.facts.passed = row.facts.way.and_then(|_| ports.before(port));
        if row.facts.way == Some(FrameWay::Out) && ports.rank(port) == 0 {
            self.cycle.take(row);
        }
        row.facts.in_cycle = self.cycle.began.map(|began| row.frame.time.since(began));
        let Some(model) = self.engine.model(seen.network) else { return true };
        let counted = model.traffic.broadcasts.counted();
        // Before, some SubDevices have not answered yet.
        let is_whole = row.facts.way == Some(FrameWay::Back) && row.facts.passed == Some(counted);
        for datagram in row.datagrams.iter_mut().filter(|_| is_whole) {
            let expected = model.expected_wkc(&datagram.datagram);
            // Of process data the highest counter so far is expected: the model does not know that of this frame yet.
            let own = datagram.is_logical().then_some(datagram.wkc_sum);
            datagram.expected_wkc = expected.map(|expected| own.unwrap_or(0).max(expected));
        }
        true
    }

    /// The capture ends at `at`; `complete` is whether all of it could be read.
    pub fn finish(&mut self, at: Instant, complete: bool) {
        self.engine.finish(at, complete);
    }

    /// The diagnosis.
    #[must_use]
    pub const fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The SubDevices, as they are known now.
    #[must_use]
    pub fn devices(&self) -> DeviceIndex {
        self.engine.model(Network::default()).map(DeviceIndex::of).unwrap_or_default()
    }
}

impl CycleStart {
    fn take(&mut self, row: &CaptureRow<'_>) {
        let key =
            |datagram: &Datagram<'_>| (datagram.code(), datagram.logical().0, datagram.data_len());
        let mut logical = row.datagrams.iter().filter(|datagram| datagram.is_logical());
        let Some(first) = logical.next().map(|row| key(&row.datagram)) else { return };
        if *self.leader.get_or_insert(first) == first {
            self.began = Some(row.frame.time);
        }
    }
}

/// SubDevices by the addresses of datagrams.
#[derive(Clone, Default, Debug)]
pub struct DeviceIndex {
    stations: BTreeMap<u16, u32>,
    positions: BTreeMap<u16, u32>,
    /// Controllers that a frame passes on its way.
    passed: u16,
    /// Who has a part in process data, by address and length.
    owners: BTreeMap<(u32, u16), SmallVec<[u32; 4]>>,
}

impl DeviceIndex {
    /// Those of a network.
    #[must_use]
    pub fn of(model: &NetworkModel) -> Self {
        let devices = model.devices.iter();
        let station = |(device, no): (&linesman_diagnosis::model::Device, u32)| {
            device.station.map(|station| (station.0, no))
        };
        let numbered = || devices.clone().zip(1..);
        let owners = model.cyclic.iter().map(|cyclic| {
            let numbers = model.owners(cyclic).map(|owner| owner.device.no()).collect();
            ((cyclic.start.0, cyclic.len), numbers)
        });
        Self {
            stations: numbered().filter_map(station).collect(),
            positions: numbered()
                .filter_map(|(device, no)| device.position.map(|position| (position.0, no)))
                .collect(),
            passed: u16::try_from(model.device_count()).unwrap_or(u16::MAX),
            owners: owners.collect(),
        }
    }

    /// Numbers of the SubDevices, from 1, that a datagram is for; none for a broadcast. Positions on the way back have
    /// been counted up by each controller.
    #[must_use]
    pub fn concerned(&self, datagram: &Datagram<'_>, row: &CaptureRow<'_>) -> SmallVec<[u32; 4]> {
        let one = |no: Option<&u32>| no.map_or_else(SmallVec::new, |no| smallvec![*no]);
        match datagram.command().map_or(Addressing::None, Command::addressing) {
            Addressing::None | Addressing::Broadcast => SmallVec::new(),
            Addressing::Station => one(self.stations.get(&datagram.adp())),
            Addressing::Position => {
                let passed = row.facts.passed.unwrap_or_else(|| match row.way() {
                    Some(FrameWay::Back) => self.passed,
                    Some(FrameWay::Out) | None => 0,
                });
                let sent = datagram.adp().wrapping_sub(passed);
                one(self.positions.get(&Position::from_auto_increment(sent).0))
            }
            Addressing::Logical => {
                let key = (datagram.logical().0, datagram.data_len() as u16);
                self.owners.get(&key).cloned().unwrap_or_default()
            }
        }
    }
}

/// Times at which a finding shows: its beginning, its end, and each piece of evidence with a time.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FindingTimes {
    /// Its number in the diagnosis: `F2`.
    pub id: String,
    /// The code of its rule.
    pub code: String,
    /// The name of its rule.
    pub name: String,
    /// When.
    pub times: Vec<Instant>,
}

impl FindingTimes {
    /// Those of all findings of a diagnosis, of consequences too.
    #[must_use]
    pub fn all(diagnosis: &Diagnosis) -> Vec<Self> {
        let mut all = Vec::new();
        add(&diagnosis.findings, &mut all);
        all
    }

    /// True if a word means it: its number, code or name, whatever the case of the letters.
    #[must_use]
    pub fn is_called(&self, word: &str) -> bool {
        let same = |text: &str| text.eq_ignore_ascii_case(word);
        same(&self.id) || same(&self.code) || same(&self.name)
    }
}

fn add(findings: &[FindingReport], all: &mut Vec<FindingTimes>) {
    for finding in findings {
        let ends = [Some(finding.opened_ns), finding.closed_ns];
        let shown = finding.evidence.iter().map(|evidence| evidence.time_ns);
        let times = ends.into_iter().chain(shown).flatten();
        all.push(FindingTimes {
            id: finding.id.clone(),
            code: finding.code.clone(),
            name: finding.name.clone(),
            times: times.map(|nanos| Instant::from_nanos(nanos.0)).collect(),
        });
        add(&finding.consequences, all);
    }
}
