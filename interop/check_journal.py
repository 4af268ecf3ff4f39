"""What happens on a line is in the journal of the system after Linesman has ended: systemd's own, in a mount namespace."""

import json
import os
import shutil
import time

from bench import NEAR, Segment
from check_own import wait_for
from harness import LINE, LINESMAN, Skip, check

JOURNALD = next((path for path in ("/lib/systemd/systemd-journald", "/usr/lib/systemd/systemd-journald") if os.access(path, os.X_OK)), None)
# Another program writes as well; the journal's own filters tell them apart.
SCRIPT = f"""
set -e
mount --make-rprivate /
mount -t tmpfs none /run
# `ip netns exec` has hidden the control groups, without which journald ends.
mount -t cgroup2 none /sys/fs/cgroup
mkdir -p /run/systemd/journal /run/systemd/journald.conf.d /run/log/journal
printf '[Journal]\\nStorage=volatile\\nReadKMsg=no\\nAudit=no\\n' > /run/systemd/journald.conf.d/linesman.conf
{JOURNALD} 2> /dev/null &
journal=$!
trap 'kill $journal' EXIT
for try in $(seq 100); do [ -S /run/systemd/journal/socket ] && break; sleep 0.05; done
"$1" run --on "$2" --cycle-us 2000 --control "$3" --no-diagnosis --system-log > "$4.out" 2>&1 &
run=$!
for number in $(seq 50); do echo "entry $number"; done | systemd-cat --identifier other
while [ ! -e "$4.stop" ]; do sleep 0.05; done
kill -INT $run
wait $run || true
journalctl --sync
journalctl --directory /run/log/journal --no-pager --output json > "$4.all"
journalctl --directory /run/log/journal --no-pager --output json --identifier linesman > "$4.ours"
journalctl --directory /run/log/journal --no-pager --output json LINESMAN_DEVICE=3 > "$4.device"
journalctl --directory /run/log/journal --no-pager --output export LINESMAN_DEVICE=3 > "$4.export"
"""


# proves: SW-07 (V)
@check
def journal_holds_what_happened_on_the_line_after_the_tool_has_ended(line):
    if JOURNALD is None or not all(map(shutil.which, ("journalctl", "systemd-cat"))):
        raise Skip("systemd-journald, journalctl or systemd-cat is not installed")
    script, control, result = line.path("script"), line.path("run"), line.path("journal")
    script.write_text(SCRIPT)
    with Segment(line, LINESMAN, LINE.file) as segment:
        run = line.start(line.near, "unshare", "--mount", "bash", script, LINESMAN, NEAR, control, result)
        wait_for(line, run, control, ["OP"] * len(LINE))
        segment.ask(do="inject", fault={"kind": "device-off", "device": "O1"})
        time.sleep(2)
        result.with_name(f"{result.name}.stop").touch()
        status, out, err = line.finish(run, 30)
    assert status == 0, f"status {status}: {(out + err)[-600:]}"
    read = {name: entries(result.with_name(f"{result.name}.{name}")) for name in ("all", "ours", "device")}
    assert 0 < len(read["ours"]) < len(read["all"]), {name: len(kept) for name, kept in read.items()}
    assert len([one for one in read["all"] if one["SYSLOG_IDENTIFIER"] == "other"]) == 50, "those of the other program"
    assert all(one["SYSLOG_IDENTIFIER"] == "linesman" for one in read["ours"]), read["ours"][:2]
    # The third SubDevice reached OP, and was lost.
    messages = [one["MESSAGE"] for one in read["device"]]
    assert 0 < len(messages) < len(read["ours"]), messages
    assert any("OP reached" in one for one in messages), messages
    lost = [one for one in read["device"] if "interrupted" in one["MESSAGE"]]
    assert lost and all(one["PRIORITY"] == "3" and one["LINESMAN_LINE"] == NEAR for one in lost), messages
    exported = result.with_name(f"{result.name}.export").read_text()
    assert exported.count("\nLINESMAN_DEVICE=3\n") == len(messages), exported[:600]


def entries(file):
    return [json.loads(one) for one in file.read_text().splitlines()]
