//! Devices that are no products: plain inputs and outputs on a cable, for lines that need some.

use super::LibraryType;
use super::analog::{FOUR_INPUT_SETTINGS, FOUR_INPUTS, OUTPUT_SETTINGS};
use super::chip::ET1100;
use super::digital::{self, OUTPUT_BYTE};
use super::smart::{self, MAILBOX_IN, MAILBOX_OUT, SYNCHRONISED, inputs, outputs};
use super::spec::{
    ApplicationSpec, EntrySpec, Function, NOBODY, PdoSpec, ProcessorSpec, SettingsSpec, Spec,
    SyncManagerSpec, Use,
};
use crate::device::application::analog::Range;
use crate::device::processor::ResponseTimes;
use crate::hardware::PortKind::{Absent, Mii};
use linesman_proto::mailbox::coe::DataType;
use linesman_proto::register::SmControl;

const OUTPUTS: SyncManagerSpec = SyncManagerSpec { start: 0x1000, length: 2, ..OUTPUT_BYTE };
const INPUTS: SyncManagerSpec = SyncManagerSpec {
    start: 0x1100,
    length: 2,
    control: SmControl::INPUTS_WITHOUT_EVENT,
    enable: 0x01,
    kind: Use::Inputs,
};

/// Four inputs, then four outputs: objects 0x6000 to 0x6030 and 0x7040 to 0x7070.
const ANALOG_PDOS: &[PdoSpec] = &[
    FOUR_INPUTS[0],
    FOUR_INPUTS[1],
    PdoSpec {
        channels: 4,
        ..PdoSpec::single(
            0x1600,
            "AO Output Channel",
            Some(2),
            &[EntrySpec::number(0x7040, 0x11, "Analog output", DataType::INT, 16)],
        )
    },
];

const ANALOG_PROCESSOR: ProcessorSpec = ProcessorSpec {
    function: Function::AnalogInputsOutputs { inputs: 4, outputs: 4, range: Range::BIPOLAR },
    hardware_version: "1",
    software_version: "1",
    settings: &[
        FOUR_INPUT_SETTINGS[0],
        SettingsSpec {
            index: 0x8040,
            channels: 4,
            name: "AO Settings Ch.",
            entries: OUTPUT_SETTINGS,
        },
    ],
    variables: &[],
    times: ResponseTimes::TERMINAL,
};

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    LibraryType {
        controllers: &[Spec {
            name: "Digital-16",
            title: "Generic device, 16 digital outputs and 16 digital inputs",
            group: "Generic",
            vendor: NOBODY,
            product: 0x0000_0016,
            revision: 0x0001_0000,
            chip: &ET1100,
            ports: [Mii, Mii, Absent, Absent],
            ebus_current_ma: 0,
            sync_managers: &[OUTPUTS, INPUTS],
            pdos: &[digital::outputs(16), PdoSpec { sync_manager: Some(1), ..digital::inputs(16) }],
            ..digital::TERMINAL
        }],
        inner_links: &[],
    },
    LibraryType {
        controllers: &[Spec {
            name: "Analog-4",
            title: "Generic device, 4 analogue inputs and 4 analogue outputs, CoE",
            group: "Generic",
            vendor: NOBODY,
            product: 0x0000_0004,
            revision: 0x0001_0000,
            ports: [Mii, Mii, Absent, Absent],
            sync_managers: &[MAILBOX_OUT, MAILBOX_IN, outputs(8), inputs(16)],
            pdos: ANALOG_PDOS,
            application: ApplicationSpec::Processor(&ANALOG_PROCESSOR),
            op_modes: SYNCHRONISED,
            ..smart::TERMINAL
        }],
        inner_links: &[],
    },
];
