"""Linesman's MainDevice drives Linesman's segment over the cable, and serves single SubDevices beside that."""

import time

from bench import NEAR, Segment, parse
from harness import LINE, LINESMAN, check

# The analogue terminal, by its number in the line.
NUMBER, VENDOR, PRODUCT = 4, 2, 0x0C203052


# proves: PLC-14 partial: states, objects, EEPROM and registers through the socket of a run over a cable
@check
def linesman_serves_subdevices_beside_its_own_run(line):
    with Segment(line, LINESMAN, LINE.file):
        control = line.path("run")
        run = line.start(
            line.near, LINESMAN, "run", "--on", NEAR, "--seconds", 60, "--cycle-us", 2000, "--control", control, "--json",
        )
        wait_for(line, run, control, ["OP"] * len(LINE))
        sdo = serve(line, control, "sdo", NUMBER, "read", "0x1018:01")
        assert [one["value"] for one in sdo["objects"]] == [VENDOR], sdo
        name = serve(line, control, "sdo", NUMBER, "read", "0x1008:00")
        assert name["objects"][0]["value"] == "EL3104", name
        written = serve(line, control, "sdo", NUMBER, "write", "0x8000:13", 1234)
        assert written["action"] == "write", written
        back = serve(line, control, "sdo", NUMBER, "read", "0x8000:13")
        assert back["objects"][0]["value"] == 1234, back
        image = serve(line, control, "sii", NUMBER, "read")["image"]
        assert (image["vendor_id"], image["product_code"], image["checksum"]) == (VENDOR, PRODUCT, "valid"), image
        register = serve(line, control, "reg", NUMBER, "read", "al-status")
        assert register["registers"][0]["bytes"] == "08 00", register
        # A refusal is told with its code, and leaves the SubDevice where it is.
        status, out, err = line.run(line.near, LINESMAN, "sdo", control, NUMBER, "read", "0x5FFF", "--json")
        assert status == 1 and parse(out, err)["code"] == 0x06020000, (status, out)
        # One goes down and comes back while the others run on.
        serve(line, control, "state", NUMBER, "--to", "PREOP")
        wait_for(line, run, control, ["PREOP" if number == NUMBER else "OP" for number in range(1, len(LINE) + 1)])
        serve(line, control, "state", NUMBER, "--to", "OP")
        wait_for(line, run, control, ["OP"] * len(LINE))
        status, out, err = line.stop(run)
        report = parse(out, err)
        assert status in (0, 1) and report["settled"], f"status {status}: {out[-600:]} {err[-300:]}"
        assert all(device["valid"] for device in report["devices"]), report["devices"]
        counts = report["counts"]
        assert counts["frames_stray"] == counts["frames_foreign"] == counts["frames_truncated"] == 0, counts
        assert counts["cyclic_sent"] > 100 and counts["cyclic_lost"] < counts["cyclic_sent"] * 0.05, counts


@check
def linesman_serves_subdevices_that_nobody_drives(line):
    with Segment(line, LINESMAN, LINE.file) as segment:
        states = serve(line, NEAR, "state")["devices"]
        assert [one["al_state"] for one in states] == ["INIT"] * len(LINE), states
        # It is taken to PREOP for that, and back.
        sdo = serve(line, NEAR, "sdo", NUMBER, "read", "0x1018:01")
        assert [one["value"] for one in sdo["objects"]] == [VENDOR], sdo
        serve(line, NEAR, "sii", NUMBER, "alias", 7, "--backup", line.path("backup.bin"))
        assert serve(line, NEAR, "sii", NUMBER, "read")["image"]["alias"] == 7
        # It counts from the next power-on.
        before = serve(line, NEAR, "reg", NUMBER, "read", "0x0012")
        segment.ask(do="inject", fault={"kind": "brown-out", "device": "A1"})
        end_at = time.monotonic() + 10
        while (after := serve(line, NEAR, "reg", NUMBER, "read", "0x0012"))["bytes"] != "07 00":
            assert time.monotonic() < end_at, after
            time.sleep(0.1)
        assert before["bytes"] == "00 00", before


@check
def of_two_maindevices_that_begin_at_once_one_is_refused(line):
    """Both listen, for a time that each draws by chance. Two that draw the same within a millisecond do not hear each
    other: that may happen once, not as a rule."""
    with Segment(line, LINESMAN, LINE.file):
        told_apart, seen = 0, []
        for _ in range(4):
            both = [line.start(line.near, LINESMAN, "run", "--on", NEAR, "--seconds", 3, "--json") for _ in range(2)]
            ended = [line.finish(one) for one in both]
            seen.append([(status, out[:200]) for status, out, _ in ended])
            refused = [out for status, out, _ in ended if status == 2]
            if len(refused) != 1:
                continue
            assert "another MainDevice drives this line" in refused[0], ended
            # The one that was heard first runs as if it were alone.
            report = next(parse(out, err) for status, out, err in ended if status != 2)
            assert report["settled"] and report["reached_ns"], report["counts"]
            told_apart += 1
        assert told_apart >= 3, seen


def serve(line, where, command, *arguments):
    """A service command on the near end: the object it prints. A command that does not do it ends the check."""
    status, out, err = line.run(line.near, LINESMAN, command, where, *arguments, "--json")
    assert status == 0, f"{command} {arguments}: status {status}: {out[-300:]} {err[-600:]}"
    return parse(out, err)


def wait_for(line, run, control, states):
    """Waits until a run says that the SubDevices are in these states."""
    end_at, told = time.monotonic() + 20, "no socket"
    while time.monotonic() < end_at:
        assert run.poll() is None, f"the run has ended: {line.finish(run)}"
        if control.exists():
            status, out, err = line.run(line.near, LINESMAN, "state", control, "--json")
            told = parse(out, err)
            # It does not know them before its scan is done.
            if status == 0 and [one["al_state"] for one in told["devices"]] == states:
                return
        time.sleep(0.05)
    raise AssertionError(f"not {states} after 20 s: {told}")
