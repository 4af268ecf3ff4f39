//! Terminals with a processor that are neither plain digital nor analogue, and what all terminals
//! with a processor share.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::register::SmControl;
use linesman_proto::sii::Protocols;

use super::LibraryType;
use super::chip::ET1100;
use super::spec::{
    ApplicationSpec, BECKHOFF, COE_WITH_COMPLETE_ACCESS, EntrySpec, Function, OpModeSpec, PdoSpec,
    ProcessorSpec, SettingSpec, SettingsSpec, Spec, SyncManagerSpec, Use,
};
use crate::device::processor::ResponseTimes;
use crate::hardware::PortKind::{Absent, Ebus};

/// SII byte 0: a processor of 8 bits, asynchronous.
pub(super) const PROCESSOR: u8 = 0x08;
/// SII byte 1: SYNC and latch unit on, no device emulation.
pub(super) const CLOCK_UNITS: u8 = 0x0C;

/// Mailbox out of 128 bytes.
pub(super) const MAILBOX_OUT: SyncManagerSpec = mailbox_out(128);
/// Mailbox in of 128 bytes.
pub(super) const MAILBOX_IN: SyncManagerSpec = mailbox_in(0x1080, 128);
/// No outputs.
pub(super) const NO_OUTPUTS: SyncManagerSpec =
    SyncManagerSpec { control: SmControl::OUTPUTS_WITHOUT_WATCHDOG, enable: 0, ..outputs(0) };
/// No inputs.
pub(super) const NO_INPUTS: SyncManagerSpec = SyncManagerSpec { enable: 0, ..inputs(0) };

/// Mailbox out at the begin of the RAM.
pub(super) const fn mailbox_out(length: u16) -> SyncManagerSpec {
    SyncManagerSpec {
        start: 0x1000,
        length,
        control: SmControl::MAILBOX_OUT,
        enable: 0x01,
        kind: Use::MailboxOut,
    }
}

/// Mailbox in.
pub(super) const fn mailbox_in(start: u16, length: u16) -> SyncManagerSpec {
    SyncManagerSpec {
        start,
        length,
        control: SmControl::MAILBOX_IN,
        enable: 0x01,
        kind: Use::MailboxIn,
    }
}

/// Outputs behind a mailbox of 128 bytes.
pub(super) const fn outputs(length: u16) -> SyncManagerSpec {
    SyncManagerSpec {
        start: 0x1100,
        length,
        control: SmControl::OUTPUTS,
        enable: 0x01,
        kind: Use::Outputs,
    }
}

/// Inputs behind a mailbox of 128 bytes.
pub(super) const fn inputs(length: u16) -> SyncManagerSpec {
    SyncManagerSpec {
        start: 0x1180,
        length,
        control: SmControl::INPUTS,
        enable: 0x01,
        kind: Use::Inputs,
    }
}

/// With the frames, or with SYNC0 and SYNC1.
pub(super) const SYNCHRONISED: &[OpModeSpec] =
    &[OpModeSpec::free("Synchron"), OpModeSpec::with_clock("DC-Synchron", 0x0700)];

/// A terminal with a processor.
pub(super) const TERMINAL: Spec = Spec {
    name: "",
    title: "",
    group: "",
    vendor: BECKHOFF,
    product: 0,
    revision: 0,
    chip: &ET1100,
    ports: [Ebus, Ebus, Absent, Absent],
    ebus_current_ma: 0,
    pdi_control: PROCESSOR,
    esc_configuration: CLOCK_UNITS,
    sync_impulse: 0,
    pdi_configuration_2: 0,
    sync_managers: &[],
    pdos: &[],
    protocols: Protocols::COE | Protocols::FOE,
    coe: COE_WITH_COMPLETE_ACCESS,
    application: ApplicationSpec::Plain,
    op_modes: &[],
};

/// Four outputs with diagnosis of each, and of the whole terminal.
const DIAGNOSED_OUTPUTS: &[PdoSpec] = &[
    PdoSpec {
        channels: 4,
        ..PdoSpec::single(
            0x1600,
            "DIG Outputs Channel",
            Some(2),
            &[EntrySpec::bit(0x7000, 1, "Output")],
        )
    },
    PdoSpec {
        channels: 4,
        ..PdoSpec::single(
            0x1A00,
            "DIG Inputs Channel",
            Some(3),
            &[
                EntrySpec::bit(0x6001, 1, "Overtemperature"),
                EntrySpec::bit(0x6001, 2, "Open load"),
                EntrySpec::bit(0x6001, 3, "Overvoltage"),
                EntrySpec::bit(0x6001, 4, "Short circuit"),
            ],
        )
    },
    PdoSpec::single(
        0x1A04,
        "DIG Inputs Device",
        Some(3),
        &[
            EntrySpec::bit(0xF600, 0x11, "Common fault"),
            EntrySpec::bit(0xF600, 0x12, "Undervoltage"),
            EntrySpec::bit(0xF600, 0x13, "Overvoltage"),
            EntrySpec::bit(0xF600, 0x14, "Overtemperature"),
        ],
    ),
];

const DIAGNOSED_OUTPUTS_PROCESSOR: ProcessorSpec = ProcessorSpec {
    function: Function::DigitalOutputs { channels: 4 },
    hardware_version: "02",
    software_version: "01",
    settings: &[],
    variables: &[],
    times: ResponseTimes::TERMINAL,
};

/// Encoder and motor of one axis.
const AXIS: &[PdoSpec] = &[
    PdoSpec::single(
        0x1600,
        "ENC Control compact",
        Some(2),
        &[
            EntrySpec::bit(0x7000, 0x01, "Enable latch C"),
            EntrySpec::bit(0x7000, 0x02, "Enable latch extern on positive edge"),
            EntrySpec::bit(0x7000, 0x03, "Set counter"),
            EntrySpec::bit(0x7000, 0x04, "Enable latch extern on negative edge"),
            EntrySpec::padding(4),
            EntrySpec::padding(8),
            EntrySpec::number(0x7000, 0x11, "Set counter value", DataType::UINT, 16),
        ],
    ),
    PdoSpec::single(
        0x1602,
        "STM Control",
        Some(2),
        &[
            EntrySpec::bit(0x7010, 0x01, "Enable"),
            EntrySpec::bit(0x7010, 0x02, "Reset"),
            EntrySpec::bit(0x7010, 0x03, "Reduce torque"),
            EntrySpec::padding(5),
            EntrySpec::padding(8),
        ],
    ),
    PdoSpec::single(
        0x1604,
        "STM Velocity",
        Some(2),
        &[EntrySpec::number(0x7010, 0x21, "Velocity", DataType::INT, 16)],
    ),
    PdoSpec::single(
        0x1A00,
        "ENC Status compact",
        Some(3),
        &[
            EntrySpec::bit(0x6000, 0x01, "Latch C valid"),
            EntrySpec::bit(0x6000, 0x02, "Latch extern valid"),
            EntrySpec::bit(0x6000, 0x03, "Set counter done"),
            EntrySpec::bit(0x6000, 0x04, "Counter underflow"),
            EntrySpec::bit(0x6000, 0x05, "Counter overflow"),
            EntrySpec::padding(3),
            EntrySpec::padding(5),
            EntrySpec::bit(0x6000, 0x0E, "Sync error"),
            EntrySpec::padding(1),
            EntrySpec::bit(0x6000, 0x10, "TxPDO Toggle"),
            EntrySpec::number(0x6000, 0x11, "Counter value", DataType::UINT, 16),
            EntrySpec::number(0x6000, 0x12, "Latch value", DataType::UINT, 16),
        ],
    ),
    PdoSpec::single(
        0x1A03,
        "STM Status",
        Some(3),
        &[
            EntrySpec::bit(0x6010, 0x01, "Ready to enable"),
            EntrySpec::bit(0x6010, 0x02, "Ready"),
            EntrySpec::bit(0x6010, 0x03, "Warning"),
            EntrySpec::bit(0x6010, 0x04, "Error"),
            EntrySpec::bit(0x6010, 0x05, "Moving positive"),
            EntrySpec::bit(0x6010, 0x06, "Moving negative"),
            EntrySpec::bit(0x6010, 0x07, "Torque reduced"),
            EntrySpec::padding(1),
            EntrySpec::padding(3),
            EntrySpec::bit(0x6010, 0x0C, "Digital input 1"),
            EntrySpec::bit(0x6010, 0x0D, "Digital input 2"),
            EntrySpec::bit(0x6010, 0x0E, "Sync error"),
            EntrySpec::padding(1),
            EntrySpec::bit(0x6010, 0x10, "TxPDO Toggle"),
        ],
    ),
];

const fn word(subindex: u8, name: &'static str, default: u32, maximum: u32) -> SettingSpec {
    let (data_type, maximum) = (DataType::UINT, Some(maximum));
    SettingSpec { subindex, name, data_type, bits: 16, default, maximum }
}

const AXIS_PROCESSOR: ProcessorSpec = ProcessorSpec {
    function: Function::Stepper,
    hardware_version: "11",
    software_version: "12",
    settings: &[
        SettingsSpec {
            index: 0x8010,
            channels: 1,
            name: "STM Motor Settings",
            entries: &[
                word(0x01, "Maximal current", 5_000, 5_000),
                word(0x02, "Reduced current", 2_500, 5_000),
                word(0x03, "Nominal voltage", 5_000, 5_000),
                word(0x04, "Motor coil resistance", 100, 65_535),
                word(0x06, "Motor fullsteps", 200, 65_535),
            ],
        },
        SettingsSpec {
            index: 0x8012,
            channels: 1,
            name: "STM Features",
            entries: &[SettingSpec {
                subindex: 0x05,
                name: "Speed range",
                data_type: DataType(0x0032),
                bits: 3,
                default: 0,
                maximum: Some(4),
            }],
        },
    ],
    variables: &[],
    times: ResponseTimes::DRIVE,
};

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EL2014",
        title: "EL2014 4Ch. Dig. Output 24V, 0.5A, Diagnostics",
        group: "DigOut",
        product: 0x07DE_3052,
        revision: 0x0011_0000,
        ebus_current_ma: 60,
        sync_managers: &[MAILBOX_OUT, MAILBOX_IN, outputs(1), inputs(3)],
        pdos: DIAGNOSED_OUTPUTS,
        application: ApplicationSpec::Processor(&DIAGNOSED_OUTPUTS_PROCESSOR),
        ..TERMINAL
    }]),
    single(&[Spec {
        name: "EL7041",
        title: "EL7041 1Ch. Stepper motor output stage (50V, 5A)",
        group: "DriveAxisTerminals",
        product: 0x1B81_3052,
        revision: 0x001A_0000,
        ebus_current_ma: 140,
        sync_managers: &[MAILBOX_OUT, MAILBOX_IN, outputs(8), inputs(8)],
        pdos: AXIS,
        application: ApplicationSpec::Processor(&AXIS_PROCESSOR),
        op_modes: &[OpModeSpec::free("Synchron"), OpModeSpec::with_clock("DC-Synchron", 0x0300)],
        ..TERMINAL
    }]),
];
