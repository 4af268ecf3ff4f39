"""Linesman beside other MainDevices: same far end, same host, same run. Run it with `cargo xtask bench-peers`.

From its begin to OP of all SubDevices, each known by its identity, and CPU time per cycle, for lines of 2, 32, 128 and 256. The far end is
`linesman sim` in another process, behind a virtual cable. Each kind takes turns with the others; the best of three
counts, since other programs disturb whole runs. CPU time is that of the whole process, Python's share of SOEM's
included.
"""

import json
import os
import resource
import sys
import time

from bench import FAR, HERE, NEAR, Bench
from plant import KINDS, Plant

LINESMAN = os.environ.get("LINESMAN", "linesman")
ETHERCRAB = os.environ.get("ETHERCRAB_PEER", "")
LENGTHS = [int(word) for word in os.environ.get("LENGTHS", "2,32,128,256").split(",")]
TURNS = int(os.environ.get("TURNS", "3"))
SECONDS, CYCLE_US = 3, 1000
# Who takes longer than this to OP does so once a line: the next turn would tell nothing new.
SLOW_MS = 10_000


def line_of(count):
    """A coupler with terminals, in and out by turns."""
    text = '[[device]]\nname = "K"\ntype = "EK1100"\non = "maindevice"\n'
    before = "K"
    for number in range(1, count):
        kind = ("EL1008", "EL2008")[number % 2]
        text += f'[[device]]\nname = "T{number}"\ntype = "{kind}"\non = "{before}.B"\n'
        before = f"T{number}"
    return text


def identities(file):
    """Vendor and product of each, in the order in which frames pass."""
    plant = Plant(file)
    return [[vendor, product] for vendor, (_, _, product) in zip(plant.vendors, plant.devices)]


def timed(line, *command):
    """Runs a MainDevice; what it prints, and the CPU time of its process in s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    status, out, err = line.run(line.near, *command, seconds=120)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # 1: it ran, and found something wrong with the line; a busy host makes cycles late.
    if status not in (0, 1) or "{" not in out:
        return None, " ".join((err or out).split())[:120]
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(out[out.index("{"):]), cpu


def ours(line, file):
    told, cpu = timed(line, LINESMAN, "run", "--on", NEAR, "--seconds", SECONDS, "--cycle-us", CYCLE_US, "--json")
    if told is None:
        return None, cpu
    if told["error"] or told["reached_ns"] is None:
        return None, told["error"] or "OP is not reached"
    # Each is read from its SII by the scan, and known by its station address from then on.
    types = [device["name"].split("(")[-1].rstrip(")") for device in told["devices"]]
    found = [[KINDS[name].vendor, KINDS[name].products[0]] for name in types]
    assert found == identities(file), types
    return {"op_ms": told["reached_ns"] / 1e6, "cycles": told["counts"]["cycles"], "cpu": cpu}, ""


def theirs(line, file, *command):
    told, cpu = timed(line, *command, NEAR, "speed", SECONDS, CYCLE_US)
    if told is None:
        return None, cpu
    assert told["identities"] == identities(file), told["identities"]
    return {"op_ms": told["op_ms"], "cycles": told["cycles"], "cpu": cpu}, ""


def kinds():
    yield "linesman", ours
    yield "SOEM", lambda line, file: theirs(line, file, sys.executable, HERE / "soem_speed.py")
    if os.access(ETHERCRAB, os.X_OK):
        yield "ethercrab", lambda line, file: theirs(line, file, ETHERCRAB)


def main():
    failed = 0
    with Bench() as line:
        print(f"{'SubDevices':>10}  {'MainDevice':<10} {'to OP':>10} {'ratio':>6} {'CPU/cycle':>10} {'ratio':>6}", flush=True)
        for count in LENGTHS:
            file = line.path("line.toml")
            file.write_text(line_of(count))
            best, why = {}, {}
            for _ in range(TURNS):
                for name, measure in kinds():
                    if name in why or best.get(name, {"op_ms": 0})["op_ms"] > SLOW_MS:
                        continue
                    socket = line.path("control")
                    far = line.start(line.far, LINESMAN, "sim", file, "--on", FAR, "--control", socket)
                    try:
                        wait_for(socket, far)
                        found, words = measure(line, file)
                    finally:
                        far.send_signal(2)
                        far.communicate(timeout=10)
                        line.running.remove(far)
                    if found is None:
                        why[name] = words
                        continue
                    # Who is in OP too late has no cycle to be measured in.
                    found["cpu_us"] = found["cpu"] * 1e6 / found["cycles"] if found["cycles"] > 100 else float("inf")
                    so_far = best.setdefault(name, found)
                    for key in ("op_ms", "cpu_us"):
                        so_far[key] = min(so_far[key], found[key])
            base = best.get("linesman")
            for name, _ in kinds():
                if name not in best:
                    print(f"{count:>10}  {name:<10} not measured: {why.get(name, '')}", flush=True)
                    failed += name == "linesman"
                    continue
                told = best[name]
                ratios = [told[key] / base[key] if base else float("nan") for key in ("op_ms", "cpu_us")]
                print(
                    f"{count:>10}  {name:<10} {told['op_ms']:>7.1f} ms {ratios[0]:>6.2f} "
                    f"{told['cpu_us']:>7.1f} µs {ratios[1]:>6.2f}", flush=True,
                )
    return 1 if failed else 0


def wait_for(socket, process):
    for _ in range(2000):
        if socket.exists():
            return
        if process.poll() is not None:
            raise RuntimeError("the segment does not start")
        time.sleep(0.01)
    raise RuntimeError("the segment does not start")


if __name__ == "__main__":
    sys.exit(main())
