"""SOEM, through pysoem, as a foreign MainDevice; see peer.py."""

import time

import pysoem

import peer
import soem_clocks


def main():
    asked = peer.arguments()
    master = pysoem.Master()
    master.open(*asked.interfaces)
    try:
        if master.config_init() <= 0:
            peer.refuse("config_init found no SubDevice")
        devices = [[slave.man, slave.id, slave.rev] for slave in master.slaves]
        names = [slave.name for slave in master.slaves]
        clocks = soem_clocks.Clocks(master, asked.sync0_ns) if asked.sync0_ns else None
        be_patient(master)
        if asked.axes:
            tell_axes(master, asked.cycle_s)
        mapped, send = configure(master, asked.overlap)
        if clocks:
            clocks.align(send)
        to_op(master, send, asked.cycle_s)
        complete, wkc, inputs = exchange(master, send, asked)
        state = "OP" if master.state_check(pysoem.OP_STATE, 50_000) == pysoem.OP_STATE else states(master)
        clocks = clocks.told() if clocks else None
        shared = shared_addresses(master) if asked.overlap else []
        stop(master)
        peer.report(
            devices=devices, names=names, state=state, mapped=mapped, shared=shared,
            wkc=wkc, cycles=asked.cycles, complete=complete, rounds=inputs, clocks=clocks,
        )
    finally:
        master.close()


def be_patient(master):
    """The watchdog of outputs waits three seconds: the host may be busy with other things."""
    for slave in master.slaves:
        slave._fpwr(0x0420, (30_000).to_bytes(2, "little"), 20_000)


def tell_axes(master, cycle_s):
    """0x60C2: value and power of ten of the time from one target to the next."""
    for slave in master.slaves:
        if not soem_clocks.has_mailbox(slave):
            continue
        try:
            slave.sdo_write(0x60C2, 1, round(cycle_s * 1000).to_bytes(1, "little"))
            slave.sdo_write(0x60C2, 2, (-3).to_bytes(1, "little", signed=True))
        except (pysoem.SdoError, pysoem.MailboxError, pysoem.WkcError):
            continue


def configure(master, overlap=False):
    """Up to SAFEOP: the size of the process data, and what sends them."""
    mapped = master.config_overlap_map() if overlap else master.config_map()
    if master.state_check(pysoem.SAFEOP_STATE, 5_000_000) != pysoem.SAFEOP_STATE:
        peer.refuse("SAFEOP not reached: " + states(master))
    return mapped, master.send_overlap_processdata if overlap else master.send_processdata


def to_op(master, send, cycle_s=0.0):
    """SubDevices with outputs want process data before they go to OP, and on the way."""
    send()
    master.receive_processdata(20_000)
    master.state = pysoem.OP_STATE
    master.write_state()
    end = time.monotonic() + 20
    while time.monotonic() < end:
        for _ in range(5):
            send()
            master.receive_processdata(20_000)
            time.sleep(cycle_s)
        if master.state_check(pysoem.OP_STATE, 2_000) == pysoem.OP_STATE:
            return
    peer.refuse("OP not reached: " + states(master))


def exchange(master, send, asked):
    """The rounds: how many exchanges were complete, the working counter, and the inputs at the end of each."""
    # SOEM leaves SubDevices whose data fill no byte out of what it expects; the highest one seen must be seen always.
    complete, expected = 0, 0
    inputs = []
    due = time.monotonic()
    for values in asked.rounds:
        for position, slave in enumerate(master.slaves):
            slave.output = peer.outputs(values, position, len(slave.output))
        for _ in range(asked.cycles // len(asked.rounds)):
            send()
            wkc = master.receive_processdata(20_000)
            if wkc > expected:
                complete, expected = 0, wkc
            complete += wkc == expected
            due += asked.cycle_s
            time.sleep(max(0.0, due - time.monotonic()))
        inputs.append([slave.input.hex() for slave in master.slaves])
    return complete, expected, inputs


def shared_addresses(master):
    """Positions of SubDevices whose outputs and inputs begin at the same logical address."""
    shared = []
    for position, slave in enumerate(master.slaves):
        starts = {}
        for fmmu in range(2):
            entry = slave._fprd(0x0600 + 16 * fmmu, 16, 20_000)
            # The direction: 2 is for outputs, 1 for inputs.
            starts[entry[11]] = entry[:4]
        if starts.get(1) is not None and starts.get(1) == starts.get(2):
            shared.append(position)
    return shared


def stop(master):
    """Orderly, so that no watchdog has to step in."""
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.state_check(pysoem.INIT_STATE, 500_000)


def states(master):
    master.read_state()
    return ", ".join(
        f"{number} {slave.name} state 0x{slave.state:02X} status 0x{slave.al_status:04X}"
        for number, slave in enumerate(master.slaves, 1)
    )


if __name__ == "__main__":
    main()
