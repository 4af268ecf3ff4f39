"""pyads, unmodified, at the ADS server of a run: what it reads and writes.

Usage: ads_client.py ADDRESS STATION. Prints one object of JSON. Its library adds the route itself, and always calls port 48898.
"""

import ctypes
import json
import sys

import pyads

MAIN_DEVICE = 0xFFFF
SAFEOP, OP = 4, 8


def main(address, station):
    net_id = f"{address}.2.1"
    found = {}
    with pyads.Connection(net_id, MAIN_DEVICE, address) as main, pyads.Connection(net_id, station, address) as one:
        count = main.read(0x06, 0, ctypes.c_uint16)
        found["info"] = main.read_device_info()[0]
        found["ads_state"] = main.read_state()[0]
        found["count"] = count
        found["state"] = main.read(0x03, 0x100, ctypes.c_uint16)
        found["stations"] = list(main.read(0x07, 0, ctypes.c_uint16 * count))
        found["states"] = list(main.read(0x09, 0, ctypes.c_uint16 * count))
        found["frames"] = list(main.read(0x0C, 0, ctypes.c_uint32 * 5))
        found["identities"] = [list(main.read(0x11, each, ctypes.c_uint32 * 4)) for each in found["stations"]]
        found["damaged"] = list(main.read(0x12, 0, ctypes.c_uint32 * count))
        found["changes"] = list(main.read(0x13, 0, ctypes.c_uint32 * count))
        found["topology"] = bytes(main.read(0x22, 0, ctypes.c_ubyte * (64 * count))).hex()
        found["vendor"] = one.read(0xF302, 0x10180001, ctypes.c_uint32)
        one.write(0xF302, 0x80100001, 1200, ctypes.c_uint16)
        found["written"] = one.read(0xF302, 0x80100001, ctypes.c_uint16)
        found["no_object"] = error(lambda: one.read(0xF302, 0x55550000, ctypes.c_uint32))
        found["abort"] = list(one.read(0xF303, 0, ctypes.c_uint32 * 5))[4]
        found["no_group"] = error(lambda: main.read(0xF080, 1, ctypes.c_uint32))
        found["reached"] = []
        for state in (SAFEOP, OP):
            main.write(0x09, station, state, ctypes.c_uint16)
            found["reached"].append(main.read(0x09, station, ctypes.c_uint16))
    return found


def error(asked):
    try:
        asked()
    except pyads.ADSError as refused:
        return refused.err_code
    return 0


print(json.dumps(main(sys.argv[1], int(sys.argv[2]))))
