//! Suitability of a network card for EtherCAT, with reasons and what to do about them.
//!
//! Reference: ETG.1000.2 (100 Mbit/s, full duplex, no other traffic on the line).

use std::fmt;

use super::card::{Duplex, Interface, InterfaceAddress, InterfaceKind};

/// EtherCAT's frames may be as long as Ethernet's.
const MTU: u32 = 1500;
/// Every EtherCAT controller links at this speed, in Mbit/s.
const SPEED_MBIT: u32 = 100;
/// A card that reports frames later than this, in µs, spoils short cycles.
const RECEIVE_DELAY_US: u32 = 10;

/// Whether an interface suits EtherCAT.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Suitability {
    /// Nothing speaks against it.
    Suitable,
    /// It works; the notes say what to mind.
    Limited,
    /// It cannot work; the notes say why.
    Unsuitable,
}

impl fmt::Display for Suitability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Suitable => "suitable",
            Self::Limited => "limited",
            Self::Unsuitable => "unsuitable",
        })
    }
}

/// How much a note weighs.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum NoteWeight {
    /// Worth knowing.
    Information,
    /// EtherCAT will run worse, or disturb something.
    Warning,
    /// EtherCAT cannot run.
    Obstacle,
}

/// One thing about an interface that matters to EtherCAT.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Note {
    /// How much it weighs.
    pub weight: NoteWeight,
    /// What it is.
    pub text: String,
    /// What to do about it; empty where nothing can be done.
    pub action: String,
}

/// What speaks for and against an interface.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Assessment {
    /// The sum of it.
    pub suitability: Suitability,
    /// The reasons, heaviest first.
    pub notes: Vec<Note>,
}

impl Interface {
    /// Whether this interface suits EtherCAT, and why.
    #[must_use]
    pub fn assess(&self) -> Assessment {
        let mut notes = Notes(Vec::new());
        self.assess_kind(&mut notes);
        self.assess_sharing(&mut notes);
        self.assess_link(&mut notes);
        let mut notes = notes.0;
        notes.sort_by_key(|note| std::cmp::Reverse(note.weight));
        let suitability = match notes.first().map(|note| note.weight) {
            Some(NoteWeight::Obstacle) => Suitability::Unsuitable,
            Some(NoteWeight::Warning) => Suitability::Limited,
            Some(NoteWeight::Information) | None => Suitability::Suitable,
        };
        Assessment { suitability, notes }
    }

    fn assess_kind(&self, notes: &mut Notes) {
        match &self.kind {
            InterfaceKind::Physical => {}
            InterfaceKind::Wireless => {
                notes.obstacle("a radio carries no EtherCAT frames", "use a cable");
            }
            InterfaceKind::Loopback => {
                notes.obstacle("the host talks to itself here", "use an Ethernet card");
            }
            InterfaceKind::NotEthernet(_) => {
                notes.obstacle("it carries no Ethernet frames", "use an Ethernet card");
            }
            InterfaceKind::Bridge => {
                notes.obstacle("a bridge learns and floods frames", "use the card itself");
            }
            InterfaceKind::Bond => {
                notes.obstacle("a bond spreads frames over its cards", "use one card itself");
            }
            InterfaceKind::Vlan => {
                notes.warn("it adds a VLAN tag to every frame", "use the card itself");
            }
            InterfaceKind::VirtualMachine => notes.warn(
                "the virtual machine's host stands between card and line: frames come late, and \
                 its error counters are not the card's",
                "pass the card itself through to the virtual machine",
            ),
            InterfaceKind::Veth | InterfaceKind::Tap => {
                notes.inform("it is virtual: for simulated segments", "");
            }
            InterfaceKind::Virtual(_) => notes.warn("it is virtual", "use an Ethernet card"),
        }
        if self.bus.as_deref() == Some("usb") {
            notes.warn(
                "a USB adapter delays each frame by 125 µs and more, irregularly",
                "use a card on PCI Express for cycles below 2 ms",
            );
        }
    }

    fn assess_sharing(&self, notes: &mut Notes) {
        let name = &self.name;
        if let Some(master) = &self.member_of {
            notes.obstacle(
                &format!("it belongs to {master}, which takes the frames away"),
                &format!("sudo ip link set {name} nomaster"),
            );
        }
        let (automatic, given): (Vec<InterfaceAddress>, Vec<InterfaceAddress>) =
            self.addresses.iter().copied().partition(|address| address.is_link_local());
        // Loopback is refused anyway, and always has an address.
        if !given.is_empty() && self.kind != InterfaceKind::Loopback {
            let list: Vec<String> = given.iter().map(ToString::to_string).collect();
            notes.warn(
                &format!("it has IP addresses ({}): a network is in use here", list.join(", ")),
                &format!(
                    "choose another card; if that network is not needed, sudo ip address flush \
                     dev {name}"
                ),
            );
        }
        if !automatic.is_empty() {
            notes.inform(
                "IPv6 is on: the host sends frames of its own into the line",
                &format!("sudo sysctl net.ipv6.conf.{name}.disable_ipv6=1"),
            );
        }
    }

    fn assess_link(&self, notes: &mut Notes) {
        let name = &self.name;
        if self.mtu < MTU {
            notes.warn(
                &format!("its MTU is {}, long EtherCAT frames need {MTU}", self.mtu),
                &format!("sudo ip link set {name} mtu {MTU}"),
            );
        }
        if !self.up {
            notes.warn("it is switched off", &format!("sudo ip link set {name} up"));
        } else if !self.carrier {
            notes.inform(
                "there is no link: nothing is connected, or the first SubDevice has no power",
                "plug the cable into the first SubDevice's IN port, switch it on",
            );
        }
        if self.duplex == Some(Duplex::Half) {
            notes.warn(
                "the link is half duplex, EtherCAT needs full duplex",
                &format!("sudo ethtool -s {name} autoneg on"),
            );
        }
        match self.speed_mbit {
            Some(speed) if speed < SPEED_MBIT => notes.warn(
                &format!("the link runs at {speed} Mbit/s, EtherCAT needs {SPEED_MBIT}"),
                &format!("sudo ethtool -s {name} autoneg on; check the cable's four wires"),
            ),
            Some(speed) if speed > SPEED_MBIT && self.kind == InterfaceKind::Physical => notes
                .inform(
                    &format!(
                        "the link runs at {speed} Mbit/s: a switch or a computer is connected, \
                         EtherCAT controllers link at {SPEED_MBIT}"
                    ),
                    "",
                ),
            Some(_) | None => {}
        }
        match self.receive_delay_us {
            Some(delay) if delay > RECEIVE_DELAY_US => notes.inform(
                &format!("the card may hold received frames back for {delay} µs"),
                &format!("sudo ethtool -C {name} rx-usecs 0 (matters in cycles below 1 ms)"),
            ),
            Some(_) | None => {}
        }
    }
}

struct Notes(Vec<Note>);

impl Notes {
    fn inform(&mut self, text: &str, action: &str) {
        self.push(NoteWeight::Information, text, action);
    }

    fn warn(&mut self, text: &str, action: &str) {
        self.push(NoteWeight::Warning, text, action);
    }

    fn obstacle(&mut self, text: &str, action: &str) {
        self.push(NoteWeight::Obstacle, text, action);
    }

    fn push(&mut self, weight: NoteWeight, text: &str, action: &str) {
        self.0.push(Note { weight, text: text.to_owned(), action: action.to_owned() });
    }
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, Ipv6Addr};

    use super::super::card::OperationalState;
    use super::*;

    fn card() -> Interface {
        Interface {
            name: "eth0".to_owned(),
            index: 2,
            mac: None,
            kind: InterfaceKind::Physical,
            up: true,
            carrier: true,
            operational: OperationalState::Up,
            speed_mbit: Some(100),
            duplex: Some(Duplex::Full),
            driver: Some("igc".to_owned()),
            bus: Some("pci".to_owned()),
            mtu: 1500,
            addresses: Vec::new(),
            member_of: None,
            receive_delay_us: Some(3),
        }
    }

    #[test]
    fn a_free_card_at_100_mbit_is_suitable_without_a_word() {
        let assessment = card().assess();
        assert_eq!(assessment.suitability, Suitability::Suitable);
        assert_eq!(assessment.notes, []);
    }

    #[test]
    fn each_trait_has_its_weight_and_its_words() {
        type Change = fn(&mut Interface);
        let ip = |ip| InterfaceAddress { ip, prefix_len: 24 };
        let rows: [(Change, Suitability, &str); 16] = [
            (|c| c.kind = InterfaceKind::Wireless, Suitability::Unsuitable, "radio"),
            (|c| c.kind = InterfaceKind::Loopback, Suitability::Unsuitable, "itself"),
            (|c| c.kind = InterfaceKind::NotEthernet(280), Suitability::Unsuitable, "no Ethernet"),
            (|c| c.kind = InterfaceKind::Bridge, Suitability::Unsuitable, "bridge"),
            (|c| c.kind = InterfaceKind::Bond, Suitability::Unsuitable, "bond"),
            (|c| c.member_of = Some("br0".into()), Suitability::Unsuitable, "belongs to br0"),
            (|c| c.kind = InterfaceKind::Vlan, Suitability::Limited, "VLAN"),
            (|c| c.kind = InterfaceKind::VirtualMachine, Suitability::Limited, "virtual machine"),
            (|c| c.kind = InterfaceKind::Veth, Suitability::Suitable, "simulated"),
            (|c| c.bus = Some("usb".into()), Suitability::Limited, "125 µs"),
            (|c| c.mtu = 1400, Suitability::Limited, "its MTU is 1400"),
            (|c| c.up = false, Suitability::Limited, "switched off"),
            (|c| c.carrier = false, Suitability::Suitable, "no link"),
            (|c| c.duplex = Some(Duplex::Half), Suitability::Limited, "half duplex"),
            (|c| c.speed_mbit = Some(1000), Suitability::Suitable, "1000 Mbit/s"),
            (|c| c.speed_mbit = Some(10), Suitability::Limited, "10 Mbit/s"),
        ];
        for (change, suitability, word) in rows {
            let mut card = card();
            change(&mut card);
            let assessment = card.assess();
            assert_eq!(assessment.suitability, suitability, "{word}");
            assert_eq!(assessment.notes.len(), 1, "{word}");
            assert!(assessment.notes[0].text.contains(word), "{:?}", assessment.notes);
        }
        let mut shared = card();
        shared.addresses = vec![
            ip(Ipv6Addr::new(0xFE80, 0, 0, 0, 0, 0, 0, 1).into()),
            ip(Ipv4Addr::new(192, 168, 0, 5).into()),
        ];
        shared.receive_delay_us = Some(30);
        let assessment = shared.assess();
        assert_eq!(assessment.suitability, Suitability::Limited);
        let texts: Vec<_> = assessment.notes.iter().map(|note| note.text.as_str()).collect();
        assert!(texts[0].contains("192.168.0.5/24"), "heaviest first: {texts:?}");
        assert!(texts[1].contains("IPv6") && texts[2].contains("30 µs"), "{texts:?}");
    }
}
