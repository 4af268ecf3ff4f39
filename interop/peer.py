"""What every foreign MainDevice written in Python does with its result.

A peer is run as `PEER.py INTERFACE[+INTERFACE] CYCLES CYCLE_US ROUNDS.json [sync0=NS] [overlap] [axes]`. It takes the line
to OP, exchanges process data for CYCLES cycles, an equal part of them for each round, and prints one JSON object:

    devices   what the scan found: [vendor, product, revision] or what this stack can tell
    state     the state reached by all
    attempts  how often it was tried to find the line, where that is more than once at times
    cycles    process data exchanges, and `complete`: those with the working counter expected
    wkc       the working counter of the process data, where this stack tells it
    rounds    for each round: the input bytes of each SubDevice at its end, in hexadecimal
    clocks    with `sync0`, the period of that signal: how far the clocks were off, see soem_clocks.py

ROUNDS.json is a list: for each round the output bytes by position, in hexadecimal. Outputs that are not named are 0.
With `overlap`, outputs and inputs lie at the same logical addresses. With `axes`, drives are told in PREOP how long it is
from one target to the next (0x60C2), as CiA 402 has it.
"""

import json
import pathlib
import sys
import types


def arguments():
    """Interfaces (two for a ring), cycles, cycle in seconds, rounds, and what else is asked."""
    _, interfaces, cycles, cycle_us, rounds, *options = sys.argv
    sync0 = [option.partition("=")[2] for option in options if option.startswith("sync0=")]
    return types.SimpleNamespace(
        interfaces=interfaces.split("+"), cycles=int(cycles), cycle_s=int(cycle_us) / 1e6,
        rounds=json.loads(pathlib.Path(rounds).read_text()),
        sync0_ns=int(sync0[0]) if sync0 else 0, overlap="overlap" in options, axes="axes" in options,
    )


def outputs(values, position, size):
    """The output bytes of one SubDevice."""
    wanted = bytes.fromhex(values.get(str(position), "00" * size))
    if len(wanted) != size:
        refuse(f"SubDevice {position + 1} has {size} output bytes, expected {len(wanted)}")
    return wanted


def report(**result):
    json.dump(result, sys.stdout)
    print()


def refuse(why):
    """Ends with the reason: the line could not be taken to OP."""
    print(why, file=sys.stderr)
    sys.exit(1)
