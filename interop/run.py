"""Foreign MainDevices, and Linesman itself, against a virtual segment over a virtual cable.

Needs root. Run it with `cargo xtask interop`, which builds what it needs; or by hand with LINESMAN
set to the binary, and ETHERCRAB_PEER to the peer in `interop/ethercrab`. With names, only the checks
whose names contain one of them. Each check prints one line that begins with `ok`, `FAIL` or `skip`;
the exit status is 1 when one failed.

Checks stand in `check_*.py` and `dc_*.py`. Each has namespaces of its own, so several run at once:
as many as LINESMAN_INTEROP_JOBS says, else one more than there are processors, as most of them wait
most of the time. What went over the cable while a check ran must be readable: tshark looks at each
packet, and none may be missing but for the time in which the host stood still (`stalls.py`). A check that fails while the
host stood still has shown nothing and is tried again, which its line tells: at once where `retried.py` names it, else
when no other check runs any more; three times at most. A check that counts what the host did and says each time that this hid
what it looks for is left out, with these words: nothing was shown, neither right nor wrong.
"""

import concurrent.futures
import dataclasses
import importlib
import os
import shutil
import sys
import time
import traceback

from bench import HERE, Bench, Capture
from harness import CHECKS, Skip, Spoiled
from retried import RETRIED
from skipped import SKIPPED
from stalls import Host, Stalls, Waits

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
    if count >= passed:
        return f"{count} packets, none malformed"
    # While the host stands still the kernel drops copies: as many as crossed in that time, at most.
    stood = sum(line.stood(capture.begun))
    excused = min(1.0, stood / capture.took_ms)
    assert passed - count <= passed * excused, (
        f"only {count} of {passed} packets were captured; that the host stood still for {stood:.0f} of {capture.took_ms:.0f} ms "
        f"excuses {passed * excused:.0f}"
    )
    return f"{count} of {passed} packets captured, the host stood still for {stood:.0f} ms, none malformed"


@dataclasses.dataclass
class Attempt:
    """One run of a check."""

    result: str  # ok, FAIL or skip
    why: str
    # For how long the host stood still in it, in milliseconds, where that excuses a failure.
    excuse_ms: float = 0.0
    # The check itself counted that the host hid what it looks for.
    is_spoiled: bool = False

    @property
    def is_excused(self):
        return self.result == "FAIL" and (self.excuse_ms > 0 or self.is_spoiled)


def told(function, attempts):
    """The line that tells how a check went."""
    *before, last = attempts
    result, why = last.result, last.why
    if all(one.is_spoiled for one in attempts):
        result, why = "skip", f"not judged, {why}"
    whys = [f"tried again, the host stood still for {one.excuse_ms:.0f} ms at most at a time: {one.why}" for one in before]
    return "; ".join([f"{result} {function.__name__}: {why}", *whys])


def tried(function, stalls):
    """The attempts at a check until one counts."""
    attempts = [once(function, stalls)]
    while function.__name__ in RETRIED and attempts[-1].is_excused and len(attempts) < ATTEMPTS:
        attempts.append(once(function, stalls))
    return attempts


def tried_alone(function, stalls, attempts):
    """The attempts at a check that failed while the host stood still, now that no other one runs."""
    for _ in range(ATTEMPTS):
        attempts = [*attempts, once(function, stalls)]
        if not attempts[-1].is_excused:
            break
    return attempts


def once(function, stalls):
    start, host = time.monotonic(), None
    try:
        with Bench() as line, Waits(line.running) as waits:
            host = line.host = Host(stalls, waits)
            note = "; ".join([captured(function, line), *line.notes])
        return Attempt("ok", f"{note}, {time.monotonic() - start:.1f} s")
    except Skip as error:
        return Attempt("skip", str(error))
    except Spoiled as error:
        why = f"the host spoiled it by itself: {error}, {time.monotonic() - start:.1f} s"
        return Attempt("FAIL", why, host.excuse_ms(start), True)
    except (AssertionError, RuntimeError) as error:
        why = f"{type(error).__name__}: {error}, {time.monotonic() - start:.1f} s"
    except Exception as error:
        why = f"{type(error).__name__}: {error}\n{traceback.format_exc()}"
    return Attempt("FAIL", why, host.excuse_ms(start) if host else 0.0)


def together(checks, jobs, stalls, tell):
    """Runs checks beside each other and tells how they went; gives those that a stall excuses, with their attempts."""
    excused = []
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(tried, one, stalls): one for one in checks}
        try:
            for done in concurrent.futures.as_completed(running):
                attempts = done.result()
                if attempts[-1].is_excused:
                    excused.append((running[done], attempts))
                else:
                    tell(running[done], attempts)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return excused


def main():
    # Timeouts of foreign MainDevices are made for hosts that do nothing else, 2 ms for a frame and 20 ms for a word of the
    # SII: so all this goes before other programs, as the segment does.
    os.nice(-19)
    load()
    wanted = sys.argv[1:]
    checks = [one for one in CHECKS if not wanted or any(word in one.__name__ for word in wanted)]
    jobs = int(os.environ.get("LINESMAN_INTEROP_JOBS") or (os.cpu_count() or 1) + 1)
    counts = {"ok": 0, "FAIL": 0, "skip": 0}
    stalls = Stalls()

    def tell(function, attempts):
        line = told(function, attempts)
        counts[line.split()[0]] += 1
        print(line, flush=True)

    try:
        for function, attempts in together(checks, jobs, stalls, tell):
            tell(function, tried_alone(function, stalls, attempts))
    finally:
        stalls.end()
    if not wanted:
        for client, feature, why in SKIPPED:
            print(f"skip {client}, {feature}: {why}", flush=True)
    print(f"{counts['ok']} checks passed, {counts['FAIL']} failed, {counts['skip']} were left out", flush=True)
    return 1 if counts["FAIL"] else 0


if __name__ == "__main__":
    sys.exit(main())
