//! Analogue terminals. They have a processor, a mailbox of 128 bytes and CoE.

use linesman_proto::mailbox::coe::DataType;

use super::LibraryType;
use super::chip::{ESC20, ET1100};
use super::smart::{
    MAILBOX_IN, MAILBOX_OUT, NO_INPUTS, NO_OUTPUTS, SYNCHRONISED, TERMINAL, inputs, outputs,
};
use super::spec::{
    ApplicationSpec, COE, EntrySpec, Function, PdoSpec, ProcessorSpec, SettingSpec, SettingsSpec,
    Spec,
};
use crate::device::application::analog::Range;
use crate::device::processor::ResponseTimes;

const fn bit(subindex: u8, name: &'static str) -> EntrySpec {
    EntrySpec::bit(0x6000, subindex, name)
}

const fn limit(subindex: u8, name: &'static str) -> EntrySpec {
    const BIT2: DataType = DataType(0x0031);
    EntrySpec { index: 0x6000, subindex, name, data_type: BIT2, bits: 2 }
}

const INPUT_VALUE: EntrySpec =
    EntrySpec { index: 0x6000, subindex: 0x11, name: "Value", data_type: DataType::INT, bits: 16 };

const VALUE_ALONE: &[EntrySpec] = &[INPUT_VALUE];
const STATUS_AND_VALUE: &[EntrySpec] = &[
    bit(0x01, "Underrange"),
    bit(0x02, "Overrange"),
    limit(0x03, "Limit 1"),
    limit(0x05, "Limit 2"),
    bit(0x07, "Error"),
    EntrySpec::padding(1),
    EntrySpec::padding(5),
    bit(0x0E, "Sync error"),
    bit(0x0F, "TxPDO State"),
    bit(0x10, "TxPDO Toggle"),
    INPUT_VALUE,
];

/// Status word and value of each channel, and as an alternative the value alone.
const fn input_pdos(channels: u8) -> [PdoSpec; 2] {
    [
        PdoSpec {
            index: 0x1A00,
            step: 2,
            channels,
            name: "AI Standard Channel",
            sync_manager: Some(3),
            entries: STATUS_AND_VALUE,
        },
        PdoSpec {
            index: 0x1A01,
            step: 2,
            channels,
            name: "AI Compact Channel",
            sync_manager: None,
            entries: VALUE_ALONE,
        },
    ]
}

const fn output_pdos(channels: u8, value: &'static [EntrySpec; 1]) -> [PdoSpec; 1] {
    [PdoSpec {
        index: 0x1600,
        step: 1,
        channels,
        name: "AO Output Channel",
        sync_manager: Some(2),
        entries: value,
    }]
}

const fn output_value(subindex: u8) -> [EntrySpec; 1] {
    [EntrySpec {
        index: 0x7000,
        subindex,
        name: "Analog output",
        data_type: DataType::INT,
        bits: 16,
    }]
}

const VALUE_AT_1: [EntrySpec; 1] = output_value(0x01);
const VALUE_AT_11: [EntrySpec; 1] = output_value(0x11);
/// Process data of four outputs whose value is subindex 0x11.
pub(super) const FOUR_OUTPUTS_AT_11: &[PdoSpec] = &output_pdos(4, &VALUE_AT_11);
const TWO_INPUTS: &[PdoSpec] = &input_pdos(2);
/// Process data of four inputs: status and value, or the value alone.
pub(super) const FOUR_INPUTS: &[PdoSpec] = &input_pdos(4);
const TWO_OUTPUTS: &[PdoSpec] = &output_pdos(2, &VALUE_AT_1);
const FOUR_OUTPUTS: &[PdoSpec] = &output_pdos(4, &VALUE_AT_1);

const fn switch(subindex: u8, name: &'static str, default: u32) -> SettingSpec {
    let data_type = DataType::BOOL;
    SettingSpec { subindex, name, data_type, bits: 1, default, maximum: None }
}

const fn word(subindex: u8, name: &'static str, maximum: Option<u32>) -> SettingSpec {
    let data_type = if maximum.is_some() { DataType::UINT } else { DataType::INT };
    SettingSpec { subindex, name, data_type, bits: 16, default: 0, maximum }
}

const GAIN: SettingSpec = SettingSpec {
    subindex: 0x12,
    name: "User scale gain",
    data_type: DataType::DINT,
    bits: 32,
    default: 0x0001_0000,
    maximum: None,
};

const INPUT_SETTINGS: &[SettingSpec] = &[
    switch(0x01, "Enable user scale", 0),
    switch(0x06, "Enable filter", 1),
    switch(0x07, "Enable limit 1", 0),
    switch(0x08, "Enable limit 2", 0),
    word(0x11, "User scale offset", None),
    GAIN,
    word(0x13, "Limit 1", None),
    word(0x14, "Limit 2", None),
    word(0x15, "Filter settings", Some(10)),
];

/// Settings of one output.
pub(super) const OUTPUT_SETTINGS: &[SettingSpec] = &[
    switch(0x01, "Enable user scale", 0),
    word(0x11, "Offset", None),
    GAIN,
    word(0x13, "Default output", None),
];

const fn input_settings(channels: u8) -> [SettingsSpec; 1] {
    [SettingsSpec { index: 0x8000, channels, name: "AI Settings Ch.", entries: INPUT_SETTINGS }]
}

const fn output_settings(channels: u8) -> [SettingsSpec; 1] {
    [SettingsSpec { index: 0x8000, channels, name: "AO Settings Ch.", entries: OUTPUT_SETTINGS }]
}

const TWO_INPUT_SETTINGS: &[SettingsSpec] = &input_settings(2);
/// Settings of four inputs.
pub(super) const FOUR_INPUT_SETTINGS: &[SettingsSpec] = &input_settings(4);
const TWO_OUTPUT_SETTINGS: &[SettingsSpec] = &output_settings(2);
/// Settings of four outputs.
pub(super) const FOUR_OUTPUT_SETTINGS: &[SettingsSpec] = &output_settings(4);

const fn input_processor(
    channels: u8,
    range: Range,
    settings: &'static [SettingsSpec],
) -> ProcessorSpec {
    ProcessorSpec {
        function: Function::AnalogInputs { channels, range },
        hardware_version: "09",
        software_version: "08",
        settings,
        variables: &[],
        times: ResponseTimes::TERMINAL,
    }
}

const fn output_processor(
    channels: u8,
    range: Range,
    settings: &'static [SettingsSpec],
) -> ProcessorSpec {
    ProcessorSpec {
        function: Function::AnalogOutputs { channels, subindex: 0x01, range },
        hardware_version: "06",
        software_version: "05",
        settings,
        variables: &[],
        times: ResponseTimes::TERMINAL,
    }
}

const TWO_BIPOLAR: ProcessorSpec = input_processor(2, Range::BIPOLAR, TWO_INPUT_SETTINGS);
const TWO_UNIPOLAR: ProcessorSpec = input_processor(2, Range::UNIPOLAR, TWO_INPUT_SETTINGS);
const FOUR_BIPOLAR: ProcessorSpec = input_processor(4, Range::BIPOLAR, FOUR_INPUT_SETTINGS);
const FOUR_BIPOLAR_12: ProcessorSpec = input_processor(4, Range::BIPOLAR_12, FOUR_INPUT_SETTINGS);
const FOUR_UNIPOLAR: ProcessorSpec = input_processor(4, Range::UNIPOLAR, FOUR_INPUT_SETTINGS);
const TWO_UNIPOLAR_OUT: ProcessorSpec = output_processor(2, Range::UNIPOLAR, TWO_OUTPUT_SETTINGS);
const FOUR_UNIPOLAR_OUT: ProcessorSpec =
    output_processor(4, Range::UNIPOLAR_12, FOUR_OUTPUT_SETTINGS);

const INPUTS: Spec = Spec {
    group: "AnaIn",
    revision: 0x0014_0000,
    ebus_current_ma: 130,
    op_modes: SYNCHRONISED,
    ..TERMINAL
};

const TWO_IN: Spec = Spec {
    sync_managers: &[MAILBOX_OUT, MAILBOX_IN, NO_OUTPUTS, inputs(8)],
    pdos: TWO_INPUTS,
    ebus_current_ma: 170,
    ..INPUTS
};

const FOUR_IN: Spec = Spec {
    sync_managers: &[MAILBOX_OUT, MAILBOX_IN, NO_OUTPUTS, inputs(16)],
    pdos: FOUR_INPUTS,
    ..INPUTS
};

const OUTPUTS: Spec = Spec {
    group: "AnaOut",
    revision: 0x0014_0000,
    ebus_current_ma: 140,
    op_modes: SYNCHRONISED,
    ..TERMINAL
};

const TWO_OUT: Spec = Spec {
    sync_managers: &[MAILBOX_OUT, MAILBOX_IN, outputs(4), NO_INPUTS],
    pdos: TWO_OUTPUTS,
    application: ApplicationSpec::Processor(&TWO_UNIPOLAR_OUT),
    ..OUTPUTS
};

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EL3004",
        title: "EL3004 4Ch. Ana. Input +/-10V, 12bit",
        product: 0x0BBC_3052,
        revision: 0x0015_0000,
        coe: COE,
        application: ApplicationSpec::Processor(&FOUR_BIPOLAR_12),
        ..FOUR_IN
    }]),
    single(&[Spec {
        name: "EL3102",
        title: "EL3102 2Ch. Ana. Input +/-10V, DIFF",
        product: 0x0C1E_3052,
        chip: &ESC20,
        coe: COE,
        application: ApplicationSpec::Processor(&TWO_BIPOLAR),
        ..TWO_IN
    }]),
    single(&[Spec {
        name: "EL3104",
        title: "EL3104 4Ch. Ana. Input +/-10V, DIFF",
        product: 0x0C20_3052,
        chip: &ET1100,
        application: ApplicationSpec::Processor(&FOUR_BIPOLAR),
        ..FOUR_IN
    }]),
    single(&[Spec {
        name: "EL3154",
        title: "EL3154 4Ch. Ana. Input 4-20mA",
        product: 0x0C52_3052,
        application: ApplicationSpec::Processor(&FOUR_UNIPOLAR),
        ..FOUR_IN
    }]),
    single(&[Spec {
        name: "EL3162",
        title: "EL3162 2Ch. Ana. Input 0-10V",
        product: 0x0C5A_3052,
        chip: &ESC20,
        coe: COE,
        application: ApplicationSpec::Processor(&TWO_UNIPOLAR),
        ..TWO_IN
    }]),
    single(&[Spec {
        name: "EL4004",
        title: "EL4004 4Ch. Ana. Output 0-10V, 12bit",
        product: 0x0FA4_3052,
        sync_managers: &[MAILBOX_OUT, MAILBOX_IN, outputs(8), NO_INPUTS],
        pdos: FOUR_OUTPUTS,
        application: ApplicationSpec::Processor(&FOUR_UNIPOLAR_OUT),
        ..OUTPUTS
    }]),
    single(&[Spec {
        name: "EL4102",
        title: "EL4102 2Ch. Ana. Output 0-10V, 16bit",
        product: 0x1006_3052,
        revision: 0x03FA_0000,
        ..TWO_OUT
    }]),
    single(&[Spec {
        name: "EL4112",
        title: "EL4112 2Ch. Ana. Output 0-20mA, 16bit",
        product: 0x1010_3052,
        ebus_current_ma: 160,
        ..TWO_OUT
    }]),
];
