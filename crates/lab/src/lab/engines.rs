//! Transfer between the engines: frames, events, probes, counters of the cards.

use std::sync::Arc;

use linesman_config::inventory::Inventory;
use linesman_config::plan::{ClockSettings, Plan, PlanOptions, PlannedDevice};
use linesman_config::project::{Described, ProjectDevice};
use linesman_diagnosis::Asked;
use linesman_diagnosis::observe::{Direction, FrameSeen, HostEvent, HostObservation};
use linesman_maindevice::watch::Watch;
use linesman_maindevice::{Event, ProbeRequest, Target, Transmit};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Outgoing;

use super::{AT_ONE_INSTANT, Lab, LabError};
use crate::habit::Habit;
use crate::options::Begin;

/// How many events are kept; the oldest go first.
const KEPT_EVENTS: usize = 10_000;

impl Lab {
    /// The project's identity of a SubDevice of the plan. A plan numbers what was found in the order
    /// of processing, which for a device with several controllers is not that of the project.
    #[must_use]
    pub fn of_plan(&self, id: DeviceId) -> DeviceId {
        let node = self.tree.order().get(id.index());
        node.map_or(id, |node| DeviceId(*node as u32))
    }

    /// The plan's identity of a SubDevice of the project; the other way round than
    /// [`Lab::of_plan`].
    #[must_use]
    pub fn in_plan(&self, id: DeviceId) -> DeviceId {
        let at = self.tree.order().iter().position(|node| *node == id.index());
        at.map_or(id, |at| DeviceId(at as u32))
    }

    /// Takes out all that the engines have to give: frames, events, probes.
    pub(super) fn drain(&mut self) -> Result<(), LabError> {
        let mut transmit = std::mem::take(&mut self.transmit);
        let mut count = 0_u32;
        while !self.is_paused()
            && let Some(sent) = self.poll_transmit(&mut transmit)
        {
            let at = sent.at.max(self.now);
            let frame = &transmit[..sent.len];
            self.show(Direction::Sent, sent.path, at, frame);
            self.segment.handle_frame(at, sent.path, frame);
            self.record_outgoing();
            count += 1;
            if count > AT_ONE_INSTANT {
                return Err(LabError::Stuck { at: self.now, what: "sending" });
            }
        }
        self.transmit = transmit;
        while let Some(event) = self.poll_event() {
            self.handle_event(event);
        }
        if let Some(watch) = &mut self.watch {
            watch.handle_timeout(self.now);
            self.log.extend(std::iter::from_fn(|| watch.poll_entry()));
        }
        while let Some(probe) = self.engine.poll_probe() {
            let device =
                self.plan.as_ref().and_then(|plan| plan.device(self.in_plan(probe.device)));
            // Who is not of the plan has no address that could be asked.
            let Some(device) = device else { continue };
            match probe.what {
                Asked::Register { address, len } => {
                    let target = Target::Station(device.station);
                    let request = ProbeRequest { target, register: address, len, write: None };
                    self.main.probe(self.now, request);
                }
                Asked::Written { address, data } => {
                    let target = Target::Station(device.station);
                    let write = Some(Vec::from(data));
                    let request = ProbeRequest { target, register: address, len: 2, write };
                    self.main.probe(self.now, request);
                }
                Asked::Object(object) => {
                    self.main.sdo_upload(self.now, device.id, object, false);
                }
            }
        }
        while let Some(event) = self.engine.poll_event() {
            if self.finding_events.len() >= KEPT_EVENTS {
                self.finding_events.pop_front();
            }
            self.finding_events.push_back(event);
        }
        Ok(())
    }

    /// The next frame of who drives the line.
    fn poll_transmit(&mut self, buffer: &mut [u8]) -> Option<Transmit> {
        match &self.other {
            Some(other) => other.poll_transmit(self.now, buffer),
            None => self.main.poll_transmit(self.now, buffer),
        }
    }

    fn poll_event(&mut self) -> Option<Event> {
        match &self.other {
            Some(other) => other.poll_event(),
            None => self.main.poll_event(),
        }
    }

    pub(super) fn show(&mut self, direction: Direction, path: Path, time: Instant, bytes: &[u8]) {
        self.frames += 1;
        if self
            .capture_loss
            .as_mut()
            .is_some_and(|capture_loss| capture_loss.hides(direction, bytes))
        {
            return;
        }
        let seen = FrameSeen {
            network: self.network,
            path: Some(path),
            direction,
            time,
            number: self.frames,
            fcs: None,
            truncated: false,
            bytes,
        };
        if self.options.habit == Habit::Own {
            self.engine.handle_frame(&seen);
        }
        if let Some(tap) = &mut self.tap {
            tap(&seen);
        }
    }

    /// Whether somebody is shown what a capture tool on the computer is shown.
    fn is_recorded(&self) -> bool {
        self.recorder.is_some() || self.options.habit != Habit::Own
    }

    /// Gives the recorder, and a diagnosis that listens, what was handed to the cards.
    pub(super) fn record_outgoing(&mut self) {
        if !self.is_recorded() {
            return;
        }
        let mut bytes = std::mem::take(&mut self.outgoing);
        while let Some(Outgoing { at, path }) = self.segment.poll_outgoing(&mut bytes) {
            self.record(Direction::Sent, path, at, &bytes);
        }
        self.outgoing = bytes;
    }

    /// Gives the recorder, and a diagnosis that listens, a frame.
    pub(super) fn record(&mut self, direction: Direction, path: Path, time: Instant, bytes: &[u8]) {
        if !self.is_recorded() {
            return;
        }
        if self
            .recorder_veil
            .as_mut()
            .is_some_and(|capture_loss| capture_loss.hides(direction, bytes))
        {
            return;
        }
        self.recorded += 1;
        let seen = FrameSeen {
            network: self.network,
            path: Some(path),
            direction,
            time,
            number: self.recorded,
            fcs: None,
            truncated: false,
            bytes,
        };
        if self.options.habit != Habit::Own {
            self.engine.handle_frame(&seen);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder(&seen);
        }
    }

    fn handle_event(&mut self, event: Event) {
        if let Event::Scanned(inventory) = &event {
            self.inventory = Some((**inventory).clone());
            if self.options.begin == Begin::Run {
                self.start(inventory);
            }
        }
        if let Event::ScanFailed(error) = &event {
            self.failure = Some(error.to_string());
        }
        if let Some(watch) = &mut self.watch {
            watch.handle_event(self.now, &event);
        }
        if self.events.len() >= KEPT_EVENTS {
            self.events.drain(..KEPT_EVENTS / 2);
        }
        self.events.push((self.now, event));
    }

    fn start(&mut self, inventory: &Inventory) {
        match self.make_plan(inventory) {
            Ok(plan) => {
                self.main.start(self.now, plan.clone());
                self.watch = self.options.log.then(|| Watch::new(Arc::new(plan.clone())));
                self.plan = Some(plan);
            }
            Err(error) => self.failure = Some(error),
        }
    }

    /// The plan for what was found, with the names of the project where they fit.
    pub(super) fn make_plan(&self, inventory: &Inventory) -> Result<Plan, String> {
        if self.project.chooses() {
            return self.chosen_plan(inventory);
        }
        let mut planned = inventory.planned(self.options.target);
        if planned.len() == self.project.devices.len() {
            for (device, id) in planned.iter_mut().zip(0..) {
                let wanted = &self.project.devices[self.of_plan(DeviceId(id)).index()];
                device.name.clone_from(&wanted.name);
            }
        }
        let (cycle, clock_datagrams) = (self.options.cycle, self.options.clocks);
        if clock_datagrams {
            for device in &mut planned {
                device.settings.clock = clocked(device, cycle);
            }
        }
        let options = PlanOptions { cycle, clock_datagrams, ..PlanOptions::default() };
        let options = self.options.habit.plan(options);
        Plan::build(&planned, inventory.tree().clone(), &options).map_err(|error| error.to_string())
    }

    /// The plan that the project chooses, for SubDevices that are what was found in their places: there are no
    /// descriptions of their makers, but what they say of themselves.
    fn chosen_plan(&self, inventory: &Inventory) -> Result<Plan, String> {
        let order = self.tree.order();
        let mut lookup = |wanted: &ProjectDevice| {
            let node = self.project.devices.iter().position(|device| device.name == wanted.name);
            let place = order.iter().position(|at| Some(*at) == node);
            let found = place.and_then(|place| inventory.devices.get(place));
            Ok(found
                .map(|found| Described { profile: found.profile.clone(), ..Described::default() }))
        };
        let resolved = self.project.resolve(&mut lookup).map_err(|error| error.to_string())?;
        let mut devices = resolved.devices;
        for (device, node) in devices.iter_mut().zip(order) {
            device.target = self.target_of(DeviceId(*node as u32));
        }
        let options = self.options.habit.plan(resolved.options);
        Plan::build(&devices, resolved.tree, &options).map_err(|error| error.to_string())
    }

    /// Turns what the cards counted since the last look into host observations.
    pub(super) fn look_at_cards(&mut self) {
        for path in Path::ALL.into_iter().take(self.paths) {
            let port = self.segment.host(path);
            let before = self.host_last[path.index()].replace(port);
            let last = before.unwrap_or_default();
            let (failures, crc) =
                (port.tx_dropped - last.tx_dropped, port.rx_crc_errors - last.rx_crc_errors);
            if before.is_none_or(|before| before.carrier != port.carrier) {
                self.observe_host(path, HostEvent::Carrier(port.carrier));
            }
            if failures > 0 {
                self.observe_host(path, HostEvent::SendFailures(failures));
            }
            if self.options.host_counters {
                let other = port.rx_length_errors - last.rx_length_errors;
                if crc + other > 0 {
                    self.observe_host(path, HostEvent::CardErrors { crc, other });
                }
                let dropped = port.rx_dropped - last.rx_dropped;
                if dropped > 0 {
                    self.observe_host(path, HostEvent::CardDrops(dropped));
                }
            }
        }
    }

    /// The host sees something of a card: of one of the segment, or of one that is not used.
    pub fn observe_host(&mut self, path: Path, what: HostEvent) {
        let observation = HostObservation { network: self.network, path, time: self.now, what };
        self.engine.handle_host(&observation);
        if let Some(tap) = &mut self.host_tap {
            tap(&observation);
        }
    }
}

/// The first operation mode of a SubDevice that has a SYNC0, with one event a cycle.
fn clocked(device: &PlannedDevice, cycle: Span) -> Option<ClockSettings> {
    let modes = device.profile.clock_modes.iter();
    let synced = modes.map(|mode| ClockSettings {
        assign_activate: mode.assign_activate,
        sync0_cycle: cycle,
        ..ClockSettings::default()
    });
    synced.into_iter().find(ClockSettings::sync0)
}
