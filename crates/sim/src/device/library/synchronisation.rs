//! The objects that say how a device keeps step: 0x1C32 for outputs, 0x1C33 for inputs.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::mailbox::coe::information::Access;

use super::object::{RECORD, SET_UP, record};
use crate::device::dictionary::{Entry, Object, READ_ONLY, READ_WRITE};

/// Which signals of its clock a device can keep step with.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(in crate::device) struct Clocked {
    sync0: bool,
    sync1: bool,
}

impl Clocked {
    /// By its operation modes: what they write to 0x0980 and 0x0981.
    pub(in crate::device) fn of(assign_activate: impl Iterator<Item = u16>) -> Self {
        assign_activate.fold(Self::default(), |clocked, mode| Self {
            sync0: clocked.sync0 || mode & 0x0200 != 0,
            sync1: clocked.sync1 || mode & 0x0400 != 0,
        })
    }
}

/// The object of a SyncManager: 2 for outputs, 3 for inputs. Without a clock the device runs free or
/// with the frames; with one its times are to be measured (bit 14 of the modes). `outputs` says
/// whether it has any: inputs then come with them.
pub(in crate::device) fn synchronisation(
    sync_manager: u8,
    clocked: Clocked,
    outputs: bool,
) -> Object {
    const FREE_RUN_OR_FRAMES: u64 = 0x0003;
    const SYNC0: u64 = 0x0004;
    const SYNC1: u64 = 0x0008;
    const DELAY_IS_FIXED: u64 = 0x0800;
    const MEASURES: u64 = 0x4000;
    const SHORTEST_CYCLE_NS: u64 = 100_000;
    const CALC_AND_COPY_NS: u64 = 12_000;
    const DELAY_NS: u64 = 1_500;
    const WITH_OWN_FRAME: u64 = 1;
    const WITH_OUTPUTS: u64 = 0x22;
    let number = |subindex, name: &str, bits, access: Access, value| {
        let data_type = if bits == 16 { DataType::UINT } else { DataType::UDINT };
        Entry::number(subindex, name, data_type, bits, access, value)
    };
    let has_clock = clocked.sync0;
    let flag = |is_on, bits| if is_on { bits } else { 0 };
    let modes = FREE_RUN_OR_FRAMES
        | flag(has_clock, SYNC0 | DELAY_IS_FIXED | MEASURES)
        | flag(clocked.sync1, SYNC1);
    let is_output = sync_manager == 2;
    let with_outputs = !is_output && outputs;
    let default = if with_outputs { WITH_OUTPUTS } else { WITH_OWN_FRAME };
    let mut sync_mode = number(0x01, "Sync mode", 16, SET_UP, default);
    sync_mode.maximum = Some(match (with_outputs, clocked.sync1, has_clock) {
        (true, _, _) => WITH_OUTPUTS as u32,
        (false, true, _) => 3,
        (false, false, true) => 2,
        (false, false, false) => 1,
    });
    let tunable = if has_clock { READ_WRITE } else { READ_ONLY };
    let mut entries = vec![
        sync_mode,
        number(0x02, "Cycle time", 32, SET_UP, 0),
        number(0x03, "Shift time", 32, tunable, 0),
        number(0x04, "Sync modes supported", 16, READ_ONLY, modes),
        number(0x05, "Minimum cycle time", 32, READ_ONLY, SHORTEST_CYCLE_NS),
        number(0x06, "Calc and copy time", 32, READ_ONLY, flag(has_clock, CALC_AND_COPY_NS)),
    ];
    if has_clock {
        entries.extend([
            number(0x07, "Minimum delay time", 32, READ_ONLY, 0),
            number(0x08, "Get cycle time", 16, READ_WRITE, 0),
            number(0x09, "Maximum delay time", 32, READ_ONLY, flag(is_output, DELAY_NS)),
            number(0x0A, "SYNC0 cycle time", 32, READ_ONLY, 0),
        ]);
    }
    entries.extend([
        number(0x0B, "SM event missed counter", 16, READ_ONLY, 0),
        number(0x0C, "Cycle exceeded counter", 16, READ_ONLY, 0),
        number(0x0D, "Shift too short counter", 16, READ_ONLY, 0),
        Entry::number(0x20, "Sync error", DataType::BOOL, 1, READ_ONLY, 0),
    ]);
    let name = if is_output { "SM output parameter" } else { "SM input parameter" };
    record(0x1C30 + u16::from(sync_manager), name, RECORD, entries)
}
