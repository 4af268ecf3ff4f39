"""Counts what arrives on an interface by source address, until it is ended; prints one JSON object."""

import collections
import json
import signal
import socket
import sys

EVERYTHING = 3


def main():
    _, interface = sys.argv
    card = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(EVERYTHING))
    card.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16 << 20)
    card.bind((interface, 0))
    seen = collections.Counter()
    running = True

    def stop(*_):
        nonlocal running
        running = False

    signal.signal(signal.SIGINT, stop)
    card.settimeout(0.1)
    print("ready", flush=True)
    while running:
        try:
            frame, (_, _, kind, _, _) = card.recvfrom(2048)
        except TimeoutError:
            continue
        if kind != socket.PACKET_OUTGOING:
            seen[frame[6:12].hex(":")] += 1
    print(json.dumps(seen), flush=True)


if __name__ == "__main__":
    main()
