"""Foreign MainDevices, and Linesman itself, against a virtual segment over a virtual cable.

Needs root. Run it with `cargo xtask interop`, which builds what it needs; or by hand with LINESMAN
set to the binary, and ETHERCRAB_PEER to the peer in `interop/ethercrab`. With names, only the checks
whose names contain one of them. Each check prints one line that begins with `ok`, `FAIL` or `skip`;
the exit status is 1 when one failed.

Checks stand in `check_*.py` and `dc_*.py`. What went over the cable while a check ran must be
readable: tshark looks at each packet.
"""

import importlib
import shutil
import sys
import time
import traceback

from bench import HERE, Bench, Capture
from harness import CHECKS, Skip
from skipped import SKIPPED

HAS_TSHARK = all(shutil.which(program) for program in ("tcpdump", "tshark"))


def load():
    """All checks, in the order of their files."""
    for pattern in ("check_*.py", "dc_*.py"):
        for file in sorted(HERE.glob(pattern)):
            importlib.import_module(file.stem)


def captured(function, line):
    """Runs a check; gives how many packets went over the cable."""
    if not HAS_TSHARK:
        function(line)
        return "not captured: tcpdump or tshark is missing"
    with Capture(line) as capture:
        function(line)
    count, bad = capture.malformed()
    assert not bad, f"{len(bad)} of {count} packets are malformed, the first is {bad[0]}"
    return f"{count} packets, none malformed"


def main():
    load()
    wanted = sys.argv[1:]
    failed = 0
    with Bench() as line:
        for function in CHECKS:
            name = function.__name__
            if wanted and not any(word in name for word in wanted):
                continue
            start = time.monotonic()
            try:
                note = captured(function, line)
                print(f"ok {name}: {note}, {time.monotonic() - start:.1f} s", flush=True)
            except Skip as why:
                print(f"skip {name}: {why}", flush=True)
            except Exception as error:
                failed += 1
                print(f"FAIL {name}: {type(error).__name__}: {error}", flush=True)
                if not isinstance(error, (AssertionError, RuntimeError)):
                    traceback.print_exc()
    if not wanted:
        for client, feature, why in SKIPPED:
            print(f"skip {client}, {feature}: {why}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
