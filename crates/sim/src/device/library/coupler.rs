//! Couplers, extensions, junctions: devices that only lead on, some with a coding switch.
//!
//! Ports are in the order A, B, C, D. In an EK110x A is X1 IN, B the terminals, C X2 OUT; in an
//! EK1122 C is the next terminal, D X1 and B X2, so that what hangs on X1 comes first.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::DataType;
use linesman_proto::port::Port;
use linesman_proto::register::SmControl;

use super::chip::{ET1100, ET1200};
use super::spec::{Behind, EntrySpec, NO_COE, PdoSpec, Spec, SyncManagerSpec, Use};
use super::{InnerLink, LibraryType};
use crate::hardware::PortKind::{Absent, Ebus, Mii};

/// SII byte 1 of couplers: device emulation, SYNC and latch unit on, and with them the time loop.
const EMULATION_WITH_CLOCK: u8 = 0x0D;
/// The same without clock units.
const EMULATION: u8 = 0x01;

const COUPLER: Spec = Spec {
    name: "",
    title: "",
    group: "SystemBk",
    product: 0,
    revision: 0,
    chip: &ET1100,
    ports: [Mii, Ebus, Mii, Absent],
    ebus_current_ma: 0,
    pdi_control: 0,
    esc_configuration: EMULATION_WITH_CLOCK,
    pdi_configuration_2: 0,
    sync_managers: &[],
    pdos: &[],
    coe: NO_COE,
    behind: Behind::Plain,
    op_modes: &[],
};

const JUNCTION: Spec = Spec { group: "Infrastructure", ..COUPLER };

/// Where the coding switch of an EK1101 can be read.
const CODING_SWITCH: RegisterAddress = RegisterAddress(0x1000);

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
        ebus_current_ma: -2_000,
        pdi_control: 0x04,
        sync_managers: &[SyncManagerSpec {
            start: CODING_SWITCH.0,
            length: 2,
            control: SmControl::INPUTS_WITHOUT_EVENT,
            enable: 0x01,
            kind: Use::Inputs,
        }],
        pdos: &[PdoSpec {
            index: 0x1A00,
            step: 1,
            channels: 1,
            name: "ID",
            sync_manager: Some(0),
            entries: &[EntrySpec {
                index: 0x6000,
                subindex: 1,
                name: "ID",
                data_type: DataType::UINT,
                bits: 16,
            }],
        }],
        behind: Behind::CodingSwitch(CODING_SWITCH),
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
    single(&[Spec {
        name: "EK1122",
        title: "EK1122 2 port EtherCAT junction",
        product: 0x0462_2C52,
        revision: 0x0012_0000,
        ports: [Ebus, Mii, Ebus, Mii],
        ebus_current_ma: 220,
        ..JUNCTION
    }]),
    single(&[Spec {
        name: "EK1521",
        title: "EK1521 1 port EtherCAT junction (Multi Mode)",
        product: 0x05F1_2C52,
        revision: 0x0015_0000,
        ports: [Ebus, Absent, Ebus, Mii],
        ebus_current_ma: 350,
        ..JUNCTION
    }]),
    single(&[Spec {
        name: "CU1123",
        title: "CU1123 3 port EtherCAT junction",
        product: 0x0463_5432,
        revision: 0x0010_0000,
        ports: [Mii, Mii, Mii, Absent],
        ..JUNCTION
    }]),
    single(&[Spec {
        name: "CU1124",
        title: "CU1124 4 port EtherCAT junction",
        product: 0x0464_5432,
        revision: 0x0010_0000,
        ports: [Mii, Mii, Mii, Mii],
        ..JUNCTION
    }]),
    LibraryType {
        controllers: &[
            Spec {
                name: "CU1128",
                title: "CU1128 8 port EtherCAT junction",
                product: 0x0468_5432,
                revision: 0x0001_0000,
                ports: [Mii, Mii, Ebus, Mii],
                ..JUNCTION
            },
            Spec {
                name: "CU1128-B",
                title: "CU1128 8 port EtherCAT junction, second controller",
                product: 0x0468_5432,
                revision: 0x0001_0001,
                ports: [Ebus, Mii, Ebus, Mii],
                ..JUNCTION
            },
            Spec {
                name: "CU1128-C",
                title: "CU1128 8 port EtherCAT junction, third controller",
                product: 0x0468_5432,
                revision: 0x0001_0002,
                ports: [Ebus, Mii, Mii, Mii],
                ..JUNCTION
            },
        ],
        inner_links: &[
            InnerLink { from: (0, Port::C), to: (1, Port::A) },
            InnerLink { from: (1, Port::C), to: (2, Port::A) },
        ],
    },
];
