//! Effects of faults on the software of a device.

use linesman_proto::mailbox::coe::{Emergency, ErrorRegister};
use linesman_proto::time::Instant;

use super::node::NodeAction;
use super::world::World;
use crate::device::SoftwareFault;
use crate::truth::{Effect, FaultId, Place};

/// Something that happens to the software of a device.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SoftwareChange {
    /// It misbehaves from now on.
    Begin(SoftwareFault),
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
pub(super) struct ActiveSoftwareChange {
    by: FaultId,
    what: ActiveChangeKind,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ActiveChangeKind {
    SoftwareFault(SoftwareFault),
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
            SoftwareChange::Begin(software_fault) => {
                Some(ActiveChangeKind::SoftwareFault(software_fault))
            }
            SoftwareChange::Hang => Some(ActiveChangeKind::Hang),
            SoftwareChange::Report(emergency) => Some(ActiveChangeKind::Emergency(emergency)),
            SoftwareChange::Reboot | SoftwareChange::ReportOnce(_) => None,
        };
        let effect = match change {
            SoftwareChange::Begin(software_fault) => Effect::Misbehaves(software_fault),
            SoftwareChange::Hang => Effect::ProcessorStopped,
            SoftwareChange::Reboot => Effect::ProcessorRestarted,
            SoftwareChange::Report(emergency) | SoftwareChange::ReportOnce(emergency) => {
                Effect::EmergencySent { code: emergency.code }
            }
        };
        let act = match change {
            SoftwareChange::Begin(software_fault) => {
                NodeAction::SoftwareFault { software_fault, begins: true }
            }
            SoftwareChange::Hang => NodeAction::Hang(true),
            SoftwareChange::Reboot => NodeAction::Reboot,
            SoftwareChange::Report(emergency) | SoftwareChange::ReportOnce(emergency) => {
                NodeAction::Report(emergency)
            }
        };
        let held_by = &mut self.nodes[node].software;
        if change == SoftwareChange::Reboot {
            held_by.retain(|held| held.by != fault || held.what != ActiveChangeKind::Hang);
        }
        if let Some(what) = held {
            // Of emergencies that repeat each other one is taken back.
            let held = ActiveSoftwareChange { by: fault, what };
            if !(matches!(what, ActiveChangeKind::Emergency(_)) && held_by.contains(&held)) {
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
            for held in Vec::<ActiveSoftwareChange>::from_iter::<Vec<ActiveSoftwareChange>>(ended) {
                match held.what {
                    ActiveChangeKind::SoftwareFault(software_fault) => {
                        node.act_at(
                            at,
                            NodeAction::SoftwareFault { software_fault, begins: false },
                        );
                    }
                    ActiveChangeKind::Hang => {
                        if !node.software.iter().any(|other| other.what == ActiveChangeKind::Hang) {
                            node.act_at(at, NodeAction::Hang(false));
                            let runs = Effect::ProcessorRuns;
                            self.truth.effect(at, Some(fault), place, runs);
                        }
                    }
                    ActiveChangeKind::Emergency(_) => {
                        let gone = Emergency { code: 0, register: ErrorRegister(0), data: [0; 5] };
                        node.act_at(at, NodeAction::Report(gone));
                        let sent = Effect::EmergencySent { code: 0 };
                        self.truth.effect(at, Some(fault), place, sent);
                    }
                }
            }
        }
    }
}
