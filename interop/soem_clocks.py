"""SOEM with distributed clocks: aligns them, takes all to OP in step with SYNC0, watches how far they are off.

Run as `soem_clocks.py INTERFACE CYCLES CYCLE_US SYNC0_NS`. Prints one JSON object: `clocked` (positions with a clock),
`before` and `after` (0x092C of each of these, in ns, without its sign), `delays` (0x0928), `speeds` (0x0932), `modes`
(0x1C32:01 or 0x1C33:01 of those that have the object), `state`, `cycles`, `complete`.
"""

import json
import sys
import time

import pysoem

import soem

ALIGNING = 20_000


def main():
    _, interface, cycles, cycle_us, sync0_ns = sys.argv
    cycles, cycle_s, sync0_ns = int(cycles), int(cycle_us) / 1e6, int(sync0_ns)
    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= 0:
            sys.exit("config_init found nothing")
        if not master.config_dc():
            sys.exit("config_dc found no clock")
        clocked = [place for place, slave in enumerate(master.slaves) if register(slave, 0x092C, 4) is not None]
        followers = clocked[1:]
        in_step = [slave for slave in master.slaves if has_modes(slave)]
        for slave in in_step:
            slave.dc_sync(True, sync0_ns)
        master.config_map()
        if master.state_check(pysoem.SAFEOP_STATE, 5_000_000) != pysoem.SAFEOP_STATE:
            sys.exit("SAFEOP not reached: " + soem.states(master))
        exchange(master, 50)
        before = differences(master, followers)
        exchange(master, ALIGNING)
        master.state = pysoem.OP_STATE
        master.write_state()
        for _ in range(400):
            exchange(master, 10, cycle_s)
            if master.state_check(pysoem.OP_STATE, 2_000) == pysoem.OP_STATE:
                break
        else:
            sys.exit("OP not reached: " + soem.states(master))
        complete = exchange(master, cycles, cycle_s)
        after = differences(master, followers)
        state = "OP" if master.state_check(pysoem.OP_STATE, 50_000) == pysoem.OP_STATE else soem.states(master)
        result = {
            "clocked": clocked, "before": before, "after": after,
            "delays": [register(master.slaves[place], 0x0928, 4) for place in clocked],
            "speeds": [register(master.slaves[place], 0x0932, 2) for place in clocked],
            "modes": [mode(slave) for slave in in_step],
            "state": state, "cycles": cycles, "complete": complete,
        }
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.state_check(pysoem.INIT_STATE, 500_000)
        json.dump(result, sys.stdout)
        print()
    finally:
        master.close()


def exchange(master, cycles, cycle_s=0.0):
    complete, expected = 0, 0
    due = time.monotonic()
    for _ in range(cycles):
        master.send_processdata()
        wkc = master.receive_processdata(20_000)
        if wkc > expected:
            complete, expected = 0, wkc
        complete += wkc == expected
        due += cycle_s
        time.sleep(max(0.0, due - time.monotonic()))
    return complete


def has_modes(slave):
    """Whether its synchronisation objects know SYNC0."""
    try:
        return int.from_bytes(slave.sdo_read(0x1C33, 4), "little") & 0x04 != 0
    except (pysoem.SdoError, pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError):
        return False


def mode(slave):
    return int.from_bytes(slave.sdo_read(0x1C33, 1), "little")


def register(slave, address, length):
    try:
        return int.from_bytes(slave._fprd(address, length, 20_000), "little")
    except (pysoem.WkcError, RuntimeError):
        return None


def differences(master, places):
    return [register(master.slaves[place], 0x092C, 4) & 0x7FFF_FFFF for place in places]


if __name__ == "__main__":
    main()
