"""SOEM prints the error counters of all SubDevices beside its cycle, twice: `soem_counters.py INTERFACE CYCLE_US PAUSE_S`.

The lines are those of docs/guide/observations.md, for `linesman diagnose`.
"""

import sys
import time

import pysoem

import peer
import soem


# Of the frames that ask, the damage of the check spoils some; a program that people use asks again.
ATTEMPTS = 20


def counters(slave):
    """The error counters of a SubDevice, 0x0300 to 0x0313."""
    for _ in range(ATTEMPTS - 1):
        try:
            return bytes(slave._fprd(0x0300, 20))
        except pysoem.WkcError:
            continue
    return bytes(slave._fprd(0x0300, 20))


def main():
    _, interface, cycle_us, pause_s = sys.argv
    cycle_s = int(cycle_us) / 1e6
    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= 0:
            peer.refuse("config_init found nothing")
        _, send = soem.configure(master)
        soem.to_op(master, send, cycle_s)
        for pause in (float(pause_s), 0.0):
            # Outputs go on: no watchdog has to step in.
            for n, slave in enumerate(master.slaves, 1):
                send()
                master.receive_processdata(2_000)
                print(f"slave {n} 0x0300: {counters(slave).hex(' ')}", flush=True)
            end = time.monotonic() + pause
            while time.monotonic() < end:
                send()
                master.receive_processdata(2_000)
                time.sleep(cycle_s)
    finally:
        master.close()


if __name__ == "__main__":
    main()
