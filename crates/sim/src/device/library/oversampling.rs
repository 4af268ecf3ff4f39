//! Analogue outputs that play many samples in each cycle, at SYNC0.
//!
//! Each channel has a SyncManager: a count of cycles, then the samples of the cycle, one unless the
//! MainDevice makes its buffer longer. There is no mailbox; when the next output begins can be read
//! from the register of SYNC1.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::register::SmControl;

use super::LibraryType;
use super::chip::ESC20_64;
use super::digital::TERMINAL;
use super::spec::{ApplicationSpec, EntrySpec, OpModeSpec, PdoSpec, Spec, SyncManagerSpec, Use};

const fn samples(start: u16) -> SyncManagerSpec {
    SyncManagerSpec {
        start,
        length: 4,
        control: SmControl::OUTPUTS,
        // Enabled, and only in OP.
        enable: 0x09,
        kind: Use::Outputs,
    }
}

const fn mode(name: &'static str, times: i16) -> OpModeSpec {
    OpModeSpec { name, assign_activate: 0x0730, sync0_factor: -times }
}

const PDOS: &[PdoSpec] = &[
    PdoSpec::single(
        0x1680,
        "Ch1 CycleCount",
        Some(0),
        &[EntrySpec::number(0x7800, 1, "Ch1 CycleCount", DataType::UINT, 16)],
    ),
    PdoSpec::single(
        0x1600,
        "Ch1 Sample",
        Some(0),
        &[EntrySpec::number(0x7000, 1, "Ch1 Value", DataType::INT, 16)],
    ),
    PdoSpec::single(
        0x1780,
        "Ch2 CycleCount",
        Some(1),
        &[EntrySpec::number(0x7800, 2, "Ch2 CycleCount", DataType::UINT, 16)],
    ),
    PdoSpec::single(
        0x1700,
        "Ch2 Sample",
        Some(1),
        &[EntrySpec::number(0x7000, 2, "Ch2 Value", DataType::INT, 16)],
    ),
    PdoSpec::single(
        0x1A82,
        "StartTimeNextOutput",
        Some(2),
        &[EntrySpec::number(0x1D09, 0x98, "StartTimeNextOutput", DataType::UDINT, 32)],
    ),
];

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[LibraryType {
    controllers: &[Spec {
        name: "EL4732",
        title: "EL4732 2Ch. Ana. Output +/-10V, Oversample",
        group: "AnaOutFast",
        product: 0x127C_3052,
        revision: 0x0004_0000,
        chip: &ESC20_64,
        ebus_current_ma: 180,
        pdi_control: 0x06,
        sync_impulse: 0x10,
        pdi_configuration_2: 0x0001,
        sync_managers: &[samples(0x1000), samples(0x1400), SyncManagerSpec::registers(0x0998)],
        pdos: PDOS,
        application: ApplicationSpec::Oversampling { channels: 2 },
        op_modes: &[
            mode("DcSync", 1),
            mode("DcSync2", 2),
            mode("DcSync4", 4),
            mode("DcSync5", 5),
            mode("DcSync8", 8),
            mode("DcSync10", 10),
            mode("DcSync20", 20),
            mode("DcSync50", 50),
            mode("DcSync100", 100),
        ],
        ..TERMINAL
    }],
    inner_links: &[],
}];
