"""SOEM with distributed clocks: switches SYNC0 on, aligns the clocks, tells how far they are off.

What it tells: `clocked` (positions with a clock), `in_step` (positions with SYNC0), `before` and `after` (0x092C of each
clock but the first, in ns, without its sign), `delays` (0x0928), `speeds` (0x0932), `modes` (0x1C33:01 of those in step).
"""

import pysoem

import peer

ALIGNING = 20_000


class Clocks:
    """The clocks of the line; switches SYNC0 on where the SubDevice can go by it, in PREOP."""

    def __init__(self, master, sync0_ns):
        self.master = master
        if not master.config_dc():
            peer.refuse("config_dc found no clock")
        slaves = list(enumerate(master.slaves))
        self.clocked = [place for place, slave in slaves if register(slave, 0x092C, 4) is not None]
        self.in_step = [place for place, slave in slaves if knows_sync0(slave)]
        for place in self.in_step:
            master.slaves[place].dc_sync(True, sync0_ns)

    def align(self, send):
        """Sends the time of the first clock with each frame, as SOEM does, until the others follow it."""
        self.exchange(send, 50)
        self.before = self.differences()
        self.exchange(send, ALIGNING)
        # Before OP: there, whoever reads objects does not exchange, and drives complain of that.
        slaves = [self.master.slaves[place] for place in self.in_step]
        self.modes = [read_number(slave, 0x1C33, 1) for slave in slaves]

    def exchange(self, send, cycles):
        for _ in range(cycles):
            send()
            self.master.receive_processdata(20_000)

    def differences(self):
        return [register(self.master.slaves[place], 0x092C, 4) & 0x7FFF_FFFF for place in self.clocked[1:]]

    def told(self):
        slaves = self.master.slaves
        return {
            "clocked": self.clocked, "in_step": self.in_step, "before": self.before, "after": self.differences(),
            "delays": [register(slaves[place], 0x0928, 4) for place in self.clocked],
            "speeds": [register(slaves[place], 0x0932, 2) for place in self.clocked],
            "modes": self.modes,
        }


def knows_sync0(slave):
    """Whether its synchronisation object knows the mode."""
    return has_mailbox(slave) and (read_number(slave, 0x1C33, 4) or 0) & 0x04 != 0


def read_number(slave, index, subindex):
    """A number, or nothing when there is no such object."""
    for _ in range(5):
        try:
            return int.from_bytes(slave.sdo_read(index, subindex), "little")
        except pysoem.SdoError:
            return None
        except (pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError, pysoem.Emergency, AssertionError):
            # On a busy host the answer may be late, which pysoem tells in many ways.
            continue
    return None


def has_mailbox(slave):
    """SyncManager 0 is in mailbox mode: there is somebody to be asked."""
    return register(slave, 0x0804, 1) & 0x03 == 0x02


def register(slave, address, length):
    try:
        return int.from_bytes(slave._fprd(address, length, 20_000), "little")
    except (pysoem.WkcError, RuntimeError):
        return None
