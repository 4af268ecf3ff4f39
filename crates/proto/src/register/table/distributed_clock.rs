//! Distributed clocks: receive times, the loop that keeps system time, SYNC and latch units: 0x0900
//! to 0x09FF.
//!
//! Reference: S2 2.15; S1 chapter 9. Values of several bytes freeze when their lowest byte is read:
//! read each in one datagram. Controllers with 32-bit clocks have the low half only.

use crate::register::entry::{Access, Field, Form, Register, choice, flag, hex, number, register};
use Access::{Read, ReadWrite, ReadWriteIf};

const CONTROL: &[(u32, &str)] = &[(0, "by EtherCAT"), (1, "by PDI")];
const SAME_OR_OPPOSITE: &[(u32, &str)] = &[(0, "same as SYNC0"), (1, "opposite to SYNC0")];
const DC: &str = "controllers with distributed clocks";
const FOUR_SYNCS: &str = "ET1150; IP core since 4.0.0";

const LATCH_CONTROL: &[Field] = &[
    choice(
        0,
        0,
        "positive edge",
        "Which rising edges are taken.",
        &[(0, "every"), (1, "first only")],
    ),
    choice(
        1,
        1,
        "negative edge",
        "Which falling edges are taken.",
        &[(0, "every"), (1, "first only")],
    ),
];
const LATCH_STATUS: &[Field] = &[
    flag(0, "positive edge seen", "In single event mode; reading the time clears it."),
    flag(1, "negative edge seen", "In single event mode; reading the time clears it."),
    flag(2, "pin high", "State of the input."),
];
const SYNC_STATUS: &[Field] = &[flag(0, "active", "The signal is active, in acknowledge mode.")];
const LATCH_TIME: &[Field] = &[number(63, 0, "time", "System time of the edge.", "ns")];
const LATCH_READ: &str =
    "Clears the event in the latch status, if the latch unit is controlled by EtherCAT.";
const LOCAL_TIME: &[Field] = &[number(31, 0, "time", "Local time of the event.", "ns")];

registers! {
    RECEIVE_TIMES: "Distributed clocks: receive times";

    /// Local time at which a port received the frame that wrote to 0x0900 with BWR or FPWR: the raw
    /// material of propagation delays. The times cannot be read in that same frame, and those of
    /// ports that are closed or not there are meaningless.
    RECEIVE_TIME = register("receive time", 0x0900, 4, ReadWriteIf, Read, "S2 2.15.1")
        .per_port()
        .only(DC)
        .fields(&[number(31, 0, "time", "Local time of the first bit of the preamble.", "ns")]);
}

registers! {
    TIME_LOOP: "Distributed clocks: time loop control unit";

    /// The local copy of the system time, taken when the frame began. A MainDevice does not set it:
    /// what it writes (the low 32 bits, by FRMW or ARMW from the reference clock) is compared with
    /// the local copy, and the loop corrects the rest. 0 is 2000-01-01 00:00 UTC.
    SYSTEM_TIME = register("system time", 0x0910, 8, ReadWriteIf, ReadWriteIf, "S2 2.15.2.1")
        .only(DC)
        .fields(&[number(63, 0, "time", "System time.", "ns")]);

    /// Local time at which the processing unit received the frame that wrote to 0x0900.
    RECEIVE_TIME_PROCESSING_UNIT =
        register("receive time ECAT processing unit", 0x0918, 8, Read, Read, "S2 2.15.1.5")
        .only(DC)
        .fields(&[number(63, 0, "time", "Local time.", "ns")]);

    /// What is added to the local time to make the system time. Reset the filters through 0x0930
    /// after changing it.
    SYSTEM_TIME_OFFSET =
        register("system time offset", 0x0920, 8, ReadWriteIf, ReadWriteIf, "S2 2.15.2.2")
        .reset(0)
        .only(DC)
        .fields(&[number(63, 0, "offset", "System time minus local time.", "ns")
            .form(Form::Signed)]);

    /// How long a frame takes from the reference clock to this controller.
    SYSTEM_TIME_DELAY =
        register("system time delay", 0x0928, 4, ReadWriteIf, ReadWriteIf, "S2 2.15.2.3")
        .reset(0)
        .only(DC)
        .fields(&[number(31, 0, "delay", "Propagation delay from the reference clock.", "ns")]);

    /// How far the local copy of the system time is off, as a mean. The sign bit set means that the
    /// local copy is ahead or equal; some old documents have it the other way round. A small, quiet
    /// value says that the clock is in step; a growing one, that the frames with the reference time
    /// do not come.
    SYSTEM_TIME_DIFFERENCE =
        register("system time difference", 0x092C, 4, Read, Read, "S2 2.15.2.4")
        .reset(0)
        .only(DC)
        .fields(&[number(31, 0, "difference", "Negative when the local copy is ahead.", "ns")
            .form(Form::SignMagnitude)]);

    /// How quickly the loop corrects: larger is slower and smoother. Any write resets the filters,
    /// 0x092C and 0x0932. Valid are 0x0080 to 0x3FFF.
    SPEED_COUNTER_START =
        register("speed counter start", 0x0930, 2, ReadWriteIf, ReadWriteIf, "S2 2.15.2.5")
        .reset(0x1000)
        .only(DC)
        .fields(&[hex(14, 0, "start", "Bandwidth of the loop.")]);

    /// How far the local quartz is off the reference clock's: with start and diff in counts, the
    /// deviation is diff / (5 (start + diff + 2) (start - diff + 2)). One that stands apart from
    /// all others is a bad quartz.
    SPEED_COUNTER_DIFF = register("speed counter diff", 0x0932, 2, Read, Read, "S2 2.15.2.6")
        .reset(0)
        .only(DC)
        .fields(&[number(15, 0, "diff", "Correction of the clock's speed.", "counts")
            .form(Form::Signed)]);

    /// How many differences of the system time are averaged, as a power of two.
    DIFFERENCE_FILTER_DEPTH = register("system time difference filter depth", 0x0934, 1,
        ReadWriteIf, ReadWriteIf, "S2 2.15.2.7")
        .reset(4)
        .only(DC)
        .fields(&[number(3, 0, "depth", "Filter depth.", "")]);

    /// How many deviations of the clock period are averaged, as a power of two.
    SPEED_FILTER_DEPTH =
        register("speed counter filter depth", 0x0935, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.2.8")
        .reset(12)
        .only(DC)
        .fields(&[number(3, 0, "depth", "Filter depth.", "")]);

    /// From which direction the frame comes whose receive times ports B to D take.
    RECEIVE_TIME_LATCH_MODE =
        register("receive time latch mode", 0x0936, 1, ReadWrite, Read, "S2 2.15.2.9")
        .reset(0)
        .only("ET1200")
        .fields(&[choice(0, 0, "direction", "Direction of the frame.",
            &[(0, "processing"), (1, "forwarding")])]);

    /// Sets the clock's speed directly instead of through the loop; 0 leaves it to the loop.
    SPEED_COUNTER_DIRECT_CONTROL = register("speed counter diff direct control", 0x0938, 2,
        ReadWriteIf, ReadWriteIf, "S2 2.15.2.10")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(&[number(15, 0, "diff", "Correction of the clock's speed.", "counts")
            .form(Form::Signed)]);
}

registers! {
    CYCLIC: "Distributed clocks: cyclic unit";

    /// Time from a SYNC0 pulse to its SYNC2 pulse.
    SYNC2_CYCLE_TIME =
        register("SYNC2 cycle time", 0x0940, 4, ReadWriteIf, ReadWriteIf, "S2 2.15.3.1")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(&[number(31, 0, "time", "Delay of SYNC2 behind SYNC0.", "ns")]);

    /// Time from a SYNC0 pulse to its SYNC3 pulse.
    SYNC3_CYCLE_TIME =
        register("SYNC3 cycle time", 0x0944, 4, ReadWriteIf, ReadWriteIf, "S2 2.15.3.2")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(&[number(31, 0, "time", "Delay of SYNC3 behind SYNC0.", "ns")]);

    /// When the next SYNC2 pulse comes.
    NEXT_SYNC2 = register("next SYNC2 pulse", 0x0950, 8, Read, Read, "S2 2.15.3.3")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(&[number(63, 0, "time", "System time of the pulse.", "ns")]);

    /// When the next SYNC3 pulse comes.
    NEXT_SYNC3 = register("next SYNC3 pulse", 0x0958, 8, Read, Read, "S2 2.15.3.4")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(&[number(63, 0, "time", "System time of the pulse.", "ns")]);

    /// Who controls the SYNC and latch units. It is the low byte of AssignActivate.
    CYCLIC_UNIT_CONTROL =
        register("cyclic unit control", 0x0980, 1, ReadWrite, Read, "S2 2.15.3.5")
        .reset(0)
        .only(DC)
        .fields(&[
            choice(0, 0, "SYNC0 control", "Who sets cyclic unit and SYNC0.", CONTROL),
            choice(1, 1, "SYNC1 control", "Who sets SYNC1.", SAME_OR_OPPOSITE),
            choice(2, 2, "SYNC2 control", "Who sets SYNC2.", SAME_OR_OPPOSITE),
            choice(3, 3, "SYNC3 control", "Who sets SYNC3.", SAME_OR_OPPOSITE),
            choice(4, 4, "latch 0 control", "Who gets the times of LATCH0.", CONTROL),
            choice(5, 5, "latch 1 control", "Who gets the times of LATCH1.", CONTROL),
            choice(6, 6, "latch 2 control", "Who gets the times of LATCH2.", CONTROL),
            choice(7, 7, "latch 3 control", "Who gets the times of LATCH3.", CONTROL),
        ]);

    /// Switches the SYNC signals on. It is the high byte of AssignActivate: 0x03 for SYNC0, 0x07
    /// for SYNC0 and SYNC1. The start time must lie ahead when it is written.
    SYNC_ACTIVATION = register("activation", 0x0981, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.4.1")
        .reset(0)
        .only(DC)
        .fields(&[
            flag(0, "cyclic unit", "The unit runs."),
            flag(1, "SYNC0", "SYNC0 is generated."),
            flag(2, "SYNC1", "SYNC1 is generated."),
            flag(3, "auto-activation", "Writing the start time starts the unit."),
            flag(4, "start time extension", "A start time of 32 bits is extended to 64."),
            flag(5, "start time plausibility check",
                "A start time outside the near future starts the signals at once."),
            choice(6, 6, "near future", "What counts as near.",
                &[(0, "half the clock's range"), (1, "2.1 s")]),
            flag(7, "debug pulse", "Makes one pulse at once; reads as 0."),
        ]);

    /// How long a SYNC pulse is. From SII word 2; 0 means that the SubDevice's processor ends it by
    /// reading the SYNC status.
    SYNC_PULSE_LENGTH =
        register("pulse length of SyncSignals", 0x0982, 2, Read, Read, "S2 2.15.4.2")
        .only(DC)
        .fields(&[number(15, 0, "length", "Pulse length in steps of 10 ns.", "x 10 ns")]);

    /// Whether the first pulses have come yet, and whether the start time made sense. A SYNC0 that
    /// stays pending had its start time in the past: it would start when the clock wraps.
    SYNC_ACTIVATION_STATUS = register("activation status", 0x0984, 1, Read, Read, "S2 2.15.4.3")
        .reset(0)
        .only("ET1150; IP core since 2.2.0")
        .fields(&[
            flag(0, "SYNC0 pending", "The first SYNC0 pulse has not come yet."),
            flag(1, "SYNC1 pending", "The first SYNC1 pulse has not come yet."),
            flag(2, "start time implausible", "The start time was outside the near future."),
            flag(3, "SYNC2 pending", "The first SYNC2 pulse has not come yet."),
            flag(4, "SYNC3 pending", "The first SYNC3 pulse has not come yet."),
        ]);

    /// Switches SYNC2 and SYNC3 on.
    SYNC23_ACTIVATION =
        register("activation SYNC2/3", 0x0986, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.4.4")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(&[
            flag(0, "SYNC2", "SYNC2 is generated."),
            flag(1, "SYNC3", "SYNC3 is generated."),
        ]);

    /// Whether SYNC2 is active, in acknowledge mode.
    SYNC2_STATUS = register("SYNC2 status", 0x098C, 1, Read, Read, "S2 2.15.4.5")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(SYNC_STATUS);

    /// Whether SYNC3 is active, in acknowledge mode.
    SYNC3_STATUS = register("SYNC3 status", 0x098D, 1, Read, Read, "S2 2.15.4.6")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(SYNC_STATUS);

    /// Whether SYNC0 is active, in acknowledge mode.
    SYNC0_STATUS = register("SYNC0 status", 0x098E, 1, Read, Read, "S2 2.15.4.7")
        .reset(0)
        .only(DC)
        .fields(SYNC_STATUS);

    /// Whether SYNC1 is active, in acknowledge mode.
    SYNC1_STATUS = register("SYNC1 status", 0x098F, 1, Read, Read, "S2 2.15.4.8")
        .reset(0)
        .only(DC)
        .fields(SYNC_STATUS);

    /// Written: the system time of the first SYNC0 pulse. Read: that of the next one. A start time
    /// in the past means no SYNC until the clock wraps.
    START_TIME = register("start time cyclic operation", 0x0990, 8, ReadWriteIf, ReadWriteIf,
        "S2 2.15.4.9")
        .reset(0)
        .only(DC)
        .fields(&[number(63, 0, "time", "Start time, or time of the next SYNC0 pulse.", "ns")]);

    /// When the next SYNC1 pulse comes.
    NEXT_SYNC1 = register("next SYNC1 pulse", 0x0998, 8, Read, Read, "S2 2.15.4.10")
        .reset(0)
        .only(DC)
        .fields(&[number(63, 0, "time", "System time of the pulse.", "ns")]);

    /// Time from one SYNC0 pulse to the next; 0 makes a single one. At least 60 ns.
    SYNC0_CYCLE_TIME =
        register("SYNC0 cycle time", 0x09A0, 4, ReadWriteIf, ReadWriteIf, "S2 2.15.4.11")
        .reset(0)
        .only(DC)
        .fields(&[number(31, 0, "time", "Cycle of SYNC0.", "ns")]);

    /// Time from a SYNC0 pulse to its SYNC1 pulse. Shorter than the SYNC0 cycle it shifts SYNC1 by
    /// that much; from one cycle up it also makes SYNC1 rarer.
    SYNC1_CYCLE_TIME =
        register("SYNC1 cycle time", 0x09A4, 4, ReadWriteIf, ReadWriteIf, "S2 2.15.4.12")
        .reset(0)
        .only(DC)
        .fields(&[number(31, 0, "time", "Delay of SYNC1 behind SYNC0.", "ns")]);
}

registers! {
    LATCH: "Distributed clocks: latch unit";

    /// Which edges of LATCH0 are time-stamped.
    LATCH0_CONTROL = register("LATCH0 control", 0x09A8, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.5.1")
        .reset(0)
        .only(DC)
        .fields(LATCH_CONTROL);

    /// Which edges of LATCH1 are time-stamped.
    LATCH1_CONTROL = register("LATCH1 control", 0x09A9, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.5.2")
        .reset(0)
        .only(DC)
        .fields(LATCH_CONTROL);

    /// Which edges of LATCH2 are time-stamped.
    LATCH2_CONTROL = register("LATCH2 control", 0x09AA, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.5.3")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(LATCH_CONTROL);

    /// Which edges of LATCH3 are time-stamped.
    LATCH3_CONTROL = register("LATCH3 control", 0x09AB, 1, ReadWriteIf, ReadWriteIf, "S2 2.15.5.4")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(LATCH_CONTROL);

    /// What happened at LATCH2.
    LATCH2_STATUS = register("LATCH2 status", 0x09AC, 1, Read, Read, "S2 2.15.5.5")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(LATCH_STATUS);

    /// What happened at LATCH3.
    LATCH3_STATUS = register("LATCH3 status", 0x09AD, 1, Read, Read, "S2 2.15.5.6")
        .reset(0)
        .only(FOUR_SYNCS)
        .fields(LATCH_STATUS);

    /// What happened at LATCH0.
    LATCH0_STATUS = register("LATCH0 status", 0x09AE, 1, Read, Read, "S2 2.15.5.7")
        .reset(0)
        .only(DC)
        .fields(LATCH_STATUS);

    /// What happened at LATCH1.
    LATCH1_STATUS = register("LATCH1 status", 0x09AF, 1, Read, Read, "S2 2.15.5.8")
        .reset(0)
        .only(DC)
        .fields(LATCH_STATUS);

    /// When LATCH0 last rose.
    LATCH0_POSITIVE = register("LATCH0 time positive edge", 0x09B0, 8, Read, Read, "S2 2.15.5.9")
        .reset(0)
        .only(DC)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH0 last fell.
    LATCH0_NEGATIVE = register("LATCH0 time negative edge", 0x09B8, 8, Read, Read, "S2 2.15.5.10")
        .reset(0)
        .only(DC)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH1 last rose.
    LATCH1_POSITIVE = register("LATCH1 time positive edge", 0x09C0, 8, Read, Read, "S2 2.15.5.11")
        .reset(0)
        .only(DC)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH1 last fell.
    LATCH1_NEGATIVE = register("LATCH1 time negative edge", 0x09C8, 8, Read, Read, "S2 2.15.5.12")
        .reset(0)
        .only(DC)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH2 last rose.
    LATCH2_POSITIVE = register("LATCH2 time positive edge", 0x09D0, 8, Read, Read, "S2 2.15.5.13")
        .reset(0)
        .only(FOUR_SYNCS)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH2 last fell.
    LATCH2_NEGATIVE = register("LATCH2 time negative edge", 0x09D8, 8, Read, Read, "S2 2.15.5.14")
        .reset(0)
        .only(FOUR_SYNCS)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH3 last rose.
    LATCH3_POSITIVE = register("LATCH3 time positive edge", 0x09E0, 8, Read, Read, "S2 2.15.5.15")
        .reset(0)
        .only(FOUR_SYNCS)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);

    /// When LATCH3 last fell.
    LATCH3_NEGATIVE = register("LATCH3 time negative edge", 0x09E8, 8, Read, Read, "S2 2.15.5.16")
        .reset(0)
        .only(FOUR_SYNCS)
        .read_effect(LATCH_READ)
        .fields(LATCH_TIME);
}

registers! {
    EVENT_TIMES: "Distributed clocks: SyncManager event times";

    /// Local time at which the frame began that made a SyncManager raise an event.
    BUFFER_CHANGE_TIME_ECAT =
        register("EtherCAT buffer change event time", 0x09F0, 4, Read, Read, "S2 2.15.6.1")
        .reset(0)
        .only("ET1100, ET1150; optional in the IP core")
        .fields(LOCAL_TIME);

    /// Local time at which the SubDevice's processor began to use a buffer.
    BUFFER_START_TIME_PDI =
        register("PDI buffer start event time", 0x09F8, 4, Read, Read, "S2 2.15.6.2")
        .reset(0)
        .only("ET1100, ET1150; optional in the IP core")
        .fields(LOCAL_TIME);

    /// Local time at which the SubDevice's processor finished with a buffer.
    BUFFER_CHANGE_TIME_PDI =
        register("PDI buffer change event time", 0x09FC, 4, Read, Read, "S2 2.15.6.3")
        .reset(0)
        .only("ET1100, ET1150; optional in the IP core")
        .fields(LOCAL_TIME);
}
