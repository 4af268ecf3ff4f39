//! From an observation file to the line that the rules look at.

use linesman_config::project::Project;
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{
    AlStatus, DlStatus, ErrorCounter, ErrorCounters, PortState, RxErrors,
};
use linesman_proto::state::{AlStatusCode, DeviceState};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;

use super::{EarlierPort, ObservationFile, ObservedDevice, ObservedPort, Word};
use crate::line::{Device, Line, Seen};
use crate::observe::{HostEvent, HostObservation};

/// Between earlier values and those of the file, since it does not say. Long enough that nothing in
/// it is taken for one event.
const WATCH: Span = Span::s(60);

impl ObservationFile {
    /// The line as the file describes it. Earlier values are at 0, the others 60 s later.
    ///
    /// What was planned comes from `project` where there is one and it has as many devices.
    #[must_use]
    pub fn line(&self, project: Option<&Project>) -> Line {
        let own = self.project();
        let planned = project.filter(|project| project.devices.len() == own.devices.len());
        let mut line = Line::planned(Network(0), planned.unwrap_or(&own));
        let at = Instant::ZERO + WATCH;
        line.now = at;
        let tree = line.tree.clone();
        for (index, observed) in self.devices.iter().enumerate() {
            if let Some(device) = line.device_mut(DeviceId(index as u32)) {
                device.type_name =
                    device.type_name.take().or_else(|| some_text(&observed.type_name));
                observed.teach(device, tree.as_ref(), at);
            }
        }
        self.teach_host(&mut line, at);
        // Whoever wrote the file saw a place for each of them, also for those that are silent.
        line.traffic.positions_seen = u16::try_from(line.devices.len()).unwrap_or(u16::MAX);
        line.touch();
        line
    }

    fn teach_host(&self, line: &mut Line, at: Instant) {
        let Some(main) = &self.maindevice else { return };
        let mut observe = |what| {
            let (network, path) = (Network(0), Path::A);
            line.host.record(&HostObservation { network, path, time: at, what });
        };
        if let Some(on) = main.link {
            observe(HostEvent::Carrier(on));
        }
        if let Some(crc) = main.crc {
            observe(HostEvent::CardErrors { crc, other: 0 });
        }
        line.host.is_watched = main.crc.is_some();
        line.traffic.lost.add(main.lost.unwrap_or(0), at);
    }
}

impl ObservedDevice {
    fn teach(&self, device: &mut Device, tree: Option<&Tree>, at: Instant) {
        let state = self.device_state();
        if state.is_some_and(|state| state.contains(DeviceState::NOT_PRESENT)) {
            device.is_silent(at, None);
            return;
        }
        let ports = self.ports.all();
        let has_ports = ports.iter().any(|(_, port)| port.is_some());
        if state.is_some() || has_ports || self.processing_unit.is_some() || self.al_code.is_some()
        {
            device.answers(at, None);
        }
        device.station =
            device.station.or(self.station.map(linesman_proto::address::StationAddress));
        self.teach_identity(device, at);
        if state.is_some_and(|state| state.contains(DeviceState::WRONG_IDENTITY)) {
            device.reported_wrong = Some(Seen::new((), at, None));
        }
        if let Some(state) = state {
            let bits = u16::from(state.device_byte() & 0x1F);
            device.al.record_status(AlStatus(bits), at, None);
        }
        if let Some(Word(code)) = self.al_code {
            device.al.record_code(AlStatusCode(code), at, None);
        }
        if state.is_some() || ports.iter().any(|(_, port)| port.as_ref().is_some_and(says_link)) {
            let (before, now) = self.dl_status(device.id, tree, &ports);
            device.dl.record(before, Instant::ZERO, None);
            device.dl.record(now, at, None);
        }
        let (before, now) = self.counters(&ports);
        device.counters.record_counters(&before, Instant::ZERO, None);
        device.counters.record_counters(&now, at, None);
    }

    fn teach_identity(&self, device: &mut Device, at: Instant) {
        let seen = |value: Option<u32>| value.map(|value| Seen::new(value, at, None));
        let identity = &mut device.identity;
        identity.vendor_id = seen(self.vendor_id);
        identity.product_code = seen(self.product_code);
        identity.revision = seen(self.revision);
        identity.serial = seen(self.serial);
    }

    /// DL status as it was when all was well, by the tree, and as it is.
    fn dl_status(
        &self,
        id: DeviceId,
        tree: Option<&Tree>,
        ports: &PortMap<Option<ObservedPort>>,
    ) -> (DlStatus, DlStatus) {
        let state = self.device_state().unwrap_or_default();
        let is_wired = |port| tree.is_some_and(|tree| tree.is_open(id.index(), port));
        let (mut before, mut now) = (DlStatus::default(), DlStatus::default());
        for port in Port::ALL {
            let planned = if is_wired(port) { PortState::IN_USE } else { PortState::UNUSED };
            before = before.with_port(port, planned);
            let concerned = state.ports()[port];
            let flagged = if concerned
                && state.contains(DeviceState::MISSING_LINK)
                && is_wired(port)
            {
                PortState::UNUSED
            } else if concerned && state.contains(DeviceState::ADDITIONAL_LINK) && !is_wired(port) {
                PortState::IN_USE
            } else {
                planned
            };
            let link = ports[port].as_ref().and_then(|port| port.link.or(port.open));
            let open = ports[port].as_ref().and_then(|port| port.open).or(link);
            let observed = match (link, open) {
                (Some(link), Some(open)) => PortState { link, closed: !open, communication: link },
                (Some(_), None) | (None, _) => flagged,
            };
            now = now.with_port(port, observed);
        }
        (before, now)
    }

    /// Earlier and present values of the counters that the file gives. Earlier ones are 0 where it
    /// does not say.
    fn counters(&self, ports: &PortMap<Option<ObservedPort>>) -> (ErrorCounters, ErrorCounters) {
        let (mut before, mut now) = (ErrorCounters::default(), ErrorCounters::default());
        let outer = self.before.as_ref().map(|before| before.ports.all()).unwrap_or_default();
        for (port, observed) in ports.iter() {
            let Some(observed) = observed else { continue };
            let earlier = observed.before.as_ref().or(outer[port].as_ref());
            let earlier = earlier.map(|earlier| readings(&EarlierPort::clone(earlier)));
            let present = EarlierPort {
                rx: observed.rx,
                frame: observed.frame,
                physical: observed.physical,
                forwarded: observed.forwarded,
                lost_link: observed.lost_link,
            };
            for (index, value) in readings(&present).into_iter().enumerate() {
                let Some(value) = value else { continue };
                let counter = [
                    ErrorCounter::InvalidFrame(port),
                    ErrorCounter::PhysicalLayer(port),
                    ErrorCounter::Forwarded(port),
                    ErrorCounter::LostLink(port),
                ][index];
                *now.slot(counter) = Some(value);
                let earlier = earlier.and_then(|earlier| earlier[index]).unwrap_or(0);
                *before.slot(counter) = Some(earlier);
            }
        }
        if let Some(errors) = self.processing_unit {
            now.processing_unit = Some(errors);
            let earlier = self.before.as_ref().and_then(|before| before.processing_unit);
            before.processing_unit = Some(earlier.unwrap_or(0));
        }
        (before, now)
    }
}

/// Bad frames, bad symbols, forwarded, lost links.
fn readings(port: &EarlierPort) -> [Option<u8>; 4] {
    let rx = port.rx.map(|Word(word)| RxErrors::from_word(word));
    [
        rx.map(|rx| rx.frames).or(port.frame),
        rx.map(|rx| rx.physical).or(port.physical),
        port.forwarded,
        port.lost_link,
    ]
}

fn says_link(port: &ObservedPort) -> bool {
    port.link.is_some() || port.open.is_some()
}

fn some_text(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}
