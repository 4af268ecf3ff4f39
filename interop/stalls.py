"""When this host let its programs stand still.

A program of its own, so that nothing but the host holds it up, sleeps for a millisecond again and again and notes when it
woke late. A check that failed while the host stood still has shown nothing; one that failed while it did not has.
"""

import subprocess
import sys
import threading
import time

# The shortest time that foreign MainDevices wait for a frame is 2 ms, those for a word of the SII 20 ms.
LATE_MS = 8.0

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

    def longest_ms(self, since):
        """For how long the host stood still at a time since then; 0 when it never did for LATE_MS."""
        # What happened a moment ago may still be on its way here.
        time.sleep(0.05)
        return max(((end - begin) * 1e3 for begin, end in list(self.seen) if end >= since), default=0.0)

    def end(self):
        self.program.kill()
        self.program.wait()
