//! The AL status codes, one entry each, in order of their numbers.
//!
//! References: *ETG.1020* stands for its table of AL status codes as the public SubDevice stack
//! code (SSC 5.11) and several MainDevice stacks repeat it; *one table only* marks codes that a
//! single third-party table names, so their advice is general. Where training material of the
//! vendor of the reference product gives checks in an order, the actions keep that order.

use super::{AlStatusCode, Class, Origin, StatusCode};
use Class::{Configuration, Hardware, Software, Timing};

/// Declares the codes: a constant of [`AlStatusCode`] for each, and the table.
macro_rules! status_codes {
    ($($constant:ident $code:literal $name:literal, $class:ident, $occurs:literal, $reference:ident;
        $cause:literal $(=> $action:expr)+;)+) => {
        impl AlStatusCode {
            $(#[doc = concat!("`", stringify!($code), "`: ", $name, ".")]
            pub const $constant: Self = Self($code);)+
        }

        /// All codes that the specification names, in order of their numbers.
        pub const ALL: &[StatusCode] = &[$(StatusCode {
            code: AlStatusCode::$constant,
            name: $name,
            origin: Origin::Standard,
            class: $class,
            occurs: $occurs,
            cause: $cause,
            actions: &[$($action),+],
            reference: $reference,
        }),+];
    };
}

const ETG: &str = "ETG.1020, AL status codes";
const ONE_TABLE: &str = "ETG.1020, AL status codes (one table only)";

const ESI: &str = "Check that the device description (ESI) in use belongs to the connected device: \
     its product code and revision must be those that the device shows in object 0x1018.";
const DEFAULTS: &str = "Check whether settings of this SubDevice were changed by hand; if so, \
     delete it from the configuration and add it anew, which restores the defaults.";
const SLOTS: &str = "For a modular SubDevice compare the configured modules with the plugged ones, \
     slot by slot.";
const JITTER: &str = "Measure the MainDevice's jitter: more than 20 to 30 % of the cycle time \
     easily costs synchronization.";
const HARDWARE_FIRST: &str = "Look for hardware errors on the way to this SubDevice (lost links, \
     frame errors, lost frames): if there are any, they are the cause and this code follows.";
const CAPTURE: &str = "If that does not help, take a capture that contains the moment of the \
     change and look at what was sent shortly before.";
const MANUFACTURER: &str = "If these checks do not help, ask the manufacturer of the SubDevice, \
     with this code and a capture.";
const CYCLE_LIMITS: &str = "Read objects 0x1C32:05 and 0x1C33:05 (minimum cycle time) and lengthen \
     the cycle of the linked task if it is shorter.";
const CYCLE_LIST: &str = "Check in the SubDevice's manual whether it takes only a discrete set of \
     cycle times.";
const DIAGNOSIS_HISTORY: &str = "Read the SubDevice's diagnosis history (object 0x10F3) and its \
     emergency messages.";
const RETRY_FROM_INIT: &str = "Set the SubDevice to INIT and bring it up again.";
const STEP_BY_STEP: &str = "Request the states one by one: INIT, PREOP, SAFEOP, OP.";
const MAILBOX_LOG: &str = "Look at the mailbox messages of this protocol just before the error; \
     the error reply names the request that failed.";
const SYNC_OBJECTS: &str = "Read the counters in 0x1C32 (0x0B events missed, 0x0C cycle exceeded, \
     0x0D shift too short): they tell late frames from a cycle that is too short.";

/// The answer for codes from 0x8000 up.
pub(super) const VENDOR_SPECIFIC: StatusCode = StatusCode {
    code: AlStatusCode(0x8000),
    name: "vendor-specific code",
    origin: Origin::Vendor,
    class: Software,
    occurs: "as the manufacturer defines",
    cause: "The manufacturer of the SubDevice gave this number its meaning.",
    actions: &[
        "Look the number up in the SubDevice's manual.",
        DIAGNOSIS_HISTORY,
        "If the manual does not name it, ask the manufacturer, with the firmware version \
         (object 0x100A) at hand.",
    ],
    reference: "ETG.1020, AL status codes: 0x8000 to 0xFFFF",
};

/// The answer for codes that no table names.
pub(super) const UNKNOWN: StatusCode = StatusCode {
    code: AlStatusCode(0xFFFF),
    name: "unknown code",
    origin: Origin::Unknown,
    class: Software,
    occurs: "unknown",
    cause: "No table known here names this number: the firmware is newer than the table, or the \
            register was read while it held a device identification.",
    actions: &[
        "Check bit 5 of AL status: if it is set, 0x0134 holds the device's identification and no \
         code.",
        "Look the number up in the SubDevice's manual.",
        DIAGNOSIS_HISTORY,
        MANUFACTURER,
    ],
    reference: "ETG.1020, AL status codes: not listed",
};

status_codes! {
    NO_ERROR 0x0000 "no error", Software, "any state", ETG;
        "The SubDevice reports no error."
        => "Nothing is to be done for this code.";

    UNSPECIFIED_ERROR 0x0001 "unspecified error", Software, "any transition", ETG;
        "Something in the SubDevice failed that has no code of its own."
        => DIAGNOSIS_HISTORY
        => RETRY_FROM_INIT
        => MANUFACTURER;

    NO_MEMORY 0x0002 "no memory", Configuration, "any transition", ETG;
        "The SubDevice's memory does not hold what the configuration asks of it, mostly too many \
         or too long process data objects."
        => "Assign fewer or shorter PDOs to this SubDevice."
        => DEFAULTS
        => MANUFACTURER;

    INVALID_DEVICE_SETUP 0x0003 "invalid device setup", Configuration, "PREOP to SAFEOP", ONE_TABLE;
        "The modules behind a coupler, or the slots of a modular SubDevice, are not the configured \
         ones, or not in the configured order."
        => "Compare the configured modules with the plugged ones, slot by slot, order included."
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    INVALID_REVISION 0x0004 "invalid revision", Configuration, "PREOP to SAFEOP", ONE_TABLE;
        "The configuration was made for another revision of the device."
        => ESI
        => "Replace the SubDevice in the configuration by one of the revision it has, or fit a \
            device of the configured revision."
        => MANUFACTURER;

    RESERVED_0005 0x0005 "reserved", Software, "none", ETG;
        "The number is reserved; a SubDevice should not show it."
        => "Look the number up in the SubDevice's manual."
        => MANUFACTURER;

    SII_FIRMWARE_MISMATCH 0x0006 "SII does not match firmware", Software, "INIT to PREOP", ETG;
        "After a firmware update the SII still describes the old firmware."
        => "Take the SubDevice from BOOT to INIT once more, which lets some devices rewrite their \
            SII."
        => "Write the SII image that belongs to the new firmware, then switch the device off and \
            on."
        => MANUFACTURER;

    FIRMWARE_UPDATE_FAILED 0x0007 "firmware update not successful", Software, "BOOT to INIT", ETG;
        "The download did not succeed; the old firmware still runs."
        => "Repeat the download over FoE, and check that the file is meant for this device."
        => HARDWARE_FIRST
        => MANUFACTURER;

    LICENSE_ERROR 0x000E "license error", Configuration, "any transition", ONE_TABLE;
        "The SubDevice misses a license for the requested function."
        => "Check the license of the SubDevice with its manual."
        => MANUFACTURER;

    INVALID_REQUESTED_STATE_CHANGE 0x0011 "invalid requested state change", Software,
        "any step that does not exist", ETG;
        "The request skipped a state, as from INIT to SAFEOP or from PREOP to OP, or left BOOT to \
         anything but INIT."
        => STEP_BY_STEP
        => "Find out who asks: a person, a program, or a second MainDevice on the line."
        => "Check whether the SubDevice fell back on its own between two requests: then the code \
            that it showed first is the one to follow.";

    UNKNOWN_REQUESTED_STATE 0x0012 "unknown requested state", Software, "any state", ETG;
        "The value written to AL control names no state."
        => "Check what is written to 0x0120: only 1, 2, 3, 4 and 8 name states."
        => "Find out who writes: a second MainDevice, or a program with register access."
        => CAPTURE;

    BOOTSTRAP_NOT_SUPPORTED 0x0013 "bootstrap not supported", Configuration, "INIT to BOOT", ETG;
        "The SubDevice has no BOOT state."
        => "Update its firmware by the way its manual describes; many devices take FoE in PREOP."
        => ESI
        => MANUFACTURER;

    NO_VALID_FIRMWARE 0x0014 "no valid firmware", Software, "INIT to PREOP", ETG;
        "The SubDevice found no firmware that it may start, often after an interrupted update."
        => "Download the firmware again: take the SubDevice to BOOT and transfer it over FoE."
        => "Check that the file is meant for exactly this hardware."
        => MANUFACTURER;

    INVALID_MAILBOX_BOOT 0x0015 "invalid mailbox configuration in BOOT", Configuration,
        "INIT to BOOT", ETG;
        "SyncManagers 0 and 1 do not have the addresses and lengths that BOOT needs."
        => "Take address and length of the bootstrap mailbox from SII words 0x14 to 0x17; they \
            differ from those of PREOP in many devices."
        => ESI
        => MANUFACTURER;

    INVALID_MAILBOX_PREOP 0x0016 "invalid mailbox configuration in PREOP", Configuration,
        "INIT to PREOP, or in PREOP", ETG;
        "SyncManagers 0 and 1 do not have the address, length, direction or mode that the \
         SubDevice expects, or they overlap."
        => "Compare SyncManagers 0 and 1 (0x0800, 0x0808) with SII words 0x18 to 0x1B."
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    INVALID_SYNC_MANAGER 0x0017 "invalid sync manager configuration", Configuration,
        "PREOP to SAFEOP, SAFEOP to OP", ETG;
        "Number, address or length of a SyncManager does not fit the SubDevice."
        => "Add up the bits of the PDOs in objects 0x1C12 and 0x1C13 and compare the bytes with \
            the lengths of SyncManagers 2 and 3."
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    NO_VALID_INPUTS 0x0018 "no valid inputs available", Hardware, "OP or SAFEOP, back to SAFEOP",
        ETG;
        "The application in the SubDevice cannot provide inputs: a sensor or a part behind it is \
         not ready."
        => "Check what the SubDevice measures or is connected to: sensor, encoder, field supply."
        => DIAGNOSIS_HISTORY
        => MANUFACTURER;

    NO_VALID_OUTPUTS 0x0019 "no valid outputs", Timing, "OP, back to SAFEOP", ETG;
        "The SubDevice got no valid outputs in time."
        => "Check that the task which sends the outputs of this SubDevice runs, and that its \
            datagram is sent before OP is requested."
        => HARDWARE_FIRST
        => "Check whether SyncManager 2 was switched off by the SubDevice (0x0817 bit 0)."
        => MANUFACTURER;

    SYNCHRONIZATION_ERROR 0x001A "synchronization error", Timing,
        "OP, back to SAFEOP; SAFEOP to OP", ETG;
        "The application in the SubDevice cannot keep step with the communication cycle: frames \
         come at the wrong moment relative to its SYNC signal, or its counter of missed events \
         passed its limit (0x10F1:02)."
        => JITTER
        => SYNC_OBJECTS
        => "Check the SYNC shift: frames must have passed the SubDevice before its SYNC0."
        => HARDWARE_FIRST
        => CAPTURE;

    SYNC_MANAGER_WATCHDOG 0x001B "sync manager watchdog", Timing, "OP, back to SAFEOP", ETG;
        "No outputs arrived for longer than the watchdog time, 100 ms unless set otherwise."
        => "Check that the task which sends the outputs is running and not stopped by a breakpoint \
            or an overrun: frames leave only when the task triggers them."
        => JITTER
        => HARDWARE_FIRST
        => CAPTURE
        => "Only when all that is in order, lengthen the watchdog (0x0420).";

    INVALID_SYNC_MANAGER_TYPES 0x001C "invalid sync manager types", Configuration,
        "PREOP to SAFEOP", ETG;
        "The types of the SyncManagers differ from those in object 0x1C00."
        => "Compare the configured SyncManagers with object 0x1C00 of the device."
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    INVALID_OUTPUT_CONFIGURATION 0x001D "invalid output configuration", Configuration,
        "PREOP to SAFEOP", ETG;
        "The output process data do not fit: SyncManager 2 has another length than the assigned \
         RxPDOs, or the wrong direction or address."
        => "Compare the length of SyncManager 2 with the sum of the PDOs assigned in object \
            0x1C12, padding entries included."
        => ESI
        => DEFAULTS
        => SLOTS
        => MANUFACTURER;

    INVALID_INPUT_CONFIGURATION 0x001E "invalid input configuration", Configuration,
        "PREOP to SAFEOP", ETG;
        "The input process data do not fit: SyncManager 3 has another length than the assigned \
         TxPDOs, or the wrong direction or address."
        => "Compare the length of SyncManager 3 with the sum of the PDOs assigned in object \
            0x1C13, padding entries included."
        => ESI
        => DEFAULTS
        => SLOTS
        => MANUFACTURER;

    INVALID_WATCHDOG 0x001F "invalid watchdog configuration", Configuration,
        "PREOP to SAFEOP, or in PREOP", ETG;
        "Watchdog time (0x0420) and watchdog trigger of SyncManager 2 (control bit 6) contradict \
         each other."
        => "Restore the watchdog settings of the device description."
        => "If the watchdog is wanted off, clear the trigger bit and set the time to 0, both."
        => MANUFACTURER;

    NEEDS_COLD_START 0x0020 "needs cold start", Software, "any transition", ETG;
        "The SubDevice asks to be switched off and on."
        => "Switch the SubDevice off and on."
        => "If the code comes back, check what changed before it: firmware, SII, modules."
        => MANUFACTURER;

    NEEDS_INIT 0x0021 "needs INIT", Software, "PREOP, SAFEOP, OP", ETG;
        "The SubDevice wants to be taken to INIT before it goes on."
        => RETRY_FROM_INIT
        => MANUFACTURER;

    NEEDS_PREOP 0x0022 "needs PREOP", Software, "SAFEOP, OP", ETG;
        "The SubDevice wants to be taken to PREOP before it goes on, mostly to take new settings."
        => "Set the SubDevice to PREOP and bring it up again."
        => MANUFACTURER;

    NEEDS_SAFEOP 0x0023 "needs SAFEOP", Software, "OP", ETG;
        "The SubDevice wants to be taken to SAFEOP before it goes on."
        => "Set the SubDevice to SAFEOP, then to OP again."
        => MANUFACTURER;

    INVALID_INPUT_MAPPING 0x0024 "invalid input mapping", Configuration, "PREOP to SAFEOP", ETG;
        "An entry mapped into a TxPDO (objects 0x1A00 and up) does not exist or cannot be mapped."
        => "Compare the mapping objects 0x1A00 and up with the device description."
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    INVALID_OUTPUT_MAPPING 0x0025 "invalid output mapping", Configuration, "PREOP to SAFEOP", ETG;
        "An entry mapped into an RxPDO (objects 0x1600 and up) does not exist or cannot be mapped."
        => "Compare the mapping objects 0x1600 and up with the device description."
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    INCONSISTENT_SETTINGS 0x0026 "inconsistent settings", Configuration, "PREOP to SAFEOP", ETG;
        "Two settings contradict each other, such as a cycle time and a mode of operation."
        => "Look at the start-up list of this SubDevice for settings made by hand."
        => DEFAULTS
        => DIAGNOSIS_HISTORY
        => MANUFACTURER;

    FREE_RUN_NOT_SUPPORTED 0x0027 "free run not supported", Configuration, "PREOP to SAFEOP", ETG;
        "The SubDevice must be synchronized, but no synchronization is configured."
        => "Switch on distributed clocks, or synchronization by SyncManager events, in the \
            configuration of this SubDevice."
        => DEFAULTS
        => MANUFACTURER;

    SYNC_NOT_SUPPORTED 0x0028 "synchronization not supported", Configuration, "PREOP to SAFEOP",
        ETG;
        "The configured kind of synchronization is not one that the SubDevice offers."
        => "Choose free run or a mode that objects 0x1C32:04 and 0x1C33:04 list as supported."
        => DEFAULTS
        => MANUFACTURER;

    FREE_RUN_NEEDS_BUFFERS 0x0029 "free run needs three-buffer mode", Configuration,
        "PREOP to SAFEOP", ETG;
        "In free run the process data SyncManagers must be buffered, and one is a mailbox."
        => "Set the control byte of SyncManagers 2 and 3 to buffered mode (bits 1 and 0 are 0)."
        => DEFAULTS
        => MANUFACTURER;

    BACKGROUND_WATCHDOG 0x002A "background watchdog", Software, "SAFEOP or OP, back to PREOP", ETG;
        "The SubDevice's own processor did not get round to its background work: it is overloaded \
         or hangs."
        => "Lengthen the cycle, or assign fewer PDOs, and see whether the code stays away."
        => "Check the firmware version and update it."
        => MANUFACTURER;

    NO_VALID_INPUTS_AND_OUTPUTS 0x002B "no valid inputs and outputs", Timing, "OP, back to SAFEOP",
        ETG;
        "Neither inputs nor outputs are exchanged any more: the MainDevice or the application in \
         the SubDevice stands still."
        => "Check that the task which exchanges this SubDevice's data is running."
        => HARDWARE_FIRST
        => "Check what the SubDevice measures or is connected to: sensor, encoder, field supply."
        => CAPTURE;

    FATAL_SYNC_ERROR 0x002C "fatal sync error", Timing, "OP, back to SAFEOP", ETG;
        "The SubDevice no longer gets SYNC0 or SYNC1 from its EtherCAT controller."
        => "Check that the reference clock is still on the line and in step: a link lost or a \
            device gone between it and this SubDevice stops the clock."
        => "Read 0x0981 (activation) and 0x0984 (activation status): SYNC0 must be switched on and \
            not pending."
        => JITTER
        => HARDWARE_FIRST
        => CAPTURE;

    NO_SYNC_ERROR 0x002D "no sync error", Timing, "SAFEOP to OP", ETG;
        "The SubDevice saw no SYNC signal while it went to OP, mostly because the start time lay \
         in the past, or its clock had not settled."
        => "Check whether the DC settings of this SubDevice were changed by hand; if so, delete it \
            from the configuration and add it anew."
        => "Take a capture of the start-up and check that the start time in 0x0990 lies ahead of \
            the system time in 0x0910 when 0x0981 is written."
        => "Read 0x092C (system time difference): it must have become small before OP is requested."
        => JITTER
        => MANUFACTURER;

    CYCLE_TIME_TOO_SMALL 0x002E "cycle time too small", Timing, "SAFEOP to OP", ONE_TABLE;
        "The SubDevice cannot finish its work in this cycle time. Older tables call this number \
         invalid input FMMU configuration."
        => CYCLE_LIMITS
        => CYCLE_LIST
        => "With an old SubDevice check the input FMMU against its SyncManager 3 as well."
        => MANUFACTURER;

    INVALID_DC_SYNC_CONFIGURATION 0x0030 "invalid DC SYNC configuration", Configuration,
        "PREOP to SAFEOP", ETG;
        "The SYNC settings sent at start-up do not suit the SubDevice, or contradict its objects \
         0x1C32 and 0x1C33."
        => "Check whether the DC settings of this SubDevice were changed by hand; if so, delete it \
            from the configuration and add it anew."
        => "Compare AssignActivate (registers 0x0980 and 0x0981) and objects 0x1C32:01 and \
            0x1C33:01 with the operation mode in the device description."
        => ESI
        => MANUFACTURER;

    INVALID_DC_LATCH_CONFIGURATION 0x0031 "invalid DC latch configuration", Configuration,
        "PREOP to SAFEOP", ETG;
        "The settings of the latch inputs do not suit the SubDevice."
        => "Compare AssignActivate with the operation mode in the device description."
        => DEFAULTS
        => MANUFACTURER;

    PLL_ERROR 0x0032 "PLL error", Timing, "SAFEOP to OP, or OP back to SAFEOP", ETG;
        "The SubDevice cannot lock its own timing to the communication cycle."
        => JITTER
        => "Check that the reference clock is steady, and that every device behind it follows: \
            0x092C must be small and quiet."
        => SYNC_OBJECTS
        => HARDWARE_FIRST
        => CAPTURE;

    DC_SYNC_IO_ERROR 0x0033 "DC sync IO error", Hardware, "SAFEOP to OP, or OP back to SAFEOP", ETG;
        "Inputs or outputs of the SubDevice could not be synchronized; the fault is mostly in the \
         device itself."
        => "Switch the SubDevice off and on; if the code comes back, replace it for a trial."
        => JITTER
        => DIAGNOSIS_HISTORY
        => MANUFACTURER;

    DC_SYNC_TIMEOUT 0x0034 "DC sync timeout", Timing, "OP, back to SAFEOP", ETG;
        "The SubDevice missed more SYNC signals, or frames belonging to them, than it tolerates."
        => JITTER
        => SYNC_OBJECTS
        => "Check the SYNC shift: frames must have passed the SubDevice before its SYNC0."
        => HARDWARE_FIRST
        => CAPTURE;

    DC_INVALID_SYNC_CYCLE_TIME 0x0035 "DC invalid sync cycle time", Configuration,
        "PREOP to SAFEOP", ETG;
        "The SubDevice does not support the configured cycle time with distributed clocks."
        => CYCLE_LIMITS
        => CYCLE_LIST
        => ESI
        => DEFAULTS
        => MANUFACTURER;

    DC_SYNC0_CYCLE_TIME 0x0036 "DC SYNC0 cycle time", Configuration, "PREOP to SAFEOP", ETG;
        "The cycle time of SYNC0 does not fit the application in the SubDevice."
        => CYCLE_LIMITS
        => CYCLE_LIST
        => DEFAULTS
        => MANUFACTURER;

    DC_SYNC1_CYCLE_TIME 0x0037 "DC SYNC1 cycle time", Configuration, "PREOP to SAFEOP", ETG;
        "The cycle time of SYNC1 does not fit the application in the SubDevice; mostly it must be \
         a multiple of SYNC0's."
        => CYCLE_LIMITS
        => CYCLE_LIST
        => DEFAULTS
        => MANUFACTURER;

    MAILBOX_AOE 0x0041 "mailbox error AoE", Software, "any state with a mailbox", ETG;
        "The SubDevice could not handle an AoE message."
        => MAILBOX_LOG
        => MANUFACTURER;

    MAILBOX_EOE 0x0042 "mailbox error EoE", Software, "any state with a mailbox", ETG;
        "The SubDevice could not handle an EoE message."
        => MAILBOX_LOG
        => "Check the IP settings that are sent to the SubDevice at start-up."
        => MANUFACTURER;

    MAILBOX_COE 0x0043 "mailbox error CoE", Software, "any state with a mailbox", ETG;
        "The SubDevice could not handle a CoE message."
        => MAILBOX_LOG
        => "Check the start-up list of this SubDevice entry by entry."
        => MANUFACTURER;

    MAILBOX_FOE 0x0044 "mailbox error FoE", Software, "BOOT, or any state with a mailbox", ETG;
        "The SubDevice could not handle a FoE message."
        => MAILBOX_LOG
        => "Check file name, password and size of the file."
        => MANUFACTURER;

    MAILBOX_SOE 0x0045 "mailbox error SoE", Software, "any state with a mailbox", ETG;
        "The SubDevice could not handle a SoE message."
        => MAILBOX_LOG
        => MANUFACTURER;

    MAILBOX_VOE 0x004F "mailbox error VoE", Software, "any state with a mailbox", ETG;
        "The SubDevice could not handle a VoE message."
        => MAILBOX_LOG
        => MANUFACTURER;

    EEPROM_NO_ACCESS 0x0050 "EEPROM no access", Software, "INIT to PREOP", ETG;
        "The SubDevice's processor needs the SII, but the MainDevice holds it."
        => "Check that the MainDevice hands the SII over before PREOP: 0x0500 must be 1."
        => "Find out who else reads the SII: a second MainDevice or a service tool."
        => MANUFACTURER;

    EEPROM_ERROR 0x0051 "EEPROM error", Hardware, "INIT to PREOP", ETG;
        "The SII is blank, damaged, or cannot be read."
        => "Read the SII and check the checksum of its first eight words."
        => "Write the image that belongs to this device and revision, then switch it off and on."
        => "If it does not keep what was written, replace the device."
        => MANUFACTURER;

    EXTERNAL_HARDWARE_NOT_READY 0x0052 "external hardware not ready", Hardware,
        "PREOP to SAFEOP, SAFEOP to OP", ETG;
        "Something outside the SubDevice is missing: field supply, encoder, power stage."
        => "Check the supplies and connectors on the field side of this SubDevice."
        => DIAGNOSIS_HISTORY
        => MANUFACTURER;

    RESTARTED_LOCALLY 0x0060 "SubDevice restarted locally", Hardware,
        "any state, back to INIT", ETG;
        "The SubDevice restarted on its own: a brown-out, a local reset, or a firmware crash."
        => "Check its supply, under load and at the moment when others on the same supply switch."
        => "Check whether neighbours lost their link at the same time: then the supply failed for \
            the whole device."
        => "Check the firmware version and update it."
        => MANUFACTURER;

    IDENTIFICATION_UPDATED 0x0061 "device identification value updated", Configuration,
        "any state", ONE_TABLE;
        "The identification, mostly a switch on the device, was changed while it runs."
        => "Read the identification again and compare it with the configured one."
        => "If nobody turned the switch on purpose, set it back.";

    MODULE_LIST_MISMATCH 0x0070 "detected module list does not match", Configuration,
        "PREOP to SAFEOP", ETG;
        "The modules found (object 0xF050) are not the configured ones (object 0xF030)."
        => SLOTS
        => "Read objects 0xF030 and 0xF050 and compare them entry by entry: the first difference \
            is the slot to look at."
        => ESI
        => MANUFACTURER;

    SUPPLY_VOLTAGE_TOO_LOW 0x0080 "supply voltage too low", Hardware, "SAFEOP to OP, OP", ONE_TABLE;
        "The SubDevice measures a supply below its limit."
        => "Measure the supply at the SubDevice's terminals under load."
        => "Check cross-section and contacts of the supply lines, and the load of the power group."
        => MANUFACTURER;

    SUPPLY_VOLTAGE_TOO_HIGH 0x0081 "supply voltage too high", Hardware, "SAFEOP to OP, OP",
        ONE_TABLE;
        "The SubDevice measures a supply above its limit."
        => "Measure the supply at the SubDevice's terminals, also while drives brake."
        => "Check the setting of the power supply unit."
        => MANUFACTURER;

    TEMPERATURE_TOO_LOW 0x0082 "temperature too low", Hardware, "SAFEOP to OP, OP", ONE_TABLE;
        "The SubDevice is colder than it may be."
        => "Check the temperature at the place of installation against the manual."
        => MANUFACTURER;

    TEMPERATURE_TOO_HIGH 0x0083 "temperature too high", Hardware, "SAFEOP to OP, OP", ONE_TABLE;
        "The SubDevice is hotter than it may be."
        => "Check cooling, spacing and load of the device, and the temperature in the cabinet."
        => MANUFACTURER;

    APPLICATION_CONTROLLER_AVAILABLE 0x00F0 "application controller available", Software,
        "any state", ONE_TABLE;
        "The SubDevice's application processor has come up, perhaps again."
        => RETRY_FROM_INIT
        => "If nobody restarted it, check its supply."
        => MANUFACTURER;
}
