"""Linesman itself on the cable: it scans, diagnoses, listens, and leaves alone what another one drives."""

import sys
import time

from bench import FAR, HERE, NEAR, Segment, Watch, parse
from harness import CYCLE_US, CYCLES, LINE, LINESMAN, SOEM, check, healthy, linesman, names, ran
from plant import VENDOR

# The source address SOEM sends from.
SOEM_ADDRESS = "01:01:01:01:01:01"


# proves: FRM-19 partial: seen from beside, without the acyclic reading
@check
def a_listener_beside_soem_sees_the_line_cut(line):
    with Segment(line, LINESMAN, LINE.file) as segment:
        rounds = LINE.draw(1)

        def cut_it():
            # The listener knows what is whole by then.
            time.sleep(1)
            segment.ask(do="inject", fault={"kind": "link-open", "at": "O1.B-A1.A"})

        listener = listening(line)
        with Watch(segment, LINE.shown(rounds[0]), cut_it) as watch:
            result = SOEM.exchange(line, LINE, rounds, cycles=2000)
        assert watch.then is None, "the line was not cut"
        assert 0 < result["complete"] < result["cycles"], f"no cut: {result['complete']} complete"
        status, out, err = line.stop(listener)
        diagnosis = parse(out, err)
        assert status == 1 and diagnosis["verdict"] == "faulty", (status, diagnosis["verdict"])
        assert diagnosis["network"]["devices"] == len(LINE), diagnosis["network"]
        # SOEM asks nobody for the status of links: the answers that are missing name the one that was cut.
        worst = diagnosis["findings"][0]
        ends = [(worst["place"][end]["no"], worst["place"][end]["port"]) for end in ("a", "b")]
        assert worst["cause"] == "link-open" and ends == [(3, "B"), (4, "A")], names(diagnosis)
        told = [worst, *worst["consequences"]]
        texts = [one["text"] for finding in told for one in finding["evidence"]]
        # Two of the terminals are cut off: one with inputs (1), one with outputs (2).
        assert any("3 instead of 6" in text for text in texts), (names(diagnosis), texts)


@check
def linesman_scans_the_same_line(line):
    with Segment(line, LINESMAN, LINE.file):
        status, out, err = linesman(line, "scan", NEAR, "--json")
        assert status == 0, f"status {status}: {err[-600:]}"
        scan = parse(out, err)
        assert scan["schema"] == "linesman.scan/1", scan["schema"]
        found = [(device["vendor_id"], device["product_code"]) for device in scan["devices"]]
        assert found == [(VENDOR, product) for _, _, product in LINE.devices], found
        assert [device["no"] for device in scan["devices"]] == [1, 2, 3, 4, 5]
        # The line of the file: each hangs on port B of the one before, the first on the MainDevice.
        for device in scan["devices"]:
            entry = next(port for port in device["ports"] if port["port"] == "A")
            before = {"no": device["no"] - 1, "port": "B" if device["no"] > 1 else "A"}
            assert entry["link"] and entry["open"] and entry["to"] == before, (device["no"], entry)


@check
def linesman_judges_the_idle_line_healthy(line):
    with Segment(line, LINESMAN, LINE.file):
        status, out, err = linesman(line, "diagnose", NEAR, "--seconds", 2, "--json")
        diagnosis = parse(out, err)
        healthy(line, status, diagnosis)
        assert diagnosis["schema"] == "linesman.diagnosis/1"
        assert diagnosis["network"]["devices"] == len(LINE), diagnosis["network"]


@check
def a_listener_beside_soem_sends_nothing(line):
    with Segment(line, LINESMAN, LINE.file):
        # While nobody else sends, every frame on this end would be the listener's.
        before = line.sent_near()
        status, out, err = line.run(line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--seconds", 1, "--json")
        assert line.sent_near() == before, "the listener sent frames on the idle line"
        # Nothing was heard, so nothing can be judged.
        assert status in (2, 3), f"status {status}: {out[:300]} {err[-300:]}"

        watch = watcher(line)
        listener = listening(line)
        result = SOEM.exchange(line, LINE, LINE.draw(2))
        status, out, err = line.stop(listener)
        seen = watched(line, watch)
        assert set(seen) == {SOEM_ADDRESS}, f"others sent as well: {seen}"
        ran(line, result)
        diagnosis = parse(out, err)
        healthy(line, status, diagnosis)
        network = diagnosis["network"]
        assert network["devices"] == len(LINE), network
        assert network["al_state_highest"] == "OP", network
        # Each exchange is at least one datagram that was judged.
        assert network["datagrams"] >= CYCLES, network


@check
def linesman_leaves_a_driven_line_alone(line):
    with Segment(line, LINESMAN, LINE.file):
        rounds = line.path("rounds.json")
        rounds.write_text("[{}]")
        watch = watcher(line)
        began = time.monotonic()
        driver = line.start(line.near, *SOEM.command(), NEAR, 2000, CYCLE_US, rounds)
        time.sleep(2)
        for command in (["scan", NEAR, "--json"], ["diagnose", NEAR, "--seconds", 1, "--json"]):
            status, out, err = line.run(line.near, LINESMAN, *command)
            assert status == 2, f"{command[0]}: status {status}: {out[:300]} {err[-300:]}"
            assert "listen:" in out + err, f"{command[0]} does not point to listen: {err}"
        status, out, err = line.finish(driver)
        assert status == 0, err[-600:]
        ran(line, parse(out.strip().splitlines()[-1], err) | {"began": began})
        seen = watched(line, watch)
        assert set(seen) == {SOEM_ADDRESS}, f"frames of others were on the line: {seen}"


def listening(line):
    """A listener that listens by now; Ctrl-C ends it with its diagnosis."""
    process = line.start(line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--seconds", 120, "--json")
    time.sleep(1)
    return process


def watcher(line, interface=FAR):
    """Counts the frames that arrive at this interface of the segment's end, by source address."""
    process = line.start(line.far, sys.executable, HERE / "watch.py", interface)
    assert process.stdout.readline() == "ready\n"
    return process


def watched(line, process):
    process.send_signal(2)
    _, out, err = line.finish(process, 10)
    return parse(out, err)
