//! Objects of drives: positions, velocities, torques, and what they are scaled with.
//!
//! Reference: CiA 402 (IEC 61800-7-201), over EtherCAT by ETG.6010.

use super::drive::{HOMING_SPEEDS, PERIOD, POINTS, RATIO};
use super::{StandardObject, object};

const CIA: &str = "CiA 402 (IEC 61800-7-201)";

objects! {
    MOTION;
    0x6062 "Position demand value", "DINT", CIA; "Position that the drive's own controller asks for.";
    0x6063 "Position actual internal value", "DINT", CIA; "Position in increments of the encoder.";
    0x6064 "Position actual value", "DINT", CIA; "Position of the axis, in user units.";
    0x6065 "Following error window", "UDINT", CIA;
        "How far the axis may be behind before the drive reports a following error (0x8611).";
    0x6066 "Following error time out", "UINT", CIA;
        "How long it may be further behind than the window before that is an error, ms.";
    0x6067 "Position window", "UDINT", CIA; "How near the target the axis must be to have reached it.";
    0x6068 "Position window time", "UINT", CIA; "How long it must be that near, ms.";
    0x6069 "Velocity sensor actual value", "DINT", CIA; "Velocity in increments of the encoder.";
    0x606B "Velocity demand value", "DINT", CIA; "Velocity that the drive's own controller asks for.";
    0x606C "Velocity actual value", "DINT", CIA; "Velocity of the axis, in user units.";
    0x606D "Velocity window", "UINT", CIA; "How near the target velocity counts as reached.";
    0x606E "Velocity window time", "UINT", CIA; "How long it must be that near, ms.";
    0x6071 "Target torque", "INT", CIA; "Torque asked for, in thousandths of the rated one.";
    0x6074 "Torque demand", "INT", CIA; "Torque that the drive's own controller asks for.";
    0x6077 "Torque actual value", "INT", CIA; "Torque, in thousandths of the rated one.";
    0x6078 "Current actual value", "INT", CIA; "Current, in thousandths of the rated one.";
    0x6079 "DC link circuit voltage", "UDINT", CIA; "Voltage of the DC link, mV.";
    0x607A "Target position", "DINT", CIA;
        "Position asked for. In mode csp it comes new in each cycle: a step in it is a jump of the axis.";
    0x607C "Home offset", "DINT", CIA; "Distance from the home position to zero.";
    0x607E "Polarity", "USINT", CIA; "Turns signs: bit 7 of the position, bit 6 of the velocity.";
    0x607F "Max profile velocity", "UDINT", CIA; "Highest velocity of a profile.";
    0x6080 "Max motor speed", "UDINT", CIA; "Highest speed of the motor, rpm.";
    0x6081 "Profile velocity", "UDINT", CIA; "Velocity of a move in mode pp.";
    0x6083 "Profile acceleration", "UDINT", CIA; "Acceleration of a profile.";
    0x6084 "Profile deceleration", "UDINT", CIA; "Deceleration of a profile.";
    0x6085 "Quick stop deceleration", "UDINT", CIA; "Deceleration of a quick stop.";
    0x6086 "Motion profile type", "INT", CIA; "Shape of the ramp: 0 linear, 3 limited jerk.";
    0x6087 "Torque slope", "UDINT", CIA; "How fast the torque may change.";
    0x608F "Position encoder resolution", "ARRAY", CIA;
        "Increments of the encoder per revolution of the motor."; entries RATIO;
    0x6091 "Gear ratio", "ARRAY", CIA; "Revolutions of the motor per revolution of the load."; entries RATIO;
    0x6092 "Feed constant", "ARRAY", CIA; "Way of the load per revolution of its shaft."; entries RATIO;
    0x6099 "Homing speeds", "ARRAY", CIA; "Speeds while the axis looks for its home."; entries HOMING_SPEEDS;
    0x609A "Homing acceleration", "UDINT", CIA; "Acceleration while the axis looks for its home.";
    0x60B0 "Position offset", "DINT", CIA; "Is added to the target position.";
    0x60B1 "Velocity offset", "DINT", CIA; "Is added to the velocity: feed forward.";
    0x60B2 "Torque offset", "INT", CIA; "Is added to the torque: feed forward.";
    0x60B8 "Touch probe function", "UINT", CIA; "What the touch probes are to catch.";
    0x60B9 "Touch probe status", "UINT", CIA; "What they have caught.";
    0x60BA "Touch probe 1 positive edge", "DINT", CIA; "Position at the rising edge of probe 1.";
    0x60BB "Touch probe 1 negative edge", "DINT", CIA; "Position at the falling edge of probe 1.";
    0x60BC "Touch probe 2 positive edge", "DINT", CIA; "Position at the rising edge of probe 2.";
    0x60BD "Touch probe 2 negative edge", "DINT", CIA; "Position at the falling edge of probe 2.";
    0x60C1 "Interpolation data record", "ARRAY", CIA; "Set-points of mode ip."; entries POINTS;
    0x60C2 "Interpolation time period", "RECORD", CIA;
        "The cycle in which set-points come. It must be the cycle of the MainDevice, else the axis moves \
         unevenly or the drive refuses OP."
        ; entries PERIOD;
    0x60C5 "Max acceleration", "UDINT", CIA; "Highest acceleration.";
    0x60C6 "Max deceleration", "UDINT", CIA; "Highest deceleration.";
    0x60E0 "Positive torque limit value", "UINT", CIA; "Highest torque forward, thousandths of the rated one.";
    0x60E1 "Negative torque limit value", "UINT", CIA; "Highest torque backward, thousandths of the rated one.";
    0x60F4 "Following error actual value", "DINT", CIA; "How far the axis is behind its target.";
    0x60FA "Control effort", "DINT", CIA; "Output of the position controller.";
    0x60FC "Position demand internal value", "DINT", CIA; "Position asked for, in increments.";
    0x60FF "Target velocity", "DINT", CIA; "Velocity asked for in modes csv and pv.";
}
