"""SOEM, through pysoem: mailbox and SII services of the analogue terminal, one by one; prints what came of them.

`SERVICES.py INTERFACE`. What is expected stands in check_services.py.
"""

import sys

import pysoem

import peer

TERMINAL = 0x0C203052
ALIAS = 0x2A
# Both in words.
ALIAS_AT, CHECKSUM_AT = 4, 7


def main():
    master = pysoem.Master()
    master.open(sys.argv[1])
    try:
        if master.config_init() <= 0:
            peer.refuse("no SubDevice found")
        slave = next(slave for slave in master.slaves if slave.id == TERMINAL)
        # One more SubDevice is needed only for its address.
        register = int.from_bytes(slave._fprd(0x0012, 2), "little")
        vendor = int.from_bytes(slave.sdo_read(0x1018, 1), "little")
        name = slave.sdo_read(0x1008, 0).decode().rstrip("\0")
        whole = slave.sdo_read(0x1018, 0, ca=True)
        before = int.from_bytes(slave.sdo_read(0x8000, 0x13), "little", signed=True)
        slave.sdo_write(0x8000, 0x13, (before + 77).to_bytes(2, "little", signed=True))
        after = int.from_bytes(slave.sdo_read(0x8000, 0x13), "little", signed=True)
        try:
            slave.sdo_read(0x5FFF, 0)
            abort = "none"
        except pysoem.SdoError as error:
            abort = f"0x{error.abort_code:08X}"
        sii = b"".join(slave.eeprom_read(word) for word in range(0, 8, 2))
        if register == 0:
            words = bytearray(sii[:14])
            words[2 * ALIAS_AT:2 * ALIAS_AT + 2] = ALIAS.to_bytes(2, "little")
            slave.eeprom_write(ALIAS_AT, ALIAS.to_bytes(2, "little"))
            slave.eeprom_write(CHECKSUM_AT, crc8(words).to_bytes(2, "little"))
        stored = int.from_bytes(slave.eeprom_read(ALIAS_AT)[:2], "little")
        peer.report(
            alias_register=register, alias_stored=stored, vendor=vendor, name=name, whole=whole.hex(),
            limit=[before, after], abort=abort, sii=sii.hex(),
        )
    finally:
        master.close()


def crc8(data):
    """The checksum of the first 14 bytes of an SII: polynomial x^8+x^2+x+1, start 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07 if crc & 0x80 else crc << 1) & 0xFF
    return crc


if __name__ == "__main__":
    main()
