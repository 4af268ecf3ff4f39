//! DHCP server of a switch terminal: gives the address that the MainDevice has set to the computer at its port.
//!
//! Reference: S0 L2891-2897 (EOE-07): the address is not that of the terminal; of an EL6614 only the first client gets
//! it. RFC 2131 for the messages.

use linesman_proto::ethernet::MacAddress;
use linesman_proto::mailbox::eoe::IpParameters;
use smoltcp::phy::ChecksumCapabilities;
use smoltcp::wire::{
    DHCP_CLIENT_PORT, DHCP_SERVER_PORT, DhcpMessageType, DhcpPacket, DhcpRepr, EthernetAddress,
    EthernetFrame, EthernetProtocol, EthernetRepr, IpAddress, IpProtocol, Ipv4Address, Ipv4Packet,
    Ipv4Repr, UdpPacket, UdpRepr,
};

/// How long the address is lent for, in seconds.
const LEASE_S: u32 = 3_600;
/// The mask where none is set.
const USUAL_MASK: [u8; 4] = [255, 255, 255, 0];

/// The server.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct DhcpServer {
    parameters: IpParameters,
    /// Who got the address.
    client: Option<[u8; 6]>,
}

impl DhcpServer {
    /// It gives other addresses from now on.
    pub(super) fn set(&mut self, parameters: IpParameters) {
        *self = Self { parameters, client: None };
    }

    /// The answer to a frame of a computer at the port of a terminal with this hardware address. `None`: it is no
    /// question for it, and goes on into the network.
    pub(super) fn answer(&mut self, own: MacAddress, frame: &[u8]) -> Option<Vec<u8>> {
        let ip = self.parameters.ip.filter(|ip| *ip != [0; 4])?;
        let frame = EthernetFrame::new_checked(frame).ok()?;
        if frame.ethertype() != EthernetProtocol::Ipv4 {
            return None;
        }
        let packet = Ipv4Packet::new_checked(frame.payload()).ok()?;
        if packet.next_header() != IpProtocol::Udp {
            return None;
        }
        let datagram = UdpPacket::new_checked(packet.payload()).ok()?;
        if datagram.dst_port() != DHCP_SERVER_PORT {
            return None;
        }
        let message = DhcpPacket::new_checked(datagram.payload()).ok()?;
        let question = DhcpRepr::parse(&message).ok()?;
        let client = question.client_hardware_address;
        if *self.client.get_or_insert(client.0) != client.0 {
            return None;
        }
        let server = server_address(ip);
        let answer = match question.message_type {
            DhcpMessageType::Discover => DhcpMessageType::Offer,
            DhcpMessageType::Request
                if question.requested_ip.is_none_or(|asked| asked.octets() == ip) =>
            {
                DhcpMessageType::Ack
            }
            DhcpMessageType::Request => DhcpMessageType::Nak,
            DhcpMessageType::Release => {
                self.client = None;
                return None;
            }
            DhcpMessageType::Offer
            | DhcpMessageType::Decline
            | DhcpMessageType::Ack
            | DhcpMessageType::Nak
            | DhcpMessageType::Inform
            | DhcpMessageType::Unknown(_) => return None,
        };
        let gateway = self.parameters.gateway.filter(|gateway| *gateway != [0; 4]);
        let mask = self.parameters.mask.unwrap_or(USUAL_MASK);
        let dhcp = DhcpRepr {
            message_type: answer,
            transaction_id: question.transaction_id,
            secs: 0,
            client_hardware_address: client,
            client_ip: Ipv4Address::UNSPECIFIED,
            your_ip: ip.into(),
            server_ip: server,
            router: gateway.map(Into::into),
            subnet_mask: Some(mask.into()),
            relay_agent_ip: Ipv4Address::UNSPECIFIED,
            broadcast: question.broadcast,
            requested_ip: None,
            client_identifier: None,
            server_identifier: Some(server),
            parameter_request_list: None,
            dns_servers: None,
            max_size: None,
            lease_duration: Some(LEASE_S),
            renew_duration: None,
            rebind_duration: None,
            additional_options: &[],
        };
        write(own, client, server, &dhcp)
    }
}

/// The address that the server answers from: the next one, which is in the same subnet unless that has no other.
fn server_address(ip: [u8; 4]) -> Ipv4Address {
    let [a, b, c, d] = ip;
    [a, b, c, if d < 254 { d + 1 } else { d - 1 }].into()
}

/// The frame of a message, to all: its receiver has no address yet.
fn write(
    own: MacAddress,
    client: EthernetAddress,
    server: Ipv4Address,
    dhcp: &DhcpRepr<'_>,
) -> Option<Vec<u8>> {
    const UDP_HEADER: usize = 8;
    let checksums = ChecksumCapabilities::default();
    let all = Ipv4Address::BROADCAST;
    let ethernet = EthernetRepr {
        src_addr: EthernetAddress(own.0),
        dst_addr: client,
        ethertype: EthernetProtocol::Ipv4,
    };
    let ip = Ipv4Repr {
        src_addr: server,
        dst_addr: all,
        next_header: IpProtocol::Udp,
        payload_len: UDP_HEADER + dhcp.buffer_len(),
        hop_limit: 64,
    };
    let udp = UdpRepr { src_port: DHCP_SERVER_PORT, dst_port: DHCP_CLIENT_PORT };
    let mut bytes = vec![0; ethernet.buffer_len() + ip.buffer_len() + ip.payload_len];
    let mut frame = EthernetFrame::new_unchecked(&mut bytes);
    ethernet.emit(&mut frame);
    let mut packet = Ipv4Packet::new_unchecked(frame.payload_mut());
    ip.emit(&mut packet, &checksums);
    let mut datagram = UdpPacket::new_unchecked(packet.payload_mut());
    let mut written = true;
    let emit = |payload: &mut [u8]| {
        written = dhcp.emit(&mut DhcpPacket::new_unchecked(payload)).is_ok();
    };
    let (from, to) = (IpAddress::Ipv4(server), IpAddress::Ipv4(all));
    udp.emit(&mut datagram, &from, &to, dhcp.buffer_len(), emit, &checksums);
    written.then_some(bytes)
}
