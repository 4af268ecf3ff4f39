"""SOEM, through pysoem, against the clock: `soem_speed.py INTERFACE speed SECONDS CYCLE_US`."""

import json
import sys
import time

import pysoem

import soem


def main():
    _, interface, _, seconds, cycle_us = sys.argv
    cycle, begun = int(cycle_us) / 1e6, time.monotonic()
    master = pysoem.Master()
    master.open(interface)
    try:
        master.config_init()
        identities = [[slave.man, slave.id] for slave in master.slaves]
        _, send = soem.configure(master)
        soem.to_op(master, send)
        reached = time.monotonic() - begun
        cycles, due, end = 0, time.monotonic(), begun + float(seconds)
        while time.monotonic() < end:
            send()
            master.receive_processdata(20_000)
            cycles += 1
            due += cycle
            time.sleep(max(0.0, due - time.monotonic()))
        soem.stop(master)
        print(json.dumps({"identities": identities, "op_ms": reached * 1e3, "cycles": cycles}))
    finally:
        master.close()


if __name__ == "__main__":
    main()
