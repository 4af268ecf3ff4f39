"""Foreign MainDevices, and Linesman itself, against a virtual segment over a virtual cable.

Needs root. Run it with `cargo xtask interop`, which builds what it needs; or by hand with LINESMAN
set to the binary, and ETHERCRAB_PEER to the peer in `interop/ethercrab`. Each check prints one line
that begins with `ok`, `FAIL` or `skip`; the exit status is 1 when one failed.
"""

import importlib.util
import os
import sys
import time
import traceback

from bench import FAR, FAR_B, HERE, NEAR, NEAR_B, Bench, Segment, parse

LINESMAN = os.environ.get("LINESMAN", "linesman")
ETHERCRAB = os.environ.get("ETHERCRAB_PEER", "")
FILE = HERE / "segment.toml"

# What stands in segment.toml, as its makers number it: vendor 2, and the type number in the high half
# of the product code.
VENDOR = 2
PRODUCTS = [0x044C2C52, 0x03F03052, 0x07D83052, 0x0C203052, 0x10063052]
# Positions in that file, from 0.
DIGITAL_IN, DIGITAL_OUT, ANALOG_IN = 1, 2, 3
# The source address SOEM sends from, and what the segment makes of it on the way back.
SOEM = "01:01:01:01:01:01"

CYCLES, CYCLE_US = 400, 2000
CHECKS = []


class Skip(Exception):
    """Cannot be tried here."""


def check(function):
    CHECKS.append(function)
    return function


def peer(line, *command, cycles=CYCLES, on=NEAR):
    """Runs a foreign MainDevice on the near end and returns what it says."""
    quiet = ("env", "RUST_BACKTRACE=0")
    status, out, err = line.run(line.near, *quiet, *command, on, cycles, CYCLE_US, seconds=60)
    assert status == 0, f"status {status}: {err[-600:]}"
    # Some stacks print words of their own before.
    return parse(out.strip().splitlines()[-1] if out.strip() else out, err)


def python_peer(line, module, script, **options):
    if importlib.util.find_spec(module) is None:
        raise Skip(f"{module} is not installed")
    return peer(line, sys.executable, HERE / script, **options)


def is_the_line(result):
    """Every SubDevice was found, by its own identity."""
    found = [tuple(device[:2]) for device in result["devices"]]
    expected = [(VENDOR, product) for product in PRODUCTS]
    assert found == expected, f"found {found}, expected {expected}"


def ran(result):
    """OP, nearly every exchange complete, and process data both ways."""
    assert result["state"] == "OP", result["state"]
    # The host is no real-time system: a few exchanges may be late.
    assert result["complete"] >= result["cycles"] * 0.95, (
        f"{result['complete']} of {result['cycles']} exchanges were complete"
    )
    for pattern, inputs in result["inputs"].items():
        # Outputs of the digital terminal are wired to the inputs of the other one.
        read = inputs[DIGITAL_IN]
        assert read == pattern.lower(), f"wrote {pattern} to the outputs, read {read!r} at the inputs"
        assert inputs[ANALOG_IN], "the analogue terminal gave no inputs"


# proves: ESC-05
@check
def soem_takes_the_line_to_op(line):
    with Segment(line, LINESMAN, FILE) as segment:
        # All ports have opened by themselves: the first frame ever, without any address, meets all.
        assert segment.present == len(PRODUCTS), segment.present
        result = python_peer(line, "pysoem", "soem.py")
        is_the_line(result)
        ran(result)


@check
def ethercrab_takes_the_line_to_op(line):
    if not os.access(ETHERCRAB, os.X_OK):
        raise Skip("ETHERCRAB_PEER is not built")
    with Segment(line, LINESMAN, FILE):
        result = peer(line, ETHERCRAB)
        is_the_line(result)
        ran(result)


@check
def kickcat_takes_the_line_to_op(line):
    with Segment(line, LINESMAN, FILE):
        result = python_peer(line, "kickcat", "kickcat_peer.py")
        assert result["devices"] == len(PRODUCTS), result["devices"]
        ran(result)


@check
def one_foreign_maindevice_after_the_other(line):
    """What one leaves behind does not stop the next."""
    with Segment(line, LINESMAN, FILE):
        for _ in range(2):
            result = python_peer(line, "pysoem", "soem.py", cycles=100)
            is_the_line(result)
            ran(result)


# proves: RED-01 partial: a foreign MainDevice in a ring that breaks while it runs
@check
def soem_keeps_a_ring_that_breaks(line):
    ring(line, "pysoem", "soem.py")


@check
def kickcat_keeps_a_ring_that_breaks(line):
    ring(line, "kickcat", "kickcat_peer.py")


def ring(line, module, script):
    """The break comes five seconds after the start, amid the exchanges of some twelve seconds."""
    with Segment(line, LINESMAN, HERE / "ring.toml", on=f"{FAR}+{FAR_B}") as segment:
        assert segment.present == 4, f"{segment.present} answered before the break"
        result = python_peer(line, module, script, cycles=5000, on=f"{NEAR}+{NEAR_B}")
        assert result["state"] == "OP", result["state"]
        # One frame may have been crossing the break; a few more may be late on a busy host.
        assert result["complete"] >= result["cycles"] * 0.99, result["complete"]
        for pattern, inputs in result["inputs"].items():
            assert inputs[DIGITAL_IN] == pattern.lower(), (pattern, inputs)
        status, out, _ = line.python(line.near, "probe.py", f"{NEAR}+{NEAR_B}")
        assert (status, out) == (0, "2\n"), f"the ring did not break: {out!r} answer on the first card"


# proves: FRM-19 partial: seen from beside, without the acyclic reading
@check
def a_listener_beside_soem_sees_the_line_cut(line):
    with Segment(line, LINESMAN, HERE / "cut.toml"):
        listener = line.start(line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--seconds", 12, "--json")
        time.sleep(0.7)
        result = python_peer(line, "pysoem", "soem.py", cycles=4000)
        assert 0 < result["complete"] < result["cycles"], f"no cut: {result['complete']} complete"
        status, out, err = line.finish(listener)
        diagnosis = parse(out, err)
        assert status == 1 and diagnosis["verdict"] == "faulty", (status, diagnosis["verdict"])
        assert diagnosis["network"]["devices"] == len(PRODUCTS), diagnosis["network"]
        texts = [one["text"] for finding in diagnosis["findings"] for one in finding["evidence"]]
        # Two of the terminals are cut off: one with inputs (1), one with outputs (2).
        assert any("3 instead of 6" in text for text in texts), (names(diagnosis), texts)


@check
def linesman_scans_the_same_line(line):
    with Segment(line, LINESMAN, FILE):
        status, out, err = line.run(line.near, LINESMAN, "scan", NEAR, "--json")
        assert status == 0, f"status {status}: {err[-600:]}"
        scan = parse(out, err)
        assert scan["schema"] == "linesman.scan/1", scan["schema"]
        found = [(device["vendor_id"], device["product_code"]) for device in scan["devices"]]
        assert found == [(VENDOR, product) for product in PRODUCTS], found
        assert [device["no"] for device in scan["devices"]] == [1, 2, 3, 4, 5]
        # The line of the file: each hangs on port B of the one before, the first on the MainDevice.
        for device in scan["devices"]:
            entry = next(port for port in device["ports"] if port["port"] == "A")
            before = {"no": device["no"] - 1, "port": "B" if device["no"] > 1 else "A"}
            assert entry["link"] and entry["open"] and entry["to"] == before, (device["no"], entry)


@check
def linesman_judges_the_idle_line_healthy(line):
    with Segment(line, LINESMAN, FILE):
        status, out, err = line.run(line.near, LINESMAN, "diagnose", NEAR, "--seconds", 2, "--json")
        diagnosis = parse(out, err)
        assert status == 0, f"status {status}, {diagnosis['verdict']}: {names(diagnosis)}"
        assert diagnosis["schema"] == "linesman.diagnosis/1"
        assert diagnosis["network"]["devices"] == len(PRODUCTS), diagnosis["network"]


@check
def a_listener_beside_soem_sends_nothing(line):
    with Segment(line, LINESMAN, FILE):
        # While nobody else sends, every frame on this end would be the listener's.
        before = line.sent_near()
        status, out, err = line.run(line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--seconds", 1, "--json")
        assert line.sent_near() == before, "the listener sent frames on the idle line"
        # Nothing was heard, so nothing can be judged.
        assert status in (2, 3), f"status {status}: {out[:300]} {err[-300:]}"

        watch = watcher(line)
        listener = line.start(line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--seconds", 5, "--json")
        time.sleep(0.7)
        result = python_peer(line, "pysoem", "soem.py")
        status, out, err = line.finish(listener)
        seen = watched(line, watch)
        assert set(seen) == {SOEM}, f"others sent as well: {seen}"
        ran(result)
        diagnosis = parse(out, err)
        assert status == 0, f"status {status}, {diagnosis['verdict']}: {names(diagnosis)}"
        assert diagnosis["verdict"] == "healthy", names(diagnosis)
        network = diagnosis["network"]
        assert network["devices"] == len(PRODUCTS), network
        assert network["al_state_highest"] == "OP", network
        # Each exchange is at least one datagram that was judged.
        assert network["datagrams"] >= CYCLES, network


@check
def linesman_leaves_a_driven_line_alone(line):
    with Segment(line, LINESMAN, FILE):
        if importlib.util.find_spec("pysoem") is None:
            raise Skip("pysoem is not installed")
        watch = watcher(line)
        driver = line.start(line.near, sys.executable, HERE / "soem.py", NEAR, 2000, CYCLE_US)
        time.sleep(2)
        for command in (["scan", NEAR, "--json"], ["diagnose", NEAR, "--seconds", 1, "--json"]):
            status, out, err = line.run(line.near, LINESMAN, *command)
            assert status == 2, f"{command[0]}: status {status}: {out[:300]} {err[-300:]}"
            assert "listen:" in out + err, f"{command[0]} does not point to listen: {err}"
        status, out, err = line.finish(driver)
        assert status == 0, err[-600:]
        ran(parse(out.strip().splitlines()[-1], err))
        seen = watched(line, watch)
        assert set(seen) == {SOEM}, f"frames of others were on the line: {seen}"


def watcher(line):
    process = line.start(line.far, sys.executable, HERE / "watch.py", FAR)
    assert process.stdout.readline() == "ready\n"
    return process


def watched(line, process):
    process.send_signal(2)
    _, out, err = line.finish(process, 10)
    return parse(out, err)


def names(diagnosis):
    return [(finding["code"], finding["cause"], finding["place"]) for finding in diagnosis["findings"]]


def main():
    wanted = sys.argv[1:]
    failed = 0
    with Bench() as line:
        for function in CHECKS:
            name = function.__name__
            if wanted and name not in wanted:
                continue
            try:
                function(line)
                print(f"ok {name}", flush=True)
            except Skip as why:
                print(f"skip {name}: {why}", flush=True)
            except Exception as error:
                failed += 1
                print(f"FAIL {name}: {type(error).__name__}: {error}", flush=True)
                if not isinstance(error, (AssertionError, RuntimeError)):
                    traceback.print_exc()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
