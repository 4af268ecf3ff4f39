"""When this host let its programs stand still.

A program of its own, so that nothing but the host holds it up, sleeps for a millisecond again and again and notes when it
woke late: `Stalls`. Who sleeps most of the time is woken soon even where those who have much to do wait long, so the kernel is
asked, too, how long the programs of a check waited for a processor: `Waits`. A check that failed while the host stood still has
shown nothing; one that failed while it did not has.
"""

import os
import pathlib
import subprocess
import sys
import threading
import time

# What counts as a stall: a program that wanted to sleep for 1 ms, or to run at once, waited for longer. The shortest time that
# foreign MainDevices wait for a frame is 2 ms.
LATE_MS = 2.0
# What excuses a check that failed: less than most of the shortest cycle of those that judge each frame, 8 ms.
EXCUSE_MS = 5.0

WATCH = f"""
import time
before = time.monotonic()
while True:
    time.sleep(0.001)
    now = time.monotonic()
    if (now - before) * 1e3 > {LATE_MS}:
        print(before, now, flush=True)
    before = now
"""


class Stalls:
    """Watches the host from now on, until `end`."""

    def __init__(self):
        self.program = subprocess.Popen([sys.executable, "-c", WATCH], stdout=subprocess.PIPE, text=True)
        self.seen = []
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.program.stdout:
            begin, end = map(float, line.split())
            self.seen.append((begin, end))

    def since(self, begin):
        """How long each stall since then was, in milliseconds; none of them is shorter than LATE_MS."""
        # What happened a moment ago may still be on its way here.
        time.sleep(0.05)
        return [(end - max(start, begin)) * 1e3 for start, end in list(self.seen) if end >= begin]

    def end(self):
        self.program.kill()
        self.program.wait()


class Waits:
    """Watches how long the programs of a check are ready to run and wait for a processor; use it in `with`."""

    EVERY_S = 0.01

    def __init__(self, running):
        self.running, self.done = running, False
        # When a wait was seen, and how long it was in milliseconds.
        self.seen = []

    def __enter__(self):
        self.thread = threading.Thread(target=self.look, daemon=True)
        self.thread.start()
        return self

    def look(self):
        waited, before = {}, time.monotonic()
        while not self.done:
            time.sleep(self.EVERY_S)
            last, waited = waited, self.waited_ms()
            now = time.monotonic()
            # The kernel adds a wait when it ends. What exceeds the time since the last look began before it, in one piece.
            since, before = (now - before) * 1e3, now
            jumps = (ms - last[task] - since for task, ms in waited.items() if task in last)
            if (longest := max(jumps, default=0.0)) > LATE_MS:
                self.seen.append((now, longest))

    def since(self, begin):
        """How long each wait since then was, in milliseconds; none of them is shorter than LATE_MS."""
        return [ms for at, ms in list(self.seen) if at >= begin]

    def waited_ms(self):
        """The time for which each thread has waited so far."""
        waited = {}
        for process in list(self.running):
            tasks = pathlib.Path(f"/proc/{process.pid}/task")
            # It may end meanwhile; and not every kernel counts.
            try:
                for task in os.listdir(tasks):
                    waited[task] = int((tasks / task / "schedstat").read_text().split()[1]) / 1e6
            except (OSError, IndexError):
                continue
        return waited

    def __exit__(self, *_):
        self.done = True
        self.thread.join()


class Host:
    """What the host did to one check: stalls of all, and waits of its own programs."""

    def __init__(self, stalls, waits):
        self.stalls, self.waits = stalls, waits

    def stood(self, since):
        """How long each stall since then was, in milliseconds, by the one of the two that saw more."""
        return max(self.stalls.since(since), self.waits.since(since), key=sum)

    def excuse_ms(self, since):
        """The longest stall since then, if it is long enough to excuse a check that failed, else 0."""
        longest = max([*self.stalls.since(since), *self.waits.since(since)], default=0.0)
        return longest if longest > EXCUSE_MS else 0.0
