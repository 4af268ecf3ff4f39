"""Sends one broadcast read of register 0x0000 and prints how many SubDevices answered.

With two interfaces, it is sent on the first; in a ring it comes back on the second.

Exit status 1 when the frame does not come back within 0.3 s.
"""

import select
import socket
import sys
import time

ETHERCAT = 0x88A4
SOURCE = bytes([0x02, 0, 0, 0, 0, 0x77])


def main():
    _, interfaces = sys.argv
    cards = [open_card(interface) for interface in interfaces.split("+")]
    # BRD, index 0x77, address 0, register 0, one byte, no interrupt, data, working counter.
    datagram = bytes([7, 0x77, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0])
    frame = b"\xff" * 6 + SOURCE + ETHERCAT.to_bytes(2, "big") + bytes([len(datagram), 0x10]) + datagram
    cards[0].send(frame.ljust(60, b"\0"))
    end = time.monotonic() + 0.3
    while (left := end - time.monotonic()) > 0:
        for card in select.select(cards, [], [], left)[0]:
            answer, (_, _, kind, _, _) = card.recvfrom(2048)
            if kind != socket.PACKET_OUTGOING and answer[16:18] == datagram[:2]:
                print(int.from_bytes(answer[27:29], "little"))
                return 0
    return 1


def open_card(interface):
    card = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
    card.bind((interface, 0))
    return card


if __name__ == "__main__":
    sys.exit(main())
