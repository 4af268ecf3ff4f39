"""Foreign MainDevices, and Linesman itself, against a virtual segment over a virtual cable.

Needs root. Run it with `cargo xtask interop`, which builds what it needs; or by hand with LINESMAN
set to the binary, and ETHERCRAB_PEER to the peer in `interop/ethercrab`. With names, only the checks
whose names contain one of them. Each check prints one line that begins with `ok`, `FAIL` or `skip`;
the exit status is 1 when one failed.

Checks stand in `check_*.py` and `dc_*.py`. Each has namespaces of its own, so several run at once:
as many as LINESMAN_INTEROP_JOBS says, else one more than there are processors, as most of them wait
most of the time. What went over the cable while a check ran must be readable: tshark looks at each
packet. A check that fails while the host stood still (`stalls.py`) has shown nothing and is tried again, which its line tells.
"""

import concurrent.futures
import importlib
import os
import shutil
import sys
import time
import traceback

from bench import HERE, Bench, Capture
from harness import CHECKS, Skip
from skipped import SKIPPED
from stalls import Stalls, Waits

ATTEMPTS = 3
HAS_TSHARK = all(shutil.which(program) for program in ("tcpdump", "tshark"))


def load():
    """All checks, in the order of their files."""
    for pattern in ("check_*.py", "dc_*.py"):
        for file in sorted(HERE.glob(pattern)):
            importlib.import_module(file.stem)


def captured(function, line):
    """Runs a check; gives how many packets went over the cable."""
    if getattr(function, "spoils_frames", False):
        function(line)
        return "not captured: frames are spoiled on purpose"
    if not HAS_TSHARK:
        function(line)
        return "not captured: tcpdump or tshark is missing"
    with Capture(line) as capture:
        function(line)
    count, passed, bad = capture.malformed()
    assert not bad, f"{len(bad)} of {count} packets are malformed, the first is {bad[0]}"
    # The host may drop copies while it is busy; where many are missing the capture proves little.
    assert count >= passed * 0.9, f"only {count} of {passed} packets were captured"
    return f"{count} packets, none malformed" if count >= passed else f"{count} of {passed} packets captured, none malformed"


def tried(function, stalls):
    """The line that tells how a check went."""
    before = []
    while True:
        start = time.monotonic()
        told, waited = once(function, before)
        if not told.startswith("FAIL") or len(before) + 1 == ATTEMPTS:
            return told
        stood = max(stalls.longest_ms(start), waited)
        if stood == 0:
            return told
        why = told.splitlines()[0].removeprefix(f"FAIL {function.__name__}: ")
        before.append(f"tried again, as the host stood still for {stood:.0f} ms: {why}")


def once(function, before):
    """The line that tells how one attempt went, and why those before it did not count; for how long a program of it had to
    wait for a processor, in milliseconds."""
    name, start = function.__name__, time.monotonic()
    waits = None
    try:
        with Bench() as line, Waits(line.running) as waits:
            note = "; ".join([captured(function, line), *line.notes, *before])
        told = f"ok {name}: {note}, {time.monotonic() - start:.1f} s"
    except Skip as why:
        told = f"skip {name}: {why}"
    except (AssertionError, RuntimeError) as error:
        told = f"FAIL {name}: {type(error).__name__}: {error}, {time.monotonic() - start:.1f} s"
    except Exception as error:
        told = f"FAIL {name}: {type(error).__name__}: {error}\n{traceback.format_exc()}"
    return told, waits.longest_ms if waits else 0.0


def main():
    # Timeouts of foreign MainDevices are made for hosts that do nothing else, 2 ms for a frame and 20 ms for a word of the
    # SII: so all this goes before other programs, as the segment does.
    os.nice(-19)
    load()
    wanted = sys.argv[1:]
    checks = [one for one in CHECKS if not wanted or any(word in one.__name__ for word in wanted)]
    jobs = int(os.environ.get("LINESMAN_INTEROP_JOBS") or (os.cpu_count() or 1) + 1)
    failed = 0
    stalls = Stalls()
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        running = [pool.submit(tried, one, stalls) for one in checks]
        try:
            for done in concurrent.futures.as_completed(running):
                failed += done.result().startswith("FAIL")
                print(done.result(), flush=True)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        finally:
            stalls.end()
    if not wanted:
        for client, feature, why in SKIPPED:
            print(f"skip {client}, {feature}: {why}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
