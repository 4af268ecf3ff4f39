"""A cycle of 50 µs, 20,000 frames a second, on a host that may be late: whatever does not come back in time is counted,
and each count says what became of it."""

import os
import time

from bench import NEAR, Segment, parse
from check_own import NUMBER, VENDOR, serve, wait_for
from harness import LINE, LINESMAN, WATCHDOG_MS, check, watchdogs_expired

CYCLE_US = 50
SECONDS = float(os.environ.get("LINESMAN_FAST_SECONDS", "3"))
# The share of cycles that a busy host may sleep through in waits too short to be measured.
SLEPT_THROUGH = 0.05
# Frames that are still on their way when the report is made.
UNDER_WAY = 256


# proves: JCT-04 (V)
@check
def every_frame_of_a_50_us_cycle_is_accounted_for(line):
    with Segment(line, LINESMAN, LINE.file):
        began, control = time.monotonic(), line.path("run")
        run = line.start(
            line.near, LINESMAN, "run", "--on", NEAR, "--seconds", 60, "--cycle-us", CYCLE_US, "--json", "--control", control,
        )
        wait_for(line, run, control, ["OP"] * len(LINE))
        time.sleep(SECONDS)
        # Acyclic frames beside them: an object and a register of a SubDevice.
        sdo = serve(line, control, "sdo", NUMBER, "read", "0x1018:01")
        assert [one["value"] for one in sdo["objects"]] == [VENDOR], sdo
        register = serve(line, control, "reg", NUMBER, "read", "al-status")
        assert register["registers"][0]["bytes"] == "08 00", register
        status, out, err = line.stop(run, SECONDS + 60)
        expired = watchdogs_expired(line)
    # A diagnosis that a busy host kept from its work says that it has left out frames, and judges nothing by them.
    behind = status == 3 and "the diagnosis does not keep up" in err
    assert status in (0, 1) or behind, f"status {status}: {(out + err)[-600:]}"
    report = parse(out, err)
    counts = report["counts"]
    told = {name: count for name, count in counts.items() if count}
    assert report["error"] is None and report["reached_ns"], report["error"]
    # Each cycle since OP began with a frame, or is counted as one that the host slept through.
    due = (report["time_ns"] - report["reached_ns"]) / (CYCLE_US * 1000)
    assert counts["cycles"] + counts["cycles_missed"] >= 0.99 * due, f"{due:.0f} cycles were due: {told}"
    # 20,000 frames a second are sent, but for what the host was late for: it is no real-time system.
    stood = sum(line.stood(began)) / (report["time_ns"] / 1e6)
    least = due * (1 - SLEPT_THROUGH - stood)
    assert counts["cycles"] >= least, f"{counts['cycles']} of {due:.0f} cycles, expected {least:.0f}: the host stood still for {stood:.1%}"
    assert counts["cyclic_sent"] + counts["cyclic_unsent"] == counts["cycles"], told
    # Each frame has come back in time, or is lost; of the lost, those that came after all are late, or strays when their
    # number had been given anew.
    under_way = counts["frames_sent"] - counts["frames_received"] - counts["frames_lost"]
    assert 0 <= under_way <= UNDER_WAY, f"{under_way} frames are neither back nor lost: {told}"
    assert counts["frames_late"] + counts["frames_stray"] <= counts["frames_lost"], told
    never = counts["frames_lost"] - counts["frames_late"] - counts["frames_stray"]
    assert never <= UNDER_WAY, f"{never} frames never came, on a cable that loses none: {told}"
    for name in ("frames_duplicate", "frames_truncated", "frames_foreign"):
        assert counts[name] == 0, told
    # A working counter is wrong only while a SubDevice is not in OP, and it leaves OP only when the host let its watchdog
    # expire: then cycles of at least that length were lost or missed.
    if counts["working_counter_errors"]:
        without = (counts["cyclic_lost"] + counts["cycles_missed"]) * CYCLE_US / 1000
        assert expired and without >= WATCHDOG_MS, f"{expired} watchdogs expired, {without:.0f} ms without outputs: {told}"
        line.notes.append(f"the host stood still for longer than a watchdog: {counts['working_counter_errors']} cycles short")
    print(f"    {CYCLE_US} µs, {due:.0f} cycles: {told}; late by {report['lateness']}", flush=True)
