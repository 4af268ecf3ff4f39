//! Profile of a type of SubDevice, as its MainDevice needs it: mailbox, SyncManagers, process data.
//!
//! It is made from the SII image, which the device itself carries.

mod sync_times;

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::PortMap;
use linesman_proto::register::{SmControl, SmMode};
use linesman_proto::sii::{
    Direction, FmmuUsage, Identification, Image, MailboxPair, OpMode, PortKind, Protocols,
    SyncManagerKind,
};
use linesman_proto::time::Span;

pub use sync_times::{DirectionTimes, SyncTimes};

/// A SyncManager for process data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProcessSyncManager {
    /// Which SyncManager, 0..=15.
    pub index: u8,
    /// Which way the data flow.
    pub direction: Direction,
    /// Where the buffer begins.
    pub start: RegisterAddress,
    /// Bytes of process data; 0 when nothing is mapped by default.
    pub len: u16,
    /// Control byte of register 0x0804 + 8 × index.
    pub control: SmControl,
    /// There is no such SyncManager: FMMUs map registers of the controller.
    pub is_virtual: bool,
    /// Bits of `len` that are used; 0 when all are.
    pub bits: u16,
}

impl ProcessSyncManager {
    /// Bits that are used.
    #[must_use]
    pub fn used_bits(&self) -> u32 {
        match self.bits {
            0 => u32::from(self.len) * 8,
            bits => u32::from(bits),
        }
    }
}

/// The mailbox and the SyncManagers that serve it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Mailbox {
    /// Where it lies.
    pub areas: MailboxPair,
    /// Where it lies in BOOT, if the device has a BOOT.
    pub bootstrap: Option<MailboxPair>,
    /// What it speaks.
    pub protocols: Protocols,
    /// Whether the device takes whole objects in one transfer.
    pub complete_access: bool,
}

/// What a SubDevice needs.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct DeviceProfile {
    /// Order designation, such as "EL2004".
    pub type_name: String,
    /// Full name.
    pub name: String,
    /// Mailbox, if it has one.
    pub mailbox: Option<Mailbox>,
    /// SyncManagers for process data, in order of their numbers.
    pub process: Vec<ProcessSyncManager>,
    /// Must not be addressed by LRW; LRD and LWR instead.
    pub no_lrw: bool,
    /// The controller mirrors AL control in AL status: no firmware, no codes, no acknowledge bit.
    pub device_emulation: bool,
    /// Current from the E-bus in mA; negative supplies. `None`: not said.
    pub ebus_current_ma: Option<i16>,
    /// What its ports are; `None`: not said.
    pub ports: Option<PortMap<PortKind>>,
    /// PDOs that are assigned to SyncManagers, in the order of their data.
    pub pdos: Vec<MappedPdo>,
    /// PDOs that are assigned to no SyncManager unless the user chooses them.
    pub spare_pdos: Vec<MappedPdo>,
    /// What its FMMUs are meant for, in their order; empty when nothing is said.
    pub fmmus: Vec<FmmuUsage>,
    /// Where the number of its selector is read.
    pub identification: Identification,
    /// Its operation modes with distributed clocks.
    pub clock_modes: Vec<ClockMode>,
    /// What it needs for its work in a cycle, as far as its dictionary says; an SII says nothing.
    pub sync_times: SyncTimes,
    /// Number of drive channels that its description states: of SoE, or of CiA 402. 0: it states none.
    pub drive_channels: u8,
}

/// An operation mode with distributed clocks (SII category 60; ESI `Dc/OpMode`).
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ClockMode {
    /// Its name, such as `DcSync`.
    pub name: String,
    /// What is written to 0x0980.
    pub assign_activate: u16,
    /// Cycle of SYNC0 in ns; 0 is that of the task, times the factor.
    pub sync0_cycle_ns: u32,
    /// Positive: every n cycles; negative: n times within a cycle.
    pub sync0_cycle_factor: i16,
    /// Shift of SYNC0 in ns.
    pub sync0_shift_ns: i32,
    /// SYNC0 refers to the shift of the inputs; an SII does not say it (`None`).
    pub input_reference: Option<bool>,
    /// Cycle of SYNC1 in cycles of SYNC0.
    pub sync1_cycle_factor: i16,
    /// Shift of SYNC1 in ns.
    pub sync1_shift_ns: i32,
}

impl ClockMode {
    /// Cycle of SYNC0 with a task of this cycle.
    #[must_use]
    pub fn sync0_cycle(&self, cycle: Span) -> Span {
        let of_task = cycle.as_nanos();
        match (self.sync0_cycle_ns, self.sync0_cycle_factor) {
            (0, 0) => cycle,
            (0, factor @ 1..) => Span::ns(of_task * factor.unsigned_abs() as u64),
            (0, factor) => Span::ns(of_task / u64::from(factor.unsigned_abs())),
            (ns, _) => Span::ns(u64::from(ns)),
        }
    }
}

/// A PDO as it is assigned.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MappedPdo {
    /// The SyncManager it is assigned to.
    pub sync_manager: u8,
    /// Which way it flows.
    pub direction: Direction,
    /// Index of its mapping object.
    pub index: u16,
    /// Its name; may be empty.
    pub name: String,
    /// What it consists of.
    pub entries: Vec<MappedEntry>,
}

/// A piece of a PDO.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MappedEntry {
    /// Index of its object; 0 for padding.
    pub index: u16,
    /// Its subindex.
    pub subindex: u8,
    /// Its bits.
    pub bits: u16,
    /// Its name; may be empty.
    pub name: String,
    /// Its type by its name in ETG.2000; empty where nothing is said.
    pub data_type: String,
}

impl MappedPdo {
    /// Its length.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bits)).sum()
    }
}

impl DeviceProfile {
    /// What an SII image says.
    #[must_use]
    pub fn from_sii(image: &Image) -> Self {
        let general = image.general();
        let text = |text: Option<&str>| text.unwrap_or_default().to_owned();
        Self {
            type_name: text(image.order()),
            name: text(image.name()),
            mailbox: image.mailbox().map(|areas| Mailbox {
                areas: *areas,
                bootstrap: Some(image.bootstrap_mailbox).filter(|pair| pair.is_present()),
                protocols: image.protocols,
                complete_access: general.is_some_and(|general| general.coe.complete_access()),
            }),
            process: process_sync_managers(image),
            no_lrw: general.is_some_and(|general| general.flags.no_lrw()),
            device_emulation: image.configuration.device_emulation(),
            ebus_current_ma: image.ebus_current_ma(),
            ports: general.map(|general| general.ports),
            pdos: pdos(image, true),
            spare_pdos: pdos(image, false),
            clock_modes: image.op_modes().map(|mode| clock_mode(image, mode)).collect(),
            fmmus: image.fmmu_usages().to_vec(),
            identification: general
                .map_or(Identification::None, linesman_proto::sii::General::identification),
            sync_times: SyncTimes::default(),
            drive_channels: general
                .map_or(0, |general| general.soe_channels.max(general.ds402_channels)),
        }
    }

    /// Sets the lengths of the SyncManagers to those of their PDOs; where a direction has no PDOs at all,
    /// they stay.
    pub fn measure(&mut self) {
        for manager in &mut self.process {
            let same_way = |pdo: &&MappedPdo| pdo.direction == manager.direction;
            if !self.pdos.iter().chain(&self.spare_pdos).any(|pdo| same_way(&pdo)) {
                continue;
            }
            let mine = self.pdos.iter().filter(same_way);
            let mine = mine.filter(|pdo| pdo.sync_manager == manager.index);
            let bits: u32 = mine.map(MappedPdo::bits).sum();
            manager.len = u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX);
            manager.bits = u16::try_from(bits).unwrap_or(0);
        }
    }

    /// Bytes of process data in one direction.
    #[must_use]
    pub fn process_len(&self, direction: Direction) -> usize {
        let mine = self.process.iter().filter(|manager| manager.direction == direction);
        mine.map(|manager| usize::from(manager.len)).sum()
    }
}

fn process_sync_managers(image: &Image) -> Vec<ProcessSyncManager> {
    (0..)
        .zip(image.sync_managers())
        .filter_map(|(index, record)| {
            let direction = match record.kind {
                SyncManagerKind::Outputs => Direction::Outputs,
                SyncManagerKind::Inputs => Direction::Inputs,
                SyncManagerKind::Unused
                | SyncManagerKind::MailboxOut
                | SyncManagerKind::MailboxIn
                | SyncManagerKind::Other(_) => return None,
            };
            let control = SmControl(record.control);
            // Where there is a mailbox, a SyncManager of its mode is no process data, whatever its kind
            // claims. Inputs of a device without one may come through a single buffer.
            if control.mode() == SmMode::Mailbox && image.mailbox().is_some() {
                return None;
            }
            let mapped = image.pdo_bits(index, direction);
            // Some images bear no PDOs; then the record's own length is all there is.
            let has_pdos = image.pdos(direction).next().is_some();
            let len =
                if has_pdos { u16::try_from(mapped.div_ceil(8)).ok()? } else { record.length };
            let bits = if has_pdos { u16::try_from(mapped).unwrap_or(0) } else { 0 };
            let (start, is_virtual) = (record.start, record.enable.is_virtual());
            Some(ProcessSyncManager { index, direction, start, len, control, is_virtual, bits })
        })
        .collect()
}

fn clock_mode(image: &Image, mode: &OpMode) -> ClockMode {
    ClockMode {
        name: image.text(mode.name).unwrap_or_default().to_owned(),
        assign_activate: mode.assign_activate,
        sync0_cycle_ns: mode.sync0_cycle_ns,
        sync0_cycle_factor: mode.sync0_cycle_factor,
        sync0_shift_ns: mode.sync0_shift_ns,
        input_reference: None,
        sync1_cycle_factor: mode.sync1_cycle_factor,
        sync1_shift_ns: mode.sync1_shift_ns,
    }
}

/// PDOs that the image assigns to SyncManagers, or those that it does not.
fn pdos(image: &Image, assigned: bool) -> Vec<MappedPdo> {
    let text = |at| image.text(at).unwrap_or_default().to_owned();
    let both = [Direction::Outputs, Direction::Inputs];
    let all = both.into_iter().flat_map(|direction| {
        let wanted = image.pdos(direction).filter(|pdo| pdo.sync_manager.is_some() == assigned);
        wanted.map(move |pdo| (direction, pdo.sync_manager.unwrap_or(0), pdo))
    });
    all.map(|(direction, sync_manager, pdo)| MappedPdo {
        sync_manager,
        direction,
        index: pdo.index,
        name: text(pdo.name),
        entries: pdo
            .entries
            .iter()
            .map(|entry| MappedEntry {
                index: entry.index,
                subindex: entry.subindex,
                bits: u16::from(entry.bits),
                name: text(entry.name),
                data_type: entry.data_type().name().unwrap_or_default().to_owned(),
            })
            .collect(),
    })
    .collect()
}
