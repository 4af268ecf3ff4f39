"""A foreign MainDevice on a ring whose cables break: SOEM (pysoem) or KickCAT; see bench_ring.py.

    ring_peer.py soem|kickcat INTERFACE+INTERFACE CYCLE_US

Takes the ring to OP and exchanges process data until it is told to end by SIGINT. Prints `{"ready": true}` when all are in OP, and
at the end how many cycles there were and in how many the data of all SubDevices did not come back: its own working counter tells.
"""

import json
import signal
import sys
import time
from datetime import timedelta


class Soem:
    def __init__(self, first, second, cycle_s):
        import pysoem
        import soem

        self.master, self.patience_us = pysoem.Master(), round(cycle_s * 1e6)
        self.master.open(first, second)
        if self.master.config_init() <= 0:
            raise RuntimeError("config_init found no SubDevice")
        soem.be_patient(self.master)
        soem.configure(self.master)
        soem.to_op(self.master, self.master.send_processdata, cycle_s)
        # SOEM leaves some SubDevices out of what it expects: what is seen is the measure.
        self.expected = max(self.exchange() for _ in range(20))

    def exchange(self):
        self.master.send_processdata()
        return self.master.receive_processdata(self.patience_us)

    def is_complete(self):
        return self.exchange() == self.expected

    def close(self):
        self.master.close()


class KickCat:
    def __init__(self, first, second, cycle_s):
        import kickcat
        import kickcat_peer

        self.bus, _ = kickcat_peer.bring_up([first, second])
        self.bus.create_mapping(4096)
        kickcat_peer.request(self.bus, kickcat.State.SAFE_OP)
        for slave in self.bus.slaves():
            if slave.output_size:
                slave.set_output_bytes(bytes(slave.output_size))
        self.bus.process_data_no_check()
        self.bus.request_state(kickcat.State.OPERATIONAL)
        self.bus.wait_for_state(kickcat.State.OPERATIONAL, timedelta(seconds=5), self.bus.process_data_no_check)

    def is_complete(self):
        try:
            self.bus.process_data()
            return True
        except Exception:  # its own exception type, for a wrong working counter or a lost frame
            return False

    def close(self):
        pass


def main():
    _, kind, interfaces, cycle_us = sys.argv
    cycle_s, ended = int(cycle_us) / 1e6, []
    signal.signal(signal.SIGINT, lambda *_: ended.append(True))
    peer = {"soem": Soem, "kickcat": KickCat}[kind](*interfaces.split("+"), cycle_s)
    bad, cycles, due = [], 0, time.monotonic()
    print(json.dumps({"ready": True}), flush=True)
    while not ended:
        began = time.monotonic()
        if not peer.is_complete():
            bad.append(began)
        cycles += 1
        due = max(due + cycle_s, time.monotonic() - cycle_s)
        time.sleep(max(0.0, due - time.monotonic()))
    print(json.dumps({"cycles": cycles, "bad": bad}), flush=True)
    peer.close()


if __name__ == "__main__":
    main()
