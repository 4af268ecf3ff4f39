//! Terminals between networks: Ethernet ports, other clocks, other EtherCAT segments.
//!
//! An EL6692 and an EL6695 have two sides, each a device in a network of its own: the primary one is a
//! terminal, the secondary one has sockets. Both tell the times of their networks to each other, and
//! values that one side puts out come in at the other, once their signals are wired.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::sii::Protocols;

use super::LibraryType;
use super::smart::{NO_INPUTS, NO_OUTPUTS, TERMINAL, inputs, mailbox_in, mailbox_out};
use super::spec::{
    ApplicationSpec, COE_WITH_PDO_CONFIGURATION, EntrySpec, Function, OpModeSpec, PdoSpec,
    ProcessorSpec, SettingSpec, SettingsSpec, Spec, SyncManagerSpec,
};
use crate::device::processor::ResponseTimes;
use crate::hardware::PortKind::{Absent, Mii};

const SWITCH_PORT_PROCESSOR: ProcessorSpec = ProcessorSpec {
    function: Function::SwitchPorts { ports: 1 },
    hardware_version: "10",
    software_version: "11",
    settings: &[],
    variables: &[],
    times: ResponseTimes::TERMINAL,
};

const FOUR_PORTS_PROCESSOR: ProcessorSpec =
    ProcessorSpec { function: Function::SwitchPorts { ports: 4 }, ..SWITCH_PORT_PROCESSOR };

/// Ethernet frames go through the mailbox: no process data.
const SWITCH_PORT: Spec = Spec {
    group: "Communication",
    sync_managers: &[
        mailbox_out(1_024),
        mailbox_in(0x1400, 1_024),
        SyncManagerSpec { start: 0x1800, ..NO_OUTPUTS },
        SyncManagerSpec { start: 0x1C00, ..NO_INPUTS },
    ],
    protocols: Protocols::EOE | Protocols::COE | Protocols::FOE,
    application: ApplicationSpec::Processor(&SWITCH_PORT_PROCESSOR),
    ..TERMINAL
};

/// The status word of external synchronisation, and the rest of its long form.
macro_rules! times {
    ($parameter:literal $(, $more:expr)*) => {
        &[
            EntrySpec::number(0x10F4, 0x01, "Sync Mode", BIT2, 2),
            EntrySpec::padding(9),
            EntrySpec::bit($parameter, 0x09, "TxPDO Toggle"),
            EntrySpec::bit($parameter, 0x07, "TxPDO State"),
            EntrySpec::bit(0x10F4, 0x0E, "Control value update toggle"),
            EntrySpec::bit(0x10F4, 0x0F, "Time stamp update toggle"),
            EntrySpec::bit(0x10F4, 0x10, "External device not connected"),
            $($more),*
        ]
    };
}

const BIT2: DataType = DataType(0x0031);
const INTERNAL_64: EntrySpec =
    EntrySpec::number(0x10F4, 0x11, "Internal time stamp", DataType::ULINT, 64);
const EXTERNAL_64: EntrySpec =
    EntrySpec::number(0x10F4, 0x12, "External time stamp", DataType::ULINT, 64);
const INTERNAL_32: EntrySpec =
    EntrySpec::number(0x10F4, 0x11, "Internal time stamp", DataType::ULINT, 32);
const EXTERNAL_32: EntrySpec =
    EntrySpec::number(0x10F4, 0x12, "External time stamp", DataType::ULINT, 32);
const CONTROL_VALUE: EntrySpec =
    EntrySpec::number(0x10F4, 0x13, "Control value for DC master clock", DataType::DINT, 32);

const CLOCK_PDOS: &[PdoSpec] = &[
    PdoSpec::single(
        0x1A00,
        "External Sync (64 Bit)",
        Some(3),
        times!(0x1800, INTERNAL_64, EXTERNAL_64, CONTROL_VALUE),
    ),
    PdoSpec::single(
        0x1A01,
        "External Sync (32 Bit)",
        None,
        times!(0x1801, INTERNAL_32, EXTERNAL_32, CONTROL_VALUE),
    ),
    PdoSpec::single(0x1A02, "External Sync Compact", None, times!(0x1802)),
];

const BRIDGE_PDOS: &[PdoSpec] = &[
    PdoSpec::single(0x1600, "IO Outputs", Some(2), &[]),
    PdoSpec::single(0x1A01, "External Sync Compact", Some(3), times!(0x1801)),
    PdoSpec::single(0x1A00, "IO Inputs", Some(3), &[]),
    PdoSpec::single(
        0x1A02,
        "External Sync (64 Bit)",
        None,
        times!(0x1802, INTERNAL_64, EXTERNAL_64, CONTROL_VALUE),
    ),
    PdoSpec::single(
        0x1A03,
        "External Sync (32 Bit)",
        None,
        times!(0x1803, INTERNAL_32, EXTERNAL_32, CONTROL_VALUE),
    ),
];

const FAST_BRIDGE_PDOS: &[PdoSpec] = &[
    PdoSpec::single(0x1608, "IO Outputs", Some(2), &[]),
    PdoSpec::single(0x1A01, "External Sync Compact", Some(3), times!(0x1801)),
    PdoSpec::single(0x1A08, "IO Inputs", Some(3), &[]),
    PdoSpec::single(
        0x1A02,
        "External Sync (64 Bit)",
        None,
        times!(0x1802, INTERNAL_64, EXTERNAL_64),
    ),
    PdoSpec::single(
        0x1A03,
        "External Sync (32 Bit)",
        None,
        times!(0x1803, INTERNAL_32, EXTERNAL_32),
    ),
];

/// Who sets the pace: 0 the primary side, 1 the secondary.
const SYNC_SETTINGS: &[SettingsSpec] = &[SettingsSpec {
    index: 0x10F5,
    channels: 1,
    name: "External synchronization settings",
    entries: &[SettingSpec {
        subindex: 0x01,
        name: "Sync master",
        data_type: DataType::BOOL,
        bits: 1,
        default: 0,
        maximum: None,
    }],
}];

const fn two_times(version: &'static str, function: Function) -> ProcessorSpec {
    ProcessorSpec {
        function,
        hardware_version: version,
        software_version: version,
        settings: SYNC_SETTINGS,
        variables: &[],
        times: ResponseTimes::TERMINAL,
    }
}

const CLOCK_PROCESSOR: ProcessorSpec = two_times("16", Function::TwoTimes);
/// 480 bytes each way.
const BRIDGE_PROCESSOR: ProcessorSpec = two_times("12", Function::Bridge { values: 120 });
/// As much as one object and one PDO hold: 1,000 bytes each way.
const FAST_BRIDGE_PROCESSOR: ProcessorSpec = two_times("12", Function::Bridge { values: 250 });

const BRIDGE: Spec = Spec {
    group: "Communication",
    product: 0x1A24_3052,
    sync_managers: &[
        mailbox_out(256),
        mailbox_in(0x1400, 256),
        SyncManagerSpec { start: 0x1800, ..NO_OUTPUTS },
        SyncManagerSpec { start: 0x1C00, ..inputs(2) },
    ],
    pdos: BRIDGE_PDOS,
    coe: COE_WITH_PDO_CONFIGURATION,
    protocols: Protocols::AOE | Protocols::EOE | Protocols::COE | Protocols::FOE | Protocols::VOE,
    application: ApplicationSpec::Processor(&BRIDGE_PROCESSOR),
    op_modes: &[OpModeSpec::free("FreeRun"), OpModeSpec::with_clock("DcSync", 0x0320)],
    ..TERMINAL
};

const FAST_BRIDGE: Spec = Spec {
    product: 0x1A27_3052,
    sync_managers: &[
        mailbox_out(1_024),
        mailbox_in(0x1400, 1_024),
        SyncManagerSpec { start: 0x1800, ..NO_OUTPUTS },
        SyncManagerSpec { start: 0x2400, ..inputs(2) },
    ],
    pdos: FAST_BRIDGE_PDOS,
    application: ApplicationSpec::Processor(&FAST_BRIDGE_PROCESSOR),
    ..BRIDGE
};

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EL6601",
        title: "EL6601 1 Port Switch (Ethernet, CoE)",
        product: 0x19C9_3052,
        revision: 0x0015_0000,
        ebus_current_ma: 260,
        ..SWITCH_PORT
    }]),
    single(&[Spec {
        name: "EL6614",
        title: "EL6614 4 Port Switch (Ethernet, CoE)",
        product: 0x19D6_3052,
        revision: 0x0015_0000,
        ebus_current_ma: 310,
        application: ApplicationSpec::Processor(&FOUR_PORTS_PROCESSOR),
        ..SWITCH_PORT
    }]),
    // Its clock of another time is its one signal: how far that time is ahead, in ns. Nothing is
    // connected while nothing drives it.
    single(&[Spec {
        name: "EL6688",
        title: "EL6688 IEEE 1588 external clock",
        group: "Communication",
        product: 0x1A20_3052,
        revision: 0x0016_0000,
        ebus_current_ma: 310,
        sync_managers: &[
            mailbox_out(1_024),
            mailbox_in(0x1400, 1_024),
            SyncManagerSpec { start: 0x1800, ..NO_OUTPUTS },
            SyncManagerSpec { start: 0x1C00, ..inputs(22) },
        ],
        pdos: CLOCK_PDOS,
        protocols: Protocols::EOE | Protocols::COE | Protocols::FOE,
        application: ApplicationSpec::Processor(&CLOCK_PROCESSOR),
        op_modes: &[OpModeSpec { name: "DcLatch", assign_activate: 0x0030, sync0_factor: 0 }],
        ..TERMINAL
    }]),
    single(&[Spec {
        name: "EL6692",
        title: "EL6692 EtherCAT bridge terminal, primary side",
        revision: 0x0012_0000,
        ebus_current_ma: 120,
        ..BRIDGE
    }]),
    single(&[Spec {
        name: "EL6692-0002",
        title: "EL6692-0002 EtherCAT bridge terminal, secondary side",
        revision: 0x0014_0002,
        ports: [Mii, Mii, Absent, Absent],
        ..BRIDGE
    }]),
    single(&[Spec {
        name: "EL6695",
        title: "EL6695 EtherCAT bridge terminal, primary side",
        revision: 0x0006_0000,
        ebus_current_ma: 400,
        ..FAST_BRIDGE
    }]),
    single(&[Spec {
        name: "EL6695-0002",
        title: "EL6695-0002 EtherCAT bridge terminal, secondary side",
        revision: 0x0006_0002,
        ports: [Mii, Mii, Absent, Absent],
        ..FAST_BRIDGE
    }]),
];
