//! Boxes for the machine: cables instead of terminal contacts, and a supply of their own.

use super::LibraryType;
use super::analog::{FOUR_OUTPUT_SETTINGS, FOUR_OUTPUTS_AT_11};
use super::chip::{ET1100, IP_CORE};
use super::digital;
use super::smart::{MAILBOX_IN, MAILBOX_OUT, NO_INPUTS, SYNCHRONISED, TERMINAL, outputs};
use super::spec::{ApplicationSpec, Function, PdoSpec, ProcessorSpec, Spec};
use crate::device::application::analog::Range;
use crate::device::processor::ResponseTimes;
use crate::hardware::PortKind::{Absent, Mii};

const DIGITAL: Spec = Spec {
    chip: &ET1100,
    ports: [Mii, Mii, Absent, Absent],
    ebus_current_ma: 0,
    revision: 0x0012_0001,
    ..digital::TERMINAL
};

const EIGHT_INPUTS: &[PdoSpec] = &[digital::inputs(8)];
const FOUR_AND_FOUR: &[PdoSpec] =
    &[digital::outputs(4), PdoSpec { sync_manager: Some(1), ..digital::inputs(4) }];

const FOUR_ANALOG_OUTPUTS: ProcessorSpec = ProcessorSpec {
    function: Function::AnalogOutputs { channels: 4, subindex: 0x11, range: Range::BIPOLAR },
    hardware_version: "03",
    software_version: "04",
    settings: FOUR_OUTPUT_SETTINGS,
    variables: &[],
    times: ResponseTimes::TERMINAL,
};

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EP1008-0001",
        title: "EP1008-0001 8 Ch. Dig. Input 24V, 3ms, M8",
        group: "DigIn",
        product: 0x03F0_4052,
        sync_managers: &[digital::INPUT_BYTE],
        pdos: EIGHT_INPUTS,
        ..DIGITAL
    }]),
    single(&[Spec {
        name: "EP2308-0001",
        title: "EP2308-0001 4 Ch. Dig. Input 3ms, 4 Ch. Dig. Output 24V, 0.5A, M8",
        group: "DigInOut",
        product: 0x0904_4052,
        pdi_configuration_2: 0x000F,
        sync_managers: &[digital::OUTPUT_BYTE, digital::INPUT_BYTE],
        pdos: FOUR_AND_FOUR,
        ..DIGITAL
    }]),
    single(&[Spec {
        name: "EP4174-0002",
        title: "EP4174-0002 4 Ch. Ana. Output +/-10V, 0/4-20mA, M12",
        group: "AnaOut",
        product: 0x104E_4052,
        revision: 0x0011_0002,
        chip: &IP_CORE,
        ports: [Mii, Mii, Absent, Absent],
        sync_managers: &[MAILBOX_OUT, MAILBOX_IN, outputs(8), NO_INPUTS],
        pdos: FOUR_OUTPUTS_AT_11,
        application: ApplicationSpec::Processor(&FOUR_ANALOG_OUTPUTS),
        op_modes: SYNCHRONISED,
        ..TERMINAL
    }]),
];
