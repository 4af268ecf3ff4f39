//! Lint of what is plugged in and out, and of rings: hot connect groups, fast connecting ports, the end of a
//! ring.
//!
//! Source: S0 L1007-1041 (ring), L1219-1290 (groups, fast connecting ports).

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::sii::PortKind;
use linesman_proto::topology::End;

use super::{Doubt, Severity};
use crate::plan::{HotConnectGroup, Plan};

impl Plan {
    fn error(&self, name: &'static str, device: DeviceId, text: String, advice: &str) -> Doubt {
        let (severity, device) = (Severity::Error, Some(device));
        Doubt { severity, name, device, text, advice: advice.to_owned() }
    }

    /// The kind of a port; `None` where nobody says it.
    fn kind(&self, node: usize, port: Port) -> Option<PortKind> {
        self.devices.get(node)?.ports.map(|ports| ports[port])
    }

    /// An end as people write it, such as `K1.C`.
    fn written(&self, end: End) -> String {
        match end {
            End::MainDevice(Path::A) => "maindevice".to_owned(),
            End::MainDevice(Path::B) => "maindevice.B".to_owned(),
            End::Controller(node, port) => {
                format!("{}.{port}", self.name(DeviceId(node as u32)))
            }
        }
    }

    /// Fast connecting ports are wired to such ports only, and never to the MainDevice (HC-13).
    pub(super) fn ports(&self, doubts: &mut Vec<Doubt>) {
        const ADVICE: &str = "wire a fast connecting port (EK1122-0080, EK1101-0080) to another one, and the \
                              entry of the line to a usual port";
        for link in self.tree.links() {
            let ends = [link.upstream, link.downstream];
            let is_fast = |end: End| match end {
                End::MainDevice(_) => Some(false),
                End::Controller(node, port) => {
                    Some(self.kind(node, port)? == PortKind::FastHotConnect)
                }
            };
            let [Some(upper), Some(lower)] = ends.map(is_fast) else { continue };
            if upper == lower {
                continue;
            }
            let (fast, other) = if upper { (ends[0], ends[1]) } else { (ends[1], ends[0]) };
            let device = fast.node().map_or(0, |node| node as u32);
            let text = format!(
                "{} is a fast connecting port and is wired to {}, which is none: no link comes up",
                self.written(fast),
                self.written(other)
            );
            doubts.push(self.error("fast-port", DeviceId(device), text, ADVICE));
        }
    }

    /// Where hot connect groups may begin, and what suffices instead (HC-09 to HC-11, HC-13).
    pub(super) fn groups(&self, doubts: &mut Vec<Doubt>) {
        let first_of_line = self.tree.first(Path::A);
        for group in &self.groups {
            let first = group.first();
            let entry = self.tree.entry(first.index());
            if first_of_line.is_some_and(|node| group.members.contains(&DeviceId(node as u32))) {
                let text = format!(
                    "hot connect group {} holds {}, the first SubDevice of the line: without it there is no line",
                    group.name,
                    self.name(first)
                );
                let advice = "begin the group behind it, or put a fixed coupler before it";
                doubts.push(self.error("group-first", first, text, advice));
            }
            if self.kind(first.index(), entry) == Some(PortKind::EBus) {
                let text = format!(
                    "hot connect group {} begins at {}, a terminal on the E-bus: it cannot be plugged under power",
                    group.name,
                    self.name(first)
                );
                let advice =
                    "begin the group at its coupler, or at a SubDevice that has a cable of its own";
                doubts.push(self.error("group-terminal", first, text, advice));
            }
            self.group_places(group, doubts);
            if let [place] = group.places.as_slice() {
                doubts.push(Doubt {
                    severity: Severity::Info,
                    name: "sync-unit-suffices",
                    device: Some(first),
                    text: format!(
                        "hot connect group {} has one place only, {}",
                        group.name,
                        self.written(*place)
                    ),
                    advice: "a sync unit of its own for this branch (`sync_unit`) suffices, without a group, if only \
                             its absence must not disturb others"
                        .to_owned(),
                });
            }
        }
    }

    /// Whether the entry of a group fits the ports at which it may be plugged in.
    fn group_places(&self, group: &HotConnectGroup, doubts: &mut Vec<Doubt>) {
        let first = group.first();
        let kind = self.kind(first.index(), self.tree.entry(first.index()));
        let Some(entry) = kind else { return };
        for place in &group.places {
            let End::Controller(node, port) = *place else { continue };
            let Some(there) = self.kind(node, port).filter(|there| *there != entry) else {
                continue;
            };
            let text = format!(
                "hot connect group {} may be plugged in at {}, which does not fit {}: that port is {}, the entry {}",
                group.name,
                self.written(*place),
                self.name(first),
                kind_word(there),
                kind_word(entry)
            );
            let advice = "name ports of the same kind in `places`";
            doubts.push(self.error("group-place", first, text, advice));
        }
    }

    /// Whether the ring closes at a legal end: behind the last SubDevice, at a port for a cable (RED-07).
    pub(super) fn ring_end(&self, doubts: &mut Vec<Doubt>) {
        let Some((node, port)) = self.tree.closes_at() else { return };
        const ADVICE: &str = "close the ring at port B of the last SubDevice with two ports, or at the output of the last \
                              coupler (port C of an EK110x)";
        let device = DeviceId(node as u32);
        let end = self.written(End::Controller(node, port));
        let is_terminal =
            |below: usize| self.kind(below, self.tree.entry(below)) == Some(PortKind::EBus);
        let branch = self.tree.children(node).find(|(_, below)| !is_terminal(*below));
        let text = if let Some((_, below)) = branch {
            format!(
                "the ring closes at {end}, between others: {} hangs behind {}, too",
                self.name(DeviceId(below as u32)),
                self.name(device)
            )
        } else if self.kind(node, port) == Some(PortKind::EBus) {
            format!("the ring closes at {end}, which is a contact for terminals and takes no cable")
        } else {
            return;
        };
        doubts.push(self.error("ring-end", device, text, ADVICE));
    }
}

/// The kind of a port in words.
fn kind_word(kind: PortKind) -> &'static str {
    match kind {
        PortKind::None => "not there",
        PortKind::Mii => "for an Ethernet cable",
        PortKind::EBus => "a contact of the E-bus",
        PortKind::FastHotConnect => "a fast connecting port",
        PortKind::Other(_) => "of an unknown kind",
    }
}
