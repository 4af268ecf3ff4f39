//! Ethernet side of a device that speaks EoE: computers at its ports, or an IP stack of its own.
//!
//! Reference: S0 L2883-2897 (EOE-05 to EOE-07). A switch terminal has ports; a computer that is plugged in there is in
//! the network of the MainDevice. Any other device has a web page. The IP stack is smoltcp, which takes bytes and time as
//! arguments as everything here does.

mod bridged_port;
mod datagrams;
mod dhcp_server;
mod host_address;
mod ip_host;
mod side;
mod web_client;
mod web_page;

pub use datagrams::{LONGEST_DATAGRAM, UdpDatagrams};
pub use host_address::HostAddress;
pub use ip_host::IpHost;
pub use side::{EthernetFunction, EthernetSetup, EthernetSide, PluggedHost};
