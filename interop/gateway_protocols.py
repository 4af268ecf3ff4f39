"""Mailbox messages of each protocol, by UDP to a mailbox gateway. Prints one object of JSON: what came back to each.

Usage: gateway_protocols.py ADDRESS TERMINAL DRIVE, the stations of a SubDevice that speaks CoE, FoE and EoE, and of one
that speaks SoE.
"""

import json
import socket
import struct
import sys

EOE, COE, FOE, SOE, VOE = 2, 3, 4, 5, 15
MAILBOX = 5


def frame(kind, station, counter, body):
    message = struct.pack("<HHBB", len(body), station, 0, kind | counter << 4) + body
    return struct.pack("<H", len(message) | MAILBOX << 12) + message


def main():
    address, terminal, drive = sys.argv[1], int(sys.argv[2], 0), int(sys.argv[3], 0)
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.connect((address, 34980))
    told = {}
    for counter, (name, kind, station, body) in enumerate([
        ("coe", COE, terminal, struct.pack("<HBHBI", 0x2000, 0x40, 0x1018, 1, 0)),
        ("foe", FOE, terminal, struct.pack("<BBI", 1, 0, 0) + b"nothing.txt"),
        # S-0-0052, its value.
        ("soe", SOE, drive, bytes([0x01, 0x40, 52, 0])),
        ("voe", VOE, terminal, bytes(8)),
        # What its IP parameters are.
        ("eoe", EOE, terminal, bytes([0x06, 0x01, 0, 0])),
    ], 1):
        client.settimeout(2 if kind == EOE else 10)
        client.send(frame(kind, station, counter, body))
        try:
            answer = client.recv(2048)
        except TimeoutError:
            told[name] = None
            continue
        length, came_from, _, last = struct.unpack("<HHBB", answer[2:8])
        assert (came_from, last >> 4) == (station, counter), (name, answer.hex())
        told[name] = {"kind": last & 0x0F, "body": answer[8:8 + length].hex()}
    print(json.dumps(told))


main()
