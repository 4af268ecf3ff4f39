"""SOEM and KickCAT for ten minutes each without questions and with them: how they fared, as they count it themselves.

`ask_long.py [--write] [MINUTES]` prints a line for each run; with `--write` it writes the table of docs/guide/ask.md. Needs root
and LINESMAN as run.py does. Runs stand one after the other, as each wants the host for itself.
"""

import json
import os
import sys

from asking import CLIENTS, FILE, answer, counts, driver, in_op, listener
from bench import HERE, Bench, Segment
from harness import LINESMAN

DOCUMENT = HERE.parent / "docs/guide/ask.md"
MARK = "<!-- long -->"
MINUTES = 10


def main():
    minutes = next((float(word) for word in sys.argv[1:] if not word.startswith("--")), MINUTES)
    os.nice(-19)
    rows = [
        f"| {minutes:g} minutes, 2 ms, 6 SubDevices, as the program itself counts | cycles | lost | short | questions |",
        "|---|---|---|---|---|",
    ]
    for name, client in CLIENTS.items():
        for with_questions in (False, True):
            rows.append(row(name, *run(client, with_questions, minutes * 60)))
            print(rows[-1], flush=True)
    if "--write" in sys.argv:
        head, mark, rest = DOCUMENT.read_text().partition(MARK)
        _, _, after = rest.partition("\n\n")
        DOCUMENT.write_text(head + mark + "\n" + "\n".join(rows) + "\n\n" + after)


def run(client, with_questions, seconds):
    """How the MainDevice fared, and what was asked."""
    with Bench() as line, Segment(line, LINESMAN, FILE), driver(line, client) as main:
        in_op(main)
        options = ["--ask"] if with_questions else []
        _, diagnosis, err = answer(line, listener(line, *options, seconds=seconds), seconds + 60)
        told = counts(main)
    print(json.dumps({"counts": told, "asking": diagnosis.get("asking"), "said": err}), file=sys.stderr, flush=True)
    return told, diagnosis.get("asking")


def row(name, told, asking):
    what = f"{name}, {'with' if asking else 'without'} questions"
    short = told.get("short", "counted as lost")
    asked = f"{asking['questions']:,}, {asking['answered']:,} answered, {asking['state']}" if asking else ""
    return f"| {what} | {told['cycles']:,} | {told['lost']:,} | {short} | {asked} |"


if __name__ == "__main__":
    main()
