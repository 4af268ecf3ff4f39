"""Linesman beside other MainDevices: same far end, same host, same run. Run it with `cargo xtask bench-peers`.

From its begin to OP of all SubDevices, and CPU time per cycle in OP, for lines of 2, 32, 128 and 256. The far end is
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

LINESMAN = os.environ.get("LINESMAN", "linesman")
ETHERCRAB = os.environ.get("ETHERCRAB_PEER", "")
LENGTHS = [int(word) for word in os.environ.get("LENGTHS", "2,32,128,256").split(",")]
TURNS = int(os.environ.get("TURNS", "3"))
SECONDS, CYCLE_US = 3, 1000


def line_of(count):
    """A coupler with terminals, in and out by turns."""
    text = '[[device]]\nname = "K"\ntype = "EK1100"\non = "maindevice"\n'
    before = "K"
    for number in range(1, count):
        kind = ("EL1008", "EL2008")[number % 2]
        text += f'[[device]]\nname = "T{number}"\ntype = "{kind}"\non = "{before}.B"\n'
        before = f"T{number}"
    return text


def timed(line, *command):
    """Runs a MainDevice; what it prints, and the CPU time of its process in s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    status, out, err = line.run(line.near, *command, seconds=120)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status != 0 or not out.strip():
        return None, (err or out).strip()[-200:]
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(out[out.index("{"):]), cpu


def ours(line, count):
    told, cpu = timed(line, LINESMAN, "run", "--on", NEAR, "--seconds", SECONDS, "--cycle-us", CYCLE_US, "--json")
    if told is None:
        return None, cpu
    if told["reached_ns"] is None:
        return None, "OP is not reached"
    assert len(told["devices"]) == count, f"{len(told['devices'])} SubDevices"
    return {"op_ms": told["reached_ns"] / 1e6, "cycles": told["counts"]["cycles"], "cpu": cpu}, ""


def theirs(line, count, *command):
    told, cpu = timed(line, *command, NEAR, "speed", SECONDS, CYCLE_US)
    if told is None:
        return None, cpu
    assert told["devices"] == count, f"{told['devices']} SubDevices"
    return {"op_ms": told["op_ms"], "cycles": told["cycles"], "cpu": cpu}, ""


def kinds():
    yield "linesman", ours
    yield "SOEM", lambda line, count: theirs(line, count, sys.executable, HERE / "soem_speed.py")
    if os.access(ETHERCRAB, os.X_OK):
        yield "ethercrab", lambda line, count: theirs(line, count, ETHERCRAB)


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
                    socket = line.path("control")
                    far = line.start(line.far, LINESMAN, "sim", file, "--on", FAR, "--control", socket)
                    try:
                        wait_for(socket, far)
                        found, words = measure(line, count)
                    finally:
                        far.send_signal(2)
                        far.communicate(timeout=10)
                        line.running.remove(far)
                    if found is None:
                        why[name] = words
                        continue
                    found["cpu_us"] = found["cpu"] * 1e6 / max(1, found["cycles"])
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
