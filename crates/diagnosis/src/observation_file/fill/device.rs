//! Readings of one SubDevice: identity, links, counters, trouble in words.

use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{DlStatus, PortState};
use linesman_proto::state::DeviceState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;

use super::super::{Count, ObservedDevice, ObservedPort, ReadDevice, ReadPort, Word};
use super::counters;
use crate::model::{Device, ErrorSum, ReportedTrouble, Seen};

/// What was read of a SubDevice at one time.
#[derive(Clone, Default)]
pub(super) struct Values {
    pub(super) state: Option<DeviceState>,
    pub(super) al_code: Option<u16>,
    pub(super) ports: PortMap<Option<ObservedPort>>,
    pub(super) processing_unit: Option<u64>,
    crc: Option<u64>,
    state_changes: Option<u64>,
    absences: Option<u64>,
    configuration_failed: bool,
    clock_failed: bool,
}

fn count(count: Option<Count>) -> Option<u64> {
    count.map(|Count(count)| count)
}

impl Values {
    pub(super) fn of(device: &ObservedDevice) -> Self {
        Self {
            state: device.device_state(),
            al_code: device.al_code.map(|Word(code)| code),
            ports: device.ports.all(),
            processing_unit: count(device.processing_unit),
            crc: count(device.crc),
            state_changes: count(device.state_changes),
            absences: count(device.absences),
            configuration_failed: device.configuration_failed == Some(true),
            clock_failed: device.clock_failed == Some(true),
        }
    }

    pub(super) fn read(device: &ReadDevice) -> Self {
        let ports = device.ports.all();
        Self {
            state: device.state.as_deref().and_then(|text| text.parse().ok()),
            al_code: device.al_code.map(|Word(code)| code),
            ports: PortMap::from_fn(|port| ports[port].as_ref().map(ReadPort::observed)),
            processing_unit: count(device.processing_unit),
            crc: count(device.crc),
            state_changes: count(device.state_changes),
            absences: count(device.absences),
            configuration_failed: device.configuration_failed == Some(true),
            clock_failed: device.clock_failed == Some(true),
        }
    }

    /// Whether anything was read.
    pub(super) fn tells(&self) -> bool {
        self.state.is_some()
            || self.al_code.is_some()
            || self.processing_unit.is_some()
            || self.crc.is_some()
            || self.state_changes.is_some()
            || self.absences.is_some()
            || self.configuration_failed
            || self.clock_failed
            || self.ports.iter().any(|(_, port)| port.is_some())
    }

    pub(super) fn is_absent(&self) -> bool {
        self.state.is_some_and(|state| state.contains(DeviceState::NOT_PRESENT))
    }

    /// Whether it was heard itself: totals of a tool are there of who is gone, too.
    pub(super) fn is_heard(&self) -> bool {
        self.state.is_some()
            || self.al_code.is_some()
            || self.processing_unit.is_some()
            || self.ports.iter().any(|(_, port)| port.is_some())
    }

    fn names_links(&self) -> bool {
        let mut ports = self.ports.iter().filter_map(|(_, port)| port.as_ref());
        let flags =
            [DeviceState::LINK_ERROR, DeviceState::MISSING_LINK, DeviceState::ADDITIONAL_LINK];
        ports.any(ObservedPort::tells_link)
            || self.state.is_some_and(|state| flags.into_iter().any(|flag| state.contains(flag)))
    }

    fn tells_links(&self) -> bool {
        let ports = self.ports.iter().filter_map(|(_, port)| port.as_ref());
        self.state.is_some() || ports.into_iter().any(ObservedPort::tells_link)
    }
}

impl ObservedDevice {
    pub(super) fn teach(
        &self,
        device: &mut Device,
        tree: Option<&Tree>,
        values: &[(Instant, Values)],
        at: Instant,
        totals: bool,
    ) {
        device.counting = self.controller.map(super::super::ControllerName::counting);
        device.delay = self.delay_ns.map(|ns| Span::ns(ns.into()));
        for (at, read) in values {
            if read.is_absent() {
                device.is_silent(*at, None);
            } else if read.is_heard() {
                device.answers(*at, None);
            }
            self.teach_trouble(device, tree, read, *at);
        }
        // Who does not answer gives no identity; what a file has of it was planned.
        if values.iter().all(|(_, read)| read.is_absent() || !read.tells())
            && values.iter().any(|(_, read)| read.is_absent())
        {
            return;
        }
        device.station =
            device.station.or(self.station.map(linesman_proto::address::StationAddress));
        self.teach_identity(device, at);
        self.teach_links(device, tree, values);
        counters::teach(self, device, values, totals);
        self.teach_sum(device, values);
    }

    fn teach_identity(&self, device: &mut Device, at: Instant) {
        let seen = |value: Option<u32>| value.map(|value| Seen::new(value, at, None));
        let identity = &mut device.identity;
        identity.vendor_id = seen(self.vendor_id);
        identity.product_code = seen(self.product_code);
        identity.revision = seen(self.revision);
        identity.serial = seen(self.serial);
    }

    fn teach_trouble(&self, device: &mut Device, tree: Option<&Tree>, read: &Values, at: Instant) {
        let state = read.state.unwrap_or_default();
        if state.contains(DeviceState::WRONG_IDENTITY) {
            device.reported_wrong.get_or_insert(Seen::new((), at, None));
        }
        let mut found = Vec::new();
        if state.contains(DeviceState::INIT_ERROR) || read.configuration_failed {
            found.push(ReportedTrouble::Configuration);
        }
        if read.clock_failed {
            found.push(ReportedTrouble::Clock);
        }
        let index = device.id.index();
        let is_wired =
            |port| tree.is_some_and(|tree| index < tree.len() && tree.is_open(index, port));
        let ports = state.ports();
        for port in Port::ALL.into_iter().filter(|port| ports[*port]) {
            if state.contains(DeviceState::LINK_ERROR) {
                found.push(ReportedTrouble::LinkError(port));
            }
            if state.contains(DeviceState::ADDITIONAL_LINK) && !is_wired(port) {
                found.push(ReportedTrouble::AdditionalLink(port));
            }
            if state.contains(DeviceState::MISSING_LINK) && !is_wired(port) {
                found.push(ReportedTrouble::MissingLink(port));
            }
        }
        let often = |count: Option<u64>| count.filter(|count| *count > 0);
        found.extend(often(read.state_changes).map(ReportedTrouble::StateChanges));
        found.extend(often(read.absences).map(ReportedTrouble::Absences));
        for trouble in found {
            let kind = std::mem::discriminant(&trouble);
            let known = device.reported_trouble.iter_mut().find(|one| {
                // Counts go on; what is about ports is of each.
                one.value == trouble
                    || (std::mem::discriminant(&one.value) == kind
                        && matches!(
                            trouble,
                            ReportedTrouble::StateChanges(_) | ReportedTrouble::Absences(_)
                        ))
            });
            match known {
                Some(known) => known.value = trouble,
                None => device.reported_trouble.push(Seen::new(trouble, at, None)),
            }
        }
    }

    fn teach_sum(&self, device: &mut Device, values: &[(Instant, Values)]) {
        let before = self.before.as_ref().and_then(|before| count(before.crc));
        let mut read: Vec<(Instant, u64)> =
            values.iter().filter_map(|(at, read)| Some((*at, read.crc?))).collect();
        let may_be_old = before.is_none() && read.len() == 1;
        if before.is_some() || may_be_old {
            read.insert(0, (Instant::ZERO, before.unwrap_or(0)));
        }
        let mut read = read.into_iter().map(|(at, count)| Seen::new(count, at, None));
        let Some(mut sum) = read.next().map(ErrorSum::first) else { return };
        read.for_each(|value| sum.record(value));
        sum.may_be_old = may_be_old;
        device.error_sum = Some(sum);
    }

    /// DL status as it was when all was well, by the tree, and as it was read.
    fn teach_links(&self, device: &mut Device, tree: Option<&Tree>, values: &[(Instant, Values)]) {
        let mut told = values.iter().filter(|(_, read)| read.tells_links() && !read.is_absent());
        let Some(first) = told.next() else { return };
        let index = device.id.index();
        let is_wired = PortMap::from_fn(|port| {
            tree.is_some_and(|tree| index < tree.len() && tree.is_open(index, port))
        });
        let mut planned = DlStatus::default();
        for port in Port::ALL {
            let state = if is_wired[port] { PortState::IN_USE } else { PortState::UNUSED };
            planned = planned.with_port(port, state);
        }
        device.dl.record(planned, Instant::ZERO, None);
        let mut last = planned;
        for (at, read) in std::iter::once(first).chain(told) {
            last = dl_status(read, last, planned, &is_wired);
            device.dl.record(last, *at, None);
            // A state alone is no reading of links.
            device.dl.is_assumed = !read.names_links();
        }
    }
}

/// DL status as a reading shows it. What it does not tell is as it was.
fn dl_status(
    read: &Values,
    last: DlStatus,
    planned: DlStatus,
    is_wired: &PortMap<bool>,
) -> DlStatus {
    let mut now = last;
    let state = read.state.unwrap_or_default();
    for port in Port::ALL {
        let concerned = state.ports()[port];
        let flagged = if read.state.is_none() {
            last.port_state(port)
        } else if concerned && state.contains(DeviceState::MISSING_LINK) && is_wired[port] {
            PortState::UNUSED
        } else if concerned && state.contains(DeviceState::ADDITIONAL_LINK) && !is_wired[port] {
            PortState::IN_USE
        } else if concerned && state.contains(DeviceState::LINK_ERROR) {
            PortState { link: true, closed: true, communication: false }
        } else {
            planned.port_state(port)
        };
        let told = read.ports[port].as_ref();
        let communication = told.and_then(|port| port.communication);
        let link = told.and_then(|port| port.link.or(communication).or(port.open));
        let open = told.and_then(|port| port.open).or(link);
        let observed = match (link, open) {
            (Some(link), Some(open)) => {
                PortState { link, closed: !open, communication: communication.unwrap_or(link) }
            }
            (Some(_), None) | (None, _) => flagged,
        };
        now = now.with_port(port, observed);
    }
    now
}
