"""Frames that are nobody's: `ask_frame.py INTERFACE udp|plain` sends one read of register 0x0000 by all, in UDP or not;
`ask_frame.py INTERFACE stranger` sends process data and state reads of its own every 4 ms, as no known MainDevice does.
"""

import itertools
import socket
import sys
import time

BRD, LRW = 7, 12
SOURCE = bytes([0x08, 0x00, 0x27, 1, 2, 3])


def main():
    _, interface, what = sys.argv
    card = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    card.bind((interface, 0))
    if what != "stranger":
        card.send(frame([datagram(BRD, 0xEE, bytes(4), 1)], what == "udp"))
        return
    for number in itertools.count():
        parts = [datagram(LRW, number % 100, bytes(4), 4)]
        if number % 20 == 0:
            parts.append(datagram(BRD, number % 100, bytes([0, 0, 0x30, 0x01]), 2))
        card.send(frame(parts, False))
        time.sleep(0.004)


def datagram(command, index, address, length):
    return bytes([command, index]) + address + length.to_bytes(2, "little") + bytes(2 + length + 2)


def frame(datagrams, in_udp):
    for at in range(len(datagrams) - 1):
        datagrams[at] = datagrams[at][:7] + bytes([datagrams[at][7] | 0x80]) + datagrams[at][8:]
    data = b"".join(datagrams)
    data = (len(data) | 0x1000).to_bytes(2, "little") + data
    if not in_udp:
        return (b"\xff" * 6 + SOURCE + b"\x88\xa4" + data).ljust(60, b"\0")
    udp = b"\x88\xa4\x88\xa4" + (8 + len(data)).to_bytes(2, "big") + bytes(2) + data
    ip = bytes([0x45, 0]) + (20 + len(udp)).to_bytes(2, "big") + bytes(4) + bytes([1, 17]) + bytes(2) + bytes(4) + b"\xff" * 4
    return (b"\x4e\x49\x4e\x45\x53\x3f" + SOURCE + b"\x08\x00" + ip + udp).ljust(60, b"\0")


if __name__ == "__main__":
    main()
