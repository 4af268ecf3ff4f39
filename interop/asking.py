"""What the checks of `diagnose listen:… --ask` share: a MainDevice that counts how it fares, and a listener that asks beside it."""

import json
import time

from bench import HERE, NEAR, parse
from harness import CAT, LINESMAN, SOEM

FILE = HERE / "beside.toml"
CYCLE_US = 2000
SCRIPTS = {"soem": "ask_soem.py", "kickcat": "ask_kickcat.py"}
CLIENTS = {"SOEM": SOEM, "KickCAT": CAT}


def driver(line, client, *options, on=NEAR):
    """A MainDevice of this kind, in OP; use it in `with`."""
    return line.telling(*client.command(SCRIPTS[client.name]), on, CYCLE_US, *options)


def in_op(client):
    assert client.next(60) == {"at": "op"}
    # The listener learns from a MainDevice that runs.
    time.sleep(0.5)


def counts(client):
    """How it fared, as it counts itself; it ends."""
    client.process.send_signal(2)
    return client.next(10)


def listener(line, *options, seconds=15, on=NEAR):
    return line.start(
        line.near, LINESMAN, "diagnose", f"listen:{on}", "--seconds", seconds, "--json", *options,
    )


def answer(line, process, seconds=60):
    """Exit status, diagnosis, and what was said beside it."""
    status, out, err = line.finish(process, seconds)
    return status, parse(out, err), err


def asked(line, *options, seconds=15):
    return answer(line, listener(line, "--ask", *options, seconds=seconds), seconds + 30)


def refused(line, *words):
    """The reason of a refusal, and the step that it names."""
    status, out, err = line.run(line.near, LINESMAN, "diagnose", *words, "--seconds", 20, "--json")
    assert status == 2, (status, out[:300], err[-300:])
    error = json.loads(out)
    assert error["schema"] == "linesman.error/1" and error["next_step"], error
    return error["reason"], error["next_step"]


def place(finding):
    told = finding["place"]
    if told["kind"] == "link":
        ends = tuple(told[end] and (told[end]["no"], told[end]["port"]) for end in ("a", "b"))
        return (*ends, told["direction"])
    return told["no"] if told["kind"] == "device" else told["kind"]


def wrong(diagnosis):
    """Findings but notes, the worst first."""
    return [one for one in diagnosis["findings"] if one["severity"] != "info"]
