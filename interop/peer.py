"""What every foreign MainDevice written in Python does with its result.

A peer is run as `PEER.py INTERFACE[+INTERFACE] CYCLES CYCLE_US`. It takes the line to OP, writes the pattern A5 to
every output for half of the cycles and 5A for the other half, and prints one JSON object:

    devices   what the scan found: [vendor, product, revision] or what this stack can tell
    state     the state reached by all
    cycles    process data exchanges, and `complete`: those with the working counter expected
    inputs    for A5 and 5A: the input bytes of each SubDevice at the end of that half, in hexadecimal
"""

import json
import sys

PATTERNS = (0xA5, 0x5A)


def arguments():
    """Interfaces (two for a ring), cycles, cycle in seconds."""
    _, interfaces, cycles, cycle_us = sys.argv
    return interfaces.split("+"), int(cycles), int(cycle_us) / 1e6


def report(**result):
    json.dump(result, sys.stdout)
    print()


def refuse(why):
    """Ends with the reason: the line could not be taken to OP."""
    print(why, file=sys.stderr)
    sys.exit(1)
