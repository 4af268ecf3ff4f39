"""PyETG1510, unmodified, at a mailbox gateway: the object dictionary of the MainDevice, and each object with its values.

Usage: etg1510_client.py ADDRESS. Prints one object of JSON: by index, the values by name.

The package lays its headers out by bit fields of ctypes, and relies on how Windows does that. Elsewhere ctypes puts fields of
one byte behind eleven bits of two into the wrong byte, so that the type of its frames is lost. Structures with plain fields,
which is all that the package needs of them, stand in for those of ctypes while it is imported.
"""

import asyncio
import ctypes
import json
import logging
import sys


class PlainStructure:
    _fields_ = ()

    def __init__(self, *values):
        for (name, *_), value in zip(self._fields_, values):
            setattr(self, name, value)

    def __init_subclass__(cls):
        for name, *_ in cls._fields_:
            setattr(cls, name, 0)


ctypes.Structure = PlainStructure
# It logs to the terminal.
logging.disable(logging.CRITICAL)

from dataclasses import fields  # noqa: E402

from pyetg1510 import EtherCATMasterConnection, ETG1510Profile, MasterODSpecification  # noqa: E402


async def objects(address):
    specification = MasterODSpecification(EtherCATMasterConnection(host=address, port=34980))
    await specification.get_object_dictionary()
    found = {}
    async for index, data in ETG1510Profile(master_od=specification):
        entries = ((one.name, getattr(data, one.name)) for one in fields(data))
        found[f"{index:04x}"] = {name: entry.value for name, entry in entries if entry.enable}
    return found


print(json.dumps({"objects": asyncio.run(objects(sys.argv[1]))}))
