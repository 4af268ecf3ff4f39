//! Verdicts that the evidence of a fault allows: the fault itself, and what looks the same on the
//! wire.
//!
//! Each entry that is not the injected fault belongs to one of the [`sets`], which has the reason. What
//! is here knows the cause and the wiring, nothing of any rule of the diagnosis.

#![expect(
    clippy::wildcard_enum_match_arm,
    reason = "each step is for a few causes of the catalogue"
)]

use linesman_config::fault::FaultName::{self, *};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::topology::{End, Tree};

use super::sets::{self, AdmittedSet};
use super::site::{Site, named};

/// A fault as it was injected, and what became of it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Truth {
    /// What it is.
    pub name: FaultName,
    /// Where it sits; several for one that acts on several places at once.
    pub places: Vec<TruthPlace>,
    /// The hops on which it has hit symbols or frames so far, from sender to receiver.
    pub hops: Vec<Hop>,
    /// How often an end of a link found its signal gone.
    pub signals_lost: u64,
    /// Devices that it has taken the supply from, in order.
    pub dark: Vec<DeviceId>,
    /// The set by which nothing may be said of it at all, if there is one.
    pub unseen: Option<&'static AdmittedSet>,
    /// Devices in a row with the one it is about, all of one type and known by nothing else; for one too many
    /// the planned ones in whose places they stand.
    pub equals: Vec<DeviceId>,
    /// Whether nobody is left in the line.
    pub leaves_nobody: bool,
}

/// One direction of a link: sender and receiver.
pub type Hop = (End<DeviceId>, End<DeviceId>);

impl Truth {
    /// A fault at places, of which nothing more is known.
    #[must_use]
    pub fn new(name: FaultName, places: Vec<TruthPlace>) -> Self {
        Self {
            name,
            places,
            hops: Vec::new(),
            signals_lost: 0,
            dark: Vec::new(),
            unseen: None,
            equals: Vec::new(),
            leaves_nobody: false,
        }
    }

    /// Whether a link was lost at most once: each of its ends finds out once.
    #[must_use]
    pub fn opened_once(&self) -> bool {
        self.signals_lost <= 2
    }

    /// Whether both directions of a link were hit.
    fn hit_both_ways(&self, one: End<DeviceId>, other: End<DeviceId>) -> bool {
        self.hops.contains(&(one, other)) && self.hops.contains(&(other, one))
    }

    /// Whether the fault itself sits on a direction of a link. Frames that it has spoiled may make symbol errors elsewhere.
    #[must_use]
    pub fn sits_on(&self, (from, to): Hop) -> bool {
        self.places.iter().any(|place| match *place {
            TruthPlace::Hop(one, other) => (one, other) == (from, to),
            TruthPlace::Link(one, other) => {
                (one, other) == (from, to) || (other, one) == (from, to)
            }
            TruthPlace::Device(id) => [from, to].iter().any(|end| end.node() == Some(id)),
            TruthPlace::Host(path) => [from, to].contains(&End::MainDevice(path)),
        })
    }

    /// Whether it has hit another link than that between two ends.
    fn hits_beyond(&self, one: End<DeviceId>, other: End<DeviceId>) -> bool {
        let is_there = |hop: &Hop| *hop == (one, other) || *hop == (other, one);
        self.hops.iter().any(|hop| !is_there(hop) && self.sits_on(*hop))
    }

    /// Devices that it sits in.
    fn devices(&self) -> impl Iterator<Item = DeviceId> {
        self.places.iter().filter_map(|place| match place {
            TruthPlace::Device(id) => Some(*id),
            TruthPlace::Hop(..) | TruthPlace::Link(..) | TruthPlace::Host(_) => None,
        })
    }
}

/// Where a fault sits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum TruthPlace {
    /// One direction of a link, from sender to receiver.
    Hop(End<DeviceId>, End<DeviceId>),
    /// Both directions of a link.
    Link(End<DeviceId>, End<DeviceId>),
    /// A SubDevice.
    Device(DeviceId),
    /// A card of the MainDevice.
    Host(Path),
}

/// What could be observed, beside the fault itself.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The wiring; node *n* is device *n*.
    pub tree: &'a Tree,
    /// Whether the card's own counters were read.
    pub host_counters: bool,
    /// Whether all that fell silent has answered again: what it remembers tells a cut from a
    /// restart.
    pub answered_again: bool,
}

/// A claim that the evidence allows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Admitted {
    /// The cause that may be named.
    pub cause: FaultName,
    /// The place that goes with it.
    pub site: Site,
    /// The set that says why it cannot be told from the injected fault; `None` for the injected fault
    /// itself.
    pub set: Option<&'static AdmittedSet>,
}

/// All that an honest diagnosis may say about `truth`; the injected fault comes first.
#[must_use]
pub fn admitted(truth: &Truth, scene: &Scene<'_>) -> Vec<Admitted> {
    let mut list = List { scene, entries: Vec::new() };
    for place in &truth.places {
        list.place(truth, *place);
    }
    list.entries
}

struct List<'a> {
    scene: &'a Scene<'a>,
    entries: Vec<Admitted>,
}

impl List<'_> {
    /// The injected fault at a place.
    fn exact(&mut self, cause: FaultName, site: Site) {
        self.entries.push(Admitted { cause, site, set: None });
    }

    /// A cause of a set at a place.
    fn add(&mut self, cause: FaultName, site: Site, set: &'static AdmittedSet) {
        if set.has(cause) {
            self.entries.push(Admitted { cause, site, set: Some(set) });
        }
    }

    fn place(&mut self, truth: &Truth, place: TruthPlace) {
        let tree = self.scene.tree;
        let name = truth.name;
        match place {
            TruthPlace::Link(one, other) => {
                self.exact(name, Site::link(tree, one, other));
                match name {
                    LinkOpen => self.open(truth, one, other),
                    FalseLink => self.one_end(truth, one, other),
                    CableDegraded | EmcNoise if truth.hit_both_ways(one, other) => {
                        let causes = sets::BOTH_WAYS.causes;
                        for cause in causes.iter().filter(|_| !truth.hits_beyond(one, other)) {
                            self.add(*cause, Site::link(tree, one, other), &sets::BOTH_WAYS);
                        }
                    }
                    CableDegraded | EmcNoise => {
                        self.symbols(truth, (one, other));
                        self.symbols(truth, (other, one));
                    }
                    _ => {}
                }
            }
            TruthPlace::Hop(from, to) => self.hop(truth, (from, to)),
            TruthPlace::Device(id) => {
                self.exact(name, Site::Device(id));
                self.device(truth, id);
            }
            TruthPlace::Host(path) => {
                self.exact(name, Site::Host);
                self.host(truth, path);
            }
        }
    }

    fn hop(&mut self, truth: &Truth, (from, to): Hop) {
        let (tree, name) = (self.scene.tree, truth.name);
        self.exact(name, Site::hop(tree, from, to));
        match name {
            CableDegraded | EmcNoise => self.symbols(truth, (from, to)),
            TransmitterDamaged => {
                self.exact(name, end_site(from));
                self.symbols(truth, (from, to));
            }
            ReceiverDamaged => {
                self.exact(name, end_site(to));
                self.symbols(truth, (from, to));
            }
            DeviceInternal => self.exact(name, end_site(from)),
            LinkOpen | FalseLink => {
                // On copper the other direction goes with it.
                self.exact(name, Site::link(tree, from, to));
                self.one_end(truth, from, to);
            }
            LinkFlapping => self.exact(name, Site::link(tree, from, to)),
            // Who else sends is not at a place of the line; its frames are everywhere on it.
            SecondMainDevice | ForeignFrames => self.exact(name, Site::Network),
            _ => {}
        }
    }

    /// No signal between two ends. In a ring both neighbours of a dead device see it; a cut shows at two
    /// live ends.
    fn open(&mut self, truth: &Truth, one: End<DeviceId>, other: End<DeviceId>) {
        let tree = self.scene.tree;
        let is_ring = tree.link_at(one.map(DeviceId::index)).is_some_and(|at| tree.is_on_ring(at));
        if is_ring || self.scene.answered_again || !truth.opened_once() {
            return;
        }
        let link = Site::link(tree, one, other);
        let Site::Link { b: Some(End::Controller(behind, _)), .. } = link else { return };
        self.silent(link, behind);
    }

    /// A link that one of its ends has lost, and the other one has not.
    fn one_end(&mut self, truth: &Truth, one: End<DeviceId>, other: End<DeviceId>) {
        if truth.signals_lost == 1 {
            for cause in sets::ONE_END.causes {
                self.add(*cause, Site::link(self.scene.tree, one, other), &sets::ONE_END);
            }
        }
    }

    /// Silence of a device and all behind it.
    fn silent(&mut self, above: Site, id: DeviceId) {
        self.add(LinkOpen, above, &sets::SILENT);
        self.add(DeviceOff, Site::Device(id), &sets::SILENT);
        self.add(SupplyOff, Site::Device(id), &sets::SILENT);
    }

    /// Symbol errors on what `from` sends and `to` receives.
    fn symbols(&mut self, truth: &Truth, (from, to): Hop) {
        let set = match (from, to) {
            (End::MainDevice(_), _) => &sets::FIRST_HOP,
            // Without counters there are drops, too, for causes that could be taken for them; a damaged
            // output is of the set of the counted hop all the same.
            (_, End::MainDevice(_))
                if self.scene.host_counters || !sets::UNCOUNTED.has(truth.name) =>
            {
                &sets::LAST_HOP
            }
            (_, End::MainDevice(_)) => &sets::UNCOUNTED,
            (End::Controller(..), End::Controller(..)) => &sets::SYMBOLS,
        };
        self.on_hop(truth, (from, to), set);
    }

    /// All causes of a set on a hop, each at the places where it sits, if the fault is one of them. What hit other links
    /// alike is not in this one: then none but interference explains all hits.
    fn on_hop(&mut self, truth: &Truth, (from, to): Hop, set: &'static AdmittedSet) {
        if !set.has(truth.name) || truth.hits_beyond(from, to) {
            return;
        }
        let hop = Site::hop(self.scene.tree, from, to);
        for cause in set.causes {
            match cause {
                NicDamaged | HostDrops => self.add(*cause, Site::Host, set),
                TransmitterDamaged => {
                    self.add(*cause, hop, set);
                    self.add(*cause, end_site(from), set);
                }
                ReceiverDamaged => {
                    self.add(*cause, hop, set);
                    self.add(*cause, end_site(to), set);
                }
                _ => self.add(*cause, hop, set),
            }
        }
    }

    fn host(&mut self, truth: &Truth, path: Path) {
        let card = End::MainDevice(path);
        let Some(far) = opposite(self.scene.tree, card) else { return };
        match truth.name {
            NicDamaged => {
                let was_hit = |hop| truth.hops.is_empty() || truth.hops.contains(&hop);
                for hop in [(card, far), (far, card)].into_iter().filter(|hop| was_hit(*hop)) {
                    self.symbols(truth, hop);
                }
            }
            HostDrops if !self.scene.host_counters => {
                self.on_hop(truth, (far, card), &sets::UNCOUNTED);
            }
            MainDeviceWrongPort => {
                // The plug has two ends: the card's cable, and the port it sits in.
                self.exact(truth.name, Site::link(self.scene.tree, card, far));
                self.exact(truth.name, end_site(far));
            }
            _ => {}
        }
    }

    fn device(&mut self, truth: &Truth, id: DeviceId) {
        match truth.name {
            DeviceOff | SupplyOff => self.unpowered(truth, id),
            DeviceMissing => {
                for equal in &truth.equals {
                    self.add(DeviceMissing, Site::Device(*equal), &sets::EQUALS);
                }
                if truth.leaves_nobody
                    && let Some(above) = Site::above(self.scene.tree, id)
                {
                    self.add(LinkOpen, above, &sets::NOBODY);
                    self.add(DeviceOff, Site::Device(id), &sets::NOBODY);
                    self.add(SupplyOff, Site::Device(id), &sets::NOBODY);
                }
            }
            DeviceExtra => {
                for equal in &truth.equals {
                    self.add(DeviceExtra, Site::Device(*equal), &sets::EXTRAS);
                }
            }
            EbusOverload => {
                for fallen in &truth.dark {
                    self.add(BrownOut, Site::Device(*fallen), &sets::OVERLOAD);
                }
            }
            DeviceInternal => {
                for (here, far) in self.links_of(id) {
                    self.exact(DeviceInternal, Site::hop(self.scene.tree, here, far));
                }
            }
            TransmitterDamaged => {
                for (here, far) in self.links_of(id) {
                    self.symbols(truth, (here, far));
                }
            }
            ReceiverDamaged => {
                for (here, far) in self.links_of(id) {
                    self.symbols(truth, (far, here));
                }
            }
            _ => {}
        }
    }

    /// A device without supply, and nothing dark but what hangs behind it.
    fn unpowered(&mut self, truth: &Truth, id: DeviceId) {
        let tree = self.scene.tree;
        let is_behind =
            |other: DeviceId| other == id || tree.is_downstream_of(other.index(), id.index());
        let is_ring = tree.link_above(id.index()).is_some_and(|link| tree.is_on_ring(link));
        if is_ring || self.scene.answered_again || !truth.devices().all(is_behind) {
            return;
        }
        if let Some(above) = Site::above(tree, id) {
            self.silent(above, id);
        }
    }

    /// The links of a device, its own end first.
    fn links_of(&self, id: DeviceId) -> Vec<Hop> {
        let here = Port::ALL.map(|port| End::Controller(id, port));
        let links = here.iter().map(|here| (*here, opposite(self.scene.tree, *here)));
        links.filter_map(|(here, far)| far.map(|far| (here, far))).collect()
    }
}

/// The device or the computer at an end.
fn end_site(end: End<DeviceId>) -> Site {
    match end {
        End::MainDevice(_) => Site::Host,
        End::Controller(id, _) => Site::Device(id),
    }
}

/// The other end of the link at `end`.
fn opposite(tree: &Tree, end: End<DeviceId>) -> Option<End<DeviceId>> {
    tree.opposite(end.map(DeviceId::index)).map(named)
}

#[cfg(test)]
mod tests {
    use linesman_proto::port::Port::{A, B, C};
    use linesman_proto::topology::Wired;

    use super::super::{Claim, Grade, Way, matches};
    use super::*;

    /// A coupler with two terminals on B and a box on C.
    fn tree() -> Tree {
        let on = |node, port| Wired { on: End::Controller(node, port), entry: A };
        let first = Wired { on: End::MainDevice(Path::A), entry: A };
        Tree::from_wiring(&[first, on(0, B), on(1, B), on(0, C)], None).unwrap()
    }

    fn end(node: u32, port: linesman_proto::port::Port) -> End<DeviceId> {
        End::Controller(DeviceId(node), port)
    }

    fn truth(name: FaultName, place: TruthPlace) -> Truth {
        Truth::new(name, vec![place])
    }

    fn grade(truth: &Truth, host_counters: bool, cause: FaultName, site: Site) -> Grade {
        let tree = tree();
        let scene = Scene { tree: &tree, host_counters, answered_again: false };
        matches(truth, &scene, Claim { cause, site }).cause
    }

    #[test]
    fn a_cut_may_be_a_dead_neighbour_but_no_other() {
        let cut = truth(LinkOpen, TruthPlace::Link(end(0, B), end(1, A)));
        let link = Site::Link { a: end(0, B), b: Some(end(1, A)), way: None };
        assert_eq!(grade(&cut, true, LinkOpen, link), Grade::Exact);
        let unseen = Site::Link { a: end(0, B), b: None, way: None };
        assert_eq!(grade(&cut, true, LinkOpen, unseen), Grade::Exact);
        assert!(matches!(
            grade(&cut, true, DeviceOff, Site::Device(DeviceId(1))),
            Grade::Admitted(_)
        ));
        for (cause, site) in [
            (DeviceOff, Site::Device(DeviceId(2))),
            (DeviceOff, Site::Device(DeviceId(0))),
            (LinkOpen, Site::Link { a: end(1, B), b: Some(end(2, A)), way: None }),
            (CableDegraded, link),
        ] {
            assert_eq!(grade(&cut, true, cause, site), Grade::Wrong, "{cause} at {site}");
        }
    }

    #[test]
    fn noise_must_be_in_the_right_direction() {
        let noise = truth(EmcNoise, TruthPlace::Hop(end(3, A), end(0, C)));
        let site = |way| Site::Link { a: end(0, C), b: Some(end(3, A)), way };
        assert_eq!(grade(&noise, true, EmcNoise, site(Some(Way::BToA))), Grade::Exact);
        assert_eq!(grade(&noise, true, EmcNoise, site(Some(Way::AToB))), Grade::Wrong);
        let cable = grade(&noise, true, CableDegraded, site(Some(Way::BToA)));
        assert!(matches!(cable, Grade::Admitted(_)));
        assert_eq!(grade(&noise, true, DeviceInternal, site(Some(Way::BToA))), Grade::Wrong);
        assert_eq!(grade(&noise, true, NicDamaged, Site::Host), Grade::Wrong);
    }

    #[test]
    fn interference_in_two_cables_is_no_worn_cable() {
        let places = [(end(0, C), end(3, A)), (End::MainDevice(Path::A), end(0, A))];
        let mut noise = Truth::new(EmcNoise, places.map(|(a, b)| TruthPlace::Link(a, b)).into());
        let link = Site::Link { a: end(0, C), b: Some(end(3, A)), way: None };
        noise.hops = vec![places[0]];
        assert!(grade(&noise, true, CableDegraded, link).is_right(), "one of them was hit");
        // Damaged frames make symbol errors further on.
        noise.hops.push((end(0, B), end(1, A)));
        assert!(grade(&noise, true, CableDegraded, link).is_right());
        noise.hops.push(places[1]);
        assert!(!grade(&noise, true, CableDegraded, link).is_right());
        assert_eq!(grade(&noise, true, EmcNoise, link), Grade::Exact);
    }

    #[test]
    fn a_damaged_output_before_the_card_may_be_four_things_counted_or_not() {
        let hop = (end(0, A), End::MainDevice(Path::A));
        let output = truth(TransmitterDamaged, TruthPlace::Hop(hop.0, hop.1));
        let link = Site::Link { a: hop.1, b: Some(hop.0), way: Some(Way::BToA) };
        for counted in [true, false] {
            assert!(grade(&output, counted, CableDegraded, link).is_right());
            assert!(!grade(&output, counted, HostDrops, Site::Host).is_right());
        }
    }

    #[test]
    fn a_link_lost_at_one_end_may_be_open_or_false() {
        let place = TruthPlace::Hop(end(0, B), end(1, A));
        let link = Site::Link { a: end(0, B), b: Some(end(1, A)), way: None };
        for (name, other) in [(LinkOpen, FalseLink), (FalseLink, LinkOpen)] {
            let one = Truth { signals_lost: 1, ..truth(name, place) };
            assert!(grade(&one, true, other, link).is_right(), "{name}");
            let none = Truth { signals_lost: 0, ..one.clone() };
            assert!(!grade(&none, true, other, link).is_right(), "{name}: nobody lost it");
            let both = Truth { signals_lost: 2, ..one };
            assert!(!grade(&both, true, other, link).is_right(), "{name}: both lost it");
        }
    }

    #[test]
    fn the_last_hop_needs_the_cards_counters() {
        let card = End::MainDevice(Path::A);
        let cable = truth(CableDegraded, TruthPlace::Hop(end(0, A), card));
        assert!(grade(&cable, true, NicDamaged, Site::Host).is_right());
        assert!(!grade(&cable, true, HostDrops, Site::Host).is_right());
        assert!(grade(&cable, false, HostDrops, Site::Host).is_right());
        let inner = truth(DeviceInternal, TruthPlace::Hop(end(0, A), card));
        assert_eq!(grade(&inner, true, DeviceInternal, Site::Device(DeviceId(0))), Grade::Exact);
        for counters in [true, false] {
            assert!(!grade(&inner, counters, NicDamaged, Site::Host).is_right());
        }
    }

    #[test]
    fn what_is_dark_on_two_branches_is_no_cut() {
        let off = |name, ids: &[u32]| {
            Truth::new(name, ids.iter().map(|id| TruthPlace::Device(DeviceId(*id))).collect())
        };
        let above = Site::Link { a: end(0, B), b: Some(end(1, A)), way: None };
        assert!(grade(&off(SupplyOff, &[1, 2]), true, LinkOpen, above).is_right());
        assert!(!grade(&off(SupplyOff, &[1, 3]), true, LinkOpen, above).is_right());
        assert!(!grade(&off(BrownOut, &[1]), true, LinkOpen, above).is_right());
        let tree = tree();
        let scene = Scene { tree: &tree, host_counters: true, answered_again: true };
        let claim = Claim { cause: LinkOpen, site: above };
        assert!(!matches(&off(DeviceOff, &[1]), &scene, claim).is_right(), "it has started anew");
    }

    #[test]
    fn a_fault_that_is_in_no_set_is_only_itself() {
        let here = Site::Device(DeviceId(2));
        for name in [InitRefused, ConfigMismatch, FirmwareFault, CycleTooFast, BrownOut] {
            let fault = truth(name, TruthPlace::Device(DeviceId(2)));
            let right =
                FaultName::ALL.iter().filter(|cause| grade(&fault, true, **cause, here).is_right());
            assert_eq!(right.collect::<Vec<_>>(), [&name]);
        }
    }
}
