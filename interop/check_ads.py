"""A client of another make at the ADS server of a run, in another subnet than the server's address."""

import importlib.util

from bench import HERE, NEAR, Segment, parse
from check_gateway import CLIENT, GATEWAY, office
from check_own import wait_for
from harness import LINESMAN, Skip, check

# Of ads.toml: a coupler, an analog terminal, a stepper.
STEPPER = 0x1003
PRODUCTS = [0x044C2C52, 0x0C1E3052, 0x1B813052]


# proves: PLC-19
@check
def pyads_reads_and_writes_what_is_seen_online(line):
    if importlib.util.find_spec("pyads") is None:
        raise Skip("pyads is not installed")
    office(line)
    with Segment(line, LINESMAN, HERE / "ads.toml"):
        control = line.path("run")
        run = line.start(
            line.near, LINESMAN, "run", "--on", NEAR, "--cycle-us", 10_000, "--ads", GATEWAY, "--ads-allow", f"{CLIENT}/32",
            "--control", control, "--json",
        )
        wait_for(line, run, control, ["OP"] * len(PRODUCTS))
        status, out, err = line.python(line.far, "ads_client.py", GATEWAY, STEPPER)
        assert status == 0, f"status {status}: {(out + err)[-600:]}"
        told = parse(out.strip().splitlines()[-1], err)
        _, out, err = line.stop(run)
    counts = parse(out, err)["ads"]
    assert told["info"] == "Linesman" and told["ads_state"] == 5 and told["state"] == 8, told
    assert told["stations"] == [0x1001, 0x1002, 0x1003] and told["states"] == [8, 8, 8], told
    assert [product for _, product, *_ in told["identities"]] == PRODUCTS, told
    assert told["frames"][1] > 10 and told["frames"][2] == 0, told["frames"]
    assert told["damaged"] == told["changes"] == [0, 0, 0], told
    # Own address, own place, then the stations at ports A to D: at port B of the coupler hangs the second.
    assert told["topology"].startswith("01100000" + "0000" + "0210"), told["topology"]
    assert told["vendor"] == 2 and told["written"] == 1200, told
    # No such object, and its abort code; no such index group.
    assert (told["no_object"], told["abort"], told["no_group"]) == (0x70C, 0x06020000, 0x702), told
    assert told["reached"] == [4, 8], told
    assert counts["answers"] == counts["requests"] > 15 and sum(counts["refused"].values()) == 2, counts
