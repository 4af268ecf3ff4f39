//! What faults do to the software of a device.

use linesman_proto::mailbox::coe::{Emergency, ErrorRegister};
use linesman_proto::time::Instant;

use super::node::Act;
use super::world::World;
use crate::device::Trouble;
use crate::truth::{Effect, FaultId, Place};

/// Something that happens to the software of a device.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SoftwareChange {
    /// It misbehaves from now on.
    Begin(Trouble),
    /// Its processor stops: nothing is served any more.
    Hang,
    /// Its processor has started anew by itself, without the controller: it is in INIT and says so.
    Reboot,
    /// It sends an emergency. What it said is taken back when the fault ends.
    Report(Emergency),
    /// It sends an emergency that nothing follows.
    ReportOnce(Emergency),
}

/// What a fault has done to the software of a device and lets go when it ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Held {
    by: FaultId,
    what: HeldWhat,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum HeldWhat {
    Trouble(Trouble),
    Hang,
    Emergency(Emergency),
}

impl World {
    /// A fault does something to the software of a device.
    pub(super) fn change_software(
        &mut self,
        at: Instant,
        fault: FaultId,
        node: usize,
        change: SoftwareChange,
    ) {
        let held = match change {
            SoftwareChange::Begin(trouble) => Some(HeldWhat::Trouble(trouble)),
            SoftwareChange::Hang => Some(HeldWhat::Hang),
            SoftwareChange::Report(emergency) => Some(HeldWhat::Emergency(emergency)),
            SoftwareChange::Reboot | SoftwareChange::ReportOnce(_) => None,
        };
        let effect = match change {
            SoftwareChange::Begin(trouble) => Effect::Misbehaves(trouble),
            SoftwareChange::Hang => Effect::ProcessorStopped,
            SoftwareChange::Reboot => Effect::ProcessorRestarted,
            SoftwareChange::Report(emergency) | SoftwareChange::ReportOnce(emergency) => {
                Effect::EmergencySent { code: emergency.code }
            }
        };
        let act = match change {
            SoftwareChange::Begin(trouble) => Act::Trouble { trouble, begins: true },
            SoftwareChange::Hang => Act::Hang(true),
            SoftwareChange::Reboot => Act::Reboot,
            SoftwareChange::Report(emergency) | SoftwareChange::ReportOnce(emergency) => {
                Act::Report(emergency)
            }
        };
        let held_by = &mut self.nodes[node].software;
        if change == SoftwareChange::Reboot {
            held_by.retain(|held| held.by != fault || held.what != HeldWhat::Hang);
        }
        if let Some(what) = held {
            // Of emergencies that repeat each other one is taken back.
            let held = Held { by: fault, what };
            if !(matches!(what, HeldWhat::Emergency(_)) && held_by.contains(&held)) {
                held_by.push(held);
            }
        }
        self.nodes[node].act_at(at, act);
        self.truth.effect(at, Some(fault), Place::Device(self.id(node)), effect);
    }

    /// A fault is over: the software of all devices does again what it did before.
    pub(super) fn release_software(&mut self, at: Instant, fault: FaultId) {
        for node in 0..self.nodes.len() {
            let place = Place::Device(self.id(node));
            let node = &mut self.nodes[node];
            let (ended, rest) = node.software.drain(..).partition(|held| held.by == fault);
            node.software = rest;
            for held in Vec::<Held>::from_iter::<Vec<Held>>(ended) {
                match held.what {
                    HeldWhat::Trouble(trouble) => {
                        node.act_at(at, Act::Trouble { trouble, begins: false });
                    }
                    HeldWhat::Hang => {
                        if !node.software.iter().any(|other| other.what == HeldWhat::Hang) {
                            node.act_at(at, Act::Hang(false));
                            let runs = Effect::ProcessorRuns;
                            self.truth.effect(at, Some(fault), place, runs);
                        }
                    }
                    HeldWhat::Emergency(_) => {
                        let gone = Emergency { code: 0, register: ErrorRegister(0), data: [0; 5] };
                        node.act_at(at, Act::Report(gone));
                        let sent = Effect::EmergencySent { code: 0 };
                        self.truth.effect(at, Some(fault), place, sent);
                    }
                }
            }
        }
    }
}
