"""Rings that break: cycles that Linesman, SOEM and KickCAT lose on the same segment. Needs root; run it by hand:

    LINESMAN=target/release/linesman python interop/bench_ring.py

with a Python that has `pysoem` and `kickcat` (target/interop-venv/bin/python, once `cargo xtask interop` has run). The ring is
`linesman sim` in another process, on two virtual cables: six boxes, seven cables. Each cable is cut, and cut and mended, at
several moments of the cycle, in a run of its own, the MainDevices taking turns. A cycle is lost when the process data of some
SubDevice do not come back in it. A run that loses cycles before its event is not judged and done again: the host was busy.
"""

import json
import os
import sys
import time

from bench import FAR, FAR_B, NEAR, NEAR_B, HERE, Bench, Segment, parse

LINESMAN = os.environ.get("LINESMAN", "linesman")
BOXES = int(os.environ.get("BOXES", "6"))
PHASES = int(os.environ.get("PHASES", "4"))
CYCLE_US = int(os.environ.get("CYCLE_US", "4000"))
ATTEMPTS = 3
ON = f"{NEAR}+{NEAR_B}"
# A link needs up to 2 s to come up.
MENDED_S, QUIET_S = 3.0, 0.4


def plant():
    """Boxes in a ring, and its cables."""
    text, cables, on = "", [], "maindevice"
    for number in range(BOXES):
        text += f'[[device]]\nname = "B{number}"\ntype = "EP2308-0001"\non = "{on}"\n'
        cables.append(f"{on}-B{number}.A")
        on = f"B{number}.B"
    cables.append(f"{on}-maindevice.B")
    return text + f'[ring]\ncloses_at = "{on}"\n', cables


class Peer:
    """SOEM or KickCAT, through its Python package."""

    def __init__(self, line, kind):
        self.telling = line.telling(sys.executable, HERE / "ring_peer.py", kind, ON, CYCLE_US)

    def __enter__(self):
        self.telling.__enter__()
        self.telling.until({"ready": True}, 60)
        return self

    def end(self):
        """When cycles were lost."""
        self.telling.process.send_signal(2)
        return self.telling.next(20)["bad"]

    def __exit__(self, *_):
        self.telling.__exit__()


class Own:
    """Linesman. It tells how many cycles were lost, not when: so far, and at the end."""

    def __init__(self, line, control):
        self.line, self.control = line, control
        self.run = line.start(
            line.near, LINESMAN, "run", "--on", ON, "--seconds", 60, "--cycle-us", CYCLE_US, "--control", control, "--json",
        )

    def __enter__(self):
        until = time.monotonic() + 30
        while time.monotonic() < until:
            if self.run.poll() is not None:
                raise AssertionError(f"it ended: {self.line.finish(self.run)[2][-300:]}")
            states = [one["al_state"] for one in self.online().get("devices", ())] if self.control.exists() else []
            if states and set(states) == {"OP"}:
                return self
            time.sleep(0.05)
        raise AssertionError("OP is not reached")

    def online(self):
        _, out, err = self.line.run(self.line.near, LINESMAN, "online", self.control, "--json")
        return parse(out, err)

    def end(self):
        # Each working counter that is wrong counts, so that this is the most it can be.
        _, out, err = self.line.stop(self.run)
        counts = parse(out, err)["counts"]
        return counts["cyclic_lost"] + counts["working_counter_errors"]

    def __exit__(self, *_):
        if self.run in self.line.running:
            self.line.stop(self.run)


def lost(line, file, kind, cable, phase, mends):
    """Cycles that one event costs; `None` when the host was too busy to tell."""
    with Segment(line, LINESMAN, file, on=f"{FAR}+{FAR_B}") as segment:
        driver = Own(line, line.path("run")) if kind == "Linesman" else Peer(line, kind.lower())
        with driver:
            time.sleep(QUIET_S)
            before = driver.online()["cyclic"]["lost"] if kind == "Linesman" else 0
            time.sleep(phase * CYCLE_US / PHASES / 1e6)
            at = time.monotonic()
            segment.ask(do="inject", fault={"kind": "link-open", "at": cable})
            time.sleep(QUIET_S)
            if mends:
                segment.ask(do="heal")
                time.sleep(MENDED_S)
            told = driver.end()
        if kind == "Linesman":
            return told if before == 0 else None
        return sum(one >= at - CYCLE_US / 1e6 for one in told) if all(one >= at - CYCLE_US / 1e6 for one in told) else None


def main():
    text, cables = plant()
    kinds = os.environ.get("PEERS", "Linesman,SOEM,KickCAT").split(",")
    tables = {(kind, mends): [0, 0, 0, 0] for kind in kinds for mends in (False, True)}
    worst = dict.fromkeys(tables, 0)
    with Bench() as line:
        file = line.path("ring.toml")
        file.write_text(text)
        for mends in (False, True):
            for phase in range(PHASES):
                for cable in cables:
                    for kind in kinds:
                        count = None
                        for _ in range(ATTEMPTS):
                            try:
                                count = lost(line, file, kind, cable, phase, mends)
                            except (AssertionError, RuntimeError) as error:
                                print(f"{kind}, {cable}: {error}", file=sys.stderr, flush=True)
                            if count is not None:
                                break
                        key = (kind, mends)
                        tables[key][3 if count is None else min(count, 2)] += 1
                        worst[key] = max(worst[key], count or 0)
    print(f"{BOXES} boxes, {len(cables)} cables, {PHASES} moments, cycle {CYCLE_US} µs")
    print(f"{'MainDevice':<10}  {'event':<14}  cycles lost: 0     1  more  most  not judged")
    for (kind, mends), (none, one, more, unjudged) in tables.items():
        event = "cut and mended" if mends else "cut"
        print(f"{kind:<10}  {event:<14}  {none:14}  {one:4}  {more:4}  {worst[kind, mends]:4}  {unjudged:10}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
