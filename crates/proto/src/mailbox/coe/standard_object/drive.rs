//! Objects of drives: state, errors, modes, limits and options.
//!
//! Reference: CiA 402 (IEC 61800-7-201), over EtherCAT by ETG.6010. Objects of a second drive in the
//! same device lie 0x800 higher. Values of motion are in [`super::drive_motion`].

use super::{Entry, ObjectIndex, StandardObject, entries, entry, object};
use crate::register::Field;
use crate::register::entry::{choice, flag};

/// The first index of the first axis.
pub(super) const FIRST: ObjectIndex = ObjectIndex(0x6000);
/// Distance between the objects of two axes.
pub(super) const AXIS: u16 = 0x0800;
/// Most axes that a device can have.
pub(super) const AXES: u16 = 8;
/// Objects of drives lie above it.
pub(super) const LEAST: ObjectIndex = ObjectIndex(0x6000);

const CIA: &str = "CiA 402 (IEC 61800-7-201)";

const CONTROLWORD: &[Field] = &[
    flag(0, "switch on", "Power on."),
    flag(1, "enable voltage", "Voltage allowed."),
    flag(2, "quick stop (0 acts)", "0 stops the axis."),
    flag(3, "enable operation", "The axis is driven."),
    flag(4, "mode 4", "Mode pp: new set-point; homing: start."),
    flag(5, "mode 5", "Mode pp: change set-point at once."),
    flag(6, "mode 6", "Mode pp: relative."),
    flag(7, "fault reset", "A change from 0 to 1 resets a fault."),
    flag(8, "halt", "The axis is halted."),
    flag(9, "mode 9", "As the mode defines."),
];

const STATUSWORD: &[Field] = &[
    flag(0, "ready to switch on", "Power may be switched on."),
    flag(1, "switched on", "Power is on."),
    flag(2, "operation enabled", "The axis is driven."),
    flag(3, "fault", "A fault: object 0x603F has its code."),
    flag(4, "voltage enabled", "The power stage has voltage."),
    flag(5, "quick stop (0 acts)", "0 while a quick stop is under way."),
    flag(6, "switch on disabled", "Switching on is not allowed."),
    flag(7, "warning", "A warning; the axis goes on."),
    flag(8, "manufacturer 8", "As the manufacturer defines."),
    flag(9, "remote", "The drive obeys the controlword."),
    flag(10, "target reached", "The target is reached."),
    flag(11, "internal limit active", "A limit of the drive holds it back."),
    flag(
        12,
        "mode 12",
        "csp, csv, cst: the drive follows; pp: set-point acknowledged; homing: done.",
    ),
    flag(13, "mode 13", "pp, csp: following error; homing: error."),
    flag(14, "manufacturer 14", "As the manufacturer defines."),
    flag(15, "manufacturer 15", "As the manufacturer defines."),
];

const MODE_NAMES: &[(u32, &str)] = &[
    (0, "no mode"),
    (1, "profile position (pp)"),
    (2, "velocity (vl)"),
    (3, "profile velocity (pv)"),
    (4, "profile torque (tq)"),
    (6, "homing (hm)"),
    (7, "interpolated position (ip)"),
    (8, "cyclic synchronous position (csp)"),
    (9, "cyclic synchronous velocity (csv)"),
    (10, "cyclic synchronous torque (cst)"),
    (11, "cyclic synchronous torque with commutation angle (cstca)"),
];

const MODE: &[Field] = &[choice(7, 0, "mode", "From 0x80 up the manufacturer's.", MODE_NAMES)];

const SUPPORTED: &[Field] = &[
    flag(0, "pp", "Profile position."),
    flag(1, "vl", "Velocity."),
    flag(2, "pv", "Profile velocity."),
    flag(3, "tq", "Profile torque."),
    flag(5, "hm", "Homing."),
    flag(6, "ip", "Interpolated position."),
    flag(7, "csp", "Cyclic synchronous position."),
    flag(8, "csv", "Cyclic synchronous velocity."),
    flag(9, "cst", "Cyclic synchronous torque."),
    flag(10, "cstca", "Cyclic synchronous torque with commutation angle."),
];

const INPUTS: &[Field] = &[
    flag(0, "negative limit switch", "The negative limit switch is hit."),
    flag(1, "positive limit switch", "The positive limit switch is hit."),
    flag(2, "home switch", "The home switch is hit."),
    flag(3, "interlock", "The drive is held off by its interlock (STO, enable)."),
];

const POSITION_LIMIT: &[Entry] = &[
    entry(1, "minimum position limit", "Least position that may be asked for."),
    entry(2, "maximum position limit", "Highest position that may be asked for."),
];

const OUTPUTS: &[Entry] = &[
    entry(1, "physical outputs", "The outputs, bit by bit; bit 0 is the brake."),
    entry(2, "bit mask", "Which bits of subindex 1 take effect."),
];

/// The state of a drive that a statusword (0x6041) tells.
#[must_use]
pub const fn drive_state(statusword: u16) -> &'static str {
    match (statusword & 0x4F, statusword & 0x6F) {
        (0x00, _) => "not ready to switch on",
        (0x40, _) => "switch on disabled",
        (_, 0x21) => "ready to switch on",
        (_, 0x23) => "switched on",
        (_, 0x27) => "operation enabled",
        (_, 0x07) => "quick stop active",
        (0x0F, _) => "fault reaction active",
        (0x08, _) => "fault",
        (_, _) => "no state of the specification",
    }
}

objects! {
    DRIVE;
    0x6007 "Abort connection option code", "INT", CIA;
        "What the drive does when the communication is lost: 0 nothing, 1 fault, 2 disable voltage, 3 \
         quick stop.";
    0x603F "Error code", "UINT", CIA;
        "Code of the last error, the same as in an emergency message."
        => "Ask for it: `linesman explain emergency 0x8611`.";
    0x6040 "Controlword", "UINT", CIA;
        "What the drive is asked to do. Usual sequence: 0x0006 (shut down), 0x0007 (switch on), 0x000F \
         (enable operation); 0x0080 resets a fault."
        ; bits CONTROLWORD;
    0x6041 "Statusword", "UINT", CIA;
        "The state that the drive is in. With fault (bit 3) object 0x603F has the code."
        => "Give its value to have it read: `linesman explain 0x6041 = 0x0237`."
        ; bits STATUSWORD;
    0x6042 "vl target velocity", "INT", CIA; "Velocity asked for in mode vl, rpm unless scaled.";
    0x6043 "vl velocity demand", "INT", CIA; "Velocity in mode vl as the ramp gives it.";
    0x6044 "vl velocity actual value", "INT", CIA; "Velocity measured in mode vl.";
    0x605A "Quick stop option code", "INT", CIA;
        "How the axis stops on a quick stop: 0 unpowered, 1 to 4 by ramps, 5 to 8 the same and stays in \
         quick stop.";
    0x605B "Shutdown option code", "INT", CIA; "How the axis stops on shutdown.";
    0x605C "Disable operation option code", "INT", CIA; "How the axis stops when it is disabled.";
    0x605D "Halt option code", "INT", CIA; "How the axis stops on halt.";
    0x605E "Fault reaction option code", "INT", CIA; "How the axis stops on a fault.";
    0x6060 "Modes of operation", "SINT", CIA;
        "The mode asked for. The drive shows the one it is in at 0x6061."; bits MODE;
    0x6061 "Modes of operation display", "SINT", CIA;
        "The mode that the drive is in."; bits MODE;
    0x6072 "Max torque", "UINT", CIA; "Highest torque allowed, in thousandths of the rated one.";
    0x6073 "Max current", "UINT", CIA; "Highest current allowed, in thousandths of the rated one.";
    0x6075 "Motor rated current", "UDINT", CIA; "Rated current of the motor, mA.";
    0x6076 "Motor rated torque", "UDINT", CIA; "Rated torque of the motor, mNm.";
    0x607D "Software position limit", "ARRAY", CIA;
        "Between which positions the axis may be sent."; entries POSITION_LIMIT;
    0x6098 "Homing method", "SINT", CIA;
        "How the axis looks for its home: by limit switch, home switch, index pulse, or where it is (35, \
         37).";
    0x60FD "Digital inputs", "UDINT", CIA; "Inputs of the drive, bit by bit."; bits INPUTS;
    0x60FE "Digital outputs", "ARRAY", CIA; "Outputs of the drive."; entries OUTPUTS;
    0x6402 "Motor type", "UINT", CIA; "Kind of motor: 3 and 10 are synchronous with permanent magnet.";
    0x6502 "Supported drive modes", "UDINT", CIA; "Which modes the drive has."; bits SUPPORTED;
    0x67FE "Version number", "UDINT", CIA; "Version of the profile that the drive follows.";
    0x67FF "Single device type", "UDINT", CIA;
        "Profile of this axis, as 0x1000 has it of a device with one.";
}

/// Entries of a list of two ratios.
pub(super) const RATIO: &[Entry] = &[
    entry(1, "numerator", "Increments, or motor side."),
    entry(
        2,
        "denominator",
        "Revolutions, or \
     load side.",
    ),
];
/// Entries of the homing speeds.
pub(super) const HOMING_SPEEDS: &[Entry] = &[
    entry(1, "speed to the switch", "While the axis looks for the switch."),
    entry(2, "speed to the zero pulse", "While it looks for the exact place."),
];
/// Entries of the interpolation period.
pub(super) const PERIOD: &[Entry] = &[
    entry(1, "value", "Number of units: 1 for 1 ms when the unit is -3."),
    entry(2, "unit", "Power of ten of a second: -3 for ms, -6 for µs."),
];
/// Entries of the interpolation data.
pub(super) const POINTS: &[Entry] = &[entries(1, 254, "set-point", "Set-points of mode ip.")];
