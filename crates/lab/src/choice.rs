//! Choosing faults by chance: what kind, where, how bad. The demo and the swarm draw from here.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::Span;
use linesman_proto::topology::{End, Tree};
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{FaultEntry, OneOrMany};

/// The line as far as choosing needs it.
#[derive(Clone, Debug)]
pub struct LineOutline<'a> {
    /// The wiring; node *n* is device *n*.
    pub tree: &'a Tree,
    /// Names by node.
    pub names: &'a [String],
    /// By link: a cable that can be pulled and disturbed, not a contact between two terminals.
    pub cabled: &'a [bool],
}

/// A fault that was chosen.
#[derive(Clone, PartialEq, Debug)]
pub struct Choice {
    /// What it is.
    pub name: FaultName,
    /// The entry of a segment file.
    pub entry: FaultEntry,
    /// The link it sits on, by index in the tree.
    pub link: Option<usize>,
    /// The device it sits in.
    pub device: Option<DeviceId>,
    /// How long it is left alone.
    pub lasts: Span,
}

/// Faults that begin while the line runs, and end when they are healed.
pub const AT_RUN_TIME: [FaultName; 10] = [
    FaultName::LinkOpen,
    FaultName::LinkFlapping,
    FaultName::EmcNoise,
    FaultName::CableDegraded,
    FaultName::TransmitterDamaged,
    FaultName::ReceiverDamaged,
    FaultName::DeviceInternal,
    FaultName::DeviceOff,
    FaultName::BrownOut,
    FaultName::NicDamaged,
];

impl LineOutline<'_> {
    /// An end as segment files write it.
    #[must_use]
    pub fn end(&self, end: End) -> String {
        match end {
            End::MainDevice(Path::A) => "maindevice".to_owned(),
            End::MainDevice(Path::B) => "maindevice.B".to_owned(),
            End::Controller(node, port) => format!("{}.{port}", self.name(node)),
        }
    }

    pub(crate) fn name(&self, node: usize) -> &str {
        self.names.get(node).map_or("?", String::as_str)
    }

    /// Chooses a place and parameters for a fault of this name; `None` if the line has no place for
    /// it, or the name is not one of [`AT_RUN_TIME`].
    #[must_use]
    pub fn choose(&self, name: FaultName, stream: &mut Stream) -> Option<Choice> {
        #[expect(clippy::wildcard_enum_match_arm, reason = "a menu, not a table of all faults")]
        match name {
            FaultName::LinkOpen => {
                let link = self.any_link(stream)?;
                Some(self.on_link(name, link, &[], Span::ms(stream.between(300, 900))))
            }
            FaultName::LinkFlapping => {
                let link = self.any_link(stream)?;
                // A cable takes a second or two to have its link again, a contact does not.
                let cabled = self.cabled.get(link).copied().unwrap_or(false);
                let rate = if cabled { 0.4 } else { 3.0 };
                let lasts = Span::ms(stream.between(3_000, 5_000));
                Some(self.on_link(
                    name,
                    link,
                    &[("openings_per_s", rate), ("open_ms", 20.0)],
                    lasts,
                ))
            }
            FaultName::CableDegraded => {
                let link = self.any_cable(stream)?;
                let rate = rate(stream, 200.0, 3_000.0);
                let lasts = Span::ms(stream.between(800, 1_500));
                Some(self.on_link(name, link, &[("hits_per_s", rate)], lasts))
            }
            FaultName::EmcNoise => {
                let link = self.any_cable(stream)?;
                let rate = rate(stream, 200.0, 3_000.0);
                Some(self.on_hop(name, link, rate, stream))
            }
            FaultName::TransmitterDamaged | FaultName::ReceiverDamaged => {
                let link = self.any_link(stream)?;
                let rate = rate(stream, 200.0, 3_000.0);
                Some(self.on_hop(name, link, rate, stream))
            }
            FaultName::DeviceInternal => {
                let node = self.any_device(stream)?;
                let rate = rate(stream, 10.0, 100.0);
                let lasts = Span::ms(stream.between(800, 1_500));
                Some(self.in_device(name, node, &[("hits_per_s", rate)], lasts))
            }
            FaultName::DeviceOff => {
                let node = self.any_device(stream)?;
                Some(self.in_device(name, node, &[], Span::ms(stream.between(300, 900))))
            }
            FaultName::BrownOut => {
                let node = self.any_device(stream)?;
                let dip = stream.between(1, 300) as f64;
                let lasts = Span::ms(stream.between(600, 900));
                Some(self.in_device(name, node, &[("dip_ms", dip)], lasts))
            }
            FaultName::NicDamaged => {
                let part = stream.pick(&["receiver", "transmitter"])?;
                let entry = FaultEntry::new(name).at("maindevice").with("part", *part);
                let lasts = Span::ms(stream.between(800, 1_500));
                Some(Choice { name, entry, link: Some(0), device: None, lasts })
            }
            _ => None,
        }
    }

    pub(crate) fn any_link(&self, stream: &mut Stream) -> Option<usize> {
        stream.pick(&(0..self.tree.links().len()).collect::<Vec<_>>()).copied()
    }

    pub(crate) fn any_cable(&self, stream: &mut Stream) -> Option<usize> {
        let cabled = |link: &usize| self.cabled.get(*link).copied().unwrap_or(false);
        let cables: Vec<usize> = (0..self.tree.links().len()).filter(cabled).collect();
        stream.pick(&cables).copied()
    }

    pub(crate) fn any_device(&self, stream: &mut Stream) -> Option<usize> {
        stream.pick(self.tree.order()).copied()
    }

    fn on_link(&self, name: FaultName, link: usize, with: &[Parameter], lasts: Span) -> Choice {
        let ends = self.tree.links()[link];
        let (up, down) = (self.end(ends.upstream), self.end(ends.downstream));
        let entry = parameters(FaultEntry::new(name).at(format!("{up}-{down}")), with);
        Choice { name, entry, link: Some(link), device: None, lasts }
    }

    fn on_hop(&self, name: FaultName, link: usize, rate: f64, stream: &mut Stream) -> Choice {
        let ends = self.tree.links()[link];
        let (mut from, mut to) = (self.end(ends.upstream), self.end(ends.downstream));
        if stream.chance(0.5) {
            std::mem::swap(&mut from, &mut to);
        }
        let entry = FaultEntry::new(name).at(format!("{from}>{to}")).with("hits_per_s", rate);
        let lasts = Span::ms(stream.between(800, 1_500));
        Choice { name, entry, link: Some(link), device: None, lasts }
    }

    fn in_device(&self, name: FaultName, node: usize, with: &[Parameter], lasts: Span) -> Choice {
        let entry = parameters(FaultEntry::new(name).device(self.name(node)), with);
        Choice { name, entry, link: None, device: Some(DeviceId(node as u32)), lasts }
    }
}

type Parameter = (&'static str, f64);

fn parameters(entry: FaultEntry, with: &[Parameter]) -> FaultEntry {
    with.iter().fold(entry, |entry, (key, value)| entry.with(key, *value))
}

/// A rate that people can read.
fn rate(stream: &mut Stream, low: f64, high: f64) -> f64 {
    stream.log_uniform(low, high).round()
}

impl Choice {
    /// What is injected, in one line.
    #[must_use]
    pub fn text(&self) -> String {
        text(&self.entry)
    }
}

/// Node that a choice sits in, or whose upstream link it sits on; `None` for a fault that has no place of its own.
fn node_of(tree: &Tree, choice: &Choice) -> Option<usize> {
    match (choice.device, choice.link) {
        (Some(id), _) => Some(id.index()),
        (None, Some(link)) => tree.links()[link].downstream.node(),
        (None, None) => None,
    }
}

/// True if neither of two faults lies behind the other, nor both at one parent.
#[must_use]
pub fn are_apart(tree: &Tree, one: &Choice, other: &Choice) -> bool {
    match (node_of(tree, one), node_of(tree, other)) {
        (Some(one), Some(other)) => {
            let related = |a: usize, b: usize| a == b || tree.is_downstream_of(a, b);
            !related(one, other) && !related(other, one) && tree.parent(one) != tree.parent(other)
        }
        (None, _) | (_, None) => false,
    }
}

/// True if `one` lies behind `other` as seen from the MainDevice, in another place than that.
#[must_use]
pub fn is_behind(tree: &Tree, one: &Choice, other: &Choice) -> bool {
    match (node_of(tree, one), node_of(tree, other)) {
        (Some(node), Some(before)) if node == before => {
            // The link of a device lies before the device itself.
            one.link.is_none() && other.link.is_some()
        }
        (Some(node), Some(before)) => tree.is_downstream_of(node, before),
        (None, _) | (_, None) => false,
    }
}

/// A fault entry in one line.
#[must_use]
pub fn text(entry: &FaultEntry) -> String {
    let mut text = entry.kind.clone();
    for at in entry.at.iter().flat_map(OneOrMany::as_slice) {
        text += &format!(" at {at}");
    }
    for device in entry.device.iter().chain(entry.devices.iter().flatten()) {
        text += &format!(" in {device}");
    }
    for (key, value) in &entry.parameters {
        text += &format!(", {key} = {value}");
    }
    text
}

#[cfg(test)]
mod tests {
    use linesman_proto::port::Port;
    use linesman_proto::topology::Wired;
    use linesman_sim::seed::Seed;

    use super::*;

    #[test]
    fn cable_faults_are_put_on_cables_and_every_name_has_a_place() {
        let on = |node, port| Wired { on: End::Controller(node, port), entry: Port::A };
        let first = Wired { on: End::MainDevice(Path::A), entry: Port::A };
        let tree = Tree::from_wiring(&[first, on(0, Port::B), on(0, Port::C)], None).unwrap();
        let names = ["K1", "T1", "K2"].map(str::to_owned);
        let outline = LineOutline { tree: &tree, names: &names, cabled: &[true, false, true] };
        for seed in 0..50 {
            let mut stream = Seed(seed).stream("choice");
            for name in AT_RUN_TIME {
                let choice = outline.choose(name, &mut stream).unwrap();
                assert_eq!(choice.entry.kind, name.name());
                if matches!(name, FaultName::EmcNoise | FaultName::CableDegraded) {
                    assert_ne!(choice.link, Some(1), "no cable there: {}", choice.text());
                }
            }
            assert_eq!(outline.choose(FaultName::HostJitter, &mut stream), None);
        }
    }
}
