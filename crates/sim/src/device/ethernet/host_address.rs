//! IP address of a virtual computer or device: none, fixed, or fetched by DHCP.

use linesman_proto::mailbox::eoe::IpParameters;

/// Bits of the subnet where nobody says them.
const USUAL_BITS: u8 = 24;

/// How it comes to its IP address.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum HostAddress {
    /// It has none, and takes no part in IP.
    #[default]
    None,
    /// It has this one.
    Fixed {
        /// The address.
        ip: [u8; 4],
        /// Bits of its subnet, 1 to 32.
        bits: u8,
        /// Where all else goes; `None`: nowhere.
        gateway: Option<[u8; 4]>,
    },
    /// It asks a DHCP server.
    Dhcp,
}

impl HostAddress {
    /// The address that a MainDevice has set. 0.0.0.0 makes it a DHCP client: no source says how a SubDevice is told so.
    #[must_use]
    pub fn of_parameters(parameters: &IpParameters) -> Self {
        match parameters.ip {
            None => Self::None,
            Some([0, 0, 0, 0]) => Self::Dhcp,
            Some(ip) => {
                let mask = parameters.mask.filter(|mask| *mask != [0; 4]);
                let bits = mask.map_or(USUAL_BITS, |mask| {
                    u8::try_from(u32::from_be_bytes(mask).leading_ones()).unwrap_or(USUAL_BITS)
                });
                let gateway = parameters.gateway.filter(|gateway| *gateway != [0; 4]);
                Self::Fixed { ip, bits: bits.max(1), gateway }
            }
        }
    }

    /// An address and the bits of its subnet, such as `192.168.1.11/24`.
    ///
    /// # Errors
    /// What is expected instead.
    pub fn parse(text: &str, gateway: Option<&str>) -> Result<Self, String> {
        let expected = || {
            format!(
                "`{text}`: expected an IPv4 address with the bits of its subnet, 192.168.1.11/24"
            )
        };
        let (ip, bits) = text.split_once('/').ok_or_else(expected)?;
        let address =
            |text: &str| text.parse::<std::net::Ipv4Addr>().map(|address| address.octets());
        let bits = bits.parse().ok().filter(|bits| (1..=32).contains(bits)).ok_or_else(expected)?;
        let gateway = gateway.map(|gateway| {
            address(gateway).map_err(|_| format!("gateway `{gateway}`: expected an IPv4 address"))
        });
        Ok(Self::Fixed {
            ip: address(ip).map_err(|_| expected())?,
            bits,
            gateway: gateway.transpose()?,
        })
    }
}
