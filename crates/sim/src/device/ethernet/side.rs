//! The Ethernet side of one device.

use std::collections::VecDeque;

use linesman_proto::ethernet::MacAddress;
use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::time::Instant;

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

/// The Ethernet side of a device.
#[derive(Debug)]
pub struct EthernetSide {
    mac: MacAddress,
    /// The IP stack of its own, and its address while the MainDevice has set none.
    own: Option<(IpHost, HostAddress)>,
    datagrams: Option<DatagramSource>,
    hosts: Vec<IpHost>,
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
        let hosts = (1..).zip(hosts).map(plugged).collect();
        Self {
            mac: *mac,
            own,
            datagrams: datagrams.map(DatagramSource::new),
            hosts,
            dhcp: DhcpServer::default(),
            sent: VecDeque::new(),
        }
    }

    /// The device has started anew: what the MainDevice had set is forgotten, the computers at its ports stay.
    pub fn restart(&mut self) {
        self.sent.clear();
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

    /// Takes a frame of the MainDevice.
    pub fn handle_frame(&mut self, frame: &[u8]) {
        for host in self.own.iter_mut().map(|(own, _)| own).chain(&mut self.hosts) {
            if is_for(frame, host.mac()) {
                host.handle_frame(frame.to_vec());
            }
        }
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
        let mut within = Vec::new();
        for (at, host) in self.hosts.iter_mut().enumerate() {
            host.handle_timeout(now);
            while let Some(frame) = host.poll_transmit() {
                match self.dhcp.answer(self.mac, &frame) {
                    Some(answer) => within.push((None, answer)),
                    None => within.push((Some(at), frame)),
                }
            }
        }
        for (from, frame) in within {
            let mut only_here = from.is_none();
            for (at, host) in self.hosts.iter_mut().enumerate() {
                if Some(at) != from && is_for(&frame, host.mac()) {
                    host.handle_frame(frame.clone());
                    only_here |= !is_group(&frame);
                }
            }
            if !only_here {
                push(&mut self.sent, frame);
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
