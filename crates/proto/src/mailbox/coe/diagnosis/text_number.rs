//! Numbers of texts of diagnosis messages, as one manufacturer counts them.
//!
//! The number belongs to a text of the device description, and means something else with another
//! manufacturer. Reference: Beckhoff, documentation of terminals with diagnosis messages, general text
//! IDs: first digit the kind, second digit the place, last two digits a number.

/// A text number and its meaning to devices of Beckhoff.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TextNumber {
    /// The number.
    pub number: u16,
    /// Its text in short.
    pub text: &'static str,
}

const fn text(number: u16, text: &'static str) -> TextNumber {
    TextNumber { number, text }
}

/// The general texts of drives, encoders and terminals, in order of their numbers.
pub const GENERAL: &[TextNumber] = &[
    text(0x0001, "no error"),
    text(0x0002, "communication established"),
    text(0x0003, "initialisation, with parameters that depend on the device"),
    text(0x1000, "information, with parameters that depend on the device"),
    text(0x1100, "detection of the mode of operation ended"),
    text(0x1135, "cycle time is well"),
    text(0x1201, "communication to the field side is back"),
    text(0x1300, "position set"),
    text(0x1400, "drive is calibrated"),
    text(0x4000, "warning, with parameters that depend on the device"),
    text(0x4101, "terminal is too warm"),
    text(0x4300, "sub-increments switched off"),
    text(0x4301, "encoder warning"),
    text(0x4400, "drive is not calibrated"),
    text(0x4401, "kind of start is not supported"),
    text(0x4402, "command rejected"),
    text(0x4411, "DC link voltage too low (warning)"),
    text(0x4413, "I2t of the amplifier: overload (warning)"),
    text(0x8105, "process data watchdog: outputs stayed away"),
    text(0x8406, "DC link voltage too low"),
];

/// The meaning of a number to devices of Beckhoff, if it is one of the general ones.
#[must_use]
pub fn general(number: u16) -> Option<&'static TextNumber> {
    GENERAL.binary_search_by_key(&number, |text| text.number).ok().map(|index| &GENERAL[index])
}

/// The kind that the first digit of such a number tells: `information`, `warning`, `error`.
#[must_use]
pub const fn kind(number: u16) -> Option<&'static str> {
    match number >> 12 {
        0 => Some("system"),
        1 => Some("information"),
        4 => Some("warning"),
        8 => Some("error"),
        _ => None,
    }
}

/// The place that the second digit of such a number tells.
#[must_use]
pub const fn place(number: u16) -> Option<&'static str> {
    match number >> 8 & 0x0F {
        0 => Some("system"),
        1 => Some("general"),
        2 => Some("communication"),
        3 => Some("encoder"),
        4 => Some("drive"),
        5 => Some("inputs"),
        6 => Some("inputs and outputs, general"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_in_order_and_tell_kind_and_place() {
        assert!(GENERAL.is_sorted_by(|a, b| a.number < b.number));
        assert_eq!(general(0x8406).unwrap().text, "DC link voltage too low");
        assert_eq!((kind(0x4413), place(0x4413)), (Some("warning"), Some("drive")));
        assert_eq!((kind(0x9000), place(0x0F00)), (None, None));
        assert_eq!(general(0x4414), None);
    }
}
