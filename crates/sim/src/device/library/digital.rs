//! Digital terminals whose controller drives the channels itself.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::register::SmControl;

use super::LibraryType;
use super::chip::ET1200;
use super::spec::{Behind, EntrySpec, NO_COE, PdoSpec, Spec, SyncManagerSpec, Use};
use crate::hardware::PortKind::{Absent, Ebus};

/// SII byte 0: digital I/O.
const DIGITAL_IO: u8 = 0x04;
/// SII byte 1: device emulation.
const EMULATION: u8 = 0x01;

/// Digital inputs; one PDO each.
pub(super) const fn inputs(count: u8) -> PdoSpec {
    PdoSpec {
        index: 0x1A00,
        step: 1,
        channels: count,
        name: "Channel",
        sync_manager: Some(0),
        entries: &[EntrySpec {
            index: 0x6000,
            subindex: 1,
            name: "Input",
            data_type: DataType::BOOL,
            bits: 1,
        }],
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
        entries: &[EntrySpec {
            index: 0x7000,
            subindex: 1,
            name: "Output",
            data_type: DataType::BOOL,
            bits: 1,
        }],
    }
}

/// A terminal without a processor.
pub(super) const TERMINAL: Spec = Spec {
    name: "",
    title: "",
    group: "",
    product: 0,
    revision: 0x0012_0000,
    chip: &ET1200,
    ports: [Ebus, Ebus, Absent, Absent],
    ebus_current_ma: 90,
    pdi_control: DIGITAL_IO,
    esc_configuration: EMULATION,
    pdi_configuration_2: 0,
    sync_managers: &[],
    pdos: &[],
    coe: NO_COE,
    behind: Behind::Plain,
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
];
