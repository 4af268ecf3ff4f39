//! A computer or device with an IP stack: answers ARP and ping, fetches its address by DHCP, has a web page, and asks those of
//! others.

use std::collections::VecDeque;
use std::fmt;
use std::net::Ipv4Addr;

use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::{Instant, Span};
use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::phy::{Device, DeviceCapabilities, Medium, RxToken, TxToken};
use smoltcp::socket::dhcpv4;
use smoltcp::time::Instant as StackInstant;
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpCidr, Ipv4Cidr};

use super::host_address::HostAddress;
use super::web_client::WebClient;
use super::web_page::WebPage;

/// The longest frame that it sends, in bytes: an Ethernet header and an MTU of 1,500.
const LONGEST: usize = 1_514;
/// Frames that wait each way; what comes then is lost.
const WAITING: usize = 64;
/// How often the stack has its turn at most for one call.
const TURNS: usize = 64;

/// An IP host.
pub struct IpHost {
    name: String,
    mac: MacAddress,
    address: HostAddress,
    interface: Interface,
    sockets: SocketSet<'static>,
    /// There while it fetches its address.
    dhcp: Option<SocketHandle>,
    /// There once it has had an address.
    web: Option<WebPage>,
    client: Option<WebClient>,
    /// Transfers that it has begun.
    transfers: u16,
    cable: HostCable,
}

impl fmt::Debug for IpHost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("IpHost")
            .field("name", &self.name)
            .field("mac", &self.mac)
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

impl IpHost {
    /// A host with this hardware address; all its chance comes from that.
    #[must_use]
    pub fn new(name: &str, mac: MacAddress, address: HostAddress) -> Self {
        let mut cable = HostCable::default();
        let mut config = Config::new(HardwareAddress::Ethernet(EthernetAddress(mac.0)));
        config.random_seed = mac.0.iter().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
        let interface = Interface::new(config, &mut cable, StackInstant::ZERO);
        let sockets = SocketSet::new(Vec::new());
        let mut host = Self {
            name: name.to_owned(),
            mac,
            address: HostAddress::None,
            interface,
            sockets,
            dhcp: None,
            web: None,
            client: None,
            transfers: 0,
            cable,
        };
        host.set_address(address);
        host
    }

    /// Its hardware address.
    #[must_use]
    pub const fn mac(&self) -> MacAddress {
        self.mac
    }

    /// Its IP address now, if it has one.
    #[must_use]
    pub fn ip(&self) -> Option<[u8; 4]> {
        self.interface.ipv4_addr().map(|address| address.octets())
    }

    /// It comes to its address otherwise from now on; connections end.
    pub fn set_address(&mut self, address: HostAddress) {
        self.address = address;
        match &mut self.web {
            Some(web) => web.restart(&mut self.sockets),
            None if address == HostAddress::None => {}
            None => self.web = Some(WebPage::new(&mut self.sockets)),
        }
        if let Some(former) = self.dhcp.take() {
            self.sockets.remove(former);
        }
        if address == HostAddress::Dhcp {
            self.dhcp = Some(self.sockets.add(dhcpv4::Socket::new()));
        }
        match address {
            HostAddress::None | HostAddress::Dhcp => self.configure(None, None),
            HostAddress::Fixed { ip, bits, gateway } => {
                self.configure(Some(Ipv4Cidr::new(ip.into(), bits)), gateway.map(Ipv4Addr::from));
            }
        }
    }

    fn configure(&mut self, address: Option<Ipv4Cidr>, gateway: Option<Ipv4Addr>) {
        self.interface.update_ip_addrs(|addresses| {
            addresses.clear();
            // There is room for the one.
            let _ = address.map(|address| addresses.push(IpCidr::Ipv4(address)));
        });
        let routes = self.interface.routes_mut();
        routes.remove_default_ipv4_route();
        if let Some(gateway) = gateway {
            // As above.
            let _ = routes.add_default_ipv4_route(gateway);
        }
    }

    /// Asks the web page of the host at `server` for `path` (`/`, `/bytes/N`); a transfer that was under way is given up.
    /// [`IpHost::fetched`] tells when the answer is there.
    pub fn fetch(&mut self, server: [u8; 4], path: &str) {
        if let Some(former) = self.client.take() {
            former.end(&mut self.sockets);
        }
        let (what, number) = ((server, path), self.transfers & 0x3FFF);
        self.transfers = self.transfers.wrapping_add(1);
        self.client = Some(WebClient::new(&mut self.interface, &mut self.sockets, what, number));
    }

    /// Answer of the web page to [`IpHost::fetch`], without its head; `None` while it is not whole, empty where the
    /// connection failed.
    #[must_use]
    pub fn fetched(&self) -> Option<&[u8]> {
        self.client.as_ref().and_then(WebClient::body)
    }

    /// Takes a frame from its cable.
    pub fn handle_frame(&mut self, frame: Vec<u8>) {
        let is_taken = self.address != HostAddress::None && self.cable.received.len() < WAITING;
        if is_taken {
            self.cable.received.push_back(frame);
        }
    }

    /// Does what is to be done now; frames wait in [`IpHost::poll_transmit`].
    pub fn handle_timeout(&mut self, now: Instant) {
        if self.address == HostAddress::None {
            return;
        }
        for _ in 0..TURNS {
            let before = (self.cable.received.len(), self.cable.sent.len());
            self.interface.poll(stack_time(now), &mut self.cable, &mut self.sockets);
            self.take_lease();
            let web = self.web.as_mut();
            let more = web.is_some_and(|web| web.serve(&mut self.sockets, &self.name));
            let client = self.client.as_mut();
            let asks = client.is_some_and(|client| client.serve(&mut self.sockets));
            if !more && !asks && before == (self.cable.received.len(), self.cable.sent.len()) {
                return;
            }
        }
    }

    fn take_lease(&mut self) {
        let Some(dhcp) = self.dhcp else { return };
        let event = self.sockets.get_mut::<dhcpv4::Socket<'_>>(dhcp).poll();
        let lease = match event {
            None => return,
            Some(dhcpv4::Event::Configured(lease)) => Some((lease.address, lease.router)),
            Some(dhcpv4::Event::Deconfigured) => None,
        };
        let (address, router) = lease.unzip();
        self.configure(address, router.flatten());
    }

    /// When it has something to do next; `None`: nothing until a frame comes.
    pub fn poll_timeout(&mut self, now: Instant) -> Option<Instant> {
        if self.address == HostAddress::None {
            return None;
        }
        if !self.cable.received.is_empty() {
            return Some(now);
        }
        let at = self.interface.poll_at(stack_time(now), &self.sockets)?;
        let micros = u64::try_from(at.total_micros()).unwrap_or(0);
        Some(Instant::ZERO + Span::us(micros))
    }

    /// The next frame that it sends.
    pub fn poll_transmit(&mut self) -> Option<Vec<u8>> {
        self.cable.sent.pop_front()
    }
}

fn stack_time(now: Instant) -> StackInstant {
    StackInstant::from_micros(i64::try_from(now.as_nanos() / 1_000).unwrap_or(i64::MAX))
}

/// The cable of a host, as its stack sees it.
#[derive(Default, Debug)]
struct HostCable {
    received: VecDeque<Vec<u8>>,
    sent: VecDeque<Vec<u8>>,
}

/// A frame that has come.
struct CameIn(Vec<u8>);

/// Room for a frame to be sent.
struct GoesOut<'a>(&'a mut VecDeque<Vec<u8>>);

impl Device for HostCable {
    type RxToken<'a> = CameIn;
    type TxToken<'a> = GoesOut<'a>;

    fn receive(&mut self, _: StackInstant) -> Option<(CameIn, GoesOut<'_>)> {
        if self.sent.len() >= WAITING {
            return None;
        }
        let frame = self.received.pop_front()?;
        Some((CameIn(frame), GoesOut(&mut self.sent)))
    }

    fn transmit(&mut self, _: StackInstant) -> Option<GoesOut<'_>> {
        (self.sent.len() < WAITING).then_some(GoesOut(&mut self.sent))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = LONGEST;
        capabilities
    }
}

impl RxToken for CameIn {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, use_it: F) -> R {
        use_it(&self.0)
    }
}

impl TxToken for GoesOut<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, len: usize, fill: F) -> R {
        let mut frame = vec![0; len];
        let result = fill(&mut frame);
        self.0.push_back(frame);
        result
    }
}
