//! Junctions: devices that branch a line, and no more.
//!
//! Ports are in the order A, B, C, D. In an EK1122 C is the next terminal, D X1 and B X2, so that
//! what hangs on X1 comes first; in an EK1121, EK1521 or EK1561 C is the next terminal and D the
//! cable; in an EP1122 and a CU112x A is IN and frames take D, B, C in this order. A CU1128 is three
//! controllers in one housing, joined by E-bus, with eight sockets.

use linesman_proto::port::Port;

use super::chip::{ET1100, ET1100_FAST};
use super::coupler::COUPLER;
use super::spec::Spec;
use super::{InnerLink, LibraryType};
use crate::hardware::PortKind::{Absent, Ebus, Mii};

const JUNCTION: Spec = Spec { group: "Infrastructure", ..COUPLER };
/// On the E-bus, with one cable.
const ONE_CABLE: Spec = Spec { ports: [Ebus, Absent, Ebus, Mii], ..JUNCTION };
/// On the E-bus, with two cables.
const TWO_CABLES: Spec = Spec { ports: [Ebus, Mii, Ebus, Mii], ebus_current_ma: 220, ..JUNCTION };

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EK1121-0010",
        title: "EK1121-0010 1 port EtherCAT junction",
        product: 0x0461_2C52,
        revision: 0x0010_000A,
        ebus_current_ma: 170,
        ..ONE_CABLE
    }]),
    single(&[Spec {
        name: "EK1122",
        title: "EK1122 2 port EtherCAT junction",
        product: 0x0462_2C52,
        revision: 0x0012_0000,
        ..TWO_CABLES
    }]),
    single(&[Spec {
        name: "EK1122-0080",
        title: "EK1122-0080 2 port EtherCAT junction (Fast Hot Connect)",
        product: 0x0462_2C52,
        revision: 0x0012_0050,
        chip: &ET1100_FAST,
        ..TWO_CABLES
    }]),
    single(&[Spec {
        name: "EK1521",
        title: "EK1521 1 port EtherCAT junction (Multi Mode)",
        product: 0x05F1_2C52,
        revision: 0x0015_0000,
        ebus_current_ma: 350,
        ..ONE_CABLE
    }]),
    single(&[Spec {
        name: "EK1561",
        title: "EK1561 1 port EtherCAT junction (POF)",
        product: 0x0619_2C52,
        revision: 0x0012_0000,
        ebus_current_ma: 200,
        ..ONE_CABLE
    }]),
    single(&[Spec {
        name: "EP1122-0001",
        title: "EP1122-0001 2 port EtherCAT junction",
        product: 0x0462_4052,
        revision: 0x0012_0001,
        chip: &ET1100,
        ports: [Mii, Mii, Mii, Mii],
        // Enhanced link detection at all ports, no clock units.
        esc_configuration: 0x03,
        ..JUNCTION
    }]),
    // The revisions of CU1123 and CU1124 are not known here; these are plausible ones.
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
    // What of a port multiplier is a SubDevice: the first one of each network behind it. Its clock is the same in all of
    // them. Its process data are left out.
    single(&[Spec {
        name: "CU2508",
        title: "CU2508 real-time Ethernet port multiplier",
        product: 0x09CC_5432,
        revision: 0x0011_0000,
        ports: [Mii, Mii, Absent, Absent],
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
