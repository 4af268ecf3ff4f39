"""Mailbox and SII services, seen by foreign MainDevices; the alias is written, and used after a power cycle."""

from bench import NEAR, Segment
from harness import CRAB, LINE, LINESMAN, SOEM, check, until_present

# The analogue terminal of the line; its SII begins with its configuration and ends the first 16 bytes with a checksum.
TERMINAL, ALIAS = "A1", 0x2A


@check
def soem_reads_and_writes_objects_and_the_sii(line):
    def ask():
        return SOEM.run(line, NEAR, script="services.py")

    first, second = with_power_cycle(line, ask)
    assert first["abort"] == "0x06020000", first["abort"]
    # Complete access: subindex 0 takes 16 bits, then vendor, product, revision, serial.
    whole = bytes.fromhex(first["whole"])
    assert len(whole) == 18 and whole[0] == 4 and whole[1] == 0, first["whole"]
    assert int.from_bytes(whole[2:6], "little") == 2 and int.from_bytes(whole[6:10], "little") == 0x0C203052
    assert second["alias_register"] == ALIAS, second


@check
def ethercrab_reads_and_writes_objects_and_the_sii(line):
    def ask():
        return CRAB.run(line, NEAR, "services")

    first, second = with_power_cycle(line, ask)
    assert "Err" in first["abort"] and "NotFound" in first["abort"].replace(" ", ""), first["abort"]
    assert (second["alias_register"], second["alias_scanned"]) == (ALIAS, ALIAS), second


def with_power_cycle(line, ask):
    """Asks, takes the power from the terminal for a moment, asks again."""
    with Segment(line, LINESMAN, LINE.file) as segment:
        first = ask()
        assert first["vendor"] == 2 and first["name"] == "EL3104", first
        before, after = first["limit"]
        assert after == before + 77, first["limit"]
        assert first["alias_register"] == 0 and first["alias_stored"] == ALIAS, first
        status, out, _ = line.python(line.near, "probe.py", NEAR, "alias", ALIAS)
        assert status == 0 and int(out) == 0, f"the alias is in force before the power cycle: {out!r}"
        segment.ask(do="inject", fault={"kind": "brown-out", "device": TERMINAL})
        until_present(line, len(LINE))
        status, out, _ = line.python(line.near, "probe.py", NEAR, "alias", ALIAS)
        assert status == 0 and int(out) == 1, f"nobody answers to the alias: {out!r}"
        second = ask()
        assert second["sii"][:16] == first["sii"][:16], "the SII changed where it was not written"
        return first, second
