//! Access to a server beside a run: where it listens, and whom it serves.

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::str::FromStr;

/// Access to a server.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NetworkAccess {
    /// Address at which it listens. Port 0: any that is free.
    pub listen: SocketAddr,
    /// Who is served beside programs on this computer.
    pub allowed: Vec<AllowedHosts>,
    /// Only what changes nothing is done: uploads of objects, and questions about dictionaries.
    pub read_only: bool,
}

impl NetworkAccess {
    /// True if requests of this host are taken: it is this computer, or it is allowed.
    #[must_use]
    pub fn allows(&self, host: IpAddr) -> bool {
        let host = host.to_canonical();
        host.is_loopback() || self.allowed.iter().any(|allowed| allowed.contains(host))
    }

    /// True if it listens for other computers although none of them is allowed.
    #[must_use]
    pub fn serves_nobody_else(&self) -> bool {
        !self.listen.ip().to_canonical().is_loopback() && self.allowed.is_empty()
    }
}

/// Hosts whose addresses begin alike: `192.168.1.0/24`, or a single one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AllowedHosts {
    network: IpAddr,
    /// Bits of the address that count.
    bits: u32,
}

impl AllowedHosts {
    /// True if it is one of them.
    #[must_use]
    pub fn contains(&self, host: IpAddr) -> bool {
        match (self.network, host.to_canonical()) {
            (IpAddr::V4(network), IpAddr::V4(host)) => {
                let mask = u32::MAX.checked_shl(32 - self.bits).unwrap_or(0);
                (network.to_bits() ^ host.to_bits()) & mask == 0
            }
            (IpAddr::V6(network), IpAddr::V6(host)) => {
                let mask = u128::MAX.checked_shl(128 - self.bits).unwrap_or(0);
                (network.to_bits() ^ host.to_bits()) & mask == 0
            }
            (IpAddr::V4(_), IpAddr::V6(_)) | (IpAddr::V6(_), IpAddr::V4(_)) => false,
        }
    }
}

impl FromStr for AllowedHosts {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || "expected an address, or an address and the bits that count: 192.168.1.0/24";
        let (address, bits) = match text.split_once('/') {
            Some((address, bits)) => (address, Some(bits)),
            None => (text, None),
        };
        let network: IpAddr = address.parse().map_err(|_| expected().to_owned())?;
        let most = if network.is_ipv4() { 32 } else { 128 };
        let bits = match bits {
            None => most,
            Some(bits) => bits.parse().ok().filter(|bits| *bits <= most).ok_or_else(expected)?,
        };
        Ok(Self { network, bits })
    }
}

impl fmt::Display for AllowedHosts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.network, self.bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hosts(text: &str) -> AllowedHosts {
        text.parse().unwrap()
    }

    #[test]
    fn hosts_are_told_by_the_bits_that_count() {
        for (allowed, host, contains) in [
            ("192.168.1.0/24", "192.168.1.77", true),
            ("192.168.1.0/24", "192.168.2.77", false),
            ("192.168.1.9", "192.168.1.9", true),
            ("192.168.1.9", "192.168.1.8", false),
            ("0.0.0.0/0", "8.8.8.8", true),
            ("0.0.0.0/0", "fe80::1", false),
            ("fe80::/10", "fe80::1", true),
            ("fe80::/10", "fd00::1", false),
            ("192.168.1.0/24", "::ffff:192.168.1.5", true),
        ] {
            assert_eq!(
                hosts(allowed).contains(host.parse().unwrap()),
                contains,
                "{allowed} {host}"
            );
        }
        assert_eq!(hosts("10.0.0.0/8").to_string(), "10.0.0.0/8");
        for wrong in ["", "eth0", "10.0.0.0/33", "10.0.0.0/", "10.0.0/8", "::/129", "1.2.3.4/-1"] {
            let error = wrong.parse::<AllowedHosts>().unwrap_err();
            assert!(error.contains("192.168.1.0/24"), "{wrong}: {error}");
        }
    }

    #[test]
    fn only_this_computer_is_served_unless_others_are_allowed() {
        let mut options = NetworkAccess {
            listen: "0.0.0.0:34980".parse().unwrap(),
            allowed: Vec::new(),
            read_only: false,
        };
        let allows = |options: &NetworkAccess, host: &str| options.allows(host.parse().unwrap());
        assert!(options.serves_nobody_else());
        assert!(allows(&options, "127.0.0.1") && allows(&options, "::1"));
        assert!(allows(&options, "::ffff:127.0.0.1"));
        assert!(!allows(&options, "192.168.1.2"));
        options.allowed.push(hosts("192.168.1.0/24"));
        assert!(!options.serves_nobody_else());
        assert!(allows(&options, "192.168.1.2") && !allows(&options, "192.168.2.2"));
    }
}
