//! Profile for Wireshark: colouring rules and filter buttons.
//!
//! Formats: the files `colorfilters` and `dfilter_buttons` of a profile directory, Wireshark User's Guide, appendix
//! "Files and Folders".

use std::fmt::Write as _;

/// A display filter with a name and a colour.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProfileRule {
    /// Report of the network.
    pub name: &'static str,
    /// The filter.
    pub filter: &'static str,
    /// Label of the button; empty for none.
    pub button: &'static str,
    /// Background: red, green, blue, 8 bits each.
    pub background: [u8; 3],
    /// Text.
    pub text: [u8; 3],
}

const BLACK: [u8; 3] = [0, 0, 0];
const WHITE: [u8; 3] = [255, 255, 255];
const RED: [u8; 3] = [176, 32, 32];
const ORANGE: [u8; 3] = [255, 196, 128];
const YELLOW: [u8; 3] = [255, 244, 170];
const BLUE: [u8; 3] = [208, 224, 255];
const GREEN: [u8; 3] = [218, 245, 214];
const GREY: [u8; 3] = [236, 236, 236];

/// The rules; the first that a frame meets colours it.
pub const RULES: [ProfileRule; 13] = [
    rule("Damaged at a probe", "esl.crcerror == 1 || esl.alignerror == 1", "Damaged", RED, WHITE),
    rule("SDO transfer aborted", "ecat_mailbox.coe.abortcode", "Abort", RED, WHITE),
    rule("Emergency", "ecat_mailbox.coe.type == 1", "Emergency", RED, WHITE),
    rule(
        "Came back, and nobody has processed a datagram",
        "ecat.cnt == 0 && eth.src.lg == 1",
        "Counter 0",
        ORANGE,
        BLACK,
    ),
    rule("State request or state", "ecat.ado in {0x0120..0x0135}", "States", YELLOW, BLACK),
    rule("Error counters", "ecat.ado in {0x0300..0x0313}", "Error counters", YELLOW, BLACK),
    rule("EEPROM", "ecat.ado in {0x0500..0x050f}", "EEPROM", YELLOW, BLACK),
    rule("CoE", "ecat_mailbox.coe", "CoE", BLUE, BLACK),
    rule("FoE", "ecat_mailbox.foe", "FoE", BLUE, BLACK),
    rule("SoE", "ecat_mailbox.soe", "SoE", BLUE, BLACK),
    rule("EoE", "ecat_mailbox.eoe", "EoE", BLUE, BLACK),
    rule("Process data", "ecat.cmd in {0x0a..0x0c}", "Cyclic", GREEN, BLACK),
    rule("Other EtherCAT", "ecat", "Not cyclic", GREY, BLACK),
];

const fn rule(
    name: &'static str,
    filter: &'static str,
    button: &'static str,
    background: [u8; 3],
    text: [u8; 3],
) -> ProfileRule {
    ProfileRule { name, filter, button, background, text }
}

/// The filter of the last button: what is left beside process data.
const NOT_CYCLIC: &str = "ecat && !(ecat.cmd in {0x0a..0x0c})";

/// Text of the file `colorfilters`.
#[must_use]
pub fn colour_rules() -> String {
    // 8 bits become 16.
    let wide = |colour: [u8; 3]| {
        let parts = colour.map(|part| (u32::from(part) * 257).to_string());
        format!("[{}]", parts.join(","))
    };
    let mut text = String::from("# EtherCAT, written by Linesman\n");
    for rule in &RULES {
        let ProfileRule { name, filter, background, text: letters, .. } = rule;
        let _ = writeln!(text, "@{name}@{filter}@{}{}", wide(*background), wide(*letters));
    }
    text
}

/// Filters of the buttons, by their labels.
pub fn buttons() -> impl Iterator<Item = (&'static str, &'static str)> {
    RULES.iter().map(|rule| match rule.filter {
        "ecat" => (rule.button, NOT_CYCLIC),
        filter => (rule.button, filter),
    })
}

/// Text of the file `dfilter_buttons`.
#[must_use]
pub fn filter_buttons() -> String {
    let mut text = String::from("# EtherCAT, written by Linesman\n");
    for (label, filter) in buttons() {
        let _ = writeln!(text, "\"TRUE\",\"{label}\",\"{filter}\",\"\"");
    }
    text
}
