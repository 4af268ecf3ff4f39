//! Objects of the communication: identity, stored settings, diagnosis, mapping and assignment of
//! process data.

use super::{Entry, StandardObject, entries, entry, object};
use crate::register::Field;
use crate::register::entry::flag;

const CIA: &str = "CiA 301; ETG.1000.6, object dictionary";
const ETG: &str = "ETG.1000.6, object dictionary";
const ETG_1020: &str = "ETG.1020";

const ERROR_REGISTER: &[Field] = &[
    flag(0, "generic", "Some error is there."),
    flag(1, "current", "Current: short circuit, overload."),
    flag(2, "voltage", "Voltage: supply, DC link."),
    flag(3, "temperature", "Temperature of device, motor or cabinet."),
    flag(4, "communication", "Communication."),
    flag(5, "device profile", "What the profile of the device defines."),
    flag(7, "manufacturer", "What the manufacturer defines."),
];

const SAVE: &[Entry] = &[
    entry(1, "all", "Write \"save\" (0x65766173) to store all settings."),
    entries(2, 127, "groups", "The same for a group of settings."),
];
const LOAD: &[Entry] = &[
    entry(
        1,
        "all",
        "Write \"load\" (0x64616F6C) to take back the defaults; they act after a restart.",
    ),
    entries(2, 127, "groups", "The same for a group of settings."),
];

const IDENTITY: &[Entry] = &[
    entry(1, "vendor", "Number of the manufacturer; 0x00000002 is Beckhoff."),
    entry(2, "product code", "Type of the device, as the manufacturer numbers it."),
    entry(3, "revision", "Revision; its high word counts up, its low word is often a variant."),
    entry(4, "serial number", "Serial number; 0 where there is none."),
];

const ERROR_SETTINGS: &[Entry] = &[
    entry(1, "local error reaction", "What the device does on an error of its own."),
    entry(
        2,
        "sync error counter limit",
        "How many SM events may be missed in step with SYNC before the device leaves OP with 0x001A; \
         often 4.",
    ),
];

const HISTORY: &[Entry] = &[
    entry(1, "maximum messages", "How many messages fit."),
    entry(2, "newest message", "Subindex of the newest message, 6 or higher."),
    entry(
        3,
        "newest acknowledged message",
        "Write a subindex to acknowledge up to there; 0 forgets all messages.",
    ),
    entry(4, "new messages available", "Whether there are messages that nobody has acknowledged."),
    entry(
        5,
        "flags",
        "Bit 0 emergencies for new messages, 1 no information, 2 no warnings, 3 no errors, 4 keep what \
         is unread instead of overwriting, 5 messages were lost.",
    ),
    entries(
        6,
        255,
        "message",
        "Code (4 bytes), flags (2), text number (2), time in ns (8), parameters. Paste its bytes to \
         `linesman explain`.",
    ),
];

const EXTERNAL_SYNC: &[Entry] = &[
    entry(1, "sync mode", "0 none, 1 the secondary side leads, 2 the primary side leads."),
    entry(0x0E, "control value toggle", "Changes with each new control value."),
    entry(0x0F, "time stamp toggle", "Changes with each new pair of time stamps."),
    entry(0x10, "external device not connected", "The other side does not answer."),
    entry(0x11, "internal time stamp", "Time of this network, ns."),
    entry(0x12, "external time stamp", "Time of the other network, ns."),
    entry(0x13, "control value", "By how much the clock is to be led, ns."),
];

const MAPPING: &[Entry] = &[
    entry(
        0,
        "number of entries",
        "Set it to 0 before the entries are changed, then to their number.",
    ),
    entries(
        1,
        254,
        "mapped entry",
        "Index in the high word, then subindex, then length in bits: 0x60410010 is 0x6041:00 with 16 \
         bits. Index 0 is a gap.",
    ),
];

const SM_TYPES: &[Entry] = &[entries(
    1,
    32,
    "type of SyncManager 0 and on",
    "0 unused, 1 mailbox out (from the MainDevice), 2 mailbox in, 3 outputs, 4 inputs.",
)];

const ASSIGNMENT: &[Entry] = &[
    entry(0, "number of PDOs", "Set it to 0 before the list is changed, then to its length."),
    entries(1, 254, "assigned PDO", "Index of the mapping object of a PDO."),
];

objects! {
    COMMUNICATION;
    0x1000 "Device type", "UDINT", CIA;
        "Low word: the profile, 402 (0x0192) of drives, 5001 (0x1389) of modular devices, 0 of none. \
         High word: what the profile defines.";
    0x1001 "Error register", "USINT", CIA;
        "Which sorts of errors are there now; the third byte of an emergency is the same."
        => "Read the emergencies and the diagnosis history (0x10F3): they say more."
        ; bits ERROR_REGISTER;
    0x1008 "Device name", "STRING", CIA; "Name of the device.";
    0x1009 "Hardware version", "STRING", CIA; "Version of the hardware.";
    0x100A "Software version", "STRING", CIA;
        "Version of the firmware: have it at hand when you ask the manufacturer.";
    0x1010 "Store parameters", "ARRAY", CIA;
        "Stores settings in the device, so that they survive power-off."; entries SAVE;
    0x1011 "Restore default parameters", "ARRAY", CIA;
        "Takes back the settings of the manufacturer."; entries LOAD;
    0x1018 "Identity", "RECORD", CIA;
        "What the device is. It must be what the configuration expects."
        => "Compare it with the project: `linesman scan WHERE --against machine.toml`."
        ; entries IDENTITY;
    0x10E0 "Device identification reload", "RECORD", ETG_1020;
        "Reads switches and identification again."
        ; entries &[entry(1, "configured station alias", "Loads the alias into register 0x0012."),
            entry(2, "write alias", "Stores the alias."), entry(3, "reload ID", "Reads the ID again.")];
    0x10F0 "Backup parameter handling", "RECORD", ETG_1020;
        "Tells whether stored settings have changed."
        => "An abort 0x06010002 at 0x10F0:01 means that this firmware has it read-only: take it out of \
            the start-up list."
        ; entries &[entry(1, "checksum", "Changes when a stored setting changes.")];
    0x10F1 "Error settings", "RECORD", ETG_1020;
        "How the device answers to errors of the communication."
        => "Raise the limit only for a trial: frames that come at the wrong time remain the reason."
        ; entries ERROR_SETTINGS;
    0x10F3 "Diagnosis history", "RECORD", ETG_1020;
        "Messages that the device has noted of itself, in a ring."
        => "`linesman history WHERE DEVICE` reads it, with the texts of the device description."
        ; entries HISTORY;
    0x10F4 "External synchronisation status", "RECORD", ETG_1020;
        "How a bridge between two networks keeps both times together."; entries EXTERNAL_SYNC;
    0x10F5 "External synchronisation settings", "RECORD", ETG_1020;
        "Which side of a bridge between two networks leads."
        ; entries &[entry(1, "sync master", "0 the primary side, 1 the secondary side.")];
    0x10F8 "Time stamp", "ULINT", ETG_1020;
        "Time of the device in ns: its distributed clock, or a local one.";
    0x1600..=0x17FF "RxPDO mapping", "RECORD", ETG;
        "Which objects an RxPDO (outputs) holds, and in which order."
        => "Write it in PREOP only. Code 0x0025 is about it; 0x001D when the lengths do not add up."
        ; entries MAPPING;
    0x1A00..=0x1BFF "TxPDO mapping", "RECORD", ETG;
        "Which objects a TxPDO (inputs) holds, and in which order."
        => "Write it in PREOP only. Code 0x0024 is about it; 0x001E when the lengths do not add up."
        ; entries MAPPING;
    0x1C00 "SyncManager types", "ARRAY", ETG;
        "What each SyncManager is for. Code 0x001C is about it."; entries SM_TYPES;
    0x1C10 "PDO assignment of SyncManager 0", "ARRAY", ETG;
        "No PDOs: SyncManager 0 is the mailbox."; entries ASSIGNMENT;
    0x1C11 "PDO assignment of SyncManager 1", "ARRAY", ETG;
        "No PDOs: SyncManager 1 is the mailbox."; entries ASSIGNMENT;
    0x1C12 "RxPDO assignment (SyncManager 2)", "ARRAY", ETG;
        "Which RxPDOs the outputs consist of. Their lengths together must be that of SyncManager 2, \
         else the device refuses SAFEOP with 0x001D."
        => "Write it in PREOP only, and subindex 0 first with 0: abort 0x08000022 says that the state is \
            wrong, 0x06010003 that subindex 0 is not 0."
        ; entries ASSIGNMENT;
    0x1C13 "TxPDO assignment (SyncManager 3)", "ARRAY", ETG;
        "Which TxPDOs the inputs consist of. Their lengths together must be that of SyncManager 3, \
         else the device refuses SAFEOP with 0x001E."
        => "Write it in PREOP only, and subindex 0 first with 0: abort 0x08000022 says that the state is \
            wrong, 0x06010003 that subindex 0 is not 0."
        ; entries ASSIGNMENT;
    0x1C14..=0x1C2F "PDO assignment of a further SyncManager", "ARRAY", ETG;
        "Which PDOs a SyncManager from 4 on carries."; entries ASSIGNMENT;
}
