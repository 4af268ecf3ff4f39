//! The addresses of an Ethernet port.

use crate::ethernet::MacAddress;
use crate::mailbox::header::BufferTooSmall;

const MAC: u32 = 1 << 0;
const IP: u32 = 1 << 1;
const MASK: u32 = 1 << 2;
const GATEWAY: u32 = 1 << 3;
const DNS: u32 = 1 << 4;
const NAME: u32 = 1 << 5;
/// Length of a name.
const NAME_LEN: usize = 32;
/// Length of all addresses together: a word that says which are there, and each of them.
pub const ADDRESS_LEN: usize = 4 + 6 + 4 * 4 + NAME_LEN;

/// Addresses, as far as they are given. Each IP address is in the order in which it is written,
/// `[192, 168, 1, 11]`; in the message its last number comes first.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct IpParameters {
    /// Hardware address.
    pub mac: Option<MacAddress>,
    /// IP address.
    pub ip: Option<[u8; 4]>,
    /// Subnet mask.
    pub mask: Option<[u8; 4]>,
    /// Where everything else is sent.
    pub gateway: Option<[u8; 4]>,
    /// Who knows names.
    pub dns: Option<[u8; 4]>,
    /// Its own name, filled up with 0.
    pub name: Option<[u8; NAME_LEN]>,
}

/// Takes the next bytes, if there are so many.
fn next<const LEN: usize>(rest: &mut &[u8]) -> Option<[u8; LEN]> {
    let (bytes, behind) = rest.split_first_chunk::<LEN>()?;
    *rest = behind;
    Some(*bytes)
}

fn next_ip(rest: &mut &[u8]) -> Option<[u8; 4]> {
    let [d, c, b, a] = next(rest)?;
    Some([a, b, c, d])
}

impl IpParameters {
    /// The addresses of a message. Those that are there follow each other without gaps, as public
    /// MainDevices send them, or each has its place, as long as a message is that has all of them.
    /// `None` when one is cut off.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes;
        let flags = u32::from_le_bytes(next(&mut rest)?);
        let placed = bytes.len() >= ADDRESS_LEN;
        let mut parameters = Self::default();
        let there = |bit: u32| flags & bit != 0;
        let due = |bit: u32| there(bit) || placed;
        if due(MAC) {
            parameters.mac = Some(MacAddress(next(&mut rest)?)).filter(|_| there(MAC));
        }
        for (bit, place) in [
            (IP, &mut parameters.ip),
            (MASK, &mut parameters.mask),
            (GATEWAY, &mut parameters.gateway),
            (DNS, &mut parameters.dns),
        ] {
            if due(bit) {
                *place = Some(next_ip(&mut rest)?).filter(|_| there(bit));
            }
        }
        if there(NAME) {
            parameters.name = Some(next(&mut rest)?);
        }
        Some(parameters)
    }

    /// What is given here stands for what was there.
    #[must_use]
    pub fn merged(self, newer: Self) -> Self {
        Self {
            mac: newer.mac.or(self.mac),
            ip: newer.ip.or(self.ip),
            mask: newer.mask.or(self.mask),
            gateway: newer.gateway.or(self.gateway),
            dns: newer.dns.or(self.dns),
            name: newer.name.or(self.name),
        }
    }

    /// Writes them without gaps to the start of a buffer and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit; the buffer is untouched then.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let mut bytes = [0; ADDRESS_LEN];
        let (mut len, mut flags) = (4, 0);
        let mut put = |bit, data: &[u8]| {
            flags |= bit;
            bytes[len..len + data.len()].copy_from_slice(data);
            len += data.len();
        };
        if let Some(mac) = self.mac {
            put(MAC, &mac.0);
        }
        for (bit, address) in
            [(IP, self.ip), (MASK, self.mask), (GATEWAY, self.gateway), (DNS, self.dns)]
        {
            if let Some([a, b, c, d]) = address {
                put(bit, &[d, c, b, a]);
            }
        }
        if let Some(name) = self.name {
            put(NAME, &name);
        }
        bytes[..4].copy_from_slice(&flags.to_le_bytes());
        BufferTooSmall::check(buffer, len)?.copy_from_slice(&bytes[..len]);
        Ok(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_come_with_and_without_gaps() {
        let parameters = IpParameters {
            ip: Some([192, 168, 1, 11]),
            mask: Some([255, 255, 255, 0]),
            ..IpParameters::default()
        };
        let mut buffer = [0; ADDRESS_LEN];
        let len = parameters.write(&mut buffer).unwrap();
        assert_eq!(buffer[..len], [6, 0, 0, 0, 11, 1, 168, 192, 0, 255, 255, 255]);
        assert_eq!(IpParameters::parse(&buffer[..len]), Some(parameters));
        let mut placed = [0; ADDRESS_LEN];
        placed[0] = 6;
        placed[10..18].copy_from_slice(&[11, 1, 168, 192, 0, 255, 255, 255]);
        assert_eq!(IpParameters::parse(&placed), Some(parameters));
        assert_eq!(IpParameters::parse(&buffer[..len - 1]), None, "cut off");
        let newer = IpParameters { ip: Some([10, 0, 0, 1]), ..IpParameters::default() };
        let merged = parameters.merged(newer);
        assert_eq!((merged.ip, merged.mask), (newer.ip, parameters.mask));
    }

    #[test]
    fn all_of_them_fill_the_message() {
        let all = IpParameters {
            mac: Some(MacAddress([2, 0, 0, 0, 0, 7])),
            ip: Some([10, 0, 0, 2]),
            mask: Some([255, 0, 0, 0]),
            gateway: Some([10, 0, 0, 1]),
            dns: Some([10, 0, 0, 3]),
            name: Some([b'n'; NAME_LEN]),
        };
        let mut buffer = [0; 100];
        assert_eq!(all.write(&mut buffer), Ok(ADDRESS_LEN));
        assert_eq!(IpParameters::parse(&buffer[..ADDRESS_LEN]), Some(all));
        assert!(all.write(&mut buffer[..10]).is_err());
    }
}
