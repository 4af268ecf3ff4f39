//! Terminals without a controller: no frame knows of them, but a cabinet is not complete without
//! them, and some of them feed the E-bus.

/// A terminal without a controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Passive {
    /// Order designation, such as "EL9011".
    pub name: &'static str,
    /// Its name in full.
    pub title: &'static str,
    /// Current that it supplies to the E-bus behind it, in mA; 0 for those that leave it alone.
    pub supplies_ma: u16,
    /// Whether nothing can be put behind it.
    pub ends_bus: bool,
}

const PASSIVE: &[Passive] = &[
    Passive { name: "EL9011", title: "EL9011 End terminal", supplies_ma: 0, ends_bus: true },
    Passive {
        name: "EL9100",
        title: "EL9100 Power supply terminal 24V",
        supplies_ma: 0,
        ends_bus: false,
    },
    Passive {
        name: "EL9400",
        title: "EL9400 E-bus power supply terminal",
        supplies_ma: 2_000,
        ends_bus: false,
    },
];

/// The one with this name, in any case.
#[must_use]
pub fn passive(type_name: &str) -> Option<&'static Passive> {
    passives().find(|known| known.name.eq_ignore_ascii_case(type_name))
}

/// All of them.
pub fn passives() -> impl Iterator<Item = &'static Passive> {
    PASSIVE.iter()
}
