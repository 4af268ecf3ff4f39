"""The tools for single SubDevices at a line over the cable: states, objects, registers, and the view of the line, once and
live in a terminal; with wrong input too."""

import shutil
import time

from bench import HERE, NEAR, Segment, parse
from harness import LINESMAN, Skip, check, linesman

MAILBOX = HERE / "mailbox.toml"


def refused(line, *arguments, words=()):
    """A wrong argument: status 2, a reason and what to do, nothing on stdout."""
    status, out, err = linesman(line, *arguments)
    assert status == 2, f"{arguments}: status {status}: {out[-300:]}{err[-300:]}"
    assert err.startswith("error: "), f"{arguments}: {err}"
    for word in words:
        assert word in err, f"{arguments}: `{word}` is not in: {err}"


# proves: DIA-08 partial: by the tool, over a cable
@check
def linesman_asks_for_states_and_reads_registers_and_objects(line):
    with Segment(line, LINESMAN, MAILBOX):
        status, out, err = linesman(line, "state", NEAR, "--json")
        states = parse(out, err)
        assert status == 0 and [one["al_state"] for one in states["devices"]] == ["INIT"] * 3, (status, out, err)
        for state in ("PREOP", "SAFEOP", "PREOP", "INIT"):
            status, out, err = linesman(line, "state", NEAR, "2", "--to", state)
            assert status == 0 and state in out, (state, status, out, err)
        status, out, err = linesman(line, "sdo", NEAR, "3", "read", "0x1018:01", "--json")
        assert status == 0 and parse(out, err)["objects"][0]["value"] == 2, (status, out, err)
        status, out, err = linesman(line, "sdo", NEAR, "3", "read", "0x5FFF:01")
        assert status == 1 and "0x06020000" in out + err, (status, out, err)
        status, out, err = linesman(line, "reg", NEAR, "3", "read", "0x0010")
        assert status == 0 and "0x1003" in out, (status, out, err)
        refused(line, "state", NEAR, "9", words=["9"])
        refused(line, "state", NEAR, "2", "--to", "RUN", words=["RUN"])
        refused(line, "sdo", NEAR, "1", "read", "0x1018", words=["mailbox"])
        refused(line, "sdo", NEAR, "3", "read", "1018h")
        refused(line, "reg", NEAR, "3", "read", "0x10000")
        refused(line, "reg", "nope0", "3", "read", "0x0010", words=["nope0"])


# proves: DIA-11 partial: of a line that nobody drives, over a cable
@check
def linesman_shows_the_line_once_and_live(line):
    if not shutil.which("script"):
        raise Skip("script, which gives a terminal, is not installed")
    with Segment(line, LINESMAN, MAILBOX) as segment:
        status, out, err = linesman(line, "online", NEAR, "--json")
        report = parse(out, err)
        assert status in (0, 1) and report["present"] == 3, (status, out[-300:], err)
        screen = line.path("screen")
        command = f"stty rows 30 cols 120; exec {LINESMAN} online {NEAR} --live --seconds 3 --interval-ms 200"
        process = line.start(line.near, "script", "-qec", command, screen)
        time.sleep(1.5)
        segment.ask(do="inject", fault={"kind": "device-off", "device": "M1"})
        status, _, err = line.finish(process)
        shown = screen.read_bytes().decode(errors="replace")
        assert status in (0, 1), (status, err, shown[-500:])
        # The other screen is taken and given back, the cursor with it.
        assert "\x1b[?1049h" in shown and "\x1b[?1049l" in shown and "\x1b[?25h" in shown, shown[-300:]
        assert "NO_COMM" in shown, shown[-900:]
        refused(line, "online", NEAR, "--interval-ms", "0")
        refused(line, "online", NEAR, "99", words=["99"])
        refused(line, "online", "nope0", words=["nope0"])
