"""Sends one broadcast read of register 0x0000 and prints how many SubDevices answered; with `alias N`, how many
answer to that alias; with `loaded`, how many of them have loaded their SII: a controller passes frames on before that.

With two interfaces, it is sent on the first; in a ring it comes back on the second.

Exit status 1 when a frame does not come back within 2 s.
"""

import select
import socket
import sys
import time

ETHERCAT = 0x88A4
SOURCE = bytes([0x02, 0, 0, 0, 0, 0x77])
APRD, FPRD, BRD, BWR = 1, 4, 7, 8


def main():
    interfaces, *what = sys.argv[1:]
    cards = [open_card(interface) for interface in interfaces.split("+")]
    match what:
        case []:
            answered = exchange(cards, BRD, 0, 0, 1)[0]
        case ["alias", alias]:
            # Use of the alias on (DL control, 0x0103), then a read that is addressed to it.
            exchange(cards, BWR, 0, 0x0103, 1, b"\x01")
            answered = exchange(cards, FPRD, int(alias), 0x0012, 2)[0]
        case ["loaded"]:
            present = exchange(cards, BRD, 0, 0, 1)[0]
            # DL status, bit 0.
            answers = [exchange(cards, APRD, -position & 0xFFFF, 0x0110, 2) for position in range(present)]
            answered = sum(counter and data[0] & 0x01 for counter, data in answers)
    print(answered)


def exchange(cards, command, station, register, length, data=b""):
    """Sends a datagram on the first card; gives its working counter and its data as they come back."""
    address = station.to_bytes(2, "little") + register.to_bytes(2, "little")
    body = data.ljust(length, b"\0")
    datagram = bytes([command, 0x77]) + address + length.to_bytes(2, "little") + b"\0\0" + body + b"\0\0"
    frame = b"\xff" * 6 + SOURCE + ETHERCAT.to_bytes(2, "big") + bytes([len(datagram), 0x10]) + datagram
    cards[0].send(frame.ljust(60, b"\0"))
    end = time.monotonic() + 2
    while (left := end - time.monotonic()) > 0:
        for card in select.select(cards, [], [], left)[0]:
            answer, (_, _, kind, _, _) = card.recvfrom(2048)
            if kind != socket.PACKET_OUTGOING and answer[16:18] == datagram[:2]:
                return int.from_bytes(answer[26 + length:28 + length], "little"), answer[26:26 + length]
    sys.exit(1)


def open_card(interface):
    card = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
    card.bind((interface, 0))
    return card


if __name__ == "__main__":
    main()
