"""What the checks share: which there are, how foreign MainDevices are run, what a good run is."""

import importlib.util
import json
import os
import sys
import time

from bench import HERE, NEAR, Segment, Watch, parse
from plant import Plant

LINESMAN = os.environ.get("LINESMAN", "linesman")
ETHERCRAB = os.environ.get("ETHERCRAB_PEER", "")

ONE, LINE, TREE = (Plant(HERE / name) for name in ("one.toml", "segment.toml", "tree.toml"))

CYCLES, CYCLE_US, ROUNDS = 800, 2000, 4
# The process data watchdog of a SubDevice, unless it is told otherwise.
WATCHDOG_MS = 100
CHECKS = []


class Skip(Exception):
    """Cannot be tried here."""


class Spoiled(AssertionError):
    """The host, by the check's own count, did by itself so much that it hides what the check looks for."""


def check(function):
    CHECKS.append(function)
    return function


class Client:
    """A foreign MainDevice."""

    def __init__(self, name, tells_identity=True):
        self.name, self.tells_identity = name, tells_identity

    def command(self, script=None):
        if self.name == "ethercrab":
            if not os.access(ETHERCRAB, os.X_OK):
                raise Skip("ETHERCRAB_PEER is not built")
            return ["env", "RUST_BACKTRACE=0", ETHERCRAB]
        module = {"soem": "pysoem", "kickcat": "kickcat", "ebpfcat": "ebpfcat"}[self.name]
        if importlib.util.find_spec(module) is None:
            raise Skip(f"{module} is not installed")
        return [sys.executable, HERE / (script or {"soem": "soem.py", "kickcat": "kickcat_peer.py", "ebpfcat": "ebpfcat_peer.py"}[self.name])]

    def run(self, line, *arguments, script=None, seconds=60):
        """Runs it on the near end; gives the object it prints."""
        began = time.monotonic()
        status, out, err = line.run(line.near, *self.command(script), *arguments, seconds=seconds)
        assert status == 0, f"status {status}: {err[-600:]}"
        # Some stacks print words of their own before.
        result = parse(out.strip().splitlines()[-1] if out.strip() else out, err)
        result["began"] = began
        if (attempts := result.get("attempts", 1)) > 1:
            line.notes.append(f"{self.name} needed {attempts} attempts to find the line")
        return result

    def exchange(self, line, plant, rounds, cycles=CYCLES, *options, on=NEAR, cycle_us=CYCLE_US, seconds=240):
        """Takes a plant to OP and writes these rounds of values."""
        return self.run(line, on, cycles, cycle_us, rounds_file(line, plant, rounds), *options, seconds=seconds)


SOEM, CRAB = Client("soem"), Client("ethercrab")
CAT = Client("kickcat", tells_identity=False)
EBPF = Client("ebpfcat")


def linesman(line, *arguments):
    """Runs Linesman on the near end."""
    return line.run(line.near, LINESMAN, *arguments)


def rounds_file(line, plant, rounds):
    """The output bytes of these rounds of values, as peer.py reads them."""
    file = line.path("rounds.json")
    file.write_text(json.dumps([plant.image(values, number) for number, values in enumerate(rounds)]))
    return file


def found(result, plant, client):
    """Every SubDevice was found, by its own identity."""
    if not client.tells_identity:
        assert result["devices"] == len(plant), result["devices"]
        return
    devices = [tuple(device[:2]) for device in result["devices"]]
    assert len(devices) == len(plant), f"found {len(devices)} SubDevices, expected {len(plant)}"
    for position, (device, (name, _, product)) in enumerate(zip(devices, plant.devices)):
        # Of a junction's inner controllers the data sheet tells no product.
        expected = (plant.vendors[position], product or device[1])
        assert device == expected, f"position {position} ({name}): found {device}, expected {expected}"


def ran(line, result, plant=None, cycle_us=CYCLE_US, lost=0):
    """OP, and every exchange complete, but for those that the host may have held up: it is no real-time system. `lost` is
    how many exchanges the fault that was put on the line may cost."""
    assert result["state"] == "OP", result["state"]
    if plant and "wkc" in result:
        assert result["wkc"] == plant.wkc(), f"working counter {result['wkc']}, expected {plant.wkc()}"
    stood = line.stood(result["began"])
    # Each stall holds up the exchange in which it begins, and those that were due in it.
    excused = lost + sum(1 + int(ms * 1000 / cycle_us) for ms in stood)
    incomplete = result["cycles"] - result["complete"]
    assert incomplete <= excused, (
        f"{incomplete} of {result['cycles']} exchanges were not complete; {len(stood)} stalls of {sum(stood):.0f} ms excuse {excused}"
    )
    if incomplete:
        line.notes.append(f"{incomplete} of {result['cycles']} exchanges not complete, {excused} excused")


def values_came_back(result, plant, rounds, wires, held=None):
    """Each input shows the value of the output that it is wired to, or at which it is held. Gives how many values were
    compared."""
    compared = 0
    for number, (values, image) in enumerate(zip(rounds, result["rounds"], strict=True), 1):
        shown = plant.shown(values)
        expected = plant.expected({name: shown[source] for name, source in wires.items()} | (held or {}))
        read = plant.read(image)
        wrong = {name: (read[name], value) for name, value in expected.items() if read[name] != value}
        assert not wrong, f"round {number}: (read, expected) {wrong}"
        if len(rounds) == ROUNDS:
            plant.check_drives(image, number - 1)
        compared += len(expected)
    return compared


def to_op(line, plant, client, cycles=CYCLES, *options, cycle_us=CYCLE_US, look=None):
    """Finds, identifies, configures, runs; process data are right in both directions, value by value. Gives how many
    values were compared; `look` sees what else the client told."""
    with Segment(line, LINESMAN, plant.file) as segment:
        # All ports have opened by themselves: the first frame ever, without any address, meets all.
        assert segment.present == len(plant), segment.present
        rounds = plant.draw(ROUNDS)
        wires = segment.wires()
        held = {name: number % 2 for number, name in enumerate(open_inputs(plant, wires), 1)}
        for name, value in held.items():
            segment.ask(do="set", input=name, value=value)
        with Watch(segment) as watch:
            result = client.exchange(line, plant, rounds, cycles, *options, cycle_us=cycle_us)
        if look:
            look(result)
        found(result, plant, client)
        ran(line, result, plant, cycle_us)
        for number, values in enumerate(rounds, 1):
            shown = plant.shown(values)
            assert watch.saw(shown), f"round {number}: the outputs never were {shown}; last: {watch.seen[-1]}"
        return values_came_back(result, plant, rounds, wires, held)


def until_present(line, count):
    """Waits until as many SubDevices answer and have loaded their SII: they pass frames on before that."""
    for _ in range(100):
        status, out, _ = line.python(line.near, "probe.py", NEAR, "loaded")
        if status == 0 and int(out) == count:
            return
        time.sleep(0.05)
    raise AssertionError(f"{out.strip() or 'none'} are ready, expected {count}")


def open_inputs(plant, wires):
    """Digital inputs that no output leads to."""
    for _, name, _, (channels, _, _, bits) in plant.channels("inputs"):
        if bits == 1:
            yield from (one for one in (f"{name}.{channel + 1}" for channel in range(channels)) if one not in wires)


def healthy(line, status, diagnosis):
    """Nothing is wrong with the line. That this computer stood still for a moment may have been told: it shares its
    processors with others, and then that is the truth."""
    others = [finding for finding in diagnosis["findings"] if finding["severity"] != "info"]
    if others and all(finding["code"] == "X513" for finding in others):
        line.notes.append(f"the host stood still: {names(diagnosis)}")
        assert (status, diagnosis["verdict"]) == (1, "faulty"), (status, diagnosis["verdict"])
        return
    gaps = [gap for subject in diagnosis["coverage"]["subjects"] for gap in subject["gaps"] if gap["essential"]]
    # A frame that this computer handed on too late counts as lost, and nothing on the line tells of it.
    if gaps and not others and all(gap["reason"] == "frames-lost" for gap in gaps) and line.stood(line.began):
        line.notes.append(f"the host stood still: {gaps[0]['text']}")
        assert (status, diagnosis["verdict"]) == (3, "inconclusive"), (status, diagnosis["verdict"])
        return
    told = (status, diagnosis["verdict"], names(diagnosis), [gap["text"] for gap in gaps])
    assert (status, diagnosis["verdict"]) == (0, "healthy"), told


def watchdogs_expired(line):
    """How often a process data watchdog of the line has expired, by the counters of its SubDevices (0x0442): nobody sent it
    outputs for that long, or the program that plays the SubDevices stood still. They leave OP then, and working counters miss
    what they add."""
    expired = 0
    for number in range(1, len(LINE) + 1):
        status, out, err = linesman(line, "reg", NEAR, number, "read", "0x0442", "--json")
        assert status == 0, f"status {status}: {(out + err)[-600:]}"
        expired += int(parse(out, err)["bytes"], 16)
    return expired


def names(diagnosis):
    return [(finding["code"], finding["cause"], finding["place"]) for finding in diagnosis["findings"]]
