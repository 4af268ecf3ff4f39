//! The network cards of this host.

use std::collections::BTreeMap;
use std::fmt;
use std::net::IpAddr;
use std::path::Path;

use linesman_proto::ethernet::MacAddress;

use super::ethtool::Ethtool;
use super::netlink::{LinkRecord, Netlink};
use crate::error::LinkError;
use crate::host_check::DriverSettings;

/// A network interface as it is now.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Interface {
    /// Its name, such as `eth0`.
    pub name: String,
    /// Its number in this network namespace.
    pub index: u32,
    /// Its hardware address; `None` where it has none of six bytes.
    pub mac: Option<MacAddress>,
    /// What stands behind it.
    pub kind: InterfaceKind,
    /// Whether it is switched on.
    pub up: bool,
    /// Whether there is a link: something is connected and powered.
    pub carrier: bool,
    /// The state by which Linux sums both up.
    pub operational: OperationalState,
    /// Speed of the link in Mbit/s; `None` without a link, or when the driver does not know.
    pub speed_mbit: Option<u32>,
    /// Duplex of the link, as speed.
    pub duplex: Option<Duplex>,
    /// Its driver.
    pub driver: Option<String>,
    /// The bus its device is on: `pci`, `usb`, `virtio`, …
    pub bus: Option<String>,
    /// Longest payload, in bytes; EtherCAT needs 1500.
    pub mtu: u32,
    /// Its IP addresses.
    pub addresses: Vec<InterfaceAddress>,
    /// The bridge or bond that it belongs to.
    pub member_of: Option<String>,
    /// How long the card may hold back a received frame to report several at once, in µs.
    pub receive_delay_us: Option<u32>,
}

/// An IP address of an interface.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct InterfaceAddress {
    /// The address.
    pub ip: IpAddr,
    /// Length of the network's part, in bits.
    pub prefix_len: u8,
}

impl InterfaceAddress {
    /// Whether it is an IPv6 address that every interface gives itself.
    #[must_use]
    pub const fn is_link_local(&self) -> bool {
        match self.ip {
            IpAddr::V4(_) => false,
            IpAddr::V6(ip) => ip.is_unicast_link_local(),
        }
    }
}

impl fmt::Display for InterfaceAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.ip, self.prefix_len)
    }
}

/// What stands behind an interface.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum InterfaceKind {
    /// A card with a socket for a cable.
    Physical,
    /// A radio.
    Wireless,
    /// A card that a virtual machine is given.
    VirtualMachine,
    /// The host talking to itself.
    Loopback,
    /// One end of a virtual cable.
    Veth,
    /// A virtual switch.
    Bridge,
    /// Several cards used as one (bond or team).
    Bond,
    /// A card's frames with one VLAN tag.
    Vlan,
    /// A program in place of a card (TAP or TUN).
    Tap,
    /// Another virtual interface, by the kernel's name for its kind.
    Virtual(String),
    /// Something without Ethernet frames, by its hardware type (`ARPHRD_…`).
    NotEthernet(u16),
}

impl fmt::Display for InterfaceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Physical => "physical",
            Self::Wireless => "wireless",
            Self::VirtualMachine => "virtual machine",
            Self::Loopback => "loopback",
            Self::Veth => "veth",
            Self::Bridge => "bridge",
            Self::Bond => "bond",
            Self::Vlan => "vlan",
            Self::Tap => "tap",
            Self::Virtual(kind) => return write!(f, "virtual ({kind})"),
            Self::NotEthernet(number) => return write!(f, "not Ethernet (type {number})"),
        })
    }
}

/// RFC 2863 state of an interface, as Linux reports it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum OperationalState {
    /// The driver does not say.
    #[default]
    Unknown,
    /// Parts of the hardware are missing.
    NotPresent,
    /// No frame can pass.
    Down,
    /// The interface beneath is down.
    LowerLayerDown,
    /// In a test mode.
    Testing,
    /// Waiting for something, such as authentication.
    Dormant,
    /// Frames can pass.
    Up,
}

impl OperationalState {
    pub(crate) const fn from_number(number: u8) -> Self {
        match number {
            1 => Self::NotPresent,
            2 => Self::Down,
            3 => Self::LowerLayerDown,
            4 => Self::Testing,
            5 => Self::Dormant,
            6 => Self::Up,
            _ => Self::Unknown,
        }
    }
}

impl fmt::Display for OperationalState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unknown => "unknown",
            Self::NotPresent => "not present",
            Self::Down => "down",
            Self::LowerLayerDown => "lower layer down",
            Self::Testing => "testing",
            Self::Dormant => "dormant",
            Self::Up => "up",
        })
    }
}

/// Whether both ends of a link may send at once.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Duplex {
    /// One at a time.
    Half,
    /// Both at once, as EtherCAT needs.
    Full,
}

impl fmt::Display for Duplex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Half => "half duplex",
            Self::Full => "full duplex",
        })
    }
}

/// The network interfaces of this namespace, in the order of their numbers.
///
/// # Errors
/// When the kernel does not answer.
pub fn list() -> Result<Vec<Interface>, LinkError> {
    let doing = "asking the kernel for its interfaces";
    let failed = |error| LinkError::all(doing, error);
    let mut netlink = Netlink::open().map_err(failed)?;
    let ethtool = Ethtool::open().map_err(failed)?;
    let mut found = BTreeMap::new();
    let mut masters = Vec::new();
    netlink
        .links(|record| {
            found.insert(record.index, describe(record));
            masters.extend(record.master.map(|master| (record.index, master)));
        })
        .map_err(failed)?;
    netlink
        .addresses(|index, ip, prefix_len| {
            if let Some(interface) = found.get_mut(&index) {
                interface.addresses.push(InterfaceAddress { ip, prefix_len });
            }
        })
        .map_err(failed)?;
    for (index, master) in masters {
        let name = found.get(&master).map(|master| master.name.clone());
        if let Some(interface) = found.get_mut(&index) {
            interface.member_of = name;
        }
    }
    for interface in found.values_mut() {
        ask_driver(&ethtool, interface);
    }
    Ok(found.into_values().collect())
}

/// The interface with this name.
///
/// # Errors
/// [`LinkError::Missing`], with the names there are; or when the kernel does not answer.
pub fn find(name: &str) -> Result<Interface, LinkError> {
    let mut all = list()?;
    match all.iter().position(|interface| interface.name == name) {
        Some(at) => Ok(all.swap_remove(at)),
        None => {
            let present = all.into_iter().map(|interface| interface.name).collect();
            Err(LinkError::Missing { interface: name.to_owned(), present })
        }
    }
}

/// What the driver of a card says of how it handles frames; nothing for a card that is not there.
///
/// # Errors
/// When no socket can be had.
pub fn driver_settings(name: &str) -> Result<DriverSettings, LinkError> {
    let failed = |error| LinkError::all("asking drivers for their settings", error);
    Ok(Ethtool::open().map_err(failed)?.settings(name))
}

fn describe(record: &LinkRecord<'_>) -> Interface {
    let up = record.is_up();
    Interface {
        name: record.name.to_owned(),
        index: record.index,
        mac: record.address,
        kind: kind(record),
        up,
        // Virtual devices claim a carrier while they are switched off.
        carrier: up && record.carrier,
        operational: OperationalState::from_number(record.operational),
        speed_mbit: None,
        duplex: None,
        driver: None,
        bus: record.bus.map(str::to_owned),
        mtu: record.mtu,
        addresses: Vec::new(),
        member_of: None,
        receive_delay_us: None,
    }
}

fn kind(record: &LinkRecord<'_>) -> InterfaceKind {
    match record.hardware_type {
        libc::ARPHRD_ETHER => {}
        libc::ARPHRD_LOOPBACK => return InterfaceKind::Loopback,
        other => return InterfaceKind::NotEthernet(other),
    }
    match record.kind {
        Some("veth") => InterfaceKind::Veth,
        Some("bridge" | "openvswitch") => InterfaceKind::Bridge,
        Some("bond" | "team") => InterfaceKind::Bond,
        Some("vlan") => InterfaceKind::Vlan,
        Some("tun") => InterfaceKind::Tap,
        Some(other) => InterfaceKind::Virtual(other.to_owned()),
        None if is_wireless(record.name) => InterfaceKind::Wireless,
        None => match record.bus {
            Some("virtio" | "vmbus" | "xen") => InterfaceKind::VirtualMachine,
            Some(_) => InterfaceKind::Physical,
            // Kernels before 5.14 do not tell the bus.
            None if sysfs(record.name, "device").exists() => InterfaceKind::Physical,
            None => InterfaceKind::Virtual("unknown".to_owned()),
        },
    }
}

fn is_wireless(name: &str) -> bool {
    ["wireless", "phy80211"].into_iter().any(|entry| sysfs(name, entry).exists())
}

fn sysfs(name: &str, entry: &str) -> std::path::PathBuf {
    Path::new("/sys/class/net").join(name).join(entry)
}

fn ask_driver(ethtool: &Ethtool, interface: &mut Interface) {
    interface.driver = ethtool.driver(&interface.name);
    if interface.carrier {
        let settings = ethtool.link_settings(&interface.name);
        (interface.speed_mbit, interface.duplex) = (settings.speed_mbit, settings.duplex);
    }
    interface.receive_delay_us = ethtool.receive_delay_us(&interface.name);
    if matches!(interface.driver.as_deref(), Some("vmxnet3" | "hv_netvsc")) {
        interface.kind = InterfaceKind::VirtualMachine;
    }
}
