"""Linesman's MainDevice drives a ring over two cables, and the ring breaks while it runs."""

import time

from bench import FAR, FAR_B, NEAR, NEAR_B, Segment, parse
from check_linesman import watched, watcher
from check_op import RING
from check_own import wait_for
from harness import CYCLE_US, LINESMAN, check

# The terminals on both sides of the break.
BEFORE, BEHIND = 2, 3


# proves: RED-01 (V), RED-02 (V)
@check
def linesman_keeps_a_ring_that_breaks(line):
    with Segment(line, LINESMAN, RING.file, on=f"{FAR}+{FAR_B}") as segment:
        watches = [watcher(line, interface) for interface in (FAR, FAR_B)]
        began, control = time.monotonic(), line.path("run")
        run = line.start(
            line.near, LINESMAN, "run", "--on", f"{NEAR}+{NEAR_B}", "--seconds", 60, "--cycle-us", CYCLE_US, "--control", control,
            "--json",
        )
        wait_for(line, run, control, ["OP"] * len(RING))
        time.sleep(1)
        intact = online(line, control)
        assert (intact["state"]["word"], intact["present"]) == (0, len(RING)), intact["state"]
        segment.ask(do="inject", fault={"kind": "link-open", "at": "I1.B-O1.A"})
        time.sleep(2)
        # All stay, and the network says that one of the two copies of each frame is missing.
        broken = online(line, control)
        assert [device["al_state"] for device in broken["devices"]] == ["OP"] * len(RING), broken["devices"]
        assert (broken["present"], broken["state"]["word"]) == (len(RING), 0x0008), broken["state"]
        status, out, err = line.stop(run)
        report = parse(out, err)
        sources = [watched(line, watch) for watch in watches]
    assert status == 1 and report["settled"], f"status {status}: {err[-300:]}"
    assert all(device["valid"] for device in report["devices"]), report["devices"]
    kept(line, report["counts"], began)
    placed(report["diagnosis"])
    twice(report["counts"], *sources)


def kept(line, counts, began):
    """At most the frame that crossed the break was lost, but for what the host held up."""
    stood = line.stood(began)
    excused = 1 + sum(1 + int(ms * 1000 / CYCLE_US) for ms in stood)
    assert counts["cyclic_lost"] <= excused, f"{counts}; {len(stood)} stalls of {sum(stood):.0f} ms"


def placed(diagnosis):
    """One finding leads to the break."""
    ends = {(BEFORE, "B"), (BEHIND, "A")}
    places = [finding["place"] for finding in diagnosis["findings"] if finding["place"]["kind"] == "link"]
    told = [{(place[end]["no"], place[end]["port"]) for end in "ab" if place.get(end)} for place in places]
    assert ends in told, f"the break is not among {told}"


def twice(counts, first, second):
    """Each frame went out on both cards, with a source address of its own on each."""
    assert len(first) == len(second) == 1, f"source addresses on the two cards: {first}, {second}"
    (one, sent), (other, copies) = *first.items(), *second.items()
    assert one != other, f"{one} on both cards"
    assert sent == copies >= counts["cyclic_sent"] / 2, f"{sent} on the first card, {copies} on the second, {counts}"


def online(line, control):
    status, out, err = line.run(line.near, LINESMAN, "online", control, "--json")
    assert status in (0, 1), f"status {status}: {(out + err)[-300:]}"
    return parse(out, err)
