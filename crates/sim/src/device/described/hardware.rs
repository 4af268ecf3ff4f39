//! Controller of a described device.
//!
//! No data name it; they say what it has to have: ports, FMMUs, SyncManagers, memory. It is the
//! smallest that has all that: an ET1200 for simple E-bus devices, an ET1100, else an IP core, whose
//! memory is as large as it has to be. One that has operation modes with distributed clocks although
//! its SII switches no clock unit on (byte 1, bits 2 and 3) has a controller of the first generation,
//! whose units are always on. A processor interface within a chip (SII byte 0: 0x80) is
//! an IP core in any case.

use linesman_config::esi::device::EsiController;
use linesman_proto::port::PortMap;
use linesman_proto::register::{SmControl, SmMode};
use linesman_proto::sii::{Image, PortKind as SiiPort};

use super::DescribedError;
use crate::device::library::chip::{ESC20_64, ET1100, ET1200, IP_CORE};
use crate::hardware::{Hardware, PortKind};

/// SII byte 0: a bus within the chip.
const ON_CHIP: u8 = 0x80;
/// SII byte 1: SYNC and latch unit.
const CLOCK_UNITS: u8 = 0x0C;
/// Where process-data RAM begins.
const RAM: u32 = 0x1000;
/// The largest RAM, in KiB.
const LARGEST_RAM: u32 = 60;
/// Most FMMUs and SyncManagers of any controller.
const MOST_UNITS: usize = 16;

/// The controller for an image.
pub(super) fn of(image: &Image) -> Result<Hardware, DescribedError> {
    with(image, &EsiController::default())
}

/// The same, where it is said what the controller has at least.
pub(super) fn with(image: &Image, said: &EsiController) -> Result<Hardware, DescribedError> {
    let ports = ports(image);
    let needs = ChipNeeds::of(image)?;
    let needs = ChipNeeds {
        fmmus: needs.fmmus.max(said.fmmus.min(MOST_UNITS as u8)),
        sync_managers: needs.sync_managers.max(said.sync_managers.min(MOST_UNITS as u8)),
        ram_kib: needs.ram_kib.max((said.ram_bytes / 1024).min(LARGEST_RAM) as u8),
    };
    let chips = [&ET1200, &ET1100, &IP_CORE].map(|chip| chip.with_ports(ports));
    let ebus = ports.iter().any(|(_, kind)| *kind == PortKind::Ebus);
    let [small, large, logic] = chips;
    let enlarged = |chip: Hardware| Hardware {
        ram_kib: chip.ram_kib.max(needs.ram_kib),
        fmmus: chip.fmmus.max(needs.fmmus),
        sync_managers: chip.sync_managers.max(needs.sync_managers),
        ..chip
    };
    let clocked = image.op_modes().any(|mode| mode.assign_activate != 0);
    if clocked && image.configuration.esc_configuration & CLOCK_UNITS == 0 {
        return Ok(enlarged(ESC20_64.with_ports(ports)));
    }
    let on_chip = image.configuration.pdi_control == ON_CHIP && !ebus;
    let fits_small = ebus && image.mailbox().is_none() && ports.0[3] == PortKind::Absent;
    if !on_chip && fits_small && needs.fit(&small) {
        return Ok(small);
    }
    if !on_chip && needs.fit(&large) {
        return Ok(large);
    }
    Ok(enlarged(logic))
}

/// What a controller has to have.
struct ChipNeeds {
    fmmus: u8,
    sync_managers: u8,
    ram_kib: u8,
}

impl ChipNeeds {
    fn of(image: &Image) -> Result<Self, DescribedError> {
        let beyond = |what: &str, found: usize, most: usize| DescribedError::Beyond {
            what: what.to_owned(),
            found: found.to_string(),
            expected: format!("at most {most}"),
        };
        let used = |code: u8| code != 0x00 && code != 0xFF;
        let fmmus = image.fmmu_usages().iter().rposition(|usage| used(usage.code()));
        let fmmus = fmmus.map_or(0, |last| last + 1);
        let managers = image.sync_managers().iter().rposition(|one| !one.enable.is_virtual());
        let sync_managers = managers.map_or(0, |last| last + 1);
        if fmmus > MOST_UNITS {
            return Err(beyond("FMMUs", fmmus, MOST_UNITS));
        }
        if sync_managers > MOST_UNITS {
            return Err(beyond("SyncManagers", sync_managers, MOST_UNITS));
        }
        let end = memory_end(image);
        let ram = end.saturating_sub(RAM).div_ceil(1024);
        if ram > LARGEST_RAM {
            let found = format!("up to address 0x{end:04X}");
            let expected = "at most 0xFFFF".to_owned();
            return Err(DescribedError::Beyond { what: "memory".to_owned(), found, expected });
        }
        Ok(Self { fmmus: fmmus as u8, sync_managers: sync_managers as u8, ram_kib: ram as u8 })
    }

    fn fit(&self, hardware: &Hardware) -> bool {
        self.fmmus <= hardware.fmmus
            && self.sync_managers <= hardware.sync_managers
            && self.ram_kib <= hardware.ram_kib
    }
}

/// The first address behind all buffers: those for process data are there three times.
fn memory_end(image: &Image) -> u32 {
    let boxes = [image.standard_mailbox, image.bootstrap_mailbox];
    let boxes = boxes.iter().flat_map(|pair| [pair.receive, pair.send]);
    let boxes = boxes.map(|area| u32::from(area.offset.0) + u32::from(area.size));
    let lengths = image.process_data();
    let process_data: Vec<(u8, u32)> = lengths.map(|one| (one.sync_manager, one.bytes)).collect();
    let buffers = (0u8..).zip(image.sync_managers()).map(|(number, record)| {
        let mapped = process_data.iter().find(|one| one.0 == number).map_or(0, |one| one.1);
        let length = u32::from(record.length).max(mapped);
        let times = match SmControl(record.control).mode() {
            SmMode::Buffered if length > 1 => 3,
            SmMode::Buffered | SmMode::Mailbox | SmMode::Reserved(_) => 1,
        };
        u32::from(record.start.0) + length * times
    });
    boxes.chain(buffers).max().unwrap_or(0)
}

/// What its ports are. An image that does not say has two for cables, as nearly all devices of
/// which no more is known.
fn ports(image: &Image) -> PortMap<PortKind> {
    let told = image.general().map_or(PortMap::default(), |general| general.ports);
    if told.iter().all(|(_, kind)| *kind == SiiPort::None) {
        return PortMap([PortKind::Mii, PortKind::Mii, PortKind::Absent, PortKind::Absent]);
    }
    PortMap(told.0.map(|kind| match kind {
        SiiPort::None => PortKind::Absent,
        SiiPort::EBus => PortKind::Ebus,
        SiiPort::Mii | SiiPort::FastHotConnect | SiiPort::Other(_) => PortKind::Mii,
    }))
}
