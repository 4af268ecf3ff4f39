"""SOEM, through pysoem, as a foreign MainDevice; see peer.py."""

import time

import pysoem

import peer


def main():
    interfaces, cycles, cycle_s, rounds = peer.arguments()
    master = pysoem.Master()
    master.open(*interfaces)
    try:
        found = master.config_init()
        if found <= 0:
            peer.refuse(f"config_init found {found} SubDevices")
        devices = [[slave.man, slave.id, slave.rev] for slave in master.slaves]
        names = [slave.name for slave in master.slaves]
        mapped = master.config_map()
        if master.state_check(pysoem.SAFEOP_STATE, 2_000_000) != pysoem.SAFEOP_STATE:
            peer.refuse("SAFEOP not reached: " + states(master))
        # SubDevices with outputs want process data before they go to OP.
        master.send_processdata()
        master.receive_processdata(20_000)
        master.state = pysoem.OP_STATE
        master.write_state()
        for _ in range(200):
            master.send_processdata()
            master.receive_processdata(20_000)
            if master.state_check(pysoem.OP_STATE, 10_000) == pysoem.OP_STATE:
                break
        else:
            peer.refuse("OP not reached: " + states(master))
        complete, wkc, inputs = exchange(master, cycles, cycle_s, rounds)
        state = "OP" if master.state_check(pysoem.OP_STATE, 50_000) == pysoem.OP_STATE else "other"
        # Orderly, so that no watchdog has to step in.
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.state_check(pysoem.INIT_STATE, 500_000)
        peer.report(
            devices=devices, names=names, state=state, mapped=mapped,
            wkc=wkc, cycles=cycles, complete=complete, rounds=inputs,
        )
    finally:
        master.close()


def exchange(master, cycles, cycle_s, rounds):
    # SOEM leaves SubDevices whose data fill no byte out of what it expects; the highest one seen must be seen always.
    complete, expected = 0, 0
    inputs = []
    due = time.monotonic()
    for values in rounds:
        for position, slave in enumerate(master.slaves):
            slave.output = peer.outputs(values, position, len(slave.output))
        for _ in range(cycles // len(rounds)):
            master.send_processdata()
            wkc = master.receive_processdata(20_000)
            if wkc > expected:
                complete, expected = 0, wkc
            complete += wkc == expected
            due += cycle_s
            time.sleep(max(0.0, due - time.monotonic()))
        inputs.append([slave.input.hex() for slave in master.slaves])
    return complete, expected, inputs


def states(master):
    master.read_state()
    return ", ".join(
        f"{number} {slave.name} state 0x{slave.state:02X} status 0x{slave.al_status:04X}"
        for number, slave in enumerate(master.slaves, 1)
    )


if __name__ == "__main__":
    main()
