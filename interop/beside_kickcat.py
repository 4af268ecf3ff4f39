"""KickCAT drives a line until it is ended: `beside_kickcat.py INTERFACE CYCLE_US`.

Process data and a look at the mailboxes in each cycle, the state of one SubDevice every 50 ms; it brings nothing back.
Prints {"at": "op"} once all are in OP.
"""

import itertools
import json
import sys
import time
from datetime import timedelta

import kickcat

import kickcat_peer

STATES_EVERY_S = 0.05


def main():
    _, interface, cycle_us = sys.argv
    cycle_s = int(cycle_us) / 1e6
    bus, _ = kickcat_peer.bring_up([interface])
    bus.create_mapping(4096)
    slaves = bus.slaves()
    kickcat_peer.request(bus, kickcat.State.SAFE_OP)
    kickcat_peer.write(slaves, {})
    bus.process_data_no_check()
    bus.request_state(kickcat.State.OPERATIONAL)
    bus.wait_for_state(kickcat.State.OPERATIONAL, timedelta(seconds=5), lambda: bus.process_data_no_check())
    print(json.dumps({"at": "op"}), flush=True)
    states_at = due = time.monotonic()
    for slave in itertools.cycle(slaves):
        attempt(bus.process_data)
        attempt(lambda: bus.process_mailboxes())
        while time.monotonic() < states_at:
            due = wait(due, cycle_s)
            attempt(bus.process_data)
        states_at = time.monotonic() + STATES_EVERY_S
        attempt(lambda: bus.get_state(slave))
        due = wait(due, cycle_s)


def wait(due, cycle_s):
    """Until the next cycle; after a long one it is not made up for."""
    due = max(due + cycle_s, time.monotonic())
    time.sleep(max(0.0, due - time.monotonic()))
    return due


def attempt(what):
    try:
        what()
    except Exception:  # its own exception type, for a wrong working counter or a lost frame
        pass


if __name__ == "__main__":
    main()
