"""ebpfcat as a foreign MainDevice, by frames of its own alone (without its programs in the kernel); see peer.py."""

import asyncio
import struct
import time

from ebpfcat.ethercat import ECCmd, EtherCat, MachineState, Packet, Terminal

import peer

START = 0x1000
# So many seconds for a step to the next state.
PATIENCE_S = 5


async def main():
    asked = peer.arguments()
    bus = EtherCat(asked.interfaces[0])
    await bus.connect()
    terminals = [Terminal(bus) for _ in range(await bus.count())]
    if not terminals:
        peer.refuse("count found no SubDevice")
    for position, terminal in enumerate(terminals):
        await terminal.initialize(-position, START + 1 + position)
        # The watchdog of outputs waits three seconds: the host may be busy with other things.
        await terminal.write(0x0420, "H", 30_000)
    devices = [[one.vendorId, one.productCode, one.revisionNo] for one in terminals]
    await step(terminals, MachineState.PRE_OPERATIONAL)
    for terminal in terminals:
        await sizes(terminal)
    image = await mapped(terminals)
    await step(terminals, MachineState.SAFE_OPERATIONAL)
    await exchange(bus, image.sent())
    await step(terminals, MachineState.OPERATIONAL, lambda: exchange(bus, image.sent()))
    complete, expected, inputs = 0, 0, []
    due = time.monotonic()
    for values in asked.rounds:
        image.fill(values)
        for _ in range(asked.cycles // len(asked.rounds)):
            data, counter = await exchange(bus, image.sent())
            if counter > expected:
                complete, expected = 0, counter
            complete += counter == expected
            due += asked.cycle_s
            await asyncio.sleep(max(0.0, due - time.monotonic()))
        inputs.append(image.inputs(data))
    states = [await one.get_state() for one in terminals]
    in_op = all(state is MachineState.OPERATIONAL for state, *_ in states)
    await step(terminals, MachineState.INIT)
    peer.report(
        devices=devices, state="OP" if in_op else str(states), wkc=expected, cycles=asked.cycles, complete=complete, rounds=inputs,
    )


async def step(terminals, state, meanwhile=None):
    """All SubDevices to a state."""
    for terminal in terminals:
        await terminal.set_state(state)
    end = time.monotonic() + PATIENCE_S
    waiting = list(terminals)
    while waiting:
        if meanwhile:
            await meanwhile()
        reached, error, code = await waiting[0].get_state()
        if error or time.monotonic() > end:
            peer.refuse(f"SubDevice {terminals.index(waiting[0]) + 1}: {reached} with code 0x{code:04X} on the way to {state}")
        if reached is state:
            waiting.pop(0)


async def sizes(terminal):
    """How long its process data are, in bytes, and its SyncManagers so long."""
    if 41 not in terminal.eeprom:
        terminal.pdo_out_sz = terminal.pdo_in_sz = None
        return
    out_bits, in_bits = await terminal.parse_pdos()
    for name, address, bits in (("out", terminal.pdo_out_addr, out_bits), ("in", terminal.pdo_in_addr, in_bits)):
        if getattr(terminal, f"pdo_{name}_off") is None or bits == 0:
            setattr(terminal, f"pdo_{name}_sz", None)
            continue
        size = (bits + 7) // 8
        setattr(terminal, f"pdo_{name}_sz", size)
        if terminal.has_mailbox():
            await terminal.write(address + 6, "B", 0)
            await terminal.write(address + 2, "H", size)
            await terminal.write(address + 6, "B", 1)


class Image:
    """Where the process data of each SubDevice lie, and what is sent."""

    def __init__(self, terminals):
        self.outputs, self.places, at = [], [], 0
        for terminal in terminals:
            out, into = terminal.pdo_out_sz or 0, terminal.pdo_in_sz or 0
            self.places.append((at, out, into))
            at += out + into
        self.data = bytearray(at)

    def fill(self, values):
        for position, (at, out, _) in enumerate(self.places):
            self.data[at:at + out] = peer.outputs(values, position, out)

    def sent(self):
        return bytes(self.data)

    def inputs(self, data):
        return [data[at + out:at + out + into].hex() for at, out, into in self.places]


async def mapped(terminals):
    """An FMMU for the outputs and one for the inputs of each SubDevice."""
    image = Image(terminals)
    for terminal, (at, out, into) in zip(terminals, image.places):
        if out:
            await terminal.write(0x0600, data=fmmu(at, out, terminal.pdo_out_off, 2))
        if into:
            await terminal.write(0x0610, data=fmmu(at + out, into, terminal.pdo_in_off, 1))
    return image


def fmmu(logical, size, offset, kind):
    """An entry of whole bytes; 1 is for inputs, 2 for outputs."""
    return struct.pack("<IHBBHBBB3x", logical, size, 0, 7, offset, 0, kind, 1)


async def exchange(bus, data):
    """One LRW with all process data: what came back, and its working counter."""
    packet = Packet()
    start, stop = packet.append(ECCmd.LRW, data, 0, 0)
    back = await bus.roundtrip_packet(packet)
    return back[start:stop], struct.unpack_from("<H", back, stop)[0]


if __name__ == "__main__":
    asyncio.run(main())
