//! Addresses of AMS: a NetId and a port.

use std::fmt;
use std::str::FromStr;

use crate::address::StationAddress;

/// A NetId: six bytes, written `192.168.1.5.2.1`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct AmsNetId(pub [u8; 6]);

/// Text that is no NetId.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("expected a NetId, six numbers from 0 to 255 with points between them: 192.168.1.5.2.1")]
pub struct AmsNetIdError;

impl AmsNetId {
    /// NetId of the first EtherCAT MainDevice of the computer with this address, as the vendor numbers them: behind the
    /// address stand 2 and 1.
    #[must_use]
    pub const fn of_main_device([a, b, c, d]: [u8; 4]) -> Self {
        Self([a, b, c, d, 2, 1])
    }

    /// NetId of the SubDevice with this station address in the network that has this NetId, where no plan gives it one: the
    /// station address, high byte first, in place of the last two bytes. A NetId is chosen freely, and is to be unique.
    #[must_use]
    pub const fn of_sub_device(self, station: StationAddress) -> Self {
        let [a, b, c, d, ..] = self.0;
        let [high, low] = station.value().to_be_bytes();
        Self([a, b, c, d, high, low])
    }
}

impl fmt::Display for AmsNetId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g] = self.0;
        write!(f, "{a}.{b}.{c}.{d}.{e}.{g}")
    }
}

impl FromStr for AmsNetId {
    type Err = AmsNetIdError;

    fn from_str(text: &str) -> Result<Self, AmsNetIdError> {
        let mut parts = text.split('.');
        let mut bytes = [0; 6];
        for byte in &mut bytes {
            let part = parts.next().ok_or(AmsNetIdError)?;
            let is_number = part.bytes().all(|one| one.is_ascii_digit());
            *byte = part.parse().ok().filter(|_| is_number).ok_or(AmsNetIdError)?;
        }
        if parts.next().is_some() { Err(AmsNetIdError) } else { Ok(Self(bytes)) }
    }
}

/// A NetId and a port of it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct AmsAddress {
    /// The router or device.
    pub net_id: AmsNetId,
    /// The service of it: 65535 is the EtherCAT MainDevice itself, other ports of its NetId are station addresses of
    /// SubDevices.
    pub port: u16,
}

impl AmsAddress {
    /// Bytes of an address.
    pub const LEN: usize = 8;
    /// Port of an EtherCAT MainDevice.
    pub const MAIN_DEVICE_PORT: u16 = 0xFFFF;

    /// The address in bytes.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; Self::LEN] {
        let [a, b, c, d, e, f] = self.net_id.0;
        let [low, high] = self.port.to_le_bytes();
        [a, b, c, d, e, f, low, high]
    }

    /// The address that these bytes are.
    #[must_use]
    pub const fn from_bytes([a, b, c, d, e, f, low, high]: [u8; Self::LEN]) -> Self {
        Self { net_id: AmsNetId([a, b, c, d, e, f]), port: u16::from_le_bytes([low, high]) }
    }
}

impl fmt::Display for AmsAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.net_id, self.port)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn net_ids_are_read_as_they_are_written() {
        let net_id: AmsNetId = "169.254.215.231.2.1".parse().unwrap();
        assert_eq!(net_id, AmsNetId::of_main_device([169, 254, 215, 231]));
        assert_eq!(net_id.to_string(), "169.254.215.231.2.1");
        let of_sub_device =
            AmsNetId::of_main_device([127, 0, 0, 1]).of_sub_device(StationAddress(0x1004));
        assert_eq!(of_sub_device.to_string(), "127.0.0.1.16.4");
        for wrong in [
            "",
            "1.2.3.4",
            "1.2.3.4.5",
            "1.2.3.4.5.6.7",
            "1.2.3.4.5.256",
            "1.2.3.4.5.+6",
            "1.2..4.5.6",
        ] {
            assert_eq!(wrong.parse::<AmsNetId>(), Err(AmsNetIdError), "{wrong}");
        }
    }

    #[test]
    fn addresses_have_their_port_behind_the_net_id() {
        let address = AmsAddress { net_id: AmsNetId([5, 1, 2, 3, 2, 1]), port: 0x1002 };
        assert_eq!(address.to_bytes(), [5, 1, 2, 3, 2, 1, 0x02, 0x10]);
        assert_eq!(AmsAddress::from_bytes(address.to_bytes()), address);
        assert_eq!(address.to_string(), "5.1.2.3.2.1:4098");
    }
}
