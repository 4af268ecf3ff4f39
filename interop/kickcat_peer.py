"""KickCAT as a foreign MainDevice; see peer.py. Its Python interface tells no identities."""

import sys
import time
from datetime import timedelta

import kickcat

import peer

ATTEMPTS = 6


def main():
    asked = peer.arguments()
    rounds = asked.rounds
    bus, attempts = bring_up(asked.interfaces)
    bus.create_mapping(4096)
    slaves = bus.slaves()
    request(bus, kickcat.State.SAFE_OP)
    write(slaves, rounds[0])
    bus.process_data_no_check()
    bus.request_state(kickcat.State.OPERATIONAL)
    bus.wait_for_state(
        kickcat.State.OPERATIONAL, timedelta(seconds=5), lambda: bus.process_data_no_check()
    )
    complete = 0
    inputs = []
    due = time.monotonic()
    for values in rounds:
        write(slaves, values)
        for _ in range(asked.cycles // len(rounds)):
            try:
                bus.process_data()
                complete += 1
            except Exception:  # its own exception type, for a wrong working counter or a lost frame
                pass
            due += asked.cycle_s
            time.sleep(max(0.0, due - time.monotonic()))
        inputs.append([bytes(slave.input_data).hex() for slave in slaves])
    reached = all(bus.get_state(slave) == kickcat.State.OPERATIONAL for slave in slaves)
    peer.report(
        attempts=attempts, devices=len(slaves), state="OP" if reached else "other", cycles=asked.cycles, complete=complete,
        rounds=inputs,
    )


def bring_up(interfaces):
    """All SubDevices in PREOP, and how many attempts it took."""
    first, *second = interfaces
    for attempt in range(1, ATTEMPTS + 1):
        # A new one each time: what came too late for the last attempt must not be taken for an answer in this one.
        link = kickcat.create_link(first, second[0] if second else "")
        # Without a second card it waits as long after each frame, and each frame that comes later ends everything: so it
        # is short, and there is another attempt, as a busy host is late at times.
        link.set_timeout(timedelta(milliseconds=40))
        bus = kickcat.Bus(link)
        try:
            bus.init(timedelta(seconds=3))
            return bus, attempt
        except RuntimeError as error:
            print(f"attempt {attempt}: {error}", file=sys.stderr)
            time.sleep(0.5)
    peer.refuse(f"not in PREOP after {ATTEMPTS} attempts")


def request(bus, state):
    bus.request_state(state)
    bus.wait_for_state(state, timedelta(seconds=5))


def write(slaves, values):
    for position, slave in enumerate(slaves):
        if slave.output_size:
            slave.set_output_bytes(peer.outputs(values, position, slave.output_size))


if __name__ == "__main__":
    main()
