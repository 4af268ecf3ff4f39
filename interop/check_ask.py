"""Linesman asks beside SOEM and KickCAT (`diagnose listen:… --ask`): it finds what a listener cannot, and does not disturb them.

How many frames each of them lost is what the program itself counts, with questions and without (`ask_soem.py`, `ask_kickcat.py`);
longer runs: `ask_long.py`.
"""

import sys
import time

import ask_relay
from asking import CLIENTS, CYCLE_US, FILE, answer, asked, counts, driver, in_op, listener, place, refused, wrong
from bench import FAR, FAR_B, HERE, NEAR, NEAR_B, Segment, parse
from check_linesman import watched, watcher
from harness import CAT, CRAB, LINESMAN, SOEM, check, linesman, names

# Its frames are late when the host is busy; that alone ends no question and is no finding here.
KICKCAT_ECHO = "S200"
QUESTIONS = "4c:49:4e:45:53:3f"
PER_S = 20
# A computer with other work loses frames of its own, now and then: whatever questions cost would show in each of so many.
ROUNDS = 3


def undisturbed(line, client):
    """Of its own counts none is worse with questions than without, in one of a few rounds at least."""
    for left in reversed(range(ROUNDS)):
        diagnosis, failed = round_with_and_without(line, client)
        if not failed:
            return diagnosis
        print(f"    (without, with): {failed}; {left} rounds left", flush=True)
    raise AssertionError(f"(without, with), in each of {ROUNDS} rounds: {failed}")


def round_with_and_without(line, client):
    """The diagnosis with questions, and what the client counted more of beside them: (without, with)."""
    with Segment(line, LINESMAN, FILE):
        told = {}
        for with_questions in (False, True):
            with driver(line, client) as main:
                in_op(main)
                options = ["--ask"] if with_questions else []
                watch = watcher(line)
                status, diagnosis, err = answer(line, listener(line, *options, seconds=20), 60)
                seen = watched(line, watch)
                told[with_questions] = counts(main)
            # What the cable saw: nobody but the MainDevice, and the questions, where they were wanted.
            assert (QUESTIONS in seen) == with_questions, seen
            assert len(seen) == 1 + with_questions, seen
        asking = diagnosis["asking"]
        assert asking["state"] == "asking" and asking["carrier"] == "udp", asking
        assert asking["devices"] == 6 and asking["questions"] > 15 * PER_S, asking
        assert asking["answered"] >= asking["questions"] - 1, asking
        assert seen[QUESTIONS] == asking["questions"], (seen, asking)
        without, beside = told[False], told[True]
        counted = {name: (without[name], beside[name]) for name in ("lost", "short", "not_in_op") if name in beside}
        failed = {name: (few, many) for name, (few, many) in counted.items() if many > few}
        line.notes.append(f"{asking['questions']} questions, {beside['cycles']} cycles, {beside['lost']} lost, without {without['lost']}")
        return diagnosis, failed


@check
def questions_beside_soem_cost_it_no_frame(line):
    diagnosis = undisturbed(line, SOEM)
    judged = {one["subject"] for one in diagnosis["coverage"]["subjects"] if one["extent"] == "judged"}
    assert {"signal-quality", "link-status"} <= judged, judged
    assert not wrong(diagnosis), names(diagnosis)


@check
def questions_beside_kickcat_cost_it_no_frame(line):
    undisturbed(line, CAT)


def found(line, client, fault, expected, for_ms=None, options=(), seconds=15):
    """A fault that comes while it is asked: cause and place of the worst finding that is not another matter."""
    with Segment(line, LINESMAN, FILE) as segment, driver(line, client) as main:
        in_op(main)
        process = listener(line, "--ask", *options, seconds=seconds)
        # Learnt, tried, and a few rounds.
        time.sleep(6)
        segment.ask(do="inject", fault=fault, for_ms=for_ms)
        status, diagnosis, err = answer(line, process)
        told = [one for one in wrong(diagnosis) if one["code"] != KICKCAT_ECHO]
        assert status == 1 and told, (status, diagnosis["verdict"], diagnosis["asking"])
        first = told[0]
        causes = {first["cause"], *(one["cause"] for one in first["alternatives"])}
        assert place(first) == expected and fault["kind"] in causes, (names(diagnosis), diagnosis["asking"])
        return diagnosis


NOISE = {"kind": "transmitter-damaged", "at": "K1.C>K2.A", "hits_per_s": 2000}
NOISY = ((1, "C"), (5, "A"), "a-to-b")
INSIDE = {"kind": "device-internal", "device": "O1", "hits_per_s": 20}
OPEN = {"kind": "link-open", "at": "O1.B-A1.A"}
OPENED = ((3, "B"), (4, "A"), "both")


@check
def noise_beside_soem_is_placed_with_its_direction(line):
    found(line, SOEM, NOISE, NOISY)


@check
def noise_beside_kickcat_is_placed_with_its_direction(line):
    found(line, CAT, NOISE, NOISY)


@check
def device_that_spoils_frames_beside_soem_is_named(line):
    found(line, SOEM, INSIDE, 3)


@check
def device_that_spoils_frames_beside_kickcat_is_named(line):
    found(line, CAT, INSIDE, 3)


@check
def link_that_opened_beside_soem_is_told_by_its_counters(line):
    diagnosis = found(line, SOEM, OPEN, OPENED, 100, ["--keep-asking"], 16)
    counted = [one for one in wrong(diagnosis)[0]["evidence"] if one["register"] in range(0x0310, 0x0314)]
    assert {one["no"] for one in counted} == {3, 4}, counted


@check
def falling_working_counter_ends_the_questions(line):
    with Segment(line, LINESMAN, FILE) as segment, driver(line, SOEM) as main:
        in_op(main)
        process = listener(line, "--ask", seconds=12)
        time.sleep(5)
        watch = watcher(line)
        segment.ask(do="inject", fault=OPEN, for_ms=300)
        _, diagnosis, err = answer(line, process)
        seen = watched(line, watch)
        asking = diagnosis["asking"]
        assert asking["state"] == "stopped" and "working counter" in asking["reason"], asking
        assert "nothing is asked any more" in err, err
        # Not one that was sent after it fell, but for the one that was under way.
        assert seen.get(QUESTIONS, 0) <= 2, (seen, asking)
        gaps = [gap for one in diagnosis["coverage"]["subjects"] for gap in one["gaps"] if gap["reason"] == "not-asked"]
        assert len(gaps) == 2, gaps


def beside(line, client, *options):
    """The diagnosis beside a client, and what the client counted meanwhile."""
    with driver(line, client) as main:
        in_op(main)
        _, diagnosis, _ = answer(line, listener(line, *options, seconds=10), 60)
        return diagnosis, counts(main)


@check
def subdevices_that_do_not_take_udp_are_asked_by_plain_frames_beside_soem_alone(line):
    with ask_relay.without_udp(line):
        rounds = []
        # The bridge is a program that is late at times: what is lost to it is lost without questions, too.
        while not any(lost * 1000 <= cycles or lost <= without for without, lost, cycles in rounds):
            assert len(rounds) < ROUNDS, f"(lost without, with, cycles): {rounds}"
            _, without = beside(line, SOEM)
            diagnosis, told = beside(line, SOEM, "--ask")
            asking = diagnosis["asking"]
            assert asking["state"] == "asking" and asking["carrier"] == "plain", asking
            assert asking["answered"] > 3 * PER_S, asking
            # In no round a frame near a question.
            assert asking["near"]["lost"] == 0 and told["short"] == 0, (asking, told)
            rounds.append((without["lost"], told["lost"], told["cycles"]))
        line.notes.append(f"(lost without, with, cycles): {rounds}")
        diagnosis, _ = beside(line, CAT, "--ask")
        asking = diagnosis["asking"]
        assert asking["state"] == "impossible" and "no SubDevice answered to EtherCAT in UDP" in asking["reason"], asking
        assert not [one for one in wrong(diagnosis) if one["code"] != KICKCAT_ECHO], names(diagnosis)


@check
def questions_are_no_second_maindevice_in_a_recording(line):
    with Segment(line, LINESMAN, FILE), driver(line, SOEM) as main:
        in_op(main)
        record = line.path("asked.pcapng")
        _, live, _ = asked(line, "--record", record, seconds=8)
        status, out, err = linesman(line, "diagnose", record, "--json")
        diagnosis = parse(out, err)
        assert not wrong(diagnosis), names(diagnosis)
        assert diagnosis["network"] == live["network"], (diagnosis["network"], live["network"])
        assert diagnosis["main_device"]["never_reads"] == [], diagnosis["main_device"]


@check
def ethercrab_is_refused_and_survives_forced_questions(line):
    with Segment(line, LINESMAN, FILE), line.telling(*CRAB.command(), NEAR, "loss", CYCLE_US) as main:
        crab_in_op(main)
        reason, step = refused(line, f"listen:{NEAR}", "--ask")
        assert "ethercrab" in reason and "--force" in step, (reason, step)
        status, diagnosis, _ = asked(line, "--force", seconds=8)
        asking = diagnosis["asking"]
        assert asking["state"] == "asking" and asking["carrier"] == "udp", asking
        assert asking["answered"] > 3 * PER_S, asking
        # It exchanges process data as before: nothing was told meanwhile but what it tells of a busy host.
        assert main.process.poll() is None, main.process.stderr.read()[-300:]


@check
def plain_frame_that_is_not_its_own_ends_ethercrab(line):
    """Why it is refused: the trial. A frame in UDP does not reach it."""
    with Segment(line, LINESMAN, FILE), line.telling(*CRAB.command(), NEAR, "loss", CYCLE_US) as main:
        crab_in_op(main)
        for form, survives in (("udp", True), ("plain", False)):
            status, out, err = line.python(line.near, "ask_frame.py", NEAR, form)
            assert status == 0, err
            end = time.monotonic() + 3
            failed = False
            while time.monotonic() < end and not failed:
                try:
                    told = main.next(max(0.01, end - time.monotonic()))
                except AssertionError:
                    break
                # Its task that receives has ended: no exchange comes to an end any more.
                failed = "error" in told
            assert failed != survives, f"{form}: {'failed' if failed else 'went on'}"


@check
def who_may_not_be_asked_is_refused_with_the_next_step(line):
    with Segment(line, LINESMAN, FILE):
        # Nobody drives.
        before = line.sent_near()
        status, out, err = line.run(line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--ask", "--seconds", 2, "--json")
        assert status == 2 and line.sent_near() == before, (status, out[:300], err[-300:])
        with driver(line, SOEM) as main:
            in_op(main)
            reason, _ = refused(line, f"listen:{NEAR}+{NEAR_B}", "--ask")
            assert "ring" in reason, reason
            first = listener(line, "--ask", seconds=4)
            time.sleep(1)
            reason, _ = refused(line, f"listen:{NEAR}", "--ask")
            assert "questions are asked on this card already" in reason, reason
            line.finish(first)
        # Not recognised: a program that nobody knows.
        with line.telling(sys.executable, HERE / "ask_frame.py", NEAR, "stranger") as main:
            time.sleep(0.5)
            reason, step = refused(line, f"listen:{NEAR}", "--ask")
            assert "not recognised" in reason and "--force" in step, (reason, step)


@check
def tap_is_refused(line):
    """What passes veth0 is repeated on another cable, at whose end is the listener."""
    with Segment(line, LINESMAN, FILE), driver(line, SOEM) as main:
        in_op(main)
        tap = line.start(line.near, sys.executable, HERE / "ask_relay.py", "tap", NEAR, NEAR_B)
        assert tap.stdout.readline() == "ready\n"
        status, out, err = line.run(line.far, LINESMAN, "diagnose", f"listen:{FAR_B}", "--ask", "--seconds", 5, "--json")
        line.stop(tap)
        reason = parse(out, err)["reason"]
        assert status == 2 and "does not send from this computer" in reason, (status, reason)


@check
def card_of_a_ring_is_refused(line):
    with Segment(line, LINESMAN, HERE / "ring.toml", on=f"{FAR}+{FAR_B}"):
        for client in (SOEM, CAT):
            rounds = line.path("rounds.json")
            rounds.write_text("[{}]")
            program = line.start(line.near, *client.command(), f"{NEAR}+{NEAR_B}", 3000, CYCLE_US, rounds)
            time.sleep(4)
            reason, _ = refused(line, f"listen:{NEAR}", "--ask")
            assert "ring" in reason, (client.name, reason)
            line.finish(program)


@check
def counters_that_a_program_with_soem_prints_name_the_link(line):
    with Segment(line, LINESMAN, FILE) as segment:
        program = line.start(line.near, *SOEM.command("soem_counters.py"), NEAR, CYCLE_US, 4)
        first = program.stdout.readline()
        time.sleep(1)
        segment.ask(do="inject", fault=NOISE, for_ms=None)
        status, out, err = line.finish(program)
        assert status == 0, err[-600:]
    file = line.path("counters.txt")
    file.write_text(first + out)
    status, out, err = linesman(line, "diagnose", file, "--json")
    diagnosis = parse(out, err)
    worst = wrong(diagnosis)[0]
    # The text does not tell that the second coupler hangs on port C: the wiring is assumed, and said so.
    assert status == 1 and worst["place"]["b"] == {"no": 5, "port": "A"}, (names(diagnosis), first, out)
    assert diagnosis["understood"]["assumed"], diagnosis["understood"]


def crab_in_op(main):
    end = time.monotonic() + 30
    while time.monotonic() < end:
        if main.next(30).get("in_op") == 6:
            time.sleep(0.5)
            return
    raise AssertionError("not in OP")


for one in (
    noise_beside_soem_is_placed_with_its_direction, noise_beside_kickcat_is_placed_with_its_direction,
    device_that_spoils_frames_beside_soem_is_named, device_that_spoils_frames_beside_kickcat_is_named,
    counters_that_a_program_with_soem_prints_name_the_link,
):
    one.spoils_frames = True
