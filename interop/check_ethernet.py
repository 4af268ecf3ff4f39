"""TCP of real computers through Ethernet over EtherCAT: one beside the MainDevice, others at ports of switch terminals, each in a
network namespace of its own."""

import contextlib
import json
import shutil
import statistics
import subprocess
import sys
import threading
import time

from bench import HERE, NEAR, Segment, ask, inside, ip, parse
from check_own import wait_for
from harness import LINESMAN, check

DEVICES, CYCLE_US = 4, 1000
OWN, DRIVE = "192.168.1.100", "192.168.1.11"
# Ports of the terminals, and the computers there.
COMPUTERS = {"S1.1": "192.168.1.21", "S4.1": "192.168.1.41", "S4.3": "192.168.1.43"}
FILE, PORT = 300_000, 8000
# Bytes that iperf3 sends each way.
SENT = 2_000_000
# One of 100 fragments each way is lost.
LOSS = {"kind": "eoe-fault", "how": "lost", "way": "both", "share": 0.01}
# Seconds for what is done in a few.
PATIENCE = 90
QUIET_S = 4
# The number of the drive, whose object is read beside the traffic, and its vendor.
NUMBER, IDENTITY = 2, {"what": "upload", "index": 0x1018, "subindex": 1}

FETCH = """
import sys, time, urllib.request
opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
for place in sys.argv[1:]:
    began = time.monotonic()
    page = opener.open(f"http://{place}", timeout=60).read().decode()
    print(len(page), page[:9], page[-9:].strip(), time.monotonic() - began)
"""


# proves: EOE-01 (V) partial: web pages and iperf3 between processes of several namespaces
@check
def http_and_iperf3_cross_the_segment_between_namespaces(line):
    with office(line, ["S1.1"]) as (segment, computers, run):
        told = {"nothing": run.while_doing(lambda: time.sleep(QUIET_S))}
        assert fetch(line, f"{DRIVE}/")[0][1] == "<!doctype"
        rates = {"HTTP from the drive": file_rate(line)}
        if shutil.which("iperf3"):
            for name, option in (("to the computer", []), ("from it", ["--reverse"])):
                told[name] = run.while_doing(lambda name=name, option=option: rates.update(
                    {f"iperf3 {name}": iperf3(line, computers["S1.1"], COMPUTERS["S1.1"], option)}
                ))
        else:
            line.notes.append("iperf3 is missing: TCP was tried by HTTP alone")
        for place in ("W1", "S1"):
            segment.ask(do="inject", fault=LOSS | {"device": place}, for_ms=None)
        rates["with 1 % of the fragments lost HTTP"] = file_rate(line)
        if shutil.which("iperf3"):
            for name, option in (("to the computer", []), ("from it", ["--reverse"])):
                rates[f"with loss iperf3 {name}"] = iperf3(line, computers["S1.1"], COMPUTERS["S1.1"], option)
        run.judge()
    print(f"    frames of which a fragment was missing: {[port['lost'] for port in run.ports]}", flush=True)
    rows = [f"{name} {rate / 1e6:.2f} MB/s" for name, rate in rates.items()]
    print(f"    {', '.join(rows)}", flush=True)
    for name, row in told.items():
        print(f"    {name} crosses: {row}", flush=True)


# proves: EOE-05 (V) partial: computers outside the segment, at two ports of a terminal
@check
def two_computers_at_an_el6614_are_each_reached_by_its_own_port(line):
    with office(line, ["S4.1", "S4.3"]) as (_, computers, run):
        with contextlib.ExitStack() as servers:
            for place, namespace in computers.items():
                servers.enter_context(web_server(line, namespace, place * 3_000))
            pages = fetch(line, *(f"{COMPUTERS[place]}:{PORT}/page" for place in computers))
            for place, page in zip(computers, pages, strict=True):
                text = place * 3_000
                assert page[:3] == (len(text), text[:9], text[-9:]), (place, page)
            # And each other, behind the terminal.
            at = line.run(computers["S4.1"], sys.executable, "-c", FETCH, f"{COMPUTERS['S4.3']}:{PORT}/page")
            assert at[0] == 0 and at[1].startswith("12000 "), at
        run.judge()
    assert all(port["lost"] == 0 for port in run.ports), run.ports


class Driven:
    """A run with an interface for Ethernet over EtherCAT, in OP."""

    def __init__(self, line):
        self.line, self.control = line, line.path("run")
        self.run = line.start(
            line.near, LINESMAN, "run", "--on", NEAR, "--cycle-us", CYCLE_US, "--eoe", "eoe0", "--eoe-address", f"{OWN}/24",
            "--control", self.control, "--json",
        )
        wait_for(line, self.run, self.control, ["OP"] * DEVICES)

    def ask(self, **request):
        return ask(self.control, request, 20)

    def lateness(self):
        return self.ask(do="status")["run"]["lateness"]

    def while_doing(self, work):
        """How late cycles were meanwhile, and how long an object takes."""
        before, took = self.lateness(), []
        with Beside(lambda: took.append(self.object_takes())):
            work()
        after = self.lateness()
        frames, late, very_late = (after[key] - before[key] for key in ("frames", "over_100us", "over_1ms"))
        return (
            f"{frames} cycles, {late / max(frames, 1):.2%} of them late by more than 100 µs, {very_late / max(frames, 1):.2%} by more "
            f"than 1 ms; an object takes {statistics.median(took) * 1000:.1f} ms, {max(took) * 1000:.1f} ms at most of {len(took)}"
        )

    def object_takes(self):
        began = time.monotonic()
        self.ask(do="serve", no=NUMBER, service=IDENTITY)
        return time.monotonic() - began

    def judge(self):
        """The line is in OP still."""
        wait_for(self.line, self.run, self.control, ["OP"] * DEVICES)


class Beside:
    """Does something again and again, ten times a second, beside what happens in `with`."""

    def __init__(self, work):
        self.work, self.done = work, threading.Event()
        self.thread = threading.Thread(target=self.again)

    def again(self):
        while not self.done.wait(0.1):
            self.work()

    def __enter__(self):
        self.work()
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.done.set()
        self.thread.join()


@contextlib.contextmanager
def office(line, places):
    """The segment, these ports of it in namespaces of their own, and a run: (segment, namespace by port, the run)."""
    for namespace in (line.near, line.far):
        inside(namespace, "sysctl", "-q", "-w", "net.ipv6.conf.default.disable_ipv6=1")
    ports = {place: f"port{at}" for at, place in enumerate(places)}
    options = [word for place, name in ports.items() for word in ("--ethernet-port", f"{place}={name}")]
    namespaces = {place: f"{line.far}-{name}" for place, name in ports.items()}
    with Segment(line, LINESMAN, HERE / "ethernet.toml", options=options) as segment:
        try:
            for place, name in ports.items():
                namespace = namespaces[place]
                ip("netns", "add", namespace)
                inside(namespace, "sysctl", "-q", "-w", "net.ipv6.conf.default.disable_ipv6=1")
                inside(line.far, "ip", "link", "set", name, "netns", namespace)
                inside(namespace, "ip", "addr", "add", f"{COMPUTERS[place]}/24", "dev", name)
                inside(namespace, "ip", "link", "set", name, "up")
                inside(namespace, "ip", "link", "set", "lo", "up")
            run = Driven(line)
            yield segment, namespaces, run
            status, out, err = line.stop(run.run)
            assert status in (0, 1, 3), f"status {status}: {(out + err)[-600:]}"
            run.ports = parse(out, err)["ethernet"]["ports"]
        finally:
            for namespace in namespaces.values():
                subprocess.run(["ip", "netns", "del", namespace], capture_output=True)


@contextlib.contextmanager
def web_server(line, namespace, text):
    """A web server in a namespace, with one page."""
    folder = line.path("www")
    folder.mkdir()
    (folder / "page").write_text(text)
    server = line.start(namespace, sys.executable, "-m", "http.server", PORT, "--directory", folder)
    listens(line, namespace, PORT)
    yield
    line.stop(server)


def listens(line, namespace, port):
    """Waits until a program in a namespace listens on a TCP port."""
    end_at = time.monotonic() + 20
    while time.monotonic() < end_at:
        # Addresses and ports are hexadecimal there; 0A is a socket that listens.
        _, out, _ = line.run(namespace, "cat", "/proc/net/tcp", "/proc/net/tcp6")
        rows = [row.split() for row in out.splitlines()]
        if any(len(row) > 3 and row[1].endswith(f":{port:04X}") and row[3] == "0A" for row in rows):
            return
        time.sleep(0.05)
    raise AssertionError(f"nobody listens on port {port}")


def file_rate(line):
    """Bytes a second of a file of the drive, which comes whole."""
    length, first, last, seconds = fetch(line, f"{DRIVE}/bytes/{FILE}")[0]
    # The letters count down what is left.
    assert (length, first, last) == (FILE, letters(FILE, 9), letters(9, 9)), (length, first, last)
    return FILE / seconds


def letters(left, count):
    """What the web page of a device sends when so many bytes are left."""
    return "".join(chr(ord("a") + at % 26) for at in range(left, left - count, -1))


def fetch(line, *places):
    """(length, first signs, last signs, seconds) of each page."""
    status, out, err = line.run(line.near, sys.executable, "-c", FETCH, *places, seconds=PATIENCE)
    assert status == 0, f"status {status}: {(out + err)[-600:]}"
    rows = [row.split(" ") for row in out.splitlines()]
    return [(int(row[0]), row[1], row[-2], float(row[-1])) for row in rows]


def iperf3(line, namespace, address, options):
    """Bytes a second that a TCP connection carries."""
    server = line.start(namespace, "iperf3", "--server", "--one-off")
    listens(line, namespace, 5201)
    status, out, err = line.run(
        line.near, "iperf3", "--client", address, "--bytes", SENT, "--json", *options, seconds=PATIENCE,
    )
    line.stop(server)
    assert status == 0, f"status {status}: {(out + err)[-600:]}"
    end = json.loads(out)["end"]
    # It ends when all is sent: what is in buffers then is not counted as received.
    sent, received = end["sum_sent"], end["sum_received"]
    assert sent["bytes"] >= SENT and received["bytes"] > SENT / 2, (sent, received)
    return received["bits_per_second"] / 8
