//! Source of the time of a network: its reference clock alone, this computer, or a clock outside (DC-10).
//!
//! A clock outside is told by a SubDevice: a bridge to another network (EL6692, EL6695), or a terminal for IEEE 1588
//! (EL6688). Its process data have two time stamps of one moment, that of the network and that outside, and a status
//! word. Reference: facts of external synchronisation, objects 0x10F4 and 0x10F5.

use linesman_proto::address::DeviceId;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::frame::DATAGRAM_OVERHEAD;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::sii::Direction;

use super::{DatagramPlan, Doubt, FramePlan, Plan, PlannedDevice, Role, Severity};
use crate::profile::{DeviceProfile, MappedPdo};

/// Whose time a network has.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum TimeSource {
    /// Its reference clock's, which is left to itself.
    ReferenceClock,
    /// This computer's: the reference clock is led to it.
    Host,
    /// One that a program tells: the reference clock is led to its speed.
    Program,
    /// One that a SubDevice tells: the reference clock is led to its speed.
    Device(DeviceId),
    /// That of the network that leads the others of the same process: the clocks are set to it at the start, and the
    /// reference clock is led to it.
    UpperNetwork,
}

/// What the time stamps of a SubDevice are read from, in the inputs of the process image.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct TimeStampPlace {
    /// First byte of the status word; `None` where it is not exchanged.
    status: Option<usize>,
    /// First byte of the time stamp of the network, and of that outside.
    stamps: [usize; 2],
    /// Bytes of each of them, 4 or 8.
    len: usize,
    /// The sync mode (0x10F4:01) with which this side of a bridge leads itself, where the bridge has a direction.
    leads_itself: Option<u8>,
}

/// Two times of one moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StampPair {
    /// That of the network, in ns; of stamps with 32 bits its low half.
    pub internal: u64,
    /// How far that outside is ahead of it, in ns.
    pub ahead_ns: i64,
}

/// Bits of the status word: sync mode, external device not connected.
const SYNC_MODE: u16 = 0x0003;
const NOT_CONNECTED: u16 = 0x8000;
/// Sync modes (0x10F4:01).
const SECONDARY_LEADS: u8 = 1;
const PRIMARY_LEADS: u8 = 2;
/// The object that both time stamps and the status are entries of.
const EXTERNAL_SYNC: u16 = 0x10F4;
const SYNC_MODE_ENTRY: u8 = 0x01;
const STAMP_ENTRIES: [u8; 2] = [0x11, 0x12];
/// Bytes of the system time that are written.
const TIME_LEN: usize = 4;

/// Order designations of SubDevices that tell a time outside, of any variant.
pub const TELL_TIME: [&str; 3] = ["EL6688", "EL6692", "EL6695"];
/// The one that is there for nothing else (DC-19).
pub const PTP_TERMINAL: &str = "EL6688";
/// The one whose direction is set in itself.
const BRIDGE_WITH_DIRECTION: &str = "EL6692";
/// The order designation of a port multiplier, and its product code.
pub const PORT_MULTIPLIER: (&str, u32) = ("CU2508", 0x09CC_5432);

/// True for this order designation, with or without a variant.
#[must_use]
pub fn is_type(type_name: &str, wanted: &str) -> bool {
    type_name.split('-').next() == Some(wanted)
}

impl TimeStampPlace {
    /// The two times; `None` where nothing is connected outside, where this side of the bridge is to lead, or where the
    /// image is too short.
    #[must_use]
    pub fn read(&self, inputs: &[u8]) -> Option<StampPair> {
        if let Some(at) = self.status {
            let status = u16::from_le_bytes(*inputs.get(at..)?.first_chunk()?);
            let mode = (status & SYNC_MODE) as u8;
            if status & NOT_CONNECTED != 0 || (mode != 0 && self.leads_itself == Some(mode)) {
                return None;
            }
        }
        let number = |at: usize| {
            let mut bytes = [0; size_of::<u64>()];
            bytes.get_mut(..self.len)?.copy_from_slice(inputs.get(at..at + self.len)?);
            Some(u64::from_le_bytes(bytes))
        };
        let [internal, external] = self.stamps;
        let (internal, external) = (number(internal)?, number(external)?);
        // Before the first pair both are zero.
        if internal == 0 {
            return None;
        }
        let ahead = external.wrapping_sub(internal);
        let ahead_ns =
            if self.len < size_of::<u64>() { i64::from(ahead as u32 as i32) } else { ahead as i64 };
        Some(StampPair { internal, ahead_ns })
    }
}

impl DeviceProfile {
    /// Bits of the time stamps that it exchanges, 32 or 64; `None` where it exchanges none.
    #[must_use]
    pub fn time_stamp_bits(&self) -> Option<u16> {
        self.pdos.iter().find_map(time_stamp_bits)
    }

    /// The PDOs of its process data with that for time stamps of so many bits in place of its like; 0: without time
    /// stamps. `None` where it has none such.
    #[must_use]
    pub(crate) fn pdos_with_time_stamps(&self, bits: u16) -> Option<Vec<u16>> {
        let is_status = |pdo: &&MappedPdo| {
            pdo.entries
                .iter()
                .any(|one| (one.index, one.subindex) == (EXTERNAL_SYNC, SYNC_MODE_ENTRY))
        };
        let fits = |pdo: &&MappedPdo| time_stamp_bits(pdo).unwrap_or(0) == bits;
        let all = self.pdos.iter().chain(&self.spare_pdos);
        let wanted = all.filter(is_status).find(fits)?.index;
        let now = self.pdos.iter().find(is_status)?.index;
        let index = |pdo: &MappedPdo| if pdo.index == now { wanted } else { pdo.index };
        Some(self.pdos.iter().map(index).collect())
    }
}

fn time_stamp_bits(pdo: &MappedPdo) -> Option<u16> {
    let stamp = |subindex| {
        pdo.entries.iter().find(move |one| (one.index, one.subindex) == (EXTERNAL_SYNC, subindex))
    };
    let [internal, external] = STAMP_ENTRIES.map(stamp);
    internal.zip(external).map(|(one, _)| one.bits)
}

impl Plan {
    /// Takes over whose time the network has: a place in the frames for it, and where time stamps lie.
    pub(super) fn take_time_source(
        &mut self,
        source: Option<TimeSource>,
        devices: &[PlannedDevice],
    ) {
        self.time_source = source;
        let is_led = !matches!(source, None | Some(TimeSource::ReferenceClock));
        if is_led {
            self.add_clock_shift();
        }
        if let Some(TimeSource::Device(id)) = source {
            self.time_stamps = devices.get(id.index()).and_then(|one| self.find_stamps(id, one));
        }
    }

    /// What keeps the network from having the time that is wanted.
    pub(super) fn time_source_doubt(&self) -> Option<Doubt> {
        let source = self.time_source.filter(|source| *source != TimeSource::ReferenceClock)?;
        let (device, text, advice) = match source {
            _ if self.datagrams().all(|(.., one)| one.role != Role::ClockShift) => (
                None,
                "another time than that of a reference clock is wanted (a terminal for IEEE 1588 tells one unless time_source says \
                 otherwise), but no SubDevice uses its clock",
                "give a SubDevice near the MainDevice a clock (`clock = { reference = true }`), or write \
                 `time_source = \"reference-clock\"` in [network]",
            ),
            TimeSource::Device(id) if self.time_stamps.is_none() => (
                Some(id),
                "the network is to have the time that a SubDevice tells, but its process data have no time stamps",
                "give it the PDO with time stamps (`time_stamps = \"bits64\"`)",
            ),
            TimeSource::ReferenceClock
            | TimeSource::Host
            | TimeSource::Program
            | TimeSource::UpperNetwork
            | TimeSource::Device(_) => return None,
        };
        let (severity, name) = (Severity::Warning, "time-source");
        Some(Doubt { severity, name, device, text: text.to_owned(), advice: advice.to_owned() })
    }

    /// Puts the datagram that writes a time to the reference clock before the one that hands its time round, if there
    /// is none yet. True if there is one now.
    pub fn add_clock_shift(&mut self) -> bool {
        if self.datagrams().any(|(.., one)| one.role == Role::ClockShift) {
            return true;
        }
        let reference = self.reference_clock().and_then(|id| self.device(id));
        let Some(station) = reference.map(|device| device.station) else { return false };
        for task in &mut self.tasks {
            let brings = |frame: &FramePlan| frame.has(Role::ReferenceClock);
            let Some(number) = task.frames.iter().position(brings) else { continue };
            let shift = DatagramPlan {
                command: Command::Fpwr,
                address: DatagramAddress::Physical(station.0, SYSTEM_TIME.address),
                len: TIME_LEN,
                role: Role::ClockShift,
                sync_unit: None,
                ownership: Vec::new(),
            };
            let frame = &mut task.frames[number];
            if frame.size() + TIME_LEN + DATAGRAM_OVERHEAD <= MAX_LEN {
                let is_time = |one: &DatagramPlan| one.role == Role::ReferenceClock;
                let at = frame.datagrams.iter().position(is_time).unwrap_or_default();
                frame.datagrams.insert(at, shift);
            } else {
                let (ahead, repeats) = (frame.ahead, frame.repeats);
                let alone = FramePlan { datagrams: vec![shift], ahead, repeats };
                task.frames.insert(number, alone);
            }
            return true;
        }
        false
    }

    fn find_stamps(&self, id: DeviceId, planned: &PlannedDevice) -> Option<TimeStampPlace> {
        let byte_of = |subindex: u8| {
            planned.profile.process.iter().find_map(|manager| {
                let mut bit = 0;
                let pdos = planned.profile.pdos.iter();
                let mine = pdos.filter(|pdo| {
                    (pdo.sync_manager, pdo.direction) == (manager.index, Direction::Inputs)
                });
                for entry in mine.flat_map(|pdo| &pdo.entries) {
                    if (entry.index, entry.subindex) == (EXTERNAL_SYNC, subindex) {
                        let at = self.image_bit(id, Direction::Inputs, manager.start, bit)?;
                        return at.is_multiple_of(8).then_some((at / 8, entry.bits));
                    }
                    bit += u32::from(entry.bits);
                }
                None
            })
        };
        let [internal, external] = STAMP_ENTRIES.map(byte_of);
        let ((internal, bits), (external, _)) = (internal?, external?);
        let name = &planned.profile.type_name;
        let is_secondary = planned.identity.revision & 0xFFFF == 2 || name.ends_with("-0002");
        let leads_itself = is_type(name, BRIDGE_WITH_DIRECTION).then_some(if is_secondary {
            SECONDARY_LEADS
        } else {
            PRIMARY_LEADS
        });
        Some(TimeStampPlace {
            status: byte_of(SYNC_MODE_ENTRY).map(|(at, _)| at),
            stamps: [internal, external],
            len: if bits > 32 { 8 } else { 4 },
            leads_itself,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: TimeStampPlace = TimeStampPlace {
        status: Some(0),
        stamps: [2, 10],
        len: 8,
        leads_itself: Some(PRIMARY_LEADS),
    };

    fn image(status: u16, internal: u64, external: u64) -> Vec<u8> {
        [&status.to_le_bytes()[..], &internal.to_le_bytes(), &external.to_le_bytes()].concat()
    }

    #[test]
    fn pair_of_time_stamps_is_read_with_its_distance() {
        let read = |status, external| WIDE.read(&image(status, 1_000, external));
        assert_eq!(read(1, 4_500), Some(StampPair { internal: 1_000, ahead_ns: 3_500 }));
        assert_eq!(read(1, 400), Some(StampPair { internal: 1_000, ahead_ns: -600 }));
        assert_eq!(read(0, 4_500), read(1, 4_500), "a bridge that says no direction");
        assert_eq!(read(2, 4_500), None, "this side leads");
        assert_eq!(read(0x8001, 4_500), None, "nothing is connected");
        assert_eq!(WIDE.read(&image(1, 0, 0)), None, "no pair yet");
        assert_eq!(WIDE.read(&[0; 9]), None, "too short");
        let narrow = TimeStampPlace { status: None, stamps: [0, 4], len: 4, leads_itself: None };
        let bytes = [0xFFFF_FF00_u32.to_le_bytes(), 0x10_u32.to_le_bytes()].concat();
        let expected = StampPair { internal: 0xFFFF_FF00, ahead_ns: 0x110 };
        assert_eq!(narrow.read(&bytes), Some(expected), "the low half goes round");
    }

    #[test]
    fn time_that_is_wanted_without_a_clock_is_doubted() {
        let mut plan = Plan::empty(linesman_proto::topology::Tree::from_wiring(&[], None).unwrap());
        assert_eq!(plan.time_source_doubt(), None);
        plan.time_source = Some(TimeSource::Host);
        let doubt = plan.time_source_doubt().expect("nobody has a clock");
        assert!(doubt.advice.contains("`clock = { reference = true }`"), "{doubt:?}");
        plan.time_source = Some(TimeSource::ReferenceClock);
        assert_eq!(plan.time_source_doubt(), None);
    }

    #[test]
    fn types_are_known_with_and_without_their_variant() {
        assert!(is_type("EL6692", "EL6692") && is_type("EL6692-0002", "EL6692"));
        assert!(!is_type("EL66920", "EL6692") && !is_type("", "EL6692"));
    }
}
