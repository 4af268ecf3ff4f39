"""SOEM drives devices that are made from descriptions and EEPROM images of their makers: terminals, a drive, a
controller board. The files are nobody's to give away: LINESMAN_DATA says where they lie."""

import os
import pathlib
import struct

from bench import NEAR, Segment, Watch
from harness import CYCLE_US, LINESMAN, SOEM, Skip, check, ran

# Name, file, where it hangs; vendor and product that SOEM must find.
DEVICES = [
    ("K1", "esi:{}/esi/dls-Beckhoff-EK11xx.xml#EK1100", "maindevice", (2, 0x044C2C52)),
    ("I1", "esi:{}/esi/dls-Beckhoff-EL1xxx.xml#EL1008", "K1.B", (2, 0x03F03052)),
    ("O1", "sii:{}/sii/ec-EL2004.bin", "I1.B", (2, 0x07D43052)),
    ("O2", "sii:{}/sii/ec-EL2828.bin", "O1.B", (2, 0x0B0C3052)),
    ("A1", "esi:{}/esi/dls-Beckhoff-EL47xx.xml#EL4732", "O2.B", (2, 0x127C3052)),
    ("D1", "esi:{}/esi/kickcat-ingenia_esi.xml", "K1.C", (0x29C, 0x03B11002)),
    ("X1", "sii:{}/sii/pairs/kickcat-xmc4800-relax.bin", "D1.B", (0x1337, 0x4800)),
]
I1, O1, O2, A1, D1 = range(1, 6)
HELD = {"I1.5": 1, "I1.7": 1}
# A drive is switched on and moved: controlword, target, and what the statusword says then under the mask 0x6F.
DRIVE = [(0x06, 0, 0x21), (0x07, 0, 0x23), (0x0F, 0, 0x27), (0x0F, 500, 0x27)]
CSP = 8
CYCLES = 800


@check
def soem_drives_devices_from_descriptions_of_their_makers(line):
    data = os.environ.get("LINESMAN_DATA")
    if not data or not pathlib.Path(data, "esi").is_dir():
        raise Skip("LINESMAN_DATA does not name a folder with descriptions (esi/) and EEPROM images (sii/)")
    with Segment(line, LINESMAN, segment_file(line, data)) as segment:
        for name, value in HELD.items():
            segment.ask(do="set", input=name, value=value)
        rounds = [round_of(number) for number in range(len(DRIVE))]
        images = line.path("rounds.json")
        images.write_text(str([{place: data.hex() for place, data in one.items()} for one in rounds]).replace("'", '"'))
        with Watch(segment) as watch:
            result = SOEM.run(line, NEAR, CYCLES, CYCLE_US, images, "axes")
        found = [tuple(device[:2]) for device in result["devices"]]
        assert found == [identity for *_, identity in DEVICES], found
        ran(line, result)
        for number, (wanted, image) in enumerate(zip(rounds, result["rounds"], strict=True)):
            arrived(number, wanted, image, watch)


def segment_file(line, data):
    file = line.path("described.toml")
    devices = [f'[[device]]\nname = "{name}"\ntype = "{kind.format(data)}"\non = "{on}"\n' for name, kind, on, _ in DEVICES]
    file.write_text("\n".join(['name = "described"\nseed = 1\n', *devices]))
    return file


def round_of(number):
    """Outputs of each position, other ones in each round."""
    control, target, _ = DRIVE[number]
    return {
        str(O1): bytes([0b0101 << number & 0x0F]),
        str(O2): bytes([0x71 + 37 * number]),
        str(A1): struct.pack("<4h", number, 1000 * number, number, -777 * number),
        str(D1): struct.pack("<HiiB", control, target, 0, CSP),
    }


def arrived(number, wanted, image, watch):
    """What was written is at the outputs; inputs and the drive answer as they must."""
    four, eight = wanted[str(O1)][0], wanted[str(O2)][0]
    shown = {f"O1.{bit + 1}": four >> bit & 1 for bit in range(4)} | {f"O2.{bit + 1}": eight >> bit & 1 for bit in range(8)}
    # Two channels, each a count of cycles and a sample. Without SYNC a sample is played when its buffer is served.
    samples = struct.unpack("<4h", wanted[str(A1)])
    shown |= {"A1.1": samples[1], "A1.2": samples[3]}
    assert watch.saw(shown), f"round {number + 1}: the outputs never were {shown}; last: {watch.seen[-1]}"
    # The first four inputs are wired to the four outputs, others are held or open.
    read = bytes.fromhex(image[I1])[0]
    assert read == four | 0b0101_0000, f"round {number + 1}: inputs 0x{read:02X}, outputs 0x{four:02X}"
    status, actual, _, mode = struct.unpack("<HiiB", bytes.fromhex(image[D1]))
    _, target, state = DRIVE[number]
    told = f"round {number + 1}: status 0x{status:04X}, mode {mode}, at {actual}"
    assert status & 0x6F == state, f"{told}; expected status 0x{state:02X} under 0x6F"
    assert abs(actual - target) <= 10, f"{told}; expected position {target}"
