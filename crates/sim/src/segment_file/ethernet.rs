//! Ethernet side of a device, as a segment file says it: `ethernet = { … }`.

use linesman_proto::address::DeviceId;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

use crate::device::ethernet::{
    EthernetSetup, HostAddress, LONGEST_DATAGRAM, PluggedHost, UdpDatagrams,
};

/// The Ethernet side of a device that speaks EoE.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentEthernet {
    /// Its own IP address, as if it had been set at the device itself, with the bits of its subnet: `192.168.1.11/24`.
    /// None unless said, until the MainDevice sets one by EoE. Switch terminals have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ip: Option<String>,
    /// Where it sends what is for other subnets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gateway: Option<String>,
    /// It fetches its address by DHCP.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub dhcp: bool,
    /// What it sends of its own accord. It needs a fixed address, `ip`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sends: Option<SegmentDatagrams>,
    /// Computers that are plugged into its ports, for a switch terminal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hosts: Vec<SegmentHost>,
}

/// Datagrams that a device sends to all in its subnet (UDP port 9, discard), as drives send recorded values.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentDatagrams {
    /// Bytes in each, 0 to 1,472.
    pub bytes: u16,
    /// So many at once, from 1 to 64; 1 unless said.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub burst: u16,
    /// From one burst to the next, in ms, from 1.
    pub every_ms: u32,
}

const fn one() -> u16 {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
const fn is_one(burst: &u16) -> bool {
    *burst == 1
}

/// A computer at a port of a switch terminal. It answers ARP and ping, and has a web page.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentHost {
    /// The port, from 1.
    pub port: u8,
    /// Its IP address with the bits of its subnet, `192.168.1.20/24`; by DHCP unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ip: Option<String>,
    /// Where it sends what is for other subnets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gateway: Option<String>,
}

impl SegmentEthernet {
    /// What the device of this name and number is told.
    ///
    /// # Errors
    /// An address that is none.
    pub(crate) fn setup(&self, name: &str, id: DeviceId) -> Result<EthernetSetup, String> {
        let address = match (&self.ip, self.dhcp) {
            (None, false) => HostAddress::None,
            (None, true) => HostAddress::Dhcp,
            (Some(ip), false) => HostAddress::parse(ip, self.gateway.as_deref())?,
            (Some(_), true) => return Err("either `ip` or `dhcp = true`, not both".to_owned()),
        };
        let host = |host: &SegmentHost| {
            let address = match &host.ip {
                None => HostAddress::Dhcp,
                Some(ip) => HostAddress::parse(ip, host.gateway.as_deref())?,
            };
            Ok::<_, String>(PluggedHost { port: host.port, address })
        };
        let hosts = self.hosts.iter().map(host).collect::<Result<_, _>>()?;
        let datagrams = match (self.sends, address) {
            (None, _) => None,
            (Some(sends), HostAddress::Fixed { ip, .. })
                if sends.bytes <= LONGEST_DATAGRAM
                    && sends.every_ms > 0
                    && (1..=64).contains(&sends.burst) =>
            {
                let every = Span::ms(sends.every_ms.into());
                Some(UdpDatagrams { from: ip, bytes: sends.bytes, burst: sends.burst, every })
            }
            (Some(_), HostAddress::Fixed { .. }) => {
                return Err(format!(
                    "`sends`: expected `bytes` from 0 to {LONGEST_DATAGRAM}, `every_ms` from 1 and `burst` from 1 to 64"
                ));
            }
            (Some(_), HostAddress::None | HostAddress::Dhcp) => {
                return Err(
                    "`sends` needs a fixed address: give it `ip = \"192.168.1.11/24\"`".to_owned()
                );
            }
        };
        let [.., high, low] = id.no().to_be_bytes();
        // A locally administered address; its last byte counts the hosts.
        let mac = MacAddress([0x02, 0x4C, 0x4D, high, low, 0]);
        Ok(EthernetSetup { name: name.to_owned(), mac, address, datagrams, hosts })
    }
}
