"""SOEM, through pysoem, at the mailboxes of mailbox.toml: SDOs of every kind, FoE, BOOT, emergencies.

Run as `mailbox_soem.py INTERFACE`. Prints one JSON object with what came of each try.
"""

import json
import sys
import time
import zlib

import pysoem

C1, M1 = 1, 2


def main():
    _, interface = sys.argv
    master = pysoem.Master()
    master.open(interface)
    try:
        found = master.config_init()
        if found != 3:
            raise SystemExit(f"config_init found {found} SubDevices")
        told = []
        terminal, axis = master.slaves[C1], master.slaves[M1]
        axis.add_emergency_callback(
            lambda message: told.append([message.error_code, message.error_reg, message.b1, message.w1, message.w2])
        )
        master.config_map()
        if master.state_check(pysoem.SAFEOP_STATE, 2_000_000) != pysoem.SAFEOP_STATE:
            raise SystemExit("SAFEOP not reached")
        result = objects(axis)
        result.update(history(axis))
        result["emergencies"] = emergencies(axis, told)
        result["segments agree"] = in_segments(axis)
        # In PREOP a list of PDOs could be changed, were it not in use.
        result["in use"] = aborted(axis, 0x1C12, 1, b"\0\x16")
        result.update(files(terminal))
        result.update(firmware(terminal))
        json.dump(result, sys.stdout)
        print()
    finally:
        master.close()


def objects(axis):
    """Expedited, normal, segmented; entry by entry and whole; aborts."""
    result = {
        "expedited": axis.sdo_read(0x1018, 1).hex(),
        "normal": axis.sdo_read(0x1008, 0).decode(),
        "whole": axis.sdo_read(0x1C13, 0, ca=True).hex(),
        "whole from 1": axis.sdo_read(0x1C13, 1, ca=True).hex(),
        "aborts": [],
    }
    axis.sdo_write(0x8010, 1, (1234).to_bytes(2, "little"))
    result["written"] = int.from_bytes(axis.sdo_read(0x8010, 1), "little")
    for index, subindex, data in ((0x5555, 0, None), (0x1018, 9, None), (0x1018, 1, b"\1\0\0\0"), (0x1C12, 1, b"\0\x16")):
        result["aborts"].append(aborted(axis, index, subindex, data))
    # SDO information walks through everything there is.
    result["objects"] = len(axis.od)
    result["entries"] = sum(len(entry.entries) for entry in axis.od)
    result["named"] = [entry.name.decode() for entry in axis.od if entry.index == 0x10F3]
    # More than a mailbox holds: it comes in segments and is refused for its length in the end.
    result["too long"] = aborted(axis, 0x8010, 1, bytes(400))
    return result


def aborted(slave, index, subindex, data):
    """The abort code of an access; 0 when it worked."""
    try:
        if data is None:
            slave.sdo_read(index, subindex)
        else:
            slave.sdo_write(index, subindex, data)
        return 0
    except pysoem.SdoError as error:
        return error.abort_code & 0xFFFFFFFF


def in_segments(axis):
    """With the shortest mailbox there is, an object of some forty bytes takes several segments."""
    expected = axis.sdo_read(0x1C32, 0, ca=True)
    step(axis, pysoem.INIT_STATE)
    axis.amend_mbx("out", 0x1000, 34)
    axis.amend_mbx("in", 0x1080, 34)
    step(axis, pysoem.PREOP_STATE)
    return len(expected) > 24 and axis.sdo_read(0x1C32, 0, ca=True) == expected


def history(axis):
    count = axis.sdo_read(0x10F3, 0)[0]
    messages = [axis.sdo_read(0x10F3, subindex).hex() for subindex in range(6, count + 1)]
    newest = axis.sdo_read(0x10F3, 2)
    axis.sdo_write(0x10F3, 3, newest)
    return {"messages": messages, "new after": axis.sdo_read(0x10F3, 4).hex()}


def emergencies(axis, told):
    until = time.monotonic() + 6
    while len(told) < 2 and time.monotonic() < until:
        axis.mbx_receive()
        time.sleep(0.02)
    return told[:2]


def files(terminal):
    result = {"before": terminal.foe_read("settings.txt", 0, 8192).decode()}
    for size in (0, 1, 1011, 1012, 1013, 4096):
        file = bytes(at % 251 for at in range(size))
        terminal.foe_write("settings.txt", 0, file)
        if terminal.foe_read("settings.txt", 0, 8192) != file:
            raise SystemExit(f"a file of {size} bytes came back otherwise")
    result["refused"] = []
    for name, password in (("nothing.txt", 0), ("service.bin", 1), ("log.txt", 0)):
        # What SOEM returns: 1 when it was taken, below 0 for a kind of error.
        result["refused"].append(terminal.foe_write(name, password, b"x"))
    result["service"] = len(terminal.foe_read("service.bin", 0x4711, 8192))
    return result


def firmware(terminal):
    """By way of BOOT: the version is another one afterwards."""
    result = {"version before": terminal.sdo_read(0x100A, 0).decode()}
    step(terminal, pysoem.INIT_STATE)
    boot = [int.from_bytes(terminal.eeprom_read(word), "little") for word in (0x14, 0x16)]
    (out, back) = [(pair & 0xFFFF, pair >> 16) for pair in boot]
    terminal.amend_mbx("out", *out)
    terminal.amend_mbx("in", *back)
    step(terminal, pysoem.BOOT_STATE)
    body = bytes(5000)
    image = f"Linesman firmware EL6601 99 {zlib.crc32(body):08X}\n".encode() + body
    terminal.foe_write("EL6601.efw", 0, image)
    step(terminal, pysoem.INIT_STATE)
    # The mailbox as before.
    pairs = [int.from_bytes(terminal.eeprom_read(word), "little") for word in (0x18, 0x1A)]
    (out, back) = [(pair & 0xFFFF, pair >> 16) for pair in pairs]
    terminal.amend_mbx("out", *out)
    terminal.amend_mbx("in", *back)
    step(terminal, pysoem.PREOP_STATE)
    result["version after"] = terminal.sdo_read(0x100A, 0).decode()
    return result


def step(slave, state):
    slave.state = state
    slave.write_state()
    if slave.state_check(state, 3_000_000) != state:
        raise SystemExit(f"state {state} not reached: 0x{slave.state:02X}, code 0x{slave.al_status:04X}")


if __name__ == "__main__":
    main()
