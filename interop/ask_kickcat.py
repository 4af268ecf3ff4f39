"""KickCAT drives a line and counts how it fares, until it is ended: `ask_kickcat.py INTERFACE CYCLE_US`.

As beside_kickcat.py. Prints {"at": "op"} once all are in OP, and at its end (SIGINT) {"cycles", "lost", "late", "longest_us"}:
exchanges, those that KickCAT calls failed (a frame that did not come back, or a wrong working counter), cycles that began more
than half a cycle late, and the longest exchange.
"""

import json
import sys
import time
from datetime import timedelta

import kickcat

import kickcat_peer
from ask_soem import Stop


def main():
    _, interface, cycle_us = sys.argv
    cycle_s = int(cycle_us) / 1e6
    stop = Stop()
    bus, _ = kickcat_peer.bring_up([interface])
    bus.create_mapping(4096)
    kickcat_peer.request(bus, kickcat.State.SAFE_OP)
    kickcat_peer.write(bus.slaves(), {})
    bus.process_data_no_check()
    bus.request_state(kickcat.State.OPERATIONAL)
    bus.wait_for_state(kickcat.State.OPERATIONAL, timedelta(seconds=5), lambda: bus.process_data_no_check())
    print(json.dumps({"at": "op"}), flush=True)
    counts = dict(cycles=0, lost=0, late=0, longest_us=0)
    due = time.monotonic()
    while not stop.wanted:
        begin = time.monotonic()
        try:
            bus.process_data()
        except Exception:  # its own exception type, for a wrong working counter or a lost frame
            counts["lost"] += 1
        end = time.monotonic()
        counts["cycles"] += 1
        counts["late"] += begin > due + cycle_s / 2
        counts["longest_us"] = max(counts["longest_us"], round((end - begin) * 1e6))
        due = max(due + cycle_s, end)
        time.sleep(max(0.0, due - time.monotonic()))
    print(json.dumps(counts), flush=True)


if __name__ == "__main__":
    main()
