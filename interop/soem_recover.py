"""SOEM brings back a SubDevice that lost its power while all were running, as its makers' examples do it.

`SOEM_RECOVER.py INTERFACE CYCLE_US ROUNDS.json`. Prints lines of JSON: {"at": "op"} once all are in OP, {"at": "lost"} when
the working counter falls, {"at": "back"} when all are in OP again and it is as before, and then what peer.py says of the
rounds, which are exchanged after that. `steps` tells what SOEM did to which SubDevice, by number.
"""

import json
import pathlib
import sys
import time
import types

import pysoem

import peer
import soem

ERROR, ACKNOWLEDGE = 0x10, 0x10
# How long the line may take to lose something, and to be whole again.
PATIENCE_S = 60


def main():
    _, interface, cycle_us, rounds = sys.argv
    asked = types.SimpleNamespace(
        cycles=400, cycle_s=int(cycle_us) / 1e6, rounds=json.loads(pathlib.Path(rounds).read_text()),
    )
    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= 0:
            peer.refuse("config_init found nothing")
        _, send = soem.configure(master)
        soem.to_op(master, send, asked.cycle_s)
        _, whole, _ = soem.exchange(master, send, types.SimpleNamespace(cycles=50, cycle_s=asked.cycle_s, rounds=[{}]))
        tell(at="op", wkc=whole)
        # A frame that is late on a busy host is no loss: several in a row are.
        until(lambda: all(cycle(master, send, asked) < whole for _ in range(5)), "nothing was lost")
        tell(at="lost")
        steps = []
        until(lambda: is_whole(master, send, asked, whole, steps), lambda: "not brought back: " + soem.states(master))
        tell(at="back")
        complete, wkc, inputs = soem.exchange(master, send, asked)
        state = "OP" if master.state_check(pysoem.OP_STATE, 50_000) == pysoem.OP_STATE else soem.states(master)
        soem.stop(master)
        peer.report(
            state=state, wkc=wkc, cycles=asked.cycles, complete=complete, rounds=inputs, steps=steps,
        )
    finally:
        master.close()


def is_whole(master, send, asked, whole, steps):
    """Goes on exchanging, looks at all SubDevices, does what is next for each that is not in OP."""
    wkcs = [cycle(master, send, asked) for _ in range(20)]
    master.read_state()
    missing = False
    for number, slave in enumerate(master.slaves, 1):
        if slave.state == pysoem.OP_STATE and not slave.is_lost:
            continue
        missing = True
        step = next_step(slave)
        if step and (not steps or steps[-1] != [number, step]):
            steps.append([number, step])
    return not missing and wkcs[-1] == whole


def next_step(slave):
    if slave.is_lost:
        if slave.state != pysoem.NONE_STATE:
            slave.is_lost = False
            return "found"
        if slave.recover(500):
            slave.is_lost = False
            return "recovered"
        return None
    if slave.state == pysoem.SAFEOP_STATE | ERROR:
        slave.state = pysoem.SAFEOP_STATE | ACKNOWLEDGE
        slave.write_state()
        return "error acknowledged"
    if slave.state == pysoem.SAFEOP_STATE:
        slave.state = pysoem.OP_STATE
        slave.write_state()
        return "asked for OP"
    if slave.state > pysoem.NONE_STATE:
        return "configured anew" if slave.reconfig(500) else None
    slave.state_check(pysoem.OP_STATE, 2_000)
    if slave.state == pysoem.NONE_STATE:
        slave.is_lost = True
        return "lost"
    return None


def cycle(master, send, asked):
    send()
    wkc = master.receive_processdata(20_000)
    time.sleep(asked.cycle_s)
    return wkc


def until(done, why):
    end = time.monotonic() + PATIENCE_S
    while not done():
        if time.monotonic() > end:
            peer.refuse(why() if callable(why) else why)


def tell(**line):
    print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
