"""Linesman listens while foreign MainDevices drive a line and a fault comes: what it says, and what it may say.

`beside_matrix.py [--write] [WORDS]` plays all cases, or those whose names hold one of the words, and prints a line for
each; with `--write` it writes the tables of docs/guide/beside.md. Needs root, LINESMAN and ETHERCRAB_PEER as run.py does.
"""

import concurrent.futures
import dataclasses
import json
import os
import pathlib
import shutil
import signal
import sys
import time

from bench import HERE, NEAR, Bench, Segment, parse
from harness import CAT, CRAB, LINESMAN, SOEM, Skip

FILE = HERE / "beside.toml"
DOCUMENT = HERE.parent / "docs/guide/beside.md"
CYCLE_US = 2000
# Cases that are played at once.
# How often a case is played that comes out otherwise than expected.
ATTEMPTS = 3
JOBS = int(os.environ.get("LINESMAN_BESIDE_JOBS") or 4)
# Where the recordings of wrong cells are kept, if anywhere.
KEEP = os.environ.get("LINESMAN_BESIDE_KEEP")
CLIENTS = {"SOEM": SOEM, "KickCAT": CAT, "ethercrab": CRAB}
# Listening from the start, and since the fault.
WHENS = ("start", "late")

# Places: a SubDevice by number, a link by its ends, the MainDevice's computer, the network as a whole.
HOST, NETWORK = "host", "network"
TAIL, CABLE = (3, 4), (1, 5)
AWAY = {"link-open", "link-flapping", "device-off", "supply-off", "brown-out", "ebus-overload"}
LOSSES = {
    "cable-degraded", "emc-noise", "transmitter-damaged", "receiver-damaged", "device-internal", "nic-damaged",
    "host-drops", "link-flapping", "false-link",
}
SENDER = {"host-jitter", "watchdog-starved", "late-frames"}


@dataclasses.dataclass
class Case:
    """A fault, and what may be said of it."""

    name: str
    what: str
    fault: dict
    causes: set
    places: set
    for_ms: float | None = None
    # Who can see it: its frames show an effect at the latest when frames are missing or unanswered.
    shown_to: tuple = tuple(CLIENTS)
    after_s: float = 2.5
    # Instead of a fault of the line: the MainDevice is stopped for so long, again and again.
    stopped_ms: int = 0


def case(name, what, causes, places, for_ms=None, **rest):
    settings = {key: rest.pop(key) for key in ("shown_to", "after_s", "stopped_ms") if key in rest}
    return Case(name, what, {"kind": name, **rest}, set(causes), set(places), for_ms, **settings)


def named(name, one):
    one.name = name
    return one


NOBODY = ()
CASES = [
    case("none", "nothing", (), (), shown_to=NOBODY),
    named("link-open 0.5 s", case("link-open", "a contact before A1 opens for 0.5 s", AWAY, {TAIL, 4}, 500, at="O1.B-A1.A")),
    named("link-open 2 s", case("link-open", "a contact before A1 opens for 2 s", AWAY, {TAIL, 4}, 2000, at="O1.B-A1.A", after_s=3.5)),
    named("link-open", case("link-open", "the cable between the couplers is out", AWAY, {CABLE, 5}, at="K1.C-K2.A")),
    case("device-off", "A1 has no power for 2 s", AWAY, {TAIL, 4}, 2000, device="A1", after_s=3.5),
    case("supply-off", "K2 and A2 have no power", AWAY, {CABLE, 5}, devices=["K2", "A2"]),
    case("brown-out", "the supply of K2 and A2 dips for 50 ms", AWAY | {"firmware-fault"}, {CABLE, 5}, devices=["K2", "A2"]),
    case("cable-degraded", "the cable between the couplers is worn", LOSSES, {CABLE, 1, 5, HOST}, at="K1.C-K2.A", hits_per_s=3000),
    case("emc-noise", "interference in that cable", LOSSES, {CABLE, 1, 5, HOST}, at="K1.C-K2.A", hits_per_s=20000),
    case("transmitter-damaged", "K1 sends poorly to K2", LOSSES, {CABLE, 1, 5, HOST}, at="K1.C>K2.A", hits_per_s=5000),
    case("nic-damaged", "the card receives poorly", LOSSES, {HOST, (0, 1)}, hits_per_s=5000),
    case("device-internal", "O1 spoils frames", LOSSES, {3, HOST}, device="O1", hits_per_s=20),
    case("host-drops", "the computer loses frames", LOSSES, {HOST}, drops_per_s=20),
    case("late-frames", "frames leave up to 1.5 ms late", SENDER, {HOST}, late_us=1500),
    named("paused", case("none", "the MainDevice stops for 300 ms again and again", SENDER, {HOST, NETWORK}, stopped_ms=300, after_s=4.5)),
    case("false-link", "the cable between the couplers passes nothing", AWAY | {"false-link"}, {CABLE, 1, 5}, at="K1.C-K2.A"),
    named("one pair open", case("link-open", "one pair of that cable is out", AWAY | {"false-link"}, {CABLE, 1, 5}, at="K1.C>K2.A")),
    case("firmware-fault", "the processor of A1 hangs", {"firmware-fault", "mailbox-stuck", "mailbox-slow"}, {4}, device="A1", shown_to=("SOEM",)),
    case("mailbox-stuck", "A1 takes and gives no messages", {"mailbox-stuck", "firmware-fault", "mailbox-slow"}, {4}, device="A1", side="both", shown_to=("SOEM",)),
    case("mailbox-slow", "A1 answers 1 s later", {"mailbox-slow", "mailbox-stuck", "firmware-fault"}, {4}, device="A1", by_ms=1000, shown_to=NOBODY),
    case("emergency", "A1 sends emergencies", {"emergency"}, {4}, device="A1", every_ms=500, shown_to=("SOEM",)),
    case("second-maindevice", "somebody else looks who is there", {"second-maindevice"}, {NETWORK, HOST, (0, 1)}),
    case("foreign-frames", "other frames on the line, which K1 destroys", {"foreign-frames"}, {NETWORK, HOST, (0, 1)}, shown_to=NOBODY),
    case("watchdog-starved", "the watchdog of A2 is shorter than the cycle", {"watchdog-starved"}, {6}, device="A2", watchdog_ms=1),
]

ALL = tuple(CLIENTS)


@dataclasses.dataclass
class Cell:
    """What was said in one case."""

    client: str
    name: str
    when: str
    # right, open, none, missed, cause, place, alarm
    outcome: str
    said: str
    # The same of the recording of what was heard, judged afterwards.
    outcome_recorded: str = ""
    said_recorded: str = ""

    def key(self):
        return (self.client, self.name, self.when)


GOOD = ("right", "open", "none")


def place_of(finding):
    place = finding["place"]
    if place["kind"] == "link":
        near = place["a"]["no"]
        if place["b"]:
            return near, place["b"]["no"]
        # The way into a SubDevice, from where was not seen.
        return near or (near,)
    return place["no"] if place["kind"] == "device" else place["kind"]


def judged(one, client, diagnosis):
    """The outcome, and what was said."""
    if "findings" not in diagnosis:
        # Nobody sent anything while it listened.
        return "open", "nothing was heard"
    told = [finding for finding in diagnosis["findings"] if finding["severity"] != "info"]
    network = diagnosis["network"]
    # A note that names the cause is more than silence.
    told = told or [finding for finding in diagnosis["findings"] if finding["cause"] in one.causes]
    if not told:
        said = diagnosis["verdict"].upper()
        if diagnosis["verdict"] == "inconclusive":
            return "open", said
        missing = network["lost"]
        if client in one.shown_to and one.name not in QUIET or missing:
            return "missed", f"{said}, {network['lost']} lost, {network['unanswered']} unanswered"
        return "none", said
    first = told[0]
    place = place_of(first)
    said = f"{first['code']} {first['cause']} {round(first['confidence'] * 100)} % at {place}"
    if not one.causes:
        return "alarm", said
    if first["cause"] not in one.causes:
        return "cause", said
    if place in one.places:
        return "right", said
    return ("open" if place == NETWORK else "place"), said


# Faults that spoil few frames, by chance none while it was looked.
QUIET = {"cable-degraded", "emc-noise", "transmitter-damaged", "nic-damaged", "device-internal", "host-drops"}


def play(one, name):
    """Plays a case beside a client: a cell for each listener."""
    client = CLIENTS[name]
    with Bench() as line, Segment(line, LINESMAN, FILE) as segment:
        records = {when: line.path(f"{when}.pcapng") for when in WHENS}
        listeners = {"start": listen(line, records["start"])}
        time.sleep(0.4)
        with line.telling(*command(client), *arguments(client)) as driver:
            in_op(driver, client)
            time.sleep(0.7)
            strike(one, segment, driver.process)
            # Late, but not too late to see any of it.
            listeners["late"] = listen(line, records["late"], 0.3 if (one.for_ms or 0) > 1000 else 0.1)
            if one.stopped_ms:
                stop_and_go(driver.process, one)
            else:
                time.sleep(one.after_s)
            cells = []
            for when, process in listeners.items():
                _, out, err = line.stop(process)
                diagnosis = parse(out, err)
                heard = judged(one, name, diagnosis)
                cells.append(Cell(name, one.name, when, *heard, *recorded(line, one, name, records[when])))
                keep(cells[-1], records[when])
            driver.process.kill()
    return cells


def recorded(line, one, client, record):
    """The outcome of the recording alone, and what was said; as that of a listener where nothing was heard."""
    _, out, err = line.run(line.near, LINESMAN, "diagnose", record, "--json")
    return judged(one, client, parse(out, err))


def command(client):
    if client is CRAB:
        return client.command()
    return client.command({"soem": "beside_soem.py", "kickcat": "beside_kickcat.py"}[client.name])


def arguments(client):
    return (NEAR, "loss", CYCLE_US) if client is CRAB else (NEAR, CYCLE_US)


def in_op(driver, client):
    if client is CRAB:
        end = time.monotonic() + 30
        while time.monotonic() < end:
            if driver.next(30).get("in_op") == 6:
                return
        raise AssertionError("not in OP")
    assert driver.next(30) == {"at": "op"}


def strike(one, segment, _):
    if one.fault["kind"] == "none":
        return
    segment.ask(do="inject", fault=one.fault, for_ms=one.for_ms)


def stop_and_go(process, one):
    pids = family(process.pid)
    end = time.monotonic() + one.after_s
    while time.monotonic() < end:
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(one.stopped_ms / 1e3)
        for pid in pids:
            os.kill(pid, signal.SIGCONT)
        time.sleep(1.2)


def family(pid):
    """A process with those that it started: `ip netns exec` becomes the program itself, `env` as well."""
    children = pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [pid, *map(int, children)]


def listen(line, record, pause=0.0):
    time.sleep(pause)
    return line.start(
        line.near, LINESMAN, "diagnose", f"listen:{NEAR}", "--seconds", 60, "--record", record, "--json",
    )


def keep(cell, record):
    if KEEP and (cell.outcome not in GOOD or cell.said_recorded != cell.said):
        file = "-".join(cell.key()).lower().replace(" ", "-")
        shutil.copy(record, pathlib.Path(KEEP) / f"{file}.pcapng")


def played(names, words=(), only=None):
    """All cells of these clients; of those cases alone that are in `only`, or whose names hold one of the words."""
    wanted = [
        (one, name)
        for name in names
        for one in CASES
        if (only is None or (name, one.name) in only) and (not words or any(word in f"{name} {one.name}" for word in words))
    ]
    cells = []
    with concurrent.futures.ThreadPoolExecutor(JOBS) as pool:
        running = {pool.submit(play, *pair): pair for pair in wanted}
        for done in concurrent.futures.as_completed(running):
            one, name = running[done]
            try:
                cells += done.result()
            except Skip:
                raise
            except Exception as error:
                why = f"{type(error).__name__}: {error}".splitlines()[0]
                cells += [Cell(name, one.name, when, "failed", why, "failed", why) for when in WHENS]
    return cells


def agrees(cell):
    """Whether it came out as it is to be, while it was listened and from the recording."""
    return cell.outcome in GOOD and cell.outcome_recorded in GOOD


def settled(names, words=()):
    """All cells of these clients. A case that comes out otherwise than expected is played again: it may have been the host."""
    cells, again = {}, None
    for _ in range(ATTEMPTS):
        tried = [cell for cell in played(names, words, again) if cell.key() not in cells or not agrees(cells[cell.key()])]
        cells |= {cell.key(): cell for cell in tried}
        again = {(client, name) for (client, name, _), cell in cells.items() if not agrees(cell)}
        if not again:
            break
    return sorted(cells.values(), key=lambda cell: (cell.client, order(cell.name), WHENS.index(cell.when)))


def told_counts(cells):
    """How many cells are admissible and right: heard, and from the recording."""
    admissible = sum(cell.outcome in GOOD for cell in cells)
    right, recorded_right = (
        sum(getattr(cell, one) in ("right", "none") for cell in cells) for one in ("outcome", "outcome_recorded")
    )
    return f"{admissible} of {len(cells)} cells admissible; right {right} heard, {recorded_right} from recordings"


def order(name):
    return [one.name for one in CASES].index(name)


WORDS = {
    "right": "{}", "open": "{} (left open)", "none": "{}", "missed": "**{}**", "cause": "**{}**", "place": "**{}**",
    "alarm": "**{}**", "failed": "not tried: {}",
}


def table(cells):
    by_key = {cell.key(): cell for cell in cells}
    for name in CLIENTS:
        yield f"## Beside {name}\n"
        yield "| fault | listening from the start | joined after it |\n|---|---|---|"
        for one in CASES:
            row = [by_key.get((name, one.name, when)) for when in WHENS]
            texts = [WORDS[cell.outcome].format(cell.said) if cell else "" for cell in row]
            yield f"| {one.what} (`{one.name}`) | {texts[0]} | {texts[1]} |"
        yield ""


def document_outcomes(client):
    """Whether the document calls a cell of this client right."""
    outcomes = {}
    _, _, part = DOCUMENT.read_text().partition(f"## Beside {client}\n")
    for row in part.partition("## ")[0].splitlines():
        cells = [cell.strip() for cell in row.split("|")[1:-1]]
        name = cells[0].rpartition("(`")[2].removesuffix("`)") if cells else ""
        if name in (one.name for one in CASES):
            outcomes |= {(client, name, when): not cell.startswith("**") for when, cell in zip(WHENS, cells[1:])}
    return outcomes


def main():
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    os.nice(-19)
    begin = time.monotonic()
    cells = settled(list(CLIENTS), words)
    for cell in cells:
        print(f"{cell.outcome:7} {cell.client:9} {cell.name:20} {cell.when:5} {cell.said}", flush=True)
        if cell.said_recorded != cell.said:
            print(f"{cell.outcome_recorded:7} {'':9} {'from the recording':20} {'':5} {cell.said_recorded}", flush=True)
    print(f"{told_counts(cells)}, {time.monotonic() - begin:.0f} s")
    if "--write" in sys.argv:
        write(cells)


def write(cells):
    head, mark, _ = DOCUMENT.read_text().partition("<!-- cells -->\n")
    DOCUMENT.write_text(head + mark + "\n" + "\n".join(table(cells)))


if __name__ == "__main__":
    main()
