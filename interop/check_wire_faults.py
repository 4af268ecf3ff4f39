"""Linesman's own MainDevice, and a cable that spoils what comes back.

800 cycles with each fault: exactly the faulty cycles are bad, what is doubled or stray costs none, each kind is counted
under its own name, and the run goes on. A host that runs other programs beside brings frames late by itself: these, too, have
to be counted as late, each of them once. Where it held a frame at the cable, or a cycle had to be left out, as many frames as
that may be counted otherwise; on a host that did neither, none. A host that did so half as often as the fault has shown nothing.
"""

import sys

from bench import FAR, HERE, NEAR, Segment, inside, parse
from harness import LINE, LINESMAN, WATCHDOG_MS, Spoiled, check, watchdogs_expired

# A cycle so long that a busy host seldom sleeps through it, and four of them end before a watchdog expires.
CYCLE_US, SETTLED, COUNTED, EVERY = 24_000, 40, 800, 20
# A host that holds a frame for longer than most of a cycle has lost it by itself.
LIMIT_MS = 16.0
# Both ends of a further cable, between what spoils and the segment.
BEFORE, BEHIND = "veth8", "veth9"
NAMES = ("frames_lost", "frames_late", "frames_duplicate", "frames_stray", "frames_truncated")


def spoiled(line, fault):
    """What Linesman counted, what the cable says it did, and how many watchdogs expired."""
    inside(line.far, "ip", "link", "add", BEFORE, "type", "veth", "peer", "name", BEHIND)
    for name in (BEFORE, BEHIND):
        inside(line.far, "sysctl", "-q", "-w", f"net.ipv6.conf.{name}.disable_ipv6=1")
        inside(line.far, "ip", "link", "set", name, "up")
    seconds = (SETTLED + COUNTED) * CYCLE_US / 1e6 + 4
    cable = line.start(
        line.far, sys.executable, HERE / "wire_faults.py", FAR, BEFORE, fault, EVERY, SETTLED, COUNTED, LIMIT_MS,
    )
    assert cable.stdout.readline().strip() == "ready"
    segment = Segment(line, LINESMAN, LINE.file, on=BEHIND)
    segment.near = NEAR
    with segment:
        status, out, err = line.run(
            line.near, LINESMAN, "run", "--on", NEAR, "--seconds", seconds, "--cycle-us", CYCLE_US, "--json",
            seconds=seconds + 60,
        )
        expired = watchdogs_expired(line)
        _, told, words = line.stop(cable)
    assert status in (0, 1), f"status {status}: {(out + err)[-600:]}"
    told, report = parse(told, words), parse(out, err)
    return report, told, expired


def judge(line, fault, cycles_lost, **counted):
    """`cycles_lost`: whether a spoiled frame costs its cycle; `counted`: the names under which it is counted."""
    report, told, expired = spoiled(line, fault)
    counts, expected = report["counts"], COUNTED // EVERY
    assert told["cyclic"] > SETTLED + COUNTED, told
    assert told["spoiled"] == expected, told
    assert report["error"] is None and report["settled"], report
    # What the cable and the run say of the host, each of them once per frame or cycle.
    excused = told["held"] + counts["cycles_missed"]
    if excused > expected // 2:
        raise Spoiled(f"{told}, {counts['cycles_missed']} cycles missed")
    latest_ms = report["lateness"]["max_ns"] / 1e6
    is_late = counts["cycles_missed"] == 0 or latest_ms > LIMIT_MS
    assert is_late, f"{counts['cycles_missed']} cycles missed, and none began more than {latest_ms:.1f} ms late"
    seen = {name: counts[name] for name in NAMES}
    wanted = {name: expected if name in counted else 0 for name in NAMES}
    # What the host brought late is lost for its cycle and comes after all.
    late = max(0, seen["frames_late"] - wanted["frames_late"])
    if late > COUNTED // 10:
        raise Spoiled(f"it brought {late} frames late")
    if late * CYCLE_US / 1e3 >= WATCHDOG_MS and expired:
        raise Spoiled(f"it stood still for longer than a watchdog, {late} frames late")
    wanted["frames_late"] += late
    wanted["frames_lost"] += late
    off = {name: seen[name] - wanted[name] for name in NAMES if abs(seen[name] - wanted[name]) > excused}
    assert not off, f"{seen}, expected {wanted} within {excused}; {told}"
    bad = expected if cycles_lost else 0
    assert bad - excused <= counts["cyclic_lost"] <= bad + late + excused, f"{counts}, expected {bad} lost; {told}"
    assert counts["working_counter_errors"] == 0, counts
    assert all(device["valid"] for device in report["devices"]), report["devices"]


@check
def doubled_frames_cost_no_cycle(line):
    judge(line, "doubled", False, frames_duplicate=True)


@check
def frames_with_an_unknown_index_cost_no_cycle(line):
    judge(line, "stray", False, frames_stray=True)


@check
def truncated_frames_cost_their_cycle(line):
    judge(line, "truncated", True, frames_truncated=True)


# What is cut off is malformed, and meant to be.
truncated_frames_cost_their_cycle.spoils_frames = True


@check
def lost_frames_cost_their_cycle(line):
    judge(line, "lost", True, frames_lost=True)


@check
def late_frames_cost_their_cycle(line):
    judge(line, "late_by_30_ms", True, frames_lost=True, frames_late=True)
