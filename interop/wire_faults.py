"""Sits in a cable and spoils what comes back: `wire_faults.py NEAR FAR FAULT EVERY FROM COUNT LIMIT_MS`.

Frames go from NEAR to FAR as they are. Of the frames with process data that come back, those FROM to FROM + COUNT are
counted, and every EVERYth of them suffers FAULT: doubled, stray, truncated, lost or late_by_30_ms. At SIGINT it prints how many it
spoiled, and how often the host itself held a frame for longer than LIMIT_MS, so that a check on a busy host knows what
it cannot blame on anybody.
"""

import heapq
import json
import os
import select
import signal
import socket
import sys
import time

ETHERCAT = 0x88A4
LOGICAL = (10, 11, 12)
# More than a cycle of those who use it.
LATE_S = 0.030
# Behind so many bytes a truncated frame ends: amid the data of its first datagram.
CUT = 30


class Stopped(Exception):
    pass


def stop(*_):
    raise Stopped


def card(name):
    one = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
    one.bind((name, ETHERCAT))
    one.setblocking(False)
    return one


def received(one):
    """Frames that have come in; not those that this program sends."""
    while True:
        try:
            frame, (_, _, kind, *_) = one.recvfrom(2048)
        except BlockingIOError:
            return
        if kind != socket.PACKET_OUTGOING:
            yield frame


def carries_process_data(frame):
    at = 16
    while at + 12 <= len(frame):
        if frame[at] in LOGICAL:
            return True
        word = int.from_bytes(frame[at + 6:at + 8], "little")
        if not word & 0x8000:
            return False
        at += 12 + (word & 0x7FF)
    return False


class Cable:
    def __init__(self, near, far, fault, every, begin, count, limit_ms):
        self.near, self.far, self.fault = card(near), card(far), fault
        self.every, self.begin, self.end = int(every), int(begin), int(begin) + int(count)
        self.limit = float(limit_ms) / 1e3
        self.cyclic, self.spoiled, self.held, self.longest = 0, 0, 0, 0.0
        self.sent_at, self.late = {}, []

    def run(self):
        while True:
            rest = max(0.0, self.late[0][0] - time.monotonic()) if self.late else None
            select.select([self.near, self.far], [], [], rest)
            for frame in received(self.near):
                self.sent_at[frame[17]] = time.monotonic()
                self.far.send(frame)
            for frame in received(self.far):
                self.come_back(frame)
            while self.late and self.late[0][0] <= time.monotonic():
                self.near.send(heapq.heappop(self.late)[2])

    def come_back(self, frame):
        if not carries_process_data(frame):
            self.near.send(frame)
            return
        self.cyclic += 1
        counts = self.begin < self.cyclic <= self.end
        if counts and self.cyclic % self.every == 0:
            self.spoiled += 1
            getattr(self, self.fault)(frame)
        else:
            self.near.send(frame)
        took = time.monotonic() - self.sent_at.get(frame[17], time.monotonic())
        self.longest = max(self.longest, took)
        self.held += took > self.limit

    def doubled(self, frame):
        self.near.send(frame)
        self.near.send(frame)

    def stray(self, frame):
        """Another frame comes with it, with a number that nobody has given of late."""
        other = bytearray(frame)
        other[17] = (other[17] + 128) % 256
        self.near.send(other)
        self.near.send(frame)

    def truncated(self, frame):
        self.near.send(frame[:CUT])

    def lost(self, _):
        pass

    def late_by_30_ms(self, frame):
        heapq.heappush(self.late, (time.monotonic() + LATE_S, self.spoiled, frame))

    def told(self):
        longest = round(self.longest * 1e3, 2)
        return {"cyclic": self.cyclic, "spoiled": self.spoiled, "held": self.held, "longest_ms": longest}


def main():
    cable = Cable(*sys.argv[1:])
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except OSError:
        pass
    signal.signal(signal.SIGINT, stop)
    print("ready", flush=True)
    try:
        cable.run()
    except Stopped:
        print(json.dumps(cable.told()), flush=True)


if __name__ == "__main__":
    main()
