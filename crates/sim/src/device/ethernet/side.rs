//! The Ethernet side of one device.

use std::collections::VecDeque;

use linesman_proto::ethernet::MacAddress;
use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::time::Instant;

use super::bridged_port::BridgedPort;
use super::datagrams::{DatagramSource, UdpDatagrams};
use super::dhcp_server::DhcpServer;
use super::host_address::HostAddress;
use super::ip_host::IpHost;

/// Frames that wait for the mailbox; what comes then is lost.
const WAITING: usize = 64;

/// What a device that speaks EoE does with Ethernet frames (S0 L2883-2886).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum EthernetFunction {
    /// It has so many Ethernet ports, and no IP address of its own.
    SwitchPorts(u8),
    /// It has an IP stack of its own.
    IpApplication,
}

/// A computer at a port of a switch terminal.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PluggedHost {
    /// The port, from 1.
    pub port: u8,
    /// Its address.
    pub address: HostAddress,
}

/// What the file of a segment says of the Ethernet side of a device.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EthernetSetup {
    /// Its name, for its page.
    pub name: String,
    /// Its hardware address; those of its hosts are counted on from there.
    pub mac: MacAddress,
    /// Its own IP address, set by some other way than EoE.
    pub address: HostAddress,
    /// What it sends of its own accord.
    pub datagrams: Option<UdpDatagrams>,
    /// The computers at its ports.
    pub hosts: Vec<PluggedHost>,
}

/// A port, by what is there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum PortIndex {
    /// This one of the computers of the segment.
    Host(usize),
    /// This one of the ports that lead out of it.
    Bridged(usize),
}

/// The Ethernet side of a device.
#[derive(Debug)]
pub struct EthernetSide {
    mac: MacAddress,
    /// The IP stack of its own, and its address while the MainDevice has set none.
    own: Option<(IpHost, HostAddress)>,
    datagrams: Option<DatagramSource>,
    hosts: Vec<IpHost>,
    /// Ports of it, from 1, at which no computer of the segment is.
    free: Vec<u8>,
    /// Ports whose cables lead out of the segment.
    bridged: Vec<BridgedPort>,
    dhcp: DhcpServer,
    /// Frames to the MainDevice.
    sent: VecDeque<Vec<u8>>,
}

impl EthernetSide {
    /// The Ethernet side of a device that does this with frames.
    #[must_use]
    pub fn new(function: EthernetFunction, setup: &EthernetSetup) -> Self {
        let EthernetSetup { name, mac, address, datagrams, hosts } = setup;
        let own = match function {
            EthernetFunction::IpApplication => Some((IpHost::new(name, *mac, *address), *address)),
            EthernetFunction::SwitchPorts(_) => None,
        };
        let plugged = |(at, host): (u8, &PluggedHost)| {
            let mut mac = *mac;
            mac.0[5] = mac.0[5].wrapping_add(at);
            IpHost::new(&format!("{name}, port {}", host.port), mac, host.address)
        };
        let ports = match function {
            EthernetFunction::SwitchPorts(ports) => ports,
            EthernetFunction::IpApplication => 0,
        };
        let free = (1..=ports).filter(|port| hosts.iter().all(|host| host.port != *port)).collect();
        let hosts = (1..).zip(hosts).map(plugged).collect();
        Self {
            mac: *mac,
            own,
            datagrams: datagrams.map(DatagramSource::new),
            hosts,
            free,
            bridged: Vec::new(),
            dhcp: DhcpServer::default(),
            sent: VecDeque::new(),
        }
    }

    /// The device has started anew: what the MainDevice had set is forgotten, the computers at its ports stay.
    pub fn restart(&mut self) {
        self.sent.clear();
        self.bridged.iter_mut().for_each(BridgedPort::clear);
        self.dhcp.set(IpParameters::default());
        if let Some((own, address)) = &mut self.own {
            own.set_address(*address);
        }
    }

    /// The MainDevice has set addresses.
    pub fn set_addresses(&mut self, parameters: &IpParameters) {
        match &mut self.own {
            Some((own, _)) => own.set_address(HostAddress::of_parameters(parameters)),
            // They are for the computer at its port (S0 L2894).
            None => self.dhcp.set(*parameters),
        }
    }

    /// The cable of a port leads out of the segment from now on. False when there is no such port, or when a computer of the
    /// segment is plugged in there.
    pub fn bridge(&mut self, port: u8) -> bool {
        let Some(at) = self.free.iter().position(|free| *free == port) else { return false };
        self.free.remove(at);
        self.bridged.push(BridgedPort::new(port));
        true
    }

    /// Takes a frame that comes from outside to a port.
    pub fn handle_outside(&mut self, port: u8, frame: Vec<u8>) {
        if let Some(bridged) = self.bridged.iter_mut().find(|bridged| bridged.number() == port) {
            bridged.receive(frame);
        }
    }

    /// True if a frame waits to leave by a port.
    pub fn has_outside(&self) -> bool {
        self.bridged.iter().any(BridgedPort::has_frame)
    }

    /// The next frame that leaves by a port, and by which.
    pub fn poll_outside(&mut self) -> Option<(u8, Vec<u8>)> {
        let mut ports = self.bridged.iter_mut();
        ports.find_map(|port| Some((port.number(), port.poll_transmit()?)))
    }

    /// Takes a frame of the MainDevice.
    pub fn handle_frame(&mut self, frame: &[u8]) {
        if let Some((own, _)) = &mut self.own
            && is_for(frame, own.mac())
        {
            own.handle_frame(frame.to_vec());
        }
        if !self.deliver(None, frame) {
            // Nobody knows where that is.
            self.bridged.iter_mut().for_each(|port| port.send(frame));
        }
    }

    /// Hands a frame to those behind the ports for whom it is, but not where it came from. True if that was all: it was for
    /// one of them.
    fn deliver(&mut self, from: Option<PortIndex>, frame: &[u8]) -> bool {
        let mut found = false;
        for (at, host) in self.hosts.iter_mut().enumerate() {
            if from != Some(PortIndex::Host(at)) && is_for(frame, host.mac()) {
                host.handle_frame(frame.to_vec());
                found |= !is_group(frame);
            }
        }
        for (at, port) in self.bridged.iter_mut().enumerate() {
            let is_known = frame
                .first_chunk::<6>()
                .is_some_and(|to| !is_group(frame) && port.knows(MacAddress(*to)));
            if is_known && from == Some(PortIndex::Bridged(at)) {
                // It has had it already.
                found = true;
            } else if is_known || is_group(frame) && from != Some(PortIndex::Bridged(at)) {
                port.send(frame);
                found |= is_known;
            }
        }
        found || is_group(frame) && from.is_none()
    }

    /// Does what is to be done now.
    pub fn handle_timeout(&mut self, now: Instant) {
        while let Some(frame) =
            self.datagrams.as_mut().and_then(|source| source.poll(now, self.mac))
        {
            push(&mut self.sent, frame);
        }
        if let Some((own, _)) = &mut self.own {
            own.handle_timeout(now);
            while let Some(frame) = own.poll_transmit() {
                push(&mut self.sent, frame);
            }
        }
        let mut came = Vec::new();
        for (at, host) in self.hosts.iter_mut().enumerate() {
            host.handle_timeout(now);
            came.extend(std::iter::from_fn(|| Some((PortIndex::Host(at), host.poll_transmit()?))));
        }
        for (at, port) in self.bridged.iter_mut().enumerate() {
            let frames = std::iter::from_fn(|| port.poll_received());
            came.extend(frames.map(|frame| (PortIndex::Bridged(at), frame)));
        }
        for (from, frame) in came {
            match self.dhcp.answer(self.mac, &frame) {
                // It is for one at a port, and for nobody in the network.
                Some(answer) => {
                    self.deliver(None, &answer);
                }
                None if self.deliver(Some(from), &frame) => {}
                None => push(&mut self.sent, frame),
            }
        }
    }

    /// When it has something to do next; `None`: nothing until a frame comes.
    pub fn poll_timeout(&mut self, now: Instant) -> Option<Instant> {
        let own = self.own.as_mut().and_then(|(own, _)| own.poll_timeout(now));
        let hosts = self.hosts.iter_mut().filter_map(|host| host.poll_timeout(now));
        let datagrams = self.datagrams.as_ref().and_then(DatagramSource::due);
        own.into_iter().chain(hosts).chain(datagrams).min()
    }

    /// The next frame for the MainDevice.
    pub fn poll_transmit(&mut self) -> Option<Vec<u8>> {
        self.sent.pop_front()
    }

    /// IP addresses as they are now: its own, or those of the computers at its ports.
    pub fn addresses(&self) -> impl Iterator<Item = Option<[u8; 4]>> {
        self.own.iter().map(|(own, _)| own).chain(&self.hosts).map(IpHost::ip)
    }
}

fn push(sent: &mut VecDeque<Vec<u8>>, frame: Vec<u8>) {
    if sent.len() < WAITING {
        sent.push_back(frame);
    }
}

/// True for a frame to a group, or to all.
fn is_group(frame: &[u8]) -> bool {
    frame.first().is_some_and(|first| first & 1 != 0)
}

fn is_for(frame: &[u8], mac: MacAddress) -> bool {
    is_group(frame) || frame.get(..6) == Some(&mac.0[..])
}
