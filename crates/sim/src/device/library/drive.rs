//! Drives of one axis: one that speaks SoE, and a generic one of CiA 402.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::sii::Protocols;

use super::LibraryType;
use super::object;
use super::smart::{TERMINAL, inputs, mailbox_in, mailbox_out, outputs};
use super::spec::{
    ApplicationSpec, COE_WITH_PDO_CONFIGURATION, EntrySpec, Function, NO_COE, NOBODY, OpModeSpec,
    PdoSpec, ProcessorSpec, Rights, SettingSpec, SettingsSpec, Spec, SyncManagerSpec, VariableSpec,
};
use crate::device::dictionary::Object;
use crate::device::mailbox::soe::parameter::BRAKE_DELAY;
use crate::device::processor::ResponseTimes;
use crate::hardware::PortKind::{Absent, Mii};

const fn entry(index: u16, name: &'static str, data_type: DataType, bits: u8) -> EntrySpec {
    EntrySpec::number(index, 0, name, data_type, bits)
}

const CONTROLWORD: EntrySpec = entry(0x6040, "Controlword", DataType::UINT, 16);
const STATUSWORD: EntrySpec = entry(0x6041, "Statusword", DataType::UINT, 16);
const MODE: EntrySpec = entry(0x6060, "Modes of operation", DataType::SINT, 8);
const MODE_DISPLAY: EntrySpec = entry(0x6061, "Modes of operation display", DataType::SINT, 8);
const TARGET_POSITION: EntrySpec = entry(0x607A, "Target position", DataType::DINT, 32);
const TARGET_VELOCITY: EntrySpec = entry(0x60FF, "Target velocity", DataType::DINT, 32);
const POSITION: EntrySpec = entry(0x6064, "Position actual value", DataType::DINT, 32);
const VELOCITY: EntrySpec = entry(0x606C, "Velocity actual value", DataType::DINT, 32);
const ERROR_CODE: EntrySpec = entry(0x603F, "Error code", DataType::UINT, 16);

const CIA402_PDOS: &[PdoSpec] = &[
    PdoSpec::single(
        0x1600,
        "Drive outputs",
        Some(2),
        &[CONTROLWORD, MODE, EntrySpec::padding(8), TARGET_POSITION, TARGET_VELOCITY],
    ),
    PdoSpec::single(0x1601, "Position outputs", None, &[CONTROLWORD, TARGET_POSITION]),
    PdoSpec::single(0x1602, "Velocity outputs", None, &[CONTROLWORD, TARGET_VELOCITY]),
    PdoSpec::single(
        0x1A00,
        "Drive inputs",
        Some(3),
        &[STATUSWORD, MODE_DISPLAY, EntrySpec::padding(8), POSITION, VELOCITY, ERROR_CODE],
    ),
    PdoSpec::single(0x1A01, "Position inputs", None, &[STATUSWORD, POSITION]),
    PdoSpec::single(0x1A02, "Velocity inputs", None, &[STATUSWORD, VELOCITY]),
];

const fn variable(
    index: u16,
    name: &'static str,
    (data_type, bits): (DataType, u8),
    default: u32,
    rights: Rights,
) -> VariableSpec {
    VariableSpec { index, name, data_type, bits, default, rights }
}

const I8: (DataType, u8) = (DataType::SINT, 8);
const U16: (DataType, u8) = (DataType::UINT, 16);
const I16: (DataType, u8) = (DataType::INT, 16);
const U32: (DataType, u8) = (DataType::UDINT, 32);
const I32: (DataType, u8) = (DataType::DINT, 32);

/// Objects of CiA 402 (ETG.6010). Lengths are in increments, an axis of some 1,000,000 a turn.
const CIA402_VARIABLES: &[VariableSpec] = &[
    variable(0x603F, "Error code", U16, 0, Rights::Input),
    variable(0x6040, "Controlword", U16, 0, Rights::Output),
    variable(0x6041, "Statusword", U16, 0, Rights::Input),
    variable(0x605A, "Quick stop option code", I16, 2, Rights::Setting),
    variable(0x6060, "Modes of operation", I8, 8, Rights::Output),
    variable(0x6061, "Modes of operation display", I8, 0, Rights::Input),
    variable(0x6062, "Position demand value", I32, 0, Rights::Input),
    variable(0x6064, "Position actual value", I32, 0, Rights::Input),
    variable(0x6065, "Following error window", U32, 100_000, Rights::Setting),
    variable(0x6066, "Following error time out", U16, 10, Rights::Setting),
    variable(0x6067, "Position window", U32, 100, Rights::Setting),
    variable(0x606C, "Velocity actual value", I32, 0, Rights::Input),
    variable(0x607A, "Target position", I32, 0, Rights::Output),
    variable(0x607C, "Home offset", I32, 0, Rights::Setting),
    variable(0x607F, "Max profile velocity", U32, 50_000_000, Rights::Setting),
    variable(0x6081, "Profile velocity", U32, 1_000_000, Rights::Output),
    variable(0x6083, "Profile acceleration", U32, 10_000_000, Rights::Output),
    variable(0x6084, "Profile deceleration", U32, 10_000_000, Rights::Output),
    variable(0x6085, "Quick stop deceleration", U32, 100_000_000, Rights::Setting),
    variable(0x6098, "Homing method", I8, 37, Rights::Setting),
    variable(0x60C5, "Max acceleration", U32, 500_000_000, Rights::Setting),
    variable(0x60F4, "Following error actual value", I32, 0, Rights::Input),
    variable(0x60FD, "Digital inputs", U32, 0, Rights::Input),
    variable(0x60FF, "Target velocity", I32, 0, Rights::Output),
    // Profile position and velocity, homing, cyclic synchronous position and velocity.
    variable(0x6502, "Supported drive modes", U32, 0x0000_01A5, Rights::Read),
];

/// What [`Cia402`](crate::device::application::drive::Cia402) needs of the profile, with values by
/// which an axis can move.
pub(in crate::device) fn profile_objects() -> Vec<Object> {
    let settings = CIA402_PROCESSOR.settings.iter().map(|settings| object::setting(settings, 0));
    CIA402_VARIABLES.iter().map(object::variable).chain(settings).collect()
}

const CIA402_PROCESSOR: ProcessorSpec = ProcessorSpec {
    function: Function::Cia402,
    hardware_version: "1",
    software_version: "1",
    settings: &[SettingsSpec {
        index: 0x60C2,
        channels: 1,
        name: "Interpolation time period",
        entries: &[
            SettingSpec {
                subindex: 1,
                name: "Interpolation time period value",
                data_type: DataType::USINT,
                bits: 8,
                default: 1,
                maximum: None,
            },
            SettingSpec {
                subindex: 2,
                name: "Interpolation time index",
                data_type: DataType::SINT,
                bits: 8,
                // -3: milliseconds.
                default: 0xFD,
                maximum: None,
            },
        ],
    }],
    variables: CIA402_VARIABLES,
    times: ResponseTimes::DRIVE,
};

const SERCOS_PDOS: &[PdoSpec] = &[
    PdoSpec::single(
        24,
        "MDT",
        Some(2),
        &[
            entry(134, "Master control word", DataType::UINT, 16),
            entry(36, "Velocity command value", DataType::DINT, 32),
        ],
    ),
    PdoSpec::single(
        16,
        "AT",
        Some(3),
        &[
            entry(135, "Drive status word", DataType::UINT, 16),
            entry(51, "Position feedback 1 value", DataType::DINT, 32),
        ],
    ),
];

/// Parameters beyond the telegrams: the index is the IDN. The velocity limit is 100 turns per second.
const SERCOS_VARIABLES: &[VariableSpec] = &[
    variable(40, "Velocity feedback value 1", I32, 0, Rights::Read),
    variable(91, "Bipolar velocity limit value", U32, 100 << 18, Rights::Setting),
    variable(BRAKE_DELAY.0, "Switch-off delay of the brake", U16, 500, Rights::Setting),
];

const SERCOS_PROCESSOR: ProcessorSpec = ProcessorSpec {
    function: Function::Sercos,
    hardware_version: "",
    software_version: "",
    settings: &[],
    variables: SERCOS_VARIABLES,
    times: ResponseTimes::DRIVE,
};

const DRIVE: Spec =
    Spec { group: "Drives", ports: [Mii, Mii, Absent, Absent], ebus_current_ma: 0, ..TERMINAL };

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    // Where its process data lie is not known here; its telegrams and its mailbox are.
    LibraryType {
        controllers: &[Spec {
            name: "AX5103-0012",
            title: "AX5103-0012 Servo drive, one axis, SoE",
            product: 0x13EF_6012,
            revision: 0x000C_0000,
            sync_managers: &[
                SyncManagerSpec { start: 0x1800, ..mailbox_out(128) },
                mailbox_in(0x1A00, 128),
                SyncManagerSpec { start: 0x1000, ..outputs(6) },
                SyncManagerSpec { start: 0x1400, ..inputs(6) },
            ],
            pdos: SERCOS_PDOS,
            protocols: Protocols::SOE | Protocols::FOE,
            coe: NO_COE,
            application: ApplicationSpec::Processor(&SERCOS_PROCESSOR),
            op_modes: &[OpModeSpec::with_clock("DC", 0x0730)],
            ..DRIVE
        }],
        inner_links: &[],
    },
    // No product: what all drives of CiA 402 have in common.
    LibraryType {
        controllers: &[Spec {
            name: "CiA402-Drive",
            title: "Generic drive of CiA 402, one axis",
            group: "Generic",
            vendor: NOBODY,
            product: 0x0000_0402,
            revision: 0x0001_0000,
            sync_managers: &[
                mailbox_out(256),
                mailbox_in(0x1100, 256),
                SyncManagerSpec { start: 0x1200, ..outputs(12) },
                SyncManagerSpec { start: 0x1400, ..inputs(14) },
            ],
            pdos: CIA402_PDOS,
            coe: COE_WITH_PDO_CONFIGURATION,
            application: ApplicationSpec::Processor(&CIA402_PROCESSOR),
            op_modes: &[OpModeSpec::free("Synchron"), OpModeSpec::with_clock("DC", 0x0300)],
            ..DRIVE
        }],
        inner_links: &[],
    },
];
