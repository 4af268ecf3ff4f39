"""What stands in a segment file, as a reader of data sheets knows it: identities, the order in which frames pass,
and where in the process data each channel lies. Nothing here is asked of Linesman."""

import random
import struct
import tomllib

VENDOR = 2

# Frames leave a controller by its ports in this order, seen from the port by which they came in.
ORDER = "ADBC"

# Outputs and inputs of each type: channels, bits from one channel to the next, bits before the value, bits of the value.
BITS_8 = (8, 1, 0, 1)
BITS_4 = (4, 1, 0, 1)


def words(channels, stride=16, before=0):
    """Analogue channels of 16 bits."""
    return (channels, stride, before, 16)


class Kind:
    """A type: its products (one for each controller), its channels, what its analogue converters resolve, what it adds
    to the working counter of an LRW: 2 for outputs, 1 for inputs."""

    def __init__(self, *products, vendor=VENDOR, outputs=None, inputs=None, low=-0x8000, lost_bits=0, axis=False, wkc=None):
        self.products, self.vendor, self.outputs, self.inputs = products, vendor, outputs, inputs
        self.low, self.lost_bits, self.axis = low, lost_bits, axis
        self.wkc = 2 * bool(outputs or axis) + bool(inputs or axis) if wkc is None else wkc

    def both_ways(self):
        return self.axis or bool(self.outputs and self.inputs)

    def is_digital(self):
        return any(channels and channels[3] == 1 for channels in (self.outputs, self.inputs))

    def has_processor(self):
        """Analogue values, and axes."""
        return self.axis or any(channels and channels[3] == 16 for channels in (self.outputs, self.inputs))

    def shown(self, value):
        """What the converter makes of a value."""
        value = max(self.low, min(value, 0x7FFF))
        return value >> self.lost_bits << self.lost_bits


# Standard inputs bring a status word before each value.
KINDS = {
    "EK1100": Kind(0x044C2C52),
    # Its switch for an identification is an input.
    "EK1101": Kind(0x044D2C52, wkc=1),
    "EK1110": Kind(0x04562C52),
    "EK1122": Kind(0x04622C52),
    "CU1128": Kind(*[None] * 3),
    "EL1008": Kind(0x03F03052, inputs=BITS_8),
    "EL1014": Kind(0x03F63052, inputs=BITS_4),
    "EL2008": Kind(0x07D83052, outputs=BITS_8),
    "EL3102": Kind(0x0C1E3052, inputs=words(2, 32, 16)),
    "EL3104": Kind(0x0C203052, inputs=words(4, 32, 16)),
    "EL3154": Kind(0x0C523052, inputs=words(4, 32, 16), low=0),
    "EL3162": Kind(0x0C5A3052, inputs=words(2, 32, 16), low=0),
    "EL4004": Kind(0x0FA43052, outputs=words(4), low=0, lost_bits=4),
    "EL4102": Kind(0x10063052, outputs=words(2), low=0),
    "EL4112": Kind(0x10103052, outputs=words(2), low=0),
    "EL7041": Kind(0x1B813052, axis=True),
    # Its vendor is nobody: it is what all drives of the profile have in common.
    "CiA402-Drive": Kind(0x402, vendor=0xFFFFFFF0, axis=True),
    "EP1008-0001": Kind(0x03F04052, inputs=BITS_8),
    "EP2308-0001": Kind(0x09044052, outputs=BITS_4, inputs=BITS_4),
    "EP4174-0002": Kind(0x104E4052, outputs=words(4)),
}


# What a drive is told in one round after the other (controlword, target position), and what it must say then
# (statusword under the mask 0x6F): ready to switch on, switched on, operation enabled, and on to another position.
# The step stays below the drives' following error window of 100,000, whatever the position in the line.
DRIVE_ROUNDS = [(0x06, 0, 0x21), (0x07, 0, 0x23), (0x0F, 0, 0x27), (0x0F, 2000, 0x27)]
# Mode of operation: cyclic synchronous position.
CSP = 8


class Plant:
    """The devices of a file in the order in which frames pass them."""

    def __init__(self, file):
        self.file = file
        devices = tomllib.loads(file.read_text())["device"]
        kinds = {device["name"]: KINDS[device["type"]] for device in devices}
        # Attached controllers by place; those in one housing hang on port C of the one before.
        hanging = {device["on"]: device["name"] for device in devices}
        for name, kind in kinds.items():
            for part in range(2, len(kind.products) + 1):
                before = name if part == 2 else f"{name}/{part - 1}"
                hanging[f"{before}.C"] = f"{name}/{part}"
        # (name, type or None for a further controller, product or None)
        self.devices = []
        self.vendors = []

        def walk(controller):
            name, _, part = controller.partition("/")
            kind = kinds[name]
            self.devices.append((controller, None if part else kind, kind.products[int(part or 1) - 1]))
            self.vendors.append(kind.vendor)
            for port in ORDER[1:]:
                if f"{controller}.{port}" in hanging:
                    walk(hanging[f"{controller}.{port}"])

        walk(hanging["maindevice"])

    def __len__(self):
        return len(self.devices)

    def wkc(self, count=None):
        """The working counter of one LRW over all process data; with `count`, of the first controllers only."""
        return sum(kind.wkc for _, kind, _ in self.devices[:count] if kind)

    def clocked(self):
        """Positions with a clock: of what is used here, all but plain digital inputs and outputs."""
        return [place for place, (_, kind, _) in enumerate(self.devices) if not (kind and kind.is_digital())]

    def in_step(self):
        """Positions of those who have a mode that goes by SYNC0: what has a processor."""
        return [place for place, (_, kind, _) in enumerate(self.devices) if kind and kind.has_processor()]

    def channels(self, direction):
        """(position, name, type, channels) of the devices with channels."""
        for position, (name, kind, _) in enumerate(self.devices):
            if kind and getattr(kind, direction):
                yield position, name, kind, getattr(kind, direction)

    def draw(self, count, seed=1):
        """Rounds of values for all outputs: name of the channel to its value."""
        chance = random.Random(seed)
        rounds = []
        for _ in range(count):
            values = {}
            for _, name, _, (channels, _, _, bits) in self.channels("outputs"):
                for channel in range(1, channels + 1):
                    low, high = (0, 1) if bits == 1 else (-0x8000, 0x7FFF)
                    values[f"{name}.{channel}"] = chance.randint(low, high)
            rounds.append(values)
        return rounds

    def drives(self):
        """Positions of the drives."""
        for position, (_, kind, _) in enumerate(self.devices):
            if kind is KINDS["CiA402-Drive"]:
                yield position

    def image(self, values, number=0):
        """The output bytes of each position that has channels, in hexadecimal; `number` is that of the round, from 0."""
        image = {}
        for position in self.drives():
            control, target, _ = DRIVE_ROUNDS[min(number, len(DRIVE_ROUNDS) - 1)]
            # Each to a position of its own.
            target *= position
            image[str(position)] = struct.pack("<HbxiI", control, CSP, target, 0).hex()
        for position, name, _, (channels, stride, before, bits) in self.channels("outputs"):
            number = 0
            for channel in range(channels):
                value = values[f"{name}.{channel + 1}"] & ((1 << bits) - 1)
                number |= value << (channel * stride + before)
            image[str(position)] = number.to_bytes((channels * stride + 7) // 8, "little").hex()
        return image

    def shown(self, values):
        """What the outputs drive then."""
        shown = {}
        for _, name, kind, (channels, _, _, bits) in self.channels("outputs"):
            for channel in range(1, channels + 1):
                value = values[f"{name}.{channel}"]
                shown[f"{name}.{channel}"] = value if bits == 1 else kind.shown(value)
        return shown

    def read(self, image):
        """The values of all inputs from the input bytes of each position."""
        values = {}
        for position, name, _, (channels, stride, before, bits) in self.channels("inputs"):
            number = int.from_bytes(bytes.fromhex(image[position]), "little")
            assert len(image[position]) // 2 >= (channels * stride + 7) // 8, f"{name}: {image[position]!r}"
            for channel in range(channels):
                value = number >> (channel * stride + before) & ((1 << bits) - 1)
                if bits == 16 and value >= 0x8000:
                    value -= 0x10000
                values[f"{name}.{channel + 1}"] = value
        return values

    def check_drives(self, image, number):
        """Each drive is in the state that follows, and where it was sent."""
        for position in self.drives():
            status, mode, actual, _, error = struct.unpack("<Hbxii H".replace(" ", ""), bytes.fromhex(image[position]))
            _, target, state = DRIVE_ROUNDS[number]
            target *= position
            told = (
                f"round {number + 1}, drive at {position}: status 0x{status:04X}, mode {mode}, at {actual}, error 0x{error:04X}"
            )
            assert status & 0x6F == state, f"{told}; expected status 0x{state:02X} under 0x6F"
            assert abs(actual - target) <= 100, f"{told}; expected position {target}"
            assert state != 0x27 or mode == CSP, told

    def expected(self, driven):
        """What the inputs show when these values are at them; an open analogue input is not told."""
        values = {}
        for _, name, kind, (channels, _, _, bits) in self.channels("inputs"):
            for channel in range(1, channels + 1):
                value = driven.get(f"{name}.{channel}")
                if bits == 1:
                    values[f"{name}.{channel}"] = int(bool(value))
                elif value is not None:
                    values[f"{name}.{channel}"] = kind.shown(value)
        return values
