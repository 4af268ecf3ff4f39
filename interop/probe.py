"""Sends one broadcast read of register 0x0000 and prints how many SubDevices answered; with `alias N`, how many
answer to that alias.

With two interfaces, it is sent on the first; in a ring it comes back on the second.

Exit status 1 when the frame does not come back within 0.3 s.
"""

import select
import socket
import sys
import time

ETHERCAT = 0x88A4
SOURCE = bytes([0x02, 0, 0, 0, 0, 0x77])
FPRD, BRD, BWR = 4, 7, 8


def main():
    interfaces, *what = sys.argv[1:]
    cards = [open_card(interface) for interface in interfaces.split("+")]
    if what:
        # Use of the alias on (DL control, 0x0103), then a read that is addressed to it.
        _, alias = what
        exchange(cards, BWR, 0, 0x0103, b"\x01")
        present = exchange(cards, FPRD, int(alias), 0x0012, b"\0\0")
    else:
        present = exchange(cards, BRD, 0, 0, b"\0")
    if present is None:
        return 1
    print(present)
    return 0


def exchange(cards, command, station, register, data):
    """Sends a datagram on the first card; its working counter, or nothing when it does not come back."""
    address = station.to_bytes(2, "little") + register.to_bytes(2, "little")
    datagram = bytes([command, 0x77]) + address + len(data).to_bytes(2, "little") + b"\0\0" + data + b"\0\0"
    frame = b"\xff" * 6 + SOURCE + ETHERCAT.to_bytes(2, "big") + bytes([len(datagram), 0x10]) + datagram
    cards[0].send(frame.ljust(60, b"\0"))
    end = time.monotonic() + 0.3
    while (left := end - time.monotonic()) > 0:
        for card in select.select(cards, [], [], left)[0]:
            answer, (_, _, kind, _, _) = card.recvfrom(2048)
            if kind != socket.PACKET_OUTGOING and answer[16:18] == datagram[:2]:
                return int.from_bytes(answer[26 + len(data):28 + len(data)], "little")
    return None


def open_card(interface):
    card = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
    card.bind((interface, 0))
    return card


if __name__ == "__main__":
    sys.exit(main())
