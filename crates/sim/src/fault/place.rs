//! Place of a fault: resolves what was written to link directions, links, controllers and cards.

mod rule;

use std::collections::BTreeMap;

use linesman_config::attachment::Attachment;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::topology::{End, Tree};

pub use rule::PlaceRule;

use super::Kind;
use super::error::{FaultError, nearest};
use crate::hardware::PortKind;
use crate::segment_file::{FaultEntry, Supply};
use crate::truth::Place;
use crate::wire::world::World;
use crate::wire::{Change, DirectedLink};

/// What places are looked up in.
pub(crate) struct FaultContext<'a> {
    /// By identity, devices that are missing included.
    pub(crate) names: &'a [String],
    pub(crate) nodes: &'a BTreeMap<DeviceId, usize>,
    pub(crate) tree: &'a Tree,
    pub(crate) world: &'a World,
    /// Current that each node takes from the E-bus, in mA; negative where it feeds it.
    pub(crate) ebus_ma: &'a [i16],
    /// Whether a terminal without a controller feeds the E-bus anew before a node.
    pub(crate) fed_anew: &'a [bool],
    /// Which devices a name such as `group:A` stands for.
    pub(crate) groups: &'a BTreeMap<String, Vec<DeviceId>>,
    pub(crate) supplies: &'a [Supply],
}

impl FaultContext<'_> {
    /// A node and all that it feeds over the E-bus.
    fn with_fed(&self, node: usize) -> Vec<usize> {
        let mut fed = vec![node];
        if self.ebus_ma.get(node).is_some_and(|current| *current < 0) {
            let mut next = 0;
            while let Some(from) = fed.get(next).copied() {
                next += 1;
                let ports = self.world.nodes[from].controller.hardware().ports;
                let children = self.tree.children(from);
                fed.extend(children.filter_map(|(port, child)| {
                    let takes = self.ebus_ma.get(child).is_some_and(|current| *current > 0);
                    let takes = takes && !self.fed_anew.get(child).is_some_and(|anew| *anew);
                    (takes && ports[port] == PortKind::Ebus).then_some(child)
                }));
            }
        }
        fed
    }
}

/// A place, found.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(crate) struct Target {
    /// For the truth log.
    pub(super) places: Vec<Place>,
    pub(super) directions: Vec<DirectedLink>,
    pub(super) links: Vec<usize>,
    pub(super) nodes: Vec<usize>,
    /// Cards of the MainDevice.
    pub(super) cards: Vec<Path>,
    /// What feeds an E-bus, then what it feeds, in order.
    pub(super) currents: Vec<Current>,
}

/// The E-bus current of a controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Current {
    pub(super) node: usize,
    /// In mA; negative is supplied.
    pub(super) ma: i16,
}

impl Target {
    /// What interrupts each place and makes it whole: both directions of a link, or one of them.
    pub(super) fn breaks(&self) -> impl Iterator<Item = (Change, Change)> {
        let one = match self.directions.as_slice() {
            [direction] => Some(*direction),
            _ => None,
        };
        self.links.iter().map(move |link| match one {
            Some(direction) => (Change::Break { direction }, Change::Mend { direction }),
            None => (Change::Open { link: *link }, Change::Close { link: *link }),
        })
    }
}

/// What is written in `at`.
enum WrittenPlace {
    /// Both directions.
    Both(usize),
    /// One direction.
    One(DirectedLink),
    /// A card.
    Card(Path),
}

pub(super) fn resolve(
    label: &str,
    kind: &Kind,
    entry: &FaultEntry,
    context: &FaultContext<'_>,
) -> Result<Target, FaultError> {
    let finder = Finder { label, kind, context };
    finder.refuse_other_keys(entry)?;
    match kind.place {
        PlaceRule::Device | PlaceRule::Devices => finder.devices(entry),
        PlaceRule::Feed => finder.feed(entry),
        PlaceRule::Pair => finder.pair(entry),
        PlaceRule::Processor | PlaceRule::Mailbox => finder.software(entry),
        PlaceRule::DeviceOrCard if entry.device.is_some() => finder.devices(entry),
        PlaceRule::Card | PlaceRule::DeviceOrCard => finder.card(entry),
        PlaceRule::RingLink if !is_ring(context.tree) => Err(FaultError::Combination {
            entry: label.to_owned(),
            kind: kind.name,
            what: "this line is no ring: give it `[ring]` with `closes_at`".to_owned(),
        }),
        PlaceRule::RingLink | PlaceRule::Entrance if entry.at.is_none() => {
            let card = if kind.place == PlaceRule::RingLink { Path::B } else { Path::A };
            let Some(link) = context.tree.link_at(End::MainDevice(card)) else {
                return Err(finder.error(format!("nothing is plugged into card {card}")));
            };
            Ok(finder.at_card(link, card))
        }
        PlaceRule::Link
        | PlaceRule::Directions
        | PlaceRule::ManyDirections
        | PlaceRule::Direction
        | PlaceRule::RingLink
        | PlaceRule::Entrance => finder.directions(entry),
    }
}

/// Whether both cards hang on one line.
fn is_ring(tree: &Tree) -> bool {
    tree.links().iter().any(|link| link.downstream == End::MainDevice(Path::B))
}

struct Finder<'a> {
    label: &'a str,
    kind: &'a Kind,
    context: &'a FaultContext<'a>,
}

impl Finder<'_> {
    fn error(&self, given: String) -> FaultError {
        FaultError::Place {
            entry: self.label.to_owned(),
            kind: self.kind.name,
            given,
            allowed: self.kind.place.allowed().to_owned(),
        }
    }

    fn refuse_other_keys(&self, entry: &FaultEntry) -> Result<(), FaultError> {
        let keys = self.kind.place.keys();
        let given = [
            ("at", entry.at.is_some()),
            ("device", entry.device.is_some()),
            ("devices", entry.devices.is_some()),
            ("supply", entry.supply.is_some()),
        ];
        match given.into_iter().find(|(key, given)| *given && !keys.contains(key)) {
            Some((key, _)) => Err(FaultError::unknown_key(self.label, self.kind, key)),
            None => Ok(()),
        }
    }

    fn devices(&self, entry: &FaultEntry) -> Result<Target, FaultError> {
        let fed = match &entry.supply {
            None => &[][..],
            Some(name) => match self.context.supplies.iter().find(|known| known.name == *name) {
                Some(supply) => supply.devices.as_slice(),
                None => return Err(self.error(format!("no supply is called `{name}`"))),
            },
        };
        let names = entry.device.iter().chain(entry.devices.iter().flatten()).chain(fed);
        let mut target = Target::default();
        for name in names {
            let of_device = |known: &str| {
                known == name
                    || known.strip_prefix(name.as_str()).is_some_and(|rest| rest.starts_with('/'))
            };
            let known = self.context.names.iter().zip(0u32..);
            let ids: Vec<DeviceId> = match self.context.groups.get(name) {
                Some(members) => members.clone(),
                None => known
                    .filter(|(known, _)| of_device(known))
                    .map(|(_, id)| DeviceId(id))
                    .collect(),
            };
            if ids.is_empty() {
                return Err(self.error(self.no_device(name)));
            }
            for node in ids.iter().filter_map(|id| self.context.nodes.get(id)) {
                if self.kind.place == PlaceRule::Devices {
                    target.nodes.extend(self.context.with_fed(*node));
                } else {
                    target.nodes.push(*node);
                }
            }
            target.places.extend(ids.into_iter().map(Place::Device));
        }
        if target.places.is_empty() {
            return Err(self.error("no device is given".to_owned()));
        }
        target.nodes.sort_unstable();
        target.nodes.dedup();
        Ok(target)
    }

    /// What feeds an E-bus, and what it feeds.
    fn feed(&self, entry: &FaultEntry) -> Result<Target, FaultError> {
        let mut target = self.devices(entry)?;
        let first = target.nodes.first().copied();
        target.nodes = first.map_or(Vec::new(), |feed| self.context.with_fed(feed));
        target.currents = target
            .nodes
            .iter()
            .map(|node| Current { node: *node, ma: self.context.ebus_ma[*node] })
            .collect();
        Ok(target)
    }

    /// Two devices in the order in which they are given; of one with several controllers the first.
    fn pair(&self, entry: &FaultEntry) -> Result<Target, FaultError> {
        let names = entry.devices.as_deref().unwrap_or(&[]);
        if names.len() != 2 || names[0] == names[1] {
            return Err(self.error(format!("{} devices are given", names.len())));
        }
        let mut target = Target::default();
        for name in names {
            let one = FaultEntry { devices: None, device: Some(name.clone()), ..entry.clone() };
            let found = self.devices(&one)?;
            target.places.extend(found.places);
            target.nodes.extend(found.nodes.first());
        }
        Ok(target)
    }

    /// Devices whose software can misbehave. Of one with several controllers those with software.
    fn software(&self, entry: &FaultEntry) -> Result<Target, FaultError> {
        let mut target = self.devices(entry)?;
        let needs_mailbox = self.kind.place == PlaceRule::Mailbox;
        target.nodes.retain(|node| {
            let firmware = self.context.world.nodes[*node].controller.firmware();
            if needs_mailbox { firmware.has_mailbox() } else { firmware.has_processor() }
        });
        if target.nodes.is_empty() {
            let name = entry.device.as_deref().unwrap_or_default();
            let what = if needs_mailbox { "mailbox" } else { "processor" };
            return Err(self.error(format!("`{name}` has no {what}")));
        }
        Ok(target)
    }

    fn no_device(&self, name: &str) -> String {
        let near = nearest(name, self.context.names.iter().map(String::as_str));
        let near = near.map_or(String::new(), |near| format!(" (did you mean `{near}`?)"));
        format!("no device is called `{name}`{near}")
    }

    fn card(&self, entry: &FaultEntry) -> Result<Target, FaultError> {
        let path = match entry.at.as_ref().map(|at| at.as_slice()) {
            None => Path::A,
            Some([at]) => match self.written(at)? {
                WrittenPlace::Card(path) => path,
                WrittenPlace::Both(_) | WrittenPlace::One(_) => {
                    return Err(self.error(format!("`{at}` is a link")));
                }
            },
            Some(_) => return Err(self.error("more than one place is given".to_owned())),
        };
        let Some(link) = self.context.tree.link_at(End::MainDevice(path)) else {
            return Err(self.error(format!("nothing is plugged into card {path}")));
        };
        Ok(Target {
            places: vec![Place::Host(path)],
            directions: self.directions_at_card(link, path),
            cards: vec![path],
            links: vec![link],
            nodes: Vec::new(),
            ..Target::default()
        })
    }

    /// The link at a card, and the line that leaves it.
    fn at_card(&self, link: usize, path: Path) -> Target {
        let world = self.context.world;
        let leaves = self.directions_at_card(link, path).pop();
        let place = match (self.kind.place, leaves) {
            (PlaceRule::Entrance, Some(direction)) => world.direction_place(direction),
            (_, _) => world.link_place(link),
        };
        let directions = leaves.into_iter().collect();
        Target { places: vec![place], directions, links: vec![link], ..Target::default() }
    }

    /// The line that arrives at the card, then the one that leaves it.
    fn directions_at_card(&self, link: usize, path: Path) -> Vec<DirectedLink> {
        let card_is_upstream = self.context.tree.links()[link].upstream == End::MainDevice(path);
        vec![
            DirectedLink { link, downstream: !card_is_upstream },
            DirectedLink { link, downstream: card_is_upstream },
        ]
    }

    fn directions(&self, entry: &FaultEntry) -> Result<Target, FaultError> {
        let given = entry.at.as_ref().map_or(&[][..], |at| at.as_slice());
        let several = self.kind.place == PlaceRule::ManyDirections;
        if given.is_empty() {
            return Err(self.error("no place is given".to_owned()));
        }
        if given.len() > 1 && !several {
            return Err(self.error("more than one place is given".to_owned()));
        }
        let mut target = Target::default();
        for at in given {
            match (self.written(at)?, self.kind.place) {
                (WrittenPlace::One(_), PlaceRule::Link | PlaceRule::RingLink) => {
                    return Err(self.error(format!("`{at}` is one direction")));
                }
                (WrittenPlace::Both(_), PlaceRule::Direction | PlaceRule::Entrance) => {
                    return Err(self.error(format!("`{at}` is both directions")));
                }
                (WrittenPlace::Card(path), _) => {
                    return Err(self.error(format!("nothing is plugged into card {path}")));
                }
                (WrittenPlace::One(direction), _) => {
                    target.places.push(self.context.world.direction_place(direction));
                    target.directions.push(direction);
                    target.links.push(direction.link);
                }
                (WrittenPlace::Both(link), _) => {
                    target.places.push(self.context.world.link_place(link));
                    target.directions.extend(DirectedLink::both(link));
                    target.links.push(link);
                }
            }
        }
        Ok(target)
    }

    /// Reads `K1.C>B3.A`, `K1.C-B3.A`, or one end of a link. Names may contain either sign: every
    /// way to part the text is tried.
    fn written(&self, at: &str) -> Result<WrittenPlace, FaultError> {
        let parts = |sign: char| {
            at.match_indices(sign).map(|(index, _)| (at[..index].trim(), at[index + 1..].trim()))
        };
        for (from, to) in parts('>') {
            if let (Some(from), Some(to)) = (self.end(from), self.end(to)) {
                let link = self.link_between(at, from, to)?;
                let downstream = self.context.tree.links()[link].upstream == from;
                return Ok(WrittenPlace::One(DirectedLink { link, downstream }));
            }
        }
        for (one, other) in parts('-') {
            if let (Some(one), Some(other)) = (self.end(one), self.end(other)) {
                return self.link_between(at, one, other).map(WrittenPlace::Both);
            }
        }
        match self.end(at) {
            Some(End::MainDevice(path))
                if matches!(self.kind.place, PlaceRule::Card | PlaceRule::DeviceOrCard) =>
            {
                Ok(WrittenPlace::Card(path))
            }
            Some(end) => match self.context.tree.link_at(end) {
                Some(link) => Ok(WrittenPlace::Both(link)),
                None => Err(self.error(format!("no link is plugged in at `{at}`"))),
            },
            None => Err(self.error(self.unknown_end(at))),
        }
    }

    fn end(&self, text: &str) -> Option<End> {
        match text.parse().ok()? {
            Attachment::MainDevice(path) => Some(End::MainDevice(path)),
            Attachment::Device { name, port } => {
                let id = self.context.names.iter().position(|known| *known == name)?;
                let node = self.context.nodes.get(&DeviceId(id as u32))?;
                Some(End::Controller(*node, port))
            }
        }
    }

    fn link_between(&self, at: &str, from: End, to: End) -> Result<usize, FaultError> {
        let link = self.context.tree.link_at(from);
        let link = link.filter(|_| self.context.tree.opposite(from) == Some(to));
        link.ok_or_else(|| {
            let name = |end: End| match end {
                End::MainDevice(path) => Attachment::MainDevice(path).to_string(),
                End::Controller(node, port) => {
                    let id = self.context.world.id(node).index();
                    format!("{}.{port}", self.context.names[id])
                }
            };
            let opposite = self.context.tree.opposite(from);
            let is = opposite.map_or("nothing".to_owned(), name);
            self.error(format!("`{at}` is no link: {} is wired to {is}", name(from)))
        })
    }

    fn unknown_end(&self, at: &str) -> String {
        let name = at.rsplit_once('.').map_or(at, |(name, _)| name);
        let first = name.split(['>', '-']).next().unwrap_or(name);
        let first = first.rsplit_once('.').map_or(first, |(name, _)| name);
        if self.context.names.iter().any(|known| known == first) {
            format!("`{at}` is no place")
        } else {
            self.no_device(first)
        }
    }
}
