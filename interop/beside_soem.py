"""SOEM drives a line until it is ended, as its makers' examples do: `beside_soem.py INTERFACE CYCLE_US`.

Process data in each cycle, states of all every 50 ms, whatever is not in OP is brought back, and an object of each
SubDevice with a mailbox is read now and then. Prints {"at": "op"} once all are in OP.
"""

import json
import sys
import time

import pysoem

import peer
import soem
import soem_clocks
import soem_recover

STATES_EVERY_S, OBJECT_EVERY_S = 0.05, 0.4
PATIENCE_US = 20_000


def main():
    _, interface, cycle_us = sys.argv
    cycle_s = int(cycle_us) / 1e6
    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= 0:
            peer.refuse("config_init found nothing")
        _, send = soem.configure(master)
        # Who waits longer for a message starves the watchdogs.
        master.sdo_read_timeout = PATIENCE_US
        soem.to_op(master, send, cycle_s)
        print(json.dumps({"at": "op"}), flush=True)
        drive(master, send, cycle_s)
    finally:
        master.close()


def drive(master, send, cycle_s):
    talking = [slave for slave in master.slaves if soem_clocks.has_mailbox(slave)]
    states_at = object_at = due = time.monotonic()
    while True:
        send()
        master.receive_processdata(2_000)
        now = time.monotonic()
        if now >= states_at:
            states_at = now + STATES_EVERY_S
            bring_back(master)
        if now >= object_at and talking:
            object_at = now + OBJECT_EVERY_S
            ask(talking[0])
            talking.append(talking.pop(0))
        # After a long wait the next cycle is not made up for.
        due = max(due + cycle_s, now)
        time.sleep(max(0.0, due - time.monotonic()))


def bring_back(master):
    """A look at all states; the next step for each that is not in OP."""
    master.read_state()
    for slave in master.slaves:
        if slave.state != pysoem.OP_STATE or slave.is_lost:
            soem_recover.next_step(slave)


def ask(slave):
    try:
        slave.sdo_read(0x1018, 1)
    except (pysoem.SdoError, pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError, pysoem.Emergency):
        pass


if __name__ == "__main__":
    main()
