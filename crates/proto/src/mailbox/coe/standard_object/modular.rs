//! Objects of modular devices: which modules are configured, which are there.
//!
//! Reference: ETG.5001, modular device profile.

use super::{Entry, StandardObject, entries, entry, object};

const MDP: &str = "ETG.5001.1, modular device profile";

const IDENTS: &[Entry] = &[
    entry(0, "number of modules", "How many slots the list has."),
    entries(1, 255, "ident of a slot", "Subindex 1 is the first slot; 0 is an empty one."),
];

objects! {
    MODULAR;
    0xF000 "Modular device profile", "RECORD", MDP;
        "How the slots of the device are numbered."
        ; entries &[entry(1, "index distance", "How far the objects of two slots are apart; 0x10."),
            entry(2, "maximum modules", "How many slots there can be."),
            entry(3, "general configuration", "Which entries the slots have."),
            entry(4, "general information", "Which information the slots give.")];
    0xF002 "Detect modules command", "RECORD", MDP;
        "Lets the device look anew which modules are plugged."
        ; entries &[entry(1, "command", "Write the command."), entry(2, "status", "How far it is."),
            entry(3, "response", "Its answer.")];
    0xF010 "Module profiles", "ARRAY", MDP;
        "The profile of each slot; its low word is that of the device type (0x1000)."; entries IDENTS;
    0xF020..=0xF02F "Configured addresses", "ARRAY", MDP;
        "Addresses of the modules, or of the SubDevices of a network, as configured."; entries IDENTS;
    0xF030 "Configured module idents", "ARRAY", MDP;
        "Which module is meant to be in each slot; the MainDevice writes it at start-up. It must be what \
         0xF050 detects, else the device refuses SAFEOP with 0x0070."
        => "Compare it with 0xF050, subindex by subindex: the first difference is the slot to look at."
        ; entries IDENTS;
    0xF040..=0xF04F "Detected addresses", "ARRAY", MDP;
        "Addresses of the modules, or of the SubDevices of a network, that were found."; entries IDENTS;
    0xF050 "Detected module idents", "ARRAY", MDP;
        "Which module is in each slot, as the device finds it."
        => "Compare it with 0xF030, subindex by subindex: the first difference is the slot to look at."
        ; entries IDENTS;
    0xF980 "Safety address", "ARRAY", MDP;
        "The address by which safety over EtherCAT (FSoE) calls the device; mostly set by switches."
        ; entries &[entries(1, 255, "FSoE address", "The address.")];
}
