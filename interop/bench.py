"""Two network namespaces with a virtual cable between them, for one check.

`near` holds the MainDevice's end, veth0; `far` the segment's, veth1. Names of namespaces carry the
process number and that of the bench, so that checks side by side do not meet; they are removed at the
end whatever happens.
"""

import itertools
import json
import os
import pathlib
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
NEAR, FAR = "veth0", "veth1"
# The second cable, for the other end of a ring.
NEAR_B, FAR_B = "veth2", "veth3"


NUMBERS = itertools.count(1)
# EtherCAT as it is, and in UDP.
EVERY_FRAME = "ether proto 0x88a4 or udp port 34980"
# The longest frame. The kernel's buffer has places of equal size: unless told, of 256 KiB each, and few of them.
LONGEST = 1518


class Bench:
    """The namespaces; use it in `with`."""

    def __enter__(self):
        number = f"{os.getpid()}-{next(NUMBERS)}"
        self.near, self.far = f"linesman-near-{number}", f"linesman-far-{number}"
        self.running = []
        self.began = time.monotonic()
        # Who knows when the host stood still; set by whoever runs the check.
        self.host = None
        # What a person should know of a check that is right in the end.
        self.notes = []
        self.folder = tempfile.TemporaryDirectory(prefix="linesman-interop-")
        self.work = pathlib.Path(self.folder.name)
        self.number = 0
        try:
            for name in (self.near, self.far):
                ip("netns", "add", name)
            ends = ((self.near, NEAR), (self.far, FAR), (self.near, NEAR_B), (self.far, FAR_B))
            for (_, near), (_, far) in (ends[:2], ends[2:]):
                ip("link", "add", near, "netns", self.near, "type", "veth", "peer", "name", far, "netns", self.far)
            for name, interface in ends:
                # No neighbour discovery: nothing is to be on the cable but what is tried.
                inside(name, "sysctl", "-q", "-w", f"net.ipv6.conf.{interface}.disable_ipv6=1")
                inside(name, "ip", "link", "set", "lo", "up")
                inside(name, "ip", "link", "set", interface, "up")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in self.running:
            end(process)
        for name in (self.near, self.far):
            subprocess.run(["ip", "netns", "del", name], capture_output=True)
        self.folder.cleanup()

    def path(self, name):
        """A new file of this run."""
        self.number += 1
        return self.work / f"{self.number}-{name}"

    def start(self, namespace, *command):
        """Starts a command that runs on beside what follows."""
        process = subprocess.Popen(
            ["ip", "netns", "exec", namespace, *map(str, command)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=HERE,
        )
        self.running.append(process)
        return process

    def run(self, namespace, *command, seconds=60):
        """Runs a command to its end: (exit status, stdout, stderr)."""
        process = self.start(namespace, *command)
        return self.finish(process, seconds)

    def stop(self, process, seconds=20):
        """Ends a command as Ctrl-C does: (exit status, stdout, stderr)."""
        process.send_signal(2)
        return self.finish(process, seconds)

    def finish(self, process, seconds=60):
        try:
            out, err = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            err += f"\nended after {seconds} s"
        self.running.remove(process)
        return process.returncode, out, err

    def telling(self, *command):
        """A command on the near end that tells, line by line, what it does; use it in `with`."""
        return Telling(self, command)

    def python(self, namespace, script, *arguments, seconds=60):
        return self.run(namespace, sys.executable, HERE / script, *arguments, seconds=seconds)

    def packets(self, interface, directions=("rx", "tx")):
        """Frames that were received and sent at an interface on the MainDevice's end so far."""
        files = [f"/sys/class/net/{interface}/statistics/{one}_packets" for one in directions]
        _, out, _ = self.run(self.near, "cat", *files)
        return sum(map(int, out.split()))

    def stood(self, since):
        """How long each stall of the host since then was, in milliseconds."""
        return self.host.stood(since) if self.host else []

    def sent_near(self):
        """Frames that any program has sent on the MainDevice's end so far."""
        return self.packets(NEAR, ["tx"])


def ask(path, request, seconds):
    """Asks a control socket, of a segment or of a run; the answer has no error."""
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(seconds)
        line.connect(str(path))
        line.sendall(json.dumps(request).encode() + b"\n")
        answer = json.loads(line.makefile().readline())
    assert answer["error"] is None, answer["error"]
    return answer


class Segment:
    """A virtual segment on the far end; use it in `with`."""

    def __init__(self, bench, linesman, file, on=FAR, options=()):
        self.bench, self.linesman, self.file, self.on, self.options = bench, linesman, file, on, options
        self.near = NEAR if on == FAR else f"{NEAR}+{NEAR_B}"
        self.socket = bench.path("control")

    def __enter__(self):
        self.process = self.bench.start(
            self.bench.far, self.linesman, "sim", self.file, "--on", self.on, "--control", self.socket, *self.options,
        )
        end_at = time.monotonic() + 20
        while time.monotonic() < end_at:
            if self.process.poll() is not None:
                _, out, err = self.bench.finish(self.process)
                raise RuntimeError(f"the segment did not start: {err or out}")
            # The socket is there once the segment answers.
            if self.socket.exists():
                status, out, _ = self.bench.python(self.bench.near, "probe.py", self.near)
                assert status == 0, "the segment does not answer"
                self.present = int(out)
                return self
            time.sleep(0.01)
        raise RuntimeError("the segment does not start")

    def ask(self, **request):
        """Asks the segment as `linesman fault` does; any program may."""
        return ask(self.socket, request, 10)

    def wires(self):
        """Which output each input is wired to."""
        signals = self.ask(do="signals")["signals"]
        return {one["name"]: one["wired_to"] for one in signals if one["wired_to"]}

    def __exit__(self, *_):
        if self.process in self.bench.running:
            end(self.process)
            self.bench.running.remove(self.process)


class Telling:
    """A process that prints an object of JSON whenever it has something to tell."""

    def __init__(self, bench, command):
        self.bench, self.command = bench, command

    def __enter__(self):
        self.process = self.bench.start(self.bench.near, *self.command)
        self.lines = queue.Queue()
        self.thread = threading.Thread(target=self.read)
        self.thread.start()
        return self

    def read(self):
        for line in self.process.stdout:
            # Some stacks print words of their own.
            if line.startswith("{"):
                self.lines.put(json.loads(line))
        self.lines.put(None)

    def next(self, seconds):
        """The next object it tells."""
        try:
            told = self.lines.get(timeout=seconds)
        except queue.Empty:
            raise AssertionError(f"nothing was told in {seconds} s") from None
        assert told is not None, f"it ended: {self.process.stderr.read()[-600:]}"
        return told

    def until(self, wanted, seconds):
        """Waits until it tells this; gives what it told before."""
        end_at, before = time.monotonic() + seconds, []
        while True:
            try:
                told = self.next(max(0.01, end_at - time.monotonic()))
            except AssertionError as error:
                raise AssertionError(f"{error}; waited for {wanted} after {before[-5:]}") from None
            if told == wanted:
                return before
            before.append(told)

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(2)
            try:
                self.process.wait(5)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self.thread.join()
        self.process.communicate()
        self.bench.running.remove(self.process)


class Watch:
    """Looks at the outputs of a segment again and again while others write them; use it in `with`.

    With `then`, does that once, as soon as all the outputs in `wanted` have their values.
    """

    def __init__(self, segment, wanted=None, then=None):
        self.segment, self.wanted, self.then = segment, wanted, then
        self.seen, self.done = [], False

    def __enter__(self):
        self.thread = threading.Thread(target=self.look)
        self.thread.start()
        return self

    def look(self):
        while not self.done:
            signals = self.segment.ask(do="signals")["signals"]
            values = {one["name"]: one["value"] for one in signals if one["direction"] == "output"}
            if not self.seen or self.seen[-1] != values:
                self.seen.append(values)
            if self.then and self.saw(self.wanted):
                then, self.then = self.then, None
                then()
            time.sleep(0.02)

    def saw(self, wanted):
        """Whether all these outputs had these values at one time."""
        return any(all(values.get(name) == value for name, value in wanted.items()) for values in self.seen)

    def __exit__(self, *_):
        self.done = True
        self.thread.join()


class Capture:
    """What goes over the cables, kept by tcpdump and judged by tshark; use it in `with`."""

    def __init__(self, bench):
        self.bench = bench

    def __enter__(self):
        self.files, self.processes = [], []
        for interface in (NEAR, NEAR_B):
            file = self.bench.path(f"{interface}.pcap")
            process = self.bench.start(
                self.bench.near, "tcpdump", "-i", interface, "-B", 65536, "-s", LONGEST, "-U", "--immediate-mode", "-Z", "root",
                "-w", file, EVERY_FRAME,
            )
            # It says so once it listens.
            while (line := process.stderr.readline()) and "listening on" not in line:
                pass
            self.files.append(file)
            self.processes.append(process)
        self.before, self.begun = self.crossed(), time.monotonic()
        return self

    def crossed(self):
        """Packets that crossed both cables so far."""
        return sum(self.bench.packets(interface) for interface in (NEAR, NEAR_B))

    def __exit__(self, *_):
        self.passed, self.took_ms = self.crossed() - self.before, (time.monotonic() - self.begun) * 1e3
        # It may be behind: it has all once its files grow no more.
        size, end_at = -1, time.monotonic() + 10
        while (now := sum(file.stat().st_size for file in self.files)) != size and time.monotonic() < end_at:
            size = now
            time.sleep(0.2)
        for process in self.processes:
            end(process)
            self.bench.running.remove(process)

    def malformed(self):
        """How many packets were kept, how many crossed, and which of them tshark cannot read."""
        count, bad = 0, []
        for file in self.files:
            command = ["tshark", "-r", file, "-T", "fields", "-e", "frame.number", "-e", "_ws.malformed"]
            done = subprocess.run(command, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr[-300:]
            for line in done.stdout.splitlines():
                count += 1
                number, _, mark = line.partition("\t")
                if mark.strip():
                    bad.append(f"{file.name} packet {number}")
            file.unlink()
        return count, self.passed, bad


def end(process):
    """Asks a process to end as Ctrl-C would, and makes it end."""
    if process.poll() is None:
        # `ip netns exec` becomes the command, so this is its own process.
        process.send_signal(2)
        try:
            process.communicate(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def ip(*arguments):
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


def inside(namespace, *command):
    ip("netns", "exec", namespace, *command)


def parse(out, err):
    """The JSON object a command printed."""
    try:
        return json.loads(out)
    except ValueError:
        raise AssertionError(f"no JSON: {out[:200]!r} {err[-400:]!r}") from None
