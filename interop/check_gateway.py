"""Tools of others at the mailbox gateway of a run, in another subnet than the gateway's address."""

import importlib.util
import shutil
import subprocess
import time

from bench import HERE, NEAR, Segment, inside, ip, parse
from check_own import wait_for
from harness import LINE, LINESMAN, Skip, check

# The gateway's address, that of its computer on the cable to the client, and the client's.
GATEWAY, OWN, CLIENT = "10.77.2.1", "10.77.1.1", "10.77.1.7"
# Both ends of a cable of its own, beside that of the line.
WALL, DESK = "wall", "desk"
PORT = "udp port 34980"
OP = 8
# Stations of gateway.toml.
TERMINAL, DRIVE = 0x1002, 0x1003


# proves: MBG-01
@check
def pyetg1510_lists_diagnoses_and_counts_through_the_gateway(line):
    if importlib.util.find_spec("pyetg1510") is None:
        raise Skip("pyetg1510 is not installed")
    office(line)
    with Segment(line, LINESMAN, LINE.file):
        with Gateway(line, len(LINE)) as gateway:
            with Recording(line) as recording:
                objects = ask(line, "etg1510_client.py")["objects"]
        counts = gateway.counts
    assert counts["answers"] == counts["requests"] > 100 and not counts["refused"], counts
    assert objects["1008"]["DeviceName"] == "Linesman", objects["1008"]
    stations = objects["f020"]["ConfiguredAddress"][: objects["f020"]["NumberofSlaves"]]
    assert len(stations) == len(LINE), stations
    for number, (station, (name, _, product)) in enumerate(zip(stations, LINE.devices, strict=True)):
        planned, found, state = (objects[f"{base + number:04x}"] for base in (0x8000, 0x9000, 0xA000))
        assert planned["FixedStationAddress"] == found["StationAddress"] == station, (name, planned, found)
        assert planned["ProductCode"] == found["ProductCode"] == (product or found["ProductCode"]), (name, planned)
        assert state["ALStatus"] == OP and state["ALStatusCode"] == 0, (name, state)
        assert sum(state["FrameErrorCounterPort"]) == 0, (name, state)
    assert objects["f120"]["CyclicFramesPerSecond"] > 0, objects["f120"]
    # Commands: none was given, and counts were not reset.
    assert objects["f002"]["ScanCommandStatus"] == 0 and not objects["f200"]["ResetDiagInfo"], objects
    recording.judge(line)


# proves: MBG-02
@check
def every_protocol_but_eoe_passes_the_gateway(line):
    office(line)
    with Segment(line, LINESMAN, HERE / "gateway.toml"):
        with Gateway(line, 3) as gateway:
            with Recording(line) as recording:
                told = ask(line, "gateway_protocols.py", TERMINAL, DRIVE)
    # The vendor; a file that is not there; a drive without this IDN (0x1001), and a terminal without VoE, which say so themselves.
    assert told["coe"] == {"kind": 3, "body": "003043181001" + "02000000"}, told["coe"]
    assert told["foe"]["kind"] == 4 and told["foe"]["body"][:2] == "05", told["foe"]
    assert told["soe"] == {"kind": 5, "body": "124034000110"}, told["soe"]
    assert told["voe"] == {"kind": 0, "body": "01000200"}, told["voe"]
    assert told["eoe"] is None, told["eoe"]
    assert gateway.counts["refused"] == {"protocol": 1} and gateway.counts["answers"] == 4, gateway.counts
    recording.judge(line, 8)


def office(line):
    """A client in another subnet than the gateway's address."""
    ip("link", "add", WALL, "netns", line.near, "type", "veth", "peer", "name", DESK, "netns", line.far)
    inside(line.near, "ip", "addr", "add", f"{OWN}/24", "dev", WALL)
    inside(line.near, "ip", "addr", "add", f"{GATEWAY}/32", "dev", "lo")
    inside(line.far, "ip", "addr", "add", f"{CLIENT}/24", "dev", DESK)
    inside(line.near, "ip", "link", "set", WALL, "up")
    inside(line.far, "ip", "link", "set", DESK, "up")
    inside(line.far, "ip", "route", "add", "10.77.2.0/24", "via", OWN)


class Gateway:
    """A run with a gateway, in OP; use it in `with`. Its counts are there in the end."""

    def __init__(self, line, devices):
        self.line, self.devices = line, devices

    def __enter__(self):
        control = self.line.path("run")
        self.run = self.line.start(
            self.line.near, LINESMAN, "run", "--on", NEAR, "--cycle-us", 10_000, "--gateway", GATEWAY,
            "--gateway-allow", f"{CLIENT}/32", "--control", control, "--json",
        )
        wait_for(self.line, self.run, control, ["OP"] * self.devices)
        return self

    def __exit__(self, failure, *_):
        _, out, err = self.line.stop(self.run)
        if failure is None:
            self.counts = parse(out, err)["gateway"]


def ask(line, script, *arguments):
    """What a client says."""
    status, out, err = line.python(line.far, script, GATEWAY, *arguments)
    assert status == 0, f"status {status}: {(out + err)[-600:]}"
    return parse(out.strip().splitlines()[-1], err)


class Recording:
    """What goes over the cable to the client; use it in `with`."""

    def __init__(self, line):
        self.line, self.file = line, line.path("gateway.pcap")

    def __enter__(self):
        if all(shutil.which(program) for program in ("tcpdump", "tshark")):
            self.process = self.line.start(self.line.near, "tcpdump", "-Z", "root", "-U", "-i", WALL, "-w", self.file, PORT)
            time.sleep(1)
        else:
            self.process = None
        return self

    def __exit__(self, *_):
        if self.process:
            time.sleep(0.5)
            self.line.stop(self.process)

    def judge(self, line, least=100):
        """Wireshark's dissector reads each packet as a mailbox message, and none is malformed."""
        if not self.process:
            line.notes.append("not read by Wireshark's dissector: tcpdump or tshark is missing")
            return

        def count(condition):
            command = ["tshark", "-r", self.file, "-Y", condition]
            ran = subprocess.run(command, capture_output=True, text=True)
            assert ran.returncode == 0, ran.stderr[-600:]
            return len(ran.stdout.splitlines())

        mailbox, malformed = count("ecat_mailbox"), count("_ws.malformed or not ecat_mailbox")
        assert mailbox >= least and malformed == 0, (mailbox, malformed)
