//! Terminals that feed others: the E-bus anew, or the power contacts, and tell whether they do.

use super::LibraryType;
use super::digital::{INPUT_BYTE, TERMINAL};
use super::spec::{EntrySpec, PdoSpec, Spec, SyncManagerSpec};

/// The records of these terminals do not ask for the SyncManager; a MainDevice switches it on because
/// PDOs map to it.
const FEED: Spec = Spec {
    group: "System",
    sync_managers: &[SyncManagerSpec { enable: 0, ..INPUT_BYTE }],
    ..TERMINAL
};

const fn status(index: u16, name: &'static str, entries: &'static [EntrySpec]) -> PdoSpec {
    PdoSpec::single(index, name, Some(0), entries)
}

const UNDERVOLTAGES: &[PdoSpec] = &[
    status(0x1A00, "Status Us", &[EntrySpec::bit(0x6000, 1, "Undervoltage")]),
    status(0x1A01, "Status Up", &[EntrySpec::bit(0x6010, 1, "Undervoltage")]),
];

const ISOLATED: &[PdoSpec] = &[
    status(0x1A00, "Status Us", &[EntrySpec::bit(0x6000, 1, "Power OK")]),
    status(0x1A01, "Status Uo", &[EntrySpec::bit(0x6010, 1, "Power OK")]),
];

const REGULATED: &[PdoSpec] = &[status(
    0x1A00,
    "Status Uo",
    &[EntrySpec::bit(0x6000, 1, "Power OK"), EntrySpec::bit(0x6000, 2, "Overload")],
)];

const fn single(spec: &'static [Spec; 1]) -> LibraryType {
    LibraryType { controllers: spec, inner_links: &[] }
}

/// All types of this family.
pub(super) const TYPES: &[LibraryType] = &[
    single(&[Spec {
        name: "EL9110",
        title: "EL9110 Power Supplier with LED (24V, Diagnostics)",
        product: 0x2396_3052,
        revision: 0x0012_0000,
        pdos: &[status(0x1A00, "PowerOK", &[EntrySpec::bit(0x6000, 1, "Input")])],
        ..FEED
    }]),
    single(&[Spec {
        name: "EL9410",
        title: "EL9410 E-Bus Power Supplier (Diagnostics)",
        product: 0x24C2_3052,
        revision: 0x0011_0000,
        ebus_current_ma: -2_000,
        pdos: UNDERVOLTAGES,
        ..FEED
    }]),
    single(&[Spec {
        name: "EL9505",
        title: "EL9505 Power supply terminal 5V",
        product: 0x2521_3052,
        revision: 0x0011_0000,
        pdos: REGULATED,
        ..FEED
    }]),
    single(&[Spec {
        name: "EL9510",
        title: "EL9510 Power supply terminal 10V",
        product: 0x2526_3052,
        revision: 0x0011_0000,
        pdos: REGULATED,
        ..FEED
    }]),
    single(&[Spec {
        name: "EL9560",
        title: "EL9560 Power supply terminal 24V DC/DC (0.1A, isolated)",
        product: 0x2558_3052,
        revision: 0x0012_0000,
        pdos: ISOLATED,
        ..FEED
    }]),
];
