"""SOEM at mailboxes: SDOs of every kind and their aborts, the diagnosis history, emergencies, files, BOOT and firmware."""

from bench import HERE, NEAR, Segment
from harness import LINESMAN, SOEM, check


# proves: SW-08 partial: by SOEM, from one virtual device, SW-11 partial: by SOEM, SW-14 partial: by SOEM
@check
def soem_at_mailboxes_with_files_and_boot(line):
    with Segment(line, LINESMAN, HERE / "mailbox.toml"):
        result = SOEM.run(line, NEAR, script="mailbox_soem.py", seconds=90)
    assert result["expedited"] == "02000000" and result["normal"] == "EL7041", result
    # Subindex 0 takes two bytes when all is read at once.
    assert result["whole"] == "0200001a031a", result["whole"]
    assert result["whole from 1"] == "001a031a", result["whole from 1"]
    assert result["written"] == 1234, result["written"]
    assert result["segments agree"] is True, "an object in segments is another one than in one piece"
    assert result["aborts"] == [0x06020000, 0x06090011, 0x06010002, 0x08000022], list(map(hex, result["aborts"]))
    assert result["in use"] == 0x06010003, hex(result["in use"])
    assert result["too long"] == 0x06070012, hex(result["too long"])
    assert result["objects"] > 20 and result["entries"] > 100, (result["objects"], result["entries"])
    assert result["named"] == ["Diagnosis history"], result["named"]
    assert result["messages"] and result["new after"] == "00", result
    # Vendor's code in the low word; information that communication is there.
    assert any(message[:4] == "00e0" and message[12:16] == "0200" for message in result["messages"]), result["messages"]
    assert result["emergencies"][0][:2] == [0x4310, 8], result["emergencies"]
    assert result["before"].startswith("vlan="), result["before"]
    assert all(code < 0 for code in result["refused"]) and result["service"] == 32, result
    assert result["version after"] == "99" != result["version before"], result
