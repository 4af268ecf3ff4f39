"""SOEM drives a line and counts how it fares, until it is ended: `ask_soem.py INTERFACE CYCLE_US [recover]`.

Process data in each cycle, states of all every 50 ms; with `recover`, what is not in OP is brought back. Prints {"at": "op"}
once all are in OP, and at its end (SIGINT) {"cycles", "lost", "short", "late", "longest_us", "not_in_op"}: exchanges, those
whose frame did not come back, those with a working counter below the usual one, cycles that began more than half a cycle
late, the longest exchange, and looks at the states that did not find all in OP.
"""

import json
import signal
import sys
import time

import pysoem

import beside_soem
import peer
import soem

STATES_EVERY_S = 0.05
# As long as a frame is waited for.
TIMEOUT_US = 2_000


def main():
    _, interface, cycle_us, *options = sys.argv
    cycle_s = int(cycle_us) / 1e6
    stop = Stop()
    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= 0:
            peer.refuse("config_init found nothing")
        _, send = soem.configure(master)
        soem.to_op(master, send, cycle_s)
        usual = max(exchange(master, send) for _ in range(50))
        print(json.dumps({"at": "op"}), flush=True)
        drive(master, send, cycle_s, usual, stop, "recover" in options)
    finally:
        master.close()


class Stop:
    """Set by SIGINT, so that the counts are printed."""

    def __init__(self):
        self.wanted = False
        signal.signal(signal.SIGINT, self.set)

    def set(self, *_):
        self.wanted = True


def exchange(master, send):
    send()
    return master.receive_processdata(TIMEOUT_US)


def drive(master, send, cycle_s, usual, stop, recovers):
    counts = dict(cycles=0, lost=0, short=0, late=0, longest_us=0, not_in_op=0)
    states_at = due = time.monotonic()
    while not stop.wanted:
        begin = time.monotonic()
        wkc = exchange(master, send)
        end = time.monotonic()
        counts["cycles"] += 1
        counts["lost"] += wkc < 0
        counts["short"] += 0 <= wkc < usual
        counts["late"] += begin > due + cycle_s / 2
        counts["longest_us"] = max(counts["longest_us"], round((end - begin) * 1e6))
        if end >= states_at:
            states_at = end + STATES_EVERY_S
            if recovers:
                beside_soem.bring_back(master)
            else:
                counts["not_in_op"] += master.read_state() != pysoem.OP_STATE
        due = max(due + cycle_s, end)
        time.sleep(max(0.0, due - time.monotonic()))
    print(json.dumps(counts), flush=True)


if __name__ == "__main__":
    main()
