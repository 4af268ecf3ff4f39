"""What was recorded beside a foreign MainDevice, in programs that read tables."""

import importlib.util
import time

from bench import NEAR, Segment, Watch, parse
from harness import LINE, LINESMAN, SOEM, Skip, check, linesman

# Datagrams whose working counter was wrong, by second and datagram.
MISSES = """
    SELECT time_ns // 1000000000 AS second, command, logical, data_len, count(*)
    FROM '{}' WHERE wkc_wrong AND way = 'back' AND logical IS NOT NULL GROUP BY ALL ORDER BY ALL
"""


@check
def wrong_working_counters_of_a_table_are_those_of_the_verdict(line):
    if importlib.util.find_spec("duckdb") is None:
        raise Skip("duckdb is not installed")
    # Not on top: other checks need nothing of it.
    import duckdb

    recording = record_cut(line)
    table = line.path("rows.parquet")
    status, out, err = linesman(line, "capture", "export", *recording, "--parquet", table)
    assert status == 0, f"export: status {status}: {err[-600:]}"
    counted = {}
    for _, command, logical, length, misses in duckdb.sql(MISSES.format(table)).fetchall():
        counted[command, logical, length] = counted.get((command, logical, length), 0) + misses

    status, out, err = linesman(line, "capture", "info", *recording, "--json")
    assert status == 0, f"info: status {status}: {err[-600:]}"
    datagrams = [one for frame in parse(out, err)["cyclic"] for one in frame["datagrams"]]
    told = {
        (one["command"], one["logical"], one["len"]): sum(miss["count"] for miss in one["misses"])
        for one in datagrams
        if one["misses"]
    }
    assert told and counted == told, (counted, told)
    line.notes.append(f"{sum(told.values())} datagrams with a wrong working counter, by DuckDB and by the verdict")


def record_cut(line):
    """The files of a recording of a line that SOEM drives, and that was cut."""
    rounds = LINE.draw(1)
    with Segment(line, LINESMAN, LINE.file) as segment:

        def cut_it():
            # The recording knows what is whole by then.
            time.sleep(1)
            segment.ask(do="inject", fault={"kind": "link-open", "at": "O1.B-A1.A"})

        recorder = line.start(line.near, LINESMAN, "capture", "record", NEAR, "--output", line.path("cut.pcapng"))
        # SOEM's bring-up is to be in it.
        time.sleep(0.5)
        with Watch(segment, LINE.shown(rounds[0]), cut_it) as watch:
            SOEM.exchange(line, LINE, rounds, cycles=2000)
        assert watch.then is None, "the line was not cut"
        status, out, err = line.stop(recorder)
        assert status == 0, f"record: status {status}: {(out + err)[-600:]}"
    recording = sorted(line.work.glob("*-cut_*.pcapng"))
    assert recording, f"nothing was recorded: {out}{err}"
    return recording
