//! What the evidence of a fault allows: the fault itself, and what looks the same on the wire.
//!
//! Each entry that is not the injected fault has its reason. The table knows the cause and the
//! wiring, nothing of any rule of the diagnosis.

use linesman_config::fault::FaultName::{self, *};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::topology::{End, Tree};

use super::site::{Site, named};

/// A fault as it was injected, and what became of it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Truth {
    /// What it is.
    pub name: FaultName,
    /// Where it sits; several for one that acts on several places at once.
    pub places: Vec<TruthPlace>,
    /// The AL status code that a refusing device gives.
    pub al_code: Option<u16>,
    /// Ports whose symbol counter stood at its end when the fault began: they could not tell
    /// symbol errors from clean symbols any more.
    pub blind: Vec<End<DeviceId>>,
    /// Devices that make a symbol error anew when they send a bad frame on.
    pub remaking: Vec<DeviceId>,
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
    /// Why it cannot be told from the injected fault; `None` for the injected fault itself.
    pub why: Option<&'static str>,
}

const SILENT: &str = "whoever hangs behind a cut and whoever has no power are equally silent, and \
                      the neighbour's port sees no signal in both cases";
const SYMBOLS: &str = "a receiver sees symbol errors; whether the sender, the cable, the plug, its \
                       own input or interference made them is not in the symbols";
const CARD: &str = "the last hop is checked by the card only, and the first one begins in it";
const LAST_HOP: &str = "on the last hop a card counts bad frames but no symbols";
const UNCOUNTED: &str = "without the card's counters frames that the card drops just do not come \
                         back";
const MII: &str = "between its PHY and its controller the receiver may spoil what came clean";
const MAY_COME_AGAIN: &str = "an opening that is over may have been the first of many";
const BLIND: &str = "the receiver's symbol counter stood at its end, so nobody knows whether the \
                     symbols were clean";
const REMADE: &str = "the sender makes a symbol error anew for each bad frame, as if the frame had \
                      been hit on the wire";
const ONCE: &str = "each opening of a flapping contact is an open link";
const RESTART: &str = "a dip of a supply and a short time without power are the same to a device";
const SHARED: &str = "one device of a supply looks the same from outside as a supply of one device";
const CODE: &str = "the status code that the device gives says so itself";
const ALL_LINKS: &str = "interference that couples into several links has no single link as place";

/// All that an honest diagnosis may say about `truth`; the injected fault comes first.
#[must_use]
pub fn admitted(truth: &Truth, scene: &Scene<'_>) -> Vec<Admitted> {
    let mut set = Set { scene, entries: Vec::new() };
    for place in &truth.places {
        set.place(truth, *place);
    }
    if truth.name == EmcNoise && truth.places.len() > 1 {
        set.add(EmcNoise, Site::Network, Some(ALL_LINKS));
    }
    set.entries
}

struct Set<'a> {
    scene: &'a Scene<'a>,
    entries: Vec<Admitted>,
}

impl Set<'_> {
    fn add(&mut self, cause: FaultName, site: Site, why: Option<&'static str>) {
        self.entries.push(Admitted { cause, site, why });
    }

    fn place(&mut self, truth: &Truth, place: TruthPlace) {
        let tree = self.scene.tree;
        let name = truth.name;
        match place {
            TruthPlace::Link(one, other) => {
                self.add(name, Site::link(tree, one, other), None);
                if name == LinkFlapping {
                    self.add(LinkOpen, Site::link(tree, one, other), Some(ONCE));
                }
                if matches!(name, LinkOpen | LinkFlapping) {
                    self.open(one, other);
                }
                if matches!(name, CableDegraded | EmcNoise) {
                    self.symbols(one, other);
                    self.symbols(other, one);
                }
            }
            TruthPlace::Hop(from, to) => {
                self.add(name, Site::hop(tree, from, to), None);
                if matches!(name, TransmitterDamaged | DeviceInternal) {
                    self.end(name, from, None);
                }
                if name == ReceiverDamaged {
                    self.end(name, to, None);
                }
                if name == DeviceInternal {
                    self.clean(truth, from, to);
                }
                if name == NicDamaged {
                    self.card(from, to);
                }
                if matches!(name, CableDegraded | EmcNoise | TransmitterDamaged | ReceiverDamaged) {
                    self.symbols(from, to);
                }
            }
            TruthPlace::Device(id) => {
                self.add(name, Site::Device(id), None);
                self.device(truth, id);
            }
            TruthPlace::Host(path) => {
                self.add(name, Site::Host, None);
                let card = End::MainDevice(path);
                let far = opposite(tree, card).filter(|_| name == NicDamaged);
                if let Some(far) = far {
                    self.card(card, far);
                    self.card(far, card);
                }
            }
        }
    }

    /// A claim that names the device or card at `end` instead of the link.
    fn end(&mut self, cause: FaultName, end: End<DeviceId>, why: Option<&'static str>) {
        match end {
            End::MainDevice(_) => self.add(cause, Site::Host, why),
            End::Controller(id, _) => self.add(cause, Site::Device(id), why),
        }
    }

    /// No signal between two ends.
    fn open(&mut self, one: End<DeviceId>, other: End<DeviceId>) {
        let tree = self.scene.tree;
        let Site::Link { b: Some(End::Controller(behind, _)), .. } = Site::link(tree, one, other)
        else {
            return;
        };
        if self.scene.answered_again {
            self.add(LinkFlapping, Site::link(tree, one, other), Some(MAY_COME_AGAIN));
        }
        // In a ring both neighbours of a dead device see it; a cut shows at two live ends.
        if tree.closes_at().is_none() && !self.scene.answered_again {
            self.add(DeviceOff, Site::Device(behind), Some(SILENT));
            self.add(SupplyOff, Site::Device(behind), Some(SILENT));
        }
    }

    /// Symbol errors on what `from` sends and `to` receives.
    fn symbols(&mut self, from: End<DeviceId>, to: End<DeviceId>) {
        let hop = Site::hop(self.scene.tree, from, to);
        for cause in [CableDegraded, EmcNoise, TransmitterDamaged, ReceiverDamaged] {
            self.add(cause, hop, Some(SYMBOLS));
        }
        self.end(TransmitterDamaged, from, Some(SYMBOLS));
        self.end(ReceiverDamaged, to, Some(SYMBOLS));
        self.card(from, to);
    }

    /// Bad frames with clean symbols from `from` to `to`.
    fn clean(&mut self, truth: &Truth, from: End<DeviceId>, to: End<DeviceId>) {
        self.end(DeviceInternal, to, Some(MII));
        let remade = from.node().is_some_and(|sender| truth.remaking.contains(&sender));
        let why = if truth.blind.contains(&to) { Some(BLIND) } else { remade.then_some(REMADE) };
        if why.is_some() {
            let hop = Site::hop(self.scene.tree, from, to);
            for cause in [CableDegraded, EmcNoise, TransmitterDamaged, ReceiverDamaged] {
                self.add(cause, hop, why);
            }
        }
        self.card(from, to);
    }

    /// What cannot be told where one of the ends is a card.
    fn card(&mut self, from: End<DeviceId>, to: End<DeviceId>) {
        let hop = Site::hop(self.scene.tree, from, to);
        let host = |end| matches!(end, End::MainDevice(_));
        if !host(from) && !host(to) {
            return;
        }
        for cause in [NicDamaged, CableDegraded, EmcNoise, TransmitterDamaged, ReceiverDamaged] {
            self.add(cause, hop, Some(CARD));
            self.end(cause, from, Some(CARD));
            self.end(cause, to, Some(CARD));
        }
        if host(to) {
            self.add(DeviceInternal, hop, Some(LAST_HOP));
            self.end(DeviceInternal, from, Some(LAST_HOP));
            if !self.scene.host_counters {
                self.add(HostDrops, Site::Host, Some(UNCOUNTED));
            }
        }
    }

    fn device(&mut self, truth: &Truth, id: DeviceId) {
        let name = truth.name;
        if matches!(name, DeviceOff | SupplyOff | BrownOut) {
            self.unpowered(name, id);
        }
        if name == DeviceInternal {
            for (here, far) in self.links_of(id) {
                self.add(DeviceInternal, Site::hop(self.scene.tree, here, far), None);
                self.clean(truth, here, far);
            }
        }
        if name == TransmitterDamaged {
            for (here, far) in self.links_of(id) {
                self.symbols(here, far);
            }
        }
        if name == ReceiverDamaged {
            for (here, far) in self.links_of(id) {
                self.symbols(far, here);
            }
        }
        if name == InitRefused {
            if truth.al_code.is_some_and(is_configuration) {
                self.add(ConfigMismatch, Site::Device(id), Some(CODE));
            }
            if truth.al_code == Some(OUTPUT_WATCHDOG) {
                self.add(WatchdogStarved, Site::Device(id), Some(CODE));
            }
        }
    }

    /// A device that is, or was, without supply.
    fn unpowered(&mut self, name: FaultName, id: DeviceId) {
        let shared = |cause| if cause == SupplyOff || name == SupplyOff { SHARED } else { RESTART };
        for cause in [DeviceOff, SupplyOff] {
            self.add(cause, Site::Device(id), Some(shared(cause)));
        }
        if self.scene.answered_again {
            self.add(BrownOut, Site::Device(id), Some(shared(BrownOut)));
            return;
        }
        // A dip is over by its nature: one that lasts is no dip, but may be a cut.
        if let Some(above) = Site::above(self.scene.tree, id) {
            self.add(LinkOpen, above, Some(SILENT));
            self.add(DeviceOff, above, Some(SILENT));
        }
    }

    /// The links of a device, its own end first.
    fn links_of(&self, id: DeviceId) -> Vec<(End<DeviceId>, End<DeviceId>)> {
        let here = Port::ALL.map(|port| End::Controller(id, port));
        let links = here.iter().map(|here| (*here, opposite(self.scene.tree, *here)));
        links.filter_map(|(here, far)| far.map(|far| (here, far))).collect()
    }
}

/// AL status code of an expired SyncManager watchdog. Reference: ETG.1000.6, AL status codes.
const OUTPUT_WATCHDOG: u16 = 0x001B;

/// AL status codes that blame what the MainDevice configured: mailbox and process data
/// SyncManagers, mappings, watchdog. Reference: ETG.1000.6, AL status codes.
fn is_configuration(code: u16) -> bool {
    matches!(code, 0x0014 | 0x0016 | 0x0017 | 0x001C..=0x001F | 0x0021..=0x0026 | 0x0060 | 0x0070)
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
        Truth { name, places: vec![place], al_code: None, blind: Vec::new(), remaking: Vec::new() }
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
    fn the_last_hop_needs_the_cards_counters() {
        let card = End::MainDevice(Path::A);
        let inner = truth(DeviceInternal, TruthPlace::Hop(end(0, A), card));
        let first = Site::Device(DeviceId(0));
        assert_eq!(grade(&inner, true, DeviceInternal, first), Grade::Exact);
        assert!(grade(&inner, true, NicDamaged, Site::Host).is_right());
        assert!(!grade(&inner, true, HostDrops, Site::Host).is_right());
        assert!(grade(&inner, false, HostDrops, Site::Host).is_right());
    }

    #[test]
    fn a_counter_at_its_end_cannot_tell_clean_symbols() {
        let mut inner = truth(DeviceInternal, TruthPlace::Device(DeviceId(1)));
        let hop = Site::Link { a: end(1, B), b: Some(end(2, A)), way: Some(Way::AToB) };
        assert!(!grade(&inner, true, CableDegraded, hop).is_right());
        inner.blind.push(end(2, A));
        assert!(grade(&inner, true, CableDegraded, hop).is_right());
        inner.blind.clear();
        inner.remaking.push(DeviceId(1));
        assert!(grade(&inner, true, CableDegraded, hop).is_right());
        inner.remaking.clear();
        inner.blind.push(end(2, A));
        let back = Site::Link { a: end(0, B), b: Some(end(1, A)), way: Some(Way::BToA) };
        assert!(!grade(&inner, true, CableDegraded, back).is_right());
    }

    #[test]
    fn a_refusal_may_be_called_what_its_code_says() {
        let mut refusal = truth(InitRefused, TruthPlace::Device(DeviceId(2)));
        let here = Site::Device(DeviceId(2));
        refusal.al_code = Some(0x001D);
        assert!(grade(&refusal, true, ConfigMismatch, here).is_right());
        refusal.al_code = Some(0x0001);
        assert!(!grade(&refusal, true, ConfigMismatch, here).is_right());
        assert_eq!(grade(&refusal, true, InitRefused, here), Grade::Exact);
    }
}
