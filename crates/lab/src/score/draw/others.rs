//! Random faults that are no damage: settings, places, computers, foreign senders.

use linesman_config::fault::FaultName::*;
use linesman_proto::topology::End;
use linesman_sim::segment_file::SegmentDevice;

use super::{Drawer, Drawn};

/// AL status codes that a refusing device gives here. None of them blames settings: that would be
/// `config-mismatch`.
const REFUSALS: [u32; 7] = [0x0001, 0x0011, 0x0012, 0x0050, 0x0051, 0x8000, 0x8123];

impl Drawer<'_, '_> {
    pub(super) fn refused(&mut self) -> Option<Drawn> {
        if self.name == ConfigMismatch {
            let (device, id) = self.with_mailbox()?;
            let what = self.word(&["process-data", "mailbox", "modules"]);
            let entry = self.entry().device(&device.name).with("what", what);
            return Some(Self::at_device(self.for_ever(entry), id));
        }
        let (device, id) = self.any_device()?;
        let entry = self
            .entry()
            .device(&device.name)
            .with("to", self.word(&["SAFEOP", "PREOP", "OP"]))
            .with("code", *self.stream.pick(&REFUSALS)?)
            .with("refusals", self.stream.below(4) as u32);
        Some(Self::at_device(self.for_ever(entry), id))
    }

    pub(super) fn pair(&mut self) -> Option<Drawn> {
        let (one, id) = self.any_device()?;
        let wants_twin = self.name == TwinsSwapped;
        let fits = |other: &&SegmentDevice| {
            let is_twin = other.type_name == one.type_name;
            other.name != one.name && (self.name == DuplicateAddress || is_twin == wants_twin)
        };
        let others: Vec<_> = self.offer.file.devices.iter().filter(fits).collect();
        let other = *self.stream.pick(&others)?;
        let mut entry = self.entry();
        entry.devices = Some(vec![one.name.clone(), other.name.clone()]);
        if self.name == DuplicateAddress {
            entry = entry.with("which", "station");
        }
        let drawn = self.lasting(entry, 2_000.0, 4_000.0);
        Some(Self::at_device(drawn, id))
    }

    pub(super) fn built_in(&mut self) -> Option<Drawn> {
        let (device, id) = self.any_device()?;
        let above = self.offer.outline.tree.upstream(id.index());
        let entry = match self.name {
            // The first one that is entered by its OUT port is `maindevice-wrong-port`.
            PortsSwapped if matches!(above, Some(End::MainDevice(_))) => return None,
            MainDeviceWrongPort => self.entry().at("maindevice"),
            DeviceExtra => self
                .entry()
                .device("extra")
                .with("type", if self.stream.chance(0.5) { "EL1008" } else { "EL2004" })
                .with("on", device.on.to_string().as_str()),
            DeviceWrong if self.stream.chance(0.4) => self
                .entry()
                .device(&device.name)
                .with("revision", self.stream.between(1, 0x00FF_0000) as u32),
            DeviceWrong => {
                let other = self.any_device()?.0;
                if other.type_name == device.type_name {
                    return None;
                }
                self.entry().device(&device.name).with("type", other.type_name.as_str())
            }
            _ => self.entry().device(&device.name),
        };
        Some(Self::at_device(self.for_ever(entry), id))
    }

    pub(super) fn host(&mut self) -> Option<Drawn> {
        let entry = self.entry().at("maindevice");
        let hits = self.stream.log_uniform(1.0, 200.0).round() as u32;
        let entry = match self.name {
            HostDrops => entry.with("hits", hits),
            HostJitter => entry.with("hits", hits).with("delay_us", self.number(100.0, 5_000.0)),
            _ => entry.with("late_us", self.number(200.0, 3_000.0)),
        };
        Some(self.lasting(entry, 500.0, 3_000.0))
    }

    pub(super) fn strangers(&mut self) -> Option<Drawn> {
        let entry = self.entry().with("frames_per_s", self.number(1.0, 500.0));
        let entry = if self.name == SecondMainDevice {
            entry.with("does", self.word(&["scan", "init", "preop", "clear-counters"]))
        } else {
            entry.with("protocol", self.word(&["mixed", "arp", "ipv4", "lldp"]))
        };
        Some(self.lasting(entry, 1_000.0, 4_000.0))
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::state::AlStatusCode;
    use linesman_proto::state::status_code::Class;

    use super::*;

    #[test]
    fn a_refusal_does_not_blame_settings() {
        for code in REFUSALS {
            assert_ne!(
                AlStatusCode(code as u16).explain().class,
                Class::Configuration,
                "{code:#x}"
            );
        }
    }
}
