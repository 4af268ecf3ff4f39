"""Foreign MainDevices align the clocks of a line whose quartzes are far apart and warm up."""

from bench import HERE, NEAR, Segment
from harness import CRAB, LINESMAN, SOEM, check, ran
from plant import Plant

CLOCKS = Plant(HERE / "dc.toml")
# SYNC0 comes rarer than frames, so that a busy host does not miss it.
CYCLES, CYCLE_US, SYNC0_NS = 400, 4_000, 20_000_000
SETTLED_NS = 100


# proves: DC-01 partial: a foreign MainDevice aligns the clocks of a virtual line
@check
def soem_aligns_clocks_and_runs_in_step_with_sync0(line):
    with Segment(line, LINESMAN, CLOCKS.file) as segment:
        assert segment.present == len(CLOCKS), segment.present
        result = SOEM.run(
            line, NEAR, CYCLES, CYCLE_US, SYNC0_NS, script="soem_clocks.py", seconds=150,
        )
        aligned(result, SETTLED_NS)
        assert max(result["before"]) > 10 * SETTLED_NS, f"there was nothing to align: {result['before']}"
        assert result["modes"] and set(result["modes"]) == {2}, f"in step with SYNC0 is 2: {result['modes']}"


# proves: DC-01 partial: a second foreign MainDevice
@check
def ethercrab_aligns_clocks_and_runs_in_step_with_sync0(line):
    with Segment(line, LINESMAN, CLOCKS.file) as segment:
        assert segment.present == len(CLOCKS), segment.present
        result = CRAB.run(line, NEAR, "clocks", CYCLES, CYCLE_US, SYNC0_NS, seconds=150)
        aligned(result, SETTLED_NS)


def aligned(result, most):
    assert len(result["clocked"]) >= 5, f"clocks at {result['clocked']}"
    far = [(place, off) for place, off in zip(result["clocked"][1:], result["after"]) if off >= most]
    assert not far, f"(position, ns off) {far}; all: {result['after']}"
    delays = result["delays"]
    assert delays[0] == 0 and all(0 < delay < 5_000 for delay in delays[1:]), f"delays {delays}"
    ran(result)
