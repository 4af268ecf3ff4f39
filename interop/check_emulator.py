"""Linesman's MainDevice against a SubDevice emulator that is nobody's here: KickCAT's network simulator.

It is built by hand, outside of this project, as its makers describe it: LINESMAN_KICKCAT names the program
`network_simulator`, two folders below the source it was built from. docs/peers.md has the last result.
"""

import os
import pathlib
import time

from bench import FAR, NEAR, parse
from harness import Skip, check, linesman, names

# What the configurations that come with it are: file, vendor, product.
CYCLE_US = 4_000
DEVICES = [
    ("freedom-k64f", 0x79A, 0xDEFEDE),
    ("xmc4800", 0x1337, 0x4800),
    ("ecat402-drive", 0x29C, 0x03B11002),
]


# proves: ESC-05 partial: against an emulator that is not ours
@check
def linesman_scans_and_diagnoses_another_emulator(line):
    with Emulator(line):
        status, out, err = linesman(line, "scan", NEAR, "--json")
        assert status == 0, f"scan: status {status}: {err[-600:]}"
        scan = parse(out, err)
        found = [(device["vendor_id"], device["product_code"]) for device in scan["devices"]]
        assert found == [(vendor, product) for _, vendor, product in DEVICES], found
        # A line: each hangs on port B of the one before.
        for device in scan["devices"]:
            entry = next(port for port in device["ports"] if port["port"] == "A")
            before = {"no": device["no"] - 1, "port": "B" if device["no"] > 1 else "A"}
            assert entry["to"] == before, (device["no"], entry)
        status, out, err = linesman(line, "diagnose", NEAR, "--seconds", 2, "--json")
        diagnosis = parse(out, err)
        assert status == 0 and diagnosis["verdict"] == "healthy", (status, diagnosis["verdict"], names(diagnosis))
        assert diagnosis["network"]["devices"] == len(DEVICES), diagnosis["network"]


@check
def linesman_runs_another_emulator(line):
    """To OP, and process data that come back."""
    with Emulator(line):
        arguments = ["--on", NEAR, "--seconds", 3, "--cycle-us", CYCLE_US, "--json"]
        status, out, err = linesman(line, "run", *arguments)
        run = parse(out, err)
        # 1: it ran, and there was something to tell of the line, such as a host that was late.
        assert status in (0, 1) and run["schema"] == "linesman.run/1", f"status {status}: {err[-600:]}"
        assert run["reached_ns"] is not None and run["responding"] == len(DEVICES), run
        assert [device["target"] for device in run["devices"]] == ["OP"] * len(DEVICES), run["devices"]
        assert all(device["valid"] for device in run["devices"]), run["devices"]
        counts = run["counts"]
        assert counts["working_counter_errors"] == 0 and counts["frames_stray"] == 0, counts
        back = counts["cyclic_sent"] - counts["cyclic_lost"]
        assert counts["cyclic_sent"] > 300 and back > counts["cyclic_sent"] * 0.8, counts


class Emulator:
    """KickCAT's network simulator on the far end; use it in `with`."""

    def __init__(self, line):
        program = os.environ.get("LINESMAN_KICKCAT")
        if not program:
            raise Skip("LINESMAN_KICKCAT does not name KickCAT's network_simulator")
        self.line, self.program = line, pathlib.Path(program).resolve()
        self.configurations = self.program.parents[2] / "simulation/slave_configs"
        if not os.access(self.program, os.X_OK) or not self.configurations.is_dir():
            raise Skip(f"LINESMAN_KICKCAT: {self.program} is no program, or {self.configurations} is not there")

    def __enter__(self):
        files = [self.configurations / f"{name}.json" for name, _, _ in DEVICES]
        self.process = self.line.start(self.line.far, self.program, "-i", FAR, "-s", *files)
        for _ in range(50):
            assert self.process.poll() is None, f"the emulator ended: {self.line.finish(self.process)}"
            status, out, _ = self.line.python(self.line.near, "probe.py", NEAR)
            if status == 0 and int(out) == len(DEVICES):
                return self
            time.sleep(0.1)
        raise RuntimeError("the emulator does not answer")

    def __exit__(self, *_):
        if self.process in self.line.running:
            self.line.stop(self.process)
