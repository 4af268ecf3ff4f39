//! IPv4 address with its subnet.

use std::fmt;
use std::str::FromStr;

/// Bits of a subnet where nobody says them.
const USUAL_BITS: u8 = 24;

/// An address and the bits of its subnet: `192.168.1.11/24`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Subnet {
    /// The address.
    pub address: [u8; 4],
    /// Bits of the subnet, 1 to 32.
    pub bits: u8,
}

impl Subnet {
    /// An address with a mask; without one, with 24 bits.
    #[must_use]
    pub fn of_mask(address: [u8; 4], mask: Option<[u8; 4]>) -> Self {
        let mask = mask.map(u32::from_be_bytes).filter(|mask| *mask != 0);
        let bits = mask.map_or(USUAL_BITS, |mask| mask.leading_ones() as u8);
        Self { address, bits: bits.clamp(1, 32) }
    }

    /// The mask, as a number.
    const fn mask(self) -> u32 {
        u32::MAX << (32 - self.bits)
    }

    /// The address of the subnet itself: `192.168.1.0/24`.
    #[must_use]
    pub const fn network(self) -> Self {
        let network = u32::from_be_bytes(self.address) & self.mask();
        Self { address: network.to_be_bytes(), bits: self.bits }
    }

    /// The address of all in it.
    #[must_use]
    pub const fn broadcast(self) -> [u8; 4] {
        (u32::from_be_bytes(self.address) | !self.mask()).to_be_bytes()
    }

    /// True if an address is in the subnet.
    #[must_use]
    pub const fn contains(self, address: [u8; 4]) -> bool {
        (u32::from_be_bytes(address) ^ u32::from_be_bytes(self.address)) & self.mask() == 0
    }

    /// True if some address is in both subnets.
    #[must_use]
    pub const fn overlaps(self, other: Self) -> bool {
        self.contains(other.network().address) || other.contains(self.network().address)
    }

    /// The address alone, as text.
    #[must_use]
    pub fn ip(self) -> String {
        std::net::Ipv4Addr::from(self.address).to_string()
    }
}

impl fmt::Display for Subnet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.ip(), self.bits)
    }
}

impl FromStr for Subnet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            "expected an IPv4 address with the bits of its subnet, such as 192.168.1.100/24"
                .to_owned()
        };
        let (address, bits) = text.split_once('/').ok_or_else(expected)?;
        let address: std::net::Ipv4Addr = address.parse().map_err(|_| expected())?;
        let bits = bits.parse().ok().filter(|bits| (1..=32).contains(bits)).ok_or_else(expected)?;
        Ok(Self { address: address.octets(), bits })
    }
}
