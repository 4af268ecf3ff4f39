"""Copies frames between interfaces: `ask_relay.py bridge ONE OTHER` hands EtherCAT frames on both ways and drops EtherCAT in
UDP, as a controller that does not process it; `ask_relay.py tap FROM TO` repeats on TO whatever passes FROM, in or out.
"""

import contextlib
import select
import socket
import sys
import time

ETHERCAT, EVERYTHING = 0x88A4, 3


def main():
    _, what, one, other = sys.argv
    cards = [card(one, ETHERCAT if what == "bridge" else EVERYTHING), card(other, ETHERCAT)]
    print("ready", flush=True)
    while True:
        for source in select.select(cards if what == "bridge" else cards[:1], [], [])[0]:
            frame, (_, kind_of, direction, _, _) = source.recvfrom(2048)
            target = cards[1 - cards.index(source)]
            if what == "tap" or direction != socket.PACKET_OUTGOING:
                target.send(frame)


def card(interface, kind):
    opened = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(kind))
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16 << 20)
    opened.bind((interface, 0))
    return opened


@contextlib.contextmanager
def without_udp(line):
    """A segment behind a bridge that drops EtherCAT in UDP: veth0 - veth1 = veth3 - veth2."""
    from bench import FAR, FAR_B, HERE, NEAR_B
    from harness import LINESMAN

    from asking import FILE

    control = line.path("control")
    segment = line.start(line.near, LINESMAN, "sim", FILE, "--on", NEAR_B, "--control", control)
    bridge = line.start(line.far, sys.executable, HERE / "ask_relay.py", "bridge", FAR, FAR_B)
    assert bridge.stdout.readline() == "ready\n"
    end = time.monotonic() + 20
    while not control.exists():
        assert time.monotonic() < end, "the segment does not start"
        time.sleep(0.01)
    yield control
    line.stop(bridge)
    line.stop(segment)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main()
