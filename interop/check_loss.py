"""A SubDevice loses its power while a foreign MainDevice runs: what that one sees, and how the line comes back."""

import time

from bench import NEAR, Segment
from harness import CRAB, CYCLE_US, LINE, LINESMAN, SOEM, check, found, ran, rounds_file, until_present, values_came_back

# The analogue input terminal; one with outputs is behind it.
TERMINAL, BEHIND = "A1", "A2"
DIP_MS = 200
# Those that stay: coupler, digital inputs and outputs.
LEFT = 3


@check
def soem_brings_back_a_subdevice_that_lost_its_power(line):
    with Segment(line, LINESMAN, LINE.file) as segment:
        rounds, wires = LINE.draw(2, seed=5), segment.wires()
        file = rounds_file(line, LINE, rounds)
        began = time.monotonic()
        with line.telling(*SOEM.command("soem_recover.py"), NEAR, CYCLE_US, file) as client:
            told = client.next(30)
            assert told == {"at": "op", "wkc": LINE.wkc()}, told
            dip(segment)
            assert client.next(30) == {"at": "lost"}
            assert client.next(70) == {"at": "back"}
            result = client.next(30)
        ran(line, result | {"began": began}, LINE)
        values_came_back(result, LINE, rounds, wires)
        numbers = {name: number for number, (name, _, _) in enumerate(LINE.devices, 1)}
        # The terminal begins anew; the one behind it was out of reach, and its watchdog took it to SAFEOP.
        assert [numbers[TERMINAL], "configured anew"] in result["steps"], result["steps"]
        assert [numbers[BEHIND], "error acknowledged"] in result["steps"], result["steps"]
        assert all(number > LEFT for number, _ in result["steps"]), result["steps"]


@check
def ethercrab_sees_a_subdevice_that_lost_its_power(line):
    with Segment(line, LINESMAN, LINE.file) as segment:
        whole = {"wkc": LINE.wkc(), "in_op": len(LINE)}
        with line.telling(*CRAB.command(), NEAR, "loss", CYCLE_US) as client:
            client.until(whole, 30)
            dip(segment)
            # What is left answers as before; the others are told as not in OP. No exchange fails for it.
            seen = client.until({"wkc": LINE.wkc(LEFT), "in_op": LEFT}, 30)
            failed = [one["error"] for one in seen if "error" in one and "Timeout" not in one["error"]]
            assert not failed, f"exchanges failed: {failed}"
        until_present(line, len(LINE))
        # It cannot bring one back, but whoever begins anew finds the line whole.
        rounds = LINE.draw(2)
        for next_client in (CRAB, SOEM):
            result = next_client.exchange(line, LINE, rounds)
            found(result, LINE, next_client)
            ran(line, result, LINE)
            values_came_back(result, LINE, rounds, segment.wires())


def dip(segment):
    segment.ask(do="inject", fault={"kind": "brown-out", "device": TERMINAL, "dip_ms": DIP_MS})
