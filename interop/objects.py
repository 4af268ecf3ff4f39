"""Objects of every length, read and written: in four bytes, in one message, in several.

`OBJECTS.py INTERFACE soem|kickcat`. The device is that of store.xml. Told are what was read before anything was written
(`number`, `label`, `page`), what was read after it was (`… written`), and the abort codes of data that are too long (`too
long`, SOEM only). What is written stands here; check_objects.py compares it.
"""

import sys
import time
from datetime import timedelta

import peer

STORE = 0x5702
NUMBER, LABEL, PAGE = 0x2000, 0x2001, 0x2002
# What is written: as long as the object each.
WRITTEN = {
    "number": (NUMBER, (0xCAFE0042).to_bytes(4, "little")),
    "label": (LABEL, b"another twenty signs"),
    "page": (PAGE, bytes(33 + at * 7 % 90 for at in range(600))),
}


def main():
    _, interface, stack = sys.argv
    {"soem": soem, "kickcat": kickcat}[stack](interface)


def soem(interface):
    import pysoem

    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= 0:
            peer.refuse("no SubDevice found")
        store = next(slave for slave in master.slaves if slave.id == STORE)

        def write(index, data):
            try:
                store.sdo_write(index, 0, data)
                return 0
            except pysoem.SdoError as error:
                return error.abort_code & 0xFFFFFFFF

        result = told(lambda index: store.sdo_read(index, 0, size=1024), write, WRITTEN)
        result["too long"] = [write(index, data + b"!") for index, data in WRITTEN.values()]
        peer.report(**result)
    finally:
        master.close()


def kickcat(interface):
    import kickcat

    import kickcat_peer

    bus, _ = kickcat_peer.bring_up([interface])
    store = bus.slaves()[0]

    def read(index):
        return bus.read_sdo(store, index, 0, kickcat.PARTIAL, 1024, timedelta(seconds=5))

    def write(index, data):
        message = store.mailbox.write_sdo(index, 0, False, data, timedelta(seconds=5))
        while message.status() == kickcat.mailbox.request.MessageStatus.RUNNING:
            bus.process_mailboxes()
            time.sleep(0.001)
        return message.status()

    # Version 2.5 takes the first bytes of what comes in segments for a length, and sends nothing in segments.
    peer.report(**told(read, write, ("number", "label")))


def told(read, write, names):
    """Reads all, writes each and reads it again."""
    result = {name: bytes(read(WRITTEN[name][0])).hex() for name in names}
    for name in names:
        status = write(*WRITTEN[name])
        result[f"{name} written"] = bytes(read(WRITTEN[name][0])).hex() if status == 0 else f"status 0x{status:08X}"
    return result


if __name__ == "__main__":
    main()
