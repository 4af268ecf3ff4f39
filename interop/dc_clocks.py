"""Foreign MainDevices align clocks whose quartzes are far apart, and run in step with SYNC0: a line whose quartzes warm
up, and the tree of thirty with all its process data."""

import random
import re

from bench import HERE
from harness import CRAB, SOEM, TREE, check, to_op
from plant import Plant

CLOCKS = Plant(HERE / "dc.toml")
# SYNC0 comes much rarer than frames: a SubDevice gives up after four without one, and the host may be busy for a while.
CYCLES, CYCLE_US, SYNC0 = 800, 4_000, "sync0=100000000"
SETTLED_NS = 100
# How far a quartz of the tree is off at most.
PPM = 50


# proves: DC-01 partial: a foreign MainDevice aligns the clocks of a virtual line
@check
def soem_aligns_clocks_and_runs_in_step_with_sync0(line):
    to_op(line, CLOCKS, SOEM, CYCLES, SYNC0, cycle_us=CYCLE_US, look=lambda result: aligned(result, CLOCKS))


# proves: DC-01 partial: a second foreign MainDevice
@check
def ethercrab_aligns_clocks_and_runs_in_step_with_sync0(line):
    to_op(line, CLOCKS, CRAB, CYCLES, SYNC0, cycle_us=CYCLE_US, look=lambda result: aligned(result, CLOCKS))


@check
def soem_takes_the_tree_to_op_in_step_with_sync0(line):
    tree_in_step(line, SOEM)


@check
def ethercrab_takes_the_tree_to_op_in_step_with_sync0(line):
    tree_in_step(line, CRAB)


def tree_in_step(line, client):
    tree = Plant(with_quartzes(TREE.file, line.path("tree.toml")))
    compared = to_op(line, tree, client, CYCLES, SYNC0, cycle_us=CYCLE_US, look=lambda result: aligned(result, tree))
    assert compared >= 200, compared


def with_quartzes(file, to):
    """The same segment, in which each quartz is off by an amount of its own."""
    chance = random.Random(3)

    def quartz(found):
        return f"{found[0]}\nclock_ppm = {chance.uniform(-PPM, PPM):.1f}"

    to.write_text(re.sub(r"^type = .*$", quartz, file.read_text(), flags=re.MULTILINE))
    return to


def aligned(result, plant):
    """Each clock shows the time of the first; each SubDevice that can goes by SYNC0."""
    clocks = result["clocks"]
    expected = plant.clocked()
    assert clocks["clocked"] == expected, f"clocks at {clocks['clocked']}, expected {expected}"
    expected = plant.in_step()
    assert clocks["in_step"] == expected, f"in step are {clocks['in_step']}, expected {expected}"
    far = [(place, off) for place, off in zip(clocks["clocked"][1:], clocks["after"], strict=True) if off >= SETTLED_NS]
    assert not far, f"(position, ns off) {far}; all: {clocks['after']}"
    # Each metre of cable takes some 5 ns, each controller less than a microsecond.
    delays = clocks["delays"]
    assert delays[0] == 0 and all(0 < delay < 1_000 * len(plant) for delay in delays[1:]), f"delays {delays}"
    if "before" in clocks:
        assert max(clocks["before"]) > 10 * SETTLED_NS, f"there was nothing to align: {clocks['before']}"
    if "modes" in clocks:
        assert clocks["modes"] and set(clocks["modes"]) == {2}, f"in step with SYNC0 is 2: {clocks['modes']}"
