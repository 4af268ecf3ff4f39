"""Objects of every length, up and down, value by value: in four bytes, in one message, in several."""

from bench import HERE, NEAR, Segment
from harness import CAT, CRAB, LINESMAN, SOEM, check
from objects import WRITTEN

# What store.xml says.
STORED = {
    "number": bytes([4, 3, 2, 1]),
    "label": b"exactly twenty signs",
    "page": b"".join(b"line %02d of the page;" % number for number in range(30)),
}
TOO_LONG = 0x06070012


@check
def soem_reads_and_writes_objects_of_every_length(line):
    result = on_the_store(line, SOEM, "soem", script="objects.py")
    all_as_written(result, ("number", "label", "page"))
    assert result["too long"] == [TOO_LONG] * 3, [hex(code) for code in result["too long"]]


@check
def kickcat_reads_and_writes_objects_of_every_length(line):
    result = on_the_store(line, CAT, "kickcat", script="objects.py")
    all_as_written(result, ("number", "label"))


@check
def ethercrab_reads_and_writes_objects_of_every_length(line):
    result = on_the_store(line, CRAB, "objects")
    assert result["number"] == int.from_bytes(STORED["number"], "little"), result["number"]
    assert result["written"] == int.from_bytes(WRITTEN["number"][1], "little"), result["written"]
    assert result["label"] == STORED["label"].hex(), result["label"]
    # Its own words for what it does not know; should it learn it, the page must be right.
    assert result["page"] in ("Wire(InvalidValue)", STORED["page"].hex()), result["page"]


def on_the_store(line, client, *arguments, script=None):
    with Segment(line, LINESMAN, HERE / "objects.toml"):
        return client.run(line, NEAR, *arguments, script=script)


def all_as_written(result, names):
    for name in names:
        assert result[name] == STORED[name].hex(), f"{name}: {result[name]}"
        assert result[f"{name} written"] == WRITTEN[name][1].hex(), f"{name} after the download: {result[f'{name} written']}"
