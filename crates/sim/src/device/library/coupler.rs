//! Couplers and extensions: from a cable to terminals and back, some with a coding switch or with
//! channels of their own.
//!
//! Ports are in the order A, B, C, D: A is X1 IN, B the terminals, C X2 OUT.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::DataType;
use linesman_proto::register::SmControl;
use linesman_proto::sii::{CoeDetails, Protocols};

use super::chip::{ET1100, ET1100_FAST, ET1200};
use super::digital::{INPUT_BYTE, OUTPUT_BYTE};
use super::smart::{mailbox_in, mailbox_out};
use super::spec::{
    ApplicationSpec, BECKHOFF, EntrySpec, Function, NO_COE, PdoSpec, ProcessorSpec, Spec,
    SyncManagerSpec, Use,
};
use super::{LibraryType, digital, smart};
use crate::device::processor::ResponseTimes;
use crate::hardware::PortKind::{Absent, Ebus, Mii};

/// SII byte 1 of couplers: device emulation, SYNC and latch unit on, and with them the time loop.
const EMULATION_WITH_CLOCK: u8 = 0x0D;
/// The same without clock units.
const EMULATION: u8 = 0x01;

/// A coupler for nothing but terminals.
pub(super) const COUPLER: Spec = Spec {
    name: "",
    title: "",
    group: "SystemBk",
    vendor: BECKHOFF,
    product: 0,
    revision: 0,
    chip: &ET1100,
    ports: [Mii, Ebus, Mii, Absent],
    ebus_current_ma: 0,
    pdi_control: 0,
    esc_configuration: EMULATION_WITH_CLOCK,
    sync_impulse: 0,
    pdi_configuration_2: 0,
    sync_managers: &[],
    pdos: &[],
    protocols: 0,
    coe: NO_COE,
    application: ApplicationSpec::Plain,
    op_modes: &[],
};

/// Where the coding switch of an EK1101 can be read.
const CODING_SWITCH: RegisterAddress = RegisterAddress(0x1000);

const WITH_CODING_SWITCH: Spec = Spec {
    ebus_current_ma: -2_000,
    pdi_control: 0x04,
    pdi_configuration_2: 0x00C0,
    sync_managers: &[SyncManagerSpec {
        start: CODING_SWITCH.0,
        length: 2,
        control: SmControl::INPUTS_WITHOUT_EVENT,
        enable: 0x01,
        kind: Use::Inputs,
    }],
    pdos: &[PdoSpec::single(
        0x1A00,
        "ID",
        Some(0),
        &[EntrySpec::number(0x6000, 1, "ID", DataType::UINT, 16)],
    )],
    application: ApplicationSpec::CodingSwitch(CODING_SWITCH),
    ..COUPLER
};

/// A coupler that has digital channels itself.
const WITH_CHANNELS: Spec =
    Spec { ebus_current_ma: -1_000, pdi_control: 0x04, sync_impulse: 10, ..COUPLER };

const OUTPUTS_AT_0F01: SyncManagerSpec = SyncManagerSpec { start: 0x0F01, ..OUTPUT_BYTE };

/// The output of one channel of a coupler.
const fn channel_out(
    index: u16,
    name: &'static str,
    sync_manager: u8,
    entries: &'static [EntrySpec],
) -> PdoSpec {
    PdoSpec::single(index, name, Some(sync_manager), entries)
}

const fn bit(object: u16) -> EntrySpec {
    EntrySpec::bit(object, 1, "Output")
}

const fn byte(object: u16, subindex: u8) -> EntrySpec {
    EntrySpec::number(object, subindex, "Byte", DataType::USINT, 8)
}

const EIGHT_BYTES_OUT: &[EntrySpec] = &[
    byte(0x7000, 1),
    byte(0x7000, 2),
    byte(0x7000, 3),
    byte(0x7000, 4),
    byte(0x7000, 5),
    byte(0x7000, 6),
    byte(0x7000, 7),
    byte(0x7000, 8),
];
const EIGHT_BYTES_IN: &[EntrySpec] = &[
    byte(0x6000, 1),
    byte(0x6000, 2),
    byte(0x6000, 3),
    byte(0x6000, 4),
    byte(0x6000, 5),
    byte(0x6000, 6),
    byte(0x6000, 7),
    byte(0x6000, 8),
];

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EK1100",
        title: "EK1100 EtherCAT Coupler (2A E-Bus)",
        product: 0x044C_2C52,
        revision: 0x0012_0000,
        ebus_current_ma: -2_000,
        ..COUPLER
    }]),
    single(&[Spec {
        name: "EK1101",
        title: "EK1101 EtherCAT Coupler (2A E-Bus, ID switch)",
        product: 0x044D_2C52,
        revision: 0x0012_0000,
        ..WITH_CODING_SWITCH
    }]),
    single(&[Spec {
        name: "EK1101-0080",
        title: "EK1101-0080 EtherCAT Coupler (2A E-Bus, ID switch, Fast Hot Connect)",
        product: 0x044D_2C52,
        revision: 0x0012_0050,
        chip: &ET1100_FAST,
        ..WITH_CODING_SWITCH
    }]),
    single(&[Spec {
        name: "EK1501",
        title: "EK1501 EtherCAT Coupler (2A E-Bus, FX Multi Mode, ID switch)",
        product: 0x05DD_2C52,
        revision: 0x0013_0000,
        ..WITH_CODING_SWITCH
    }]),
    single(&[Spec {
        name: "EK1541",
        title: "EK1541 EtherCAT Coupler (2A E-Bus, POF, ID switch)",
        product: 0x0605_2C52,
        revision: 0x0012_0000,
        ..WITH_CODING_SWITCH
    }]),
    single(&[Spec {
        name: "EK1814",
        title: "EK1814 EtherCAT IO-Coupler (1A E-Bus, 4 Ch. Dig. In, 4 Ch. Dig. Out)",
        product: 0x0716_2C52,
        revision: 0x0013_0000,
        pdi_configuration_2: 0x0030,
        sync_managers: &[OUTPUTS_AT_0F01, INPUT_BYTE],
        pdos: &[
            PdoSpec { channels: 4, ..channel_out(0x1608, "Out Channel", 0, &[bit(0x7080)]) },
            PdoSpec { sync_manager: Some(1), ..digital::inputs(4) },
        ],
        ..WITH_CHANNELS
    }]),
    single(&[Spec {
        name: "EK1818",
        title: "EK1818 EtherCAT IO-Coupler (1A E-Bus, 8 Ch. Dig. In, 4 Ch. Dig. Out)",
        product: 0x071A_2C52,
        revision: 0x0012_0000,
        pdi_configuration_2: 0x0030,
        sync_managers: &[OUTPUTS_AT_0F01, INPUT_BYTE],
        pdos: &[
            PdoSpec { channels: 4, ..channel_out(0x1600, "Out Channel", 0, &[bit(0x7000)]) },
            PdoSpec { sync_manager: Some(1), ..digital::inputs(8) },
        ],
        ..WITH_CHANNELS
    }]),
    single(&[Spec {
        name: "EK1828",
        title: "EK1828 EtherCAT IO-Coupler (1A E-Bus, 4 Ch. Dig. In, 8 Ch. Dig. Out)",
        product: 0x0724_2C52,
        revision: 0x0012_0000,
        pdi_configuration_2: 0x003C,
        sync_managers: &[OUTPUT_BYTE, OUTPUTS_AT_0F01, INPUT_BYTE],
        pdos: &[
            // Outputs are the high half of one byte and the low half of the next.
            channel_out(0x1600, "Channel 5", 0, &[EntrySpec::padding(4), bit(0x7000)]),
            channel_out(0x1601, "Channel 6", 0, &[bit(0x7010)]),
            channel_out(0x1602, "Channel 7", 0, &[bit(0x7020)]),
            channel_out(0x1603, "Channel 8", 0, &[bit(0x7030)]),
            channel_out(0x1604, "Channel 9", 1, &[bit(0x7040)]),
            channel_out(0x1605, "Channel 10", 1, &[bit(0x7050)]),
            channel_out(0x1606, "Channel 11", 1, &[bit(0x7060)]),
            channel_out(0x1607, "Channel 12", 1, &[bit(0x7070), EntrySpec::padding(4)]),
            PdoSpec { sync_manager: Some(2), ..digital::inputs(3) },
            PdoSpec::single(
                0x1A03,
                "Channel 4",
                Some(2),
                &[EntrySpec::bit(0x6030, 1, "Input"), EntrySpec::padding(4)],
            ),
        ],
        ..WITH_CHANNELS
    }]),
    // Identity, mailbox, SyncManagers and currents as a real one tells them; what its eight bytes of
    // process data are made of is not known here, so they are plain bytes.
    single(&[Spec {
        name: "EK1914",
        title: "EK1914 EtherCAT Coupler with standard and fail-safe channels",
        product: 0x077A_2C52,
        revision: 0x0012_0000,
        ebus_current_ma: -500,
        pdi_control: smart::PROCESSOR,
        esc_configuration: smart::CLOCK_UNITS,
        sync_managers: &[
            mailbox_out(256),
            mailbox_in(0x1100, 256),
            SyncManagerSpec {
                start: 0x1200,
                control: SmControl::OUTPUTS_WITHOUT_WATCHDOG,
                ..smart::outputs(8)
            },
            SyncManagerSpec { start: 0x1900, ..smart::inputs(8) },
        ],
        pdos: &[
            PdoSpec::single(0x1600, "Outputs", Some(2), EIGHT_BYTES_OUT),
            PdoSpec::single(0x1A00, "Inputs", Some(3), EIGHT_BYTES_IN),
        ],
        protocols: Protocols::COE | Protocols::FOE,
        coe: CoeDetails(0x03),
        application: ApplicationSpec::Processor(&ProcessorSpec {
            function: Function::None,
            hardware_version: "",
            software_version: "",
            settings: &[],
            variables: &[],
            times: ResponseTimes::TERMINAL,
        }),
        ..COUPLER
    }]),
    single(&[Spec {
        name: "EK1110",
        title: "EK1110 EtherCAT extension",
        product: 0x0456_2C52,
        revision: 0x0011_0000,
        chip: &ET1200,
        ports: [Ebus, Mii, Absent, Absent],
        ebus_current_ma: 130,
        esc_configuration: EMULATION,
        ..COUPLER
    }]),
];
