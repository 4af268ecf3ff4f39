//! Digital terminals whose controller drives the channels itself.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::register::SmControl;

use super::LibraryType;
use super::chip::{ESC20_64, ET1200};
use super::spec::{
    ApplicationSpec, BECKHOFF, EntrySpec, NO_COE, OpModeSpec, PdoSpec, Spec, SyncManagerSpec, Use,
};
use crate::hardware::PortKind::{Absent, Ebus};

/// SII byte 0: digital I/O.
const DIGITAL_IO: u8 = 0x04;
/// SII byte 1: device emulation.
const EMULATION: u8 = 0x01;

const ONE_INPUT: &[EntrySpec] = &[EntrySpec::bit(0x6000, 1, "Input")];
const ONE_OUTPUT: &[EntrySpec] = &[EntrySpec::bit(0x7000, 1, "Output")];

/// Digital inputs; one PDO each.
pub(super) const fn inputs(count: u8) -> PdoSpec {
    PdoSpec {
        index: 0x1A00,
        step: 1,
        channels: count,
        name: "Channel",
        sync_manager: Some(0),
        entries: ONE_INPUT,
    }
}

/// Digital outputs; one PDO each.
pub(super) const fn outputs(count: u8) -> PdoSpec {
    PdoSpec {
        index: 0x1600,
        step: 1,
        channels: count,
        name: "Channel",
        sync_manager: Some(0),
        entries: ONE_OUTPUT,
    }
}

/// A terminal without a processor.
pub(super) const TERMINAL: Spec = Spec {
    name: "",
    title: "",
    group: "",
    vendor: BECKHOFF,
    product: 0,
    revision: 0x0012_0000,
    chip: &ET1200,
    ports: [Ebus, Ebus, Absent, Absent],
    ebus_current_ma: 90,
    pdi_control: DIGITAL_IO,
    esc_configuration: EMULATION,
    sync_impulse: 0,
    pdi_configuration_2: 0,
    sync_managers: &[],
    pdos: &[],
    protocols: 0,
    coe: NO_COE,
    application: ApplicationSpec::Plain,
    op_modes: &[],
};

/// Up to eight inputs.
pub(super) const INPUT_BYTE: SyncManagerSpec = SyncManagerSpec {
    start: 0x1000,
    length: 1,
    control: SmControl::INPUTS_WITHOUT_EVENT,
    enable: 0x01,
    kind: Use::Inputs,
};

/// Up to eight outputs.
pub(super) const OUTPUT_BYTE: SyncManagerSpec = SyncManagerSpec {
    start: 0x0F00,
    length: 1,
    control: SmControl::OUTPUTS_WITHOUT_EVENT,
    // Enabled, and only in OP.
    enable: 0x09,
    kind: Use::Outputs,
};

const INPUTS: Spec = Spec { group: "DigIn", sync_managers: &[INPUT_BYTE], ..TERMINAL };

const OUTPUTS: Spec = Spec { group: "DigOut", sync_managers: &[OUTPUT_BYTE], ..TERMINAL };

const fn register(address: u16, name: &'static str, data_type: DataType, bits: u8) -> EntrySpec {
    let [low, high] = address.to_le_bytes();
    EntrySpec::number(0x1D00 | high as u16, low, name, data_type, bits)
}

/// Status and time stamps of the latch unit, 0x09AE to 0x09CF, as they lie there.
const LATCHES: &[EntrySpec] = &[
    register(0x09AE, "Status1", DataType::USINT, 8),
    register(0x09AF, "Status2", DataType::USINT, 8),
    register(0x09B0, "LatchPos1", DataType::ULINT, 64),
    register(0x09B8, "LatchNeg1", DataType::ULINT, 64),
    register(0x09C0, "LatchPos2", DataType::ULINT, 64),
    register(0x09C8, "LatchNeg2", DataType::ULINT, 64),
];

const LATCHED_INPUTS: &[PdoSpec] = &[
    PdoSpec::single(0x1A00, "Channel 1", Some(0), &[EntrySpec::bit(0x6000, 1, "Input")]),
    PdoSpec::single(
        0x1A01,
        "Channel 2",
        Some(0),
        &[EntrySpec::bit(0x6000, 2, "Input"), EntrySpec::padding(6)],
    ),
    PdoSpec::single(0x1A13, "Latch", Some(1), LATCHES),
    PdoSpec::single(0x1A15, "SysTime", None, &[register(0x0910, "SysTime", DataType::ULINT, 64)]),
];

const FOUR_INPUTS: &[PdoSpec] = &[inputs(4)];
const EIGHT_INPUTS: &[PdoSpec] = &[inputs(8)];
const FOUR_OUTPUTS: &[PdoSpec] = &[outputs(4)];
const EIGHT_OUTPUTS: &[PdoSpec] = &[outputs(8)];

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EL1004",
        title: "EL1004 4Ch. Dig. Input 24V, 3ms",
        product: 0x03EC_3052,
        revision: 0x0013_0000,
        pdos: FOUR_INPUTS,
        ..INPUTS
    }]),
    single(&[Spec {
        name: "EL1008",
        title: "EL1008 8Ch. Dig. Input 24V, 3ms",
        product: 0x03F0_3052,
        pdos: EIGHT_INPUTS,
        ..INPUTS
    }]),
    single(&[Spec {
        name: "EL1014",
        title: "EL1014 4Ch. Dig. Input 24V, 10us",
        product: 0x03F6_3052,
        revision: 0x0013_0000,
        pdos: FOUR_INPUTS,
        ..INPUTS
    }]),
    single(&[Spec {
        name: "EL1018",
        title: "EL1018 8Ch. Dig. Input 24V, 10us",
        product: 0x03FA_3052,
        pdos: EIGHT_INPUTS,
        ..INPUTS
    }]),
    single(&[Spec {
        name: "EL2004",
        title: "EL2004 4Ch. Dig. Output 24V, 0.5A",
        product: 0x07D4_3052,
        ebus_current_ma: 100,
        pdi_configuration_2: 0x000F,
        pdos: FOUR_OUTPUTS,
        ..OUTPUTS
    }]),
    single(&[Spec {
        name: "EL2008",
        title: "EL2008 8Ch. Dig. Output 24V, 0.5A",
        product: 0x07D8_3052,
        ebus_current_ma: 110,
        pdi_configuration_2: 0x00FF,
        pdos: EIGHT_OUTPUTS,
        ..OUTPUTS
    }]),
    single(&[Spec {
        name: "EL2024",
        title: "EL2024 4Ch. Dig. Output 24V, 2A",
        product: 0x07E8_3052,
        ebus_current_ma: 120,
        pdi_configuration_2: 0x000F,
        pdos: FOUR_OUTPUTS,
        ..OUTPUTS
    }]),
    // Inputs with time stamps: two bits that come through a buffer of one byte, and the latch
    // registers of the controller, which FMMUs read where they are.
    single(&[Spec {
        name: "EL1252",
        title: "EL1252 2Ch. Fast Dig. Input 24V, 1us, DC Latch",
        product: 0x04E4_3052,
        revision: 0x0016_0000,
        chip: &ESC20_64,
        ebus_current_ma: 110,
        sync_managers: &[
            SyncManagerSpec { control: SmControl::MAILBOX_IN, ..INPUT_BYTE },
            SyncManagerSpec::registers(0x09AE),
            SyncManagerSpec::registers(0x0910),
        ],
        pdos: LATCHED_INPUTS,
        op_modes: &[OpModeSpec { name: "DcLatch", assign_activate: 0x0100, sync0_factor: 0 }],
        ..INPUTS
    }]),
];
