//! Headers around the EtherCAT data: Ethernet II, an optional VLAN tag, and the UDP form.
//!
//! Reference: S1 chapter 2.1. A controller looks for EtherType 0x88A4, past one 802.1Q tag, or for
//! IPv4 without options carrying UDP to port 0x88A4.

use std::fmt;

/// EtherType of EtherCAT.
pub const ETHERTYPE_ETHERCAT: u16 = 0x88A4;
/// EtherType of an 802.1Q tag.
pub const ETHERTYPE_VLAN: u16 = 0x8100;
/// EtherType of a second (provider) tag.
pub const ETHERTYPE_QINQ: u16 = 0x88A8;
/// EtherType of IPv4.
pub const ETHERTYPE_IPV4: u16 = 0x0800;
/// UDP port of EtherCAT, 34980.
pub const UDP_PORT: u16 = 0x88A4;
/// Length of an untagged Ethernet header in bytes.
pub const HEADER_LEN: usize = 14;
/// Shortest frame without its check sequence, in bytes.
pub const MIN_LEN: usize = 60;
/// Longest untagged frame without its check sequence, in bytes.
pub const MAX_LEN: usize = 1514;
/// Bit of the first source-address byte that the first controller sets when it processes a frame.
///
/// It tells a frame that came back from the line from the copy that went out (S1, DL control bit 0).
pub const SOURCE_MARK: u8 = 0x02;

/// Source address of the read requests that Linesman sends beside another MainDevice: that one, and whoever judges a
/// recording, tells them by it from the frames of a second MainDevice. [`SOURCE_MARK`] is clear in it.
pub const ASKING_SOURCE: MacAddress = MacAddress([0x4C, 0x49, 0x4E, 0x45, 0x53, 0x3F]);
/// Destination address of these requests where they are sent in UDP: of no host, so that the IP layer of the computer
/// that receives them throws them away.
pub const ASKING_DESTINATION: MacAddress = MacAddress([0x4E, 0x49, 0x4E, 0x45, 0x53, 0x3F]);

/// A hardware address.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct MacAddress(pub [u8; 6]);

impl MacAddress {
    /// All ones.
    pub const BROADCAST: Self = Self([0xFF; 6]);

    /// The address with [`SOURCE_MARK`] set, as a controller returns it.
    #[must_use]
    #[inline]
    pub const fn marked(self) -> Self {
        let mut bytes = self.0;
        bytes[0] |= SOURCE_MARK;
        Self(bytes)
    }

    /// Whether [`SOURCE_MARK`] is set.
    #[must_use]
    #[inline]
    pub const fn is_marked(self) -> bool {
        self.0[0] & SOURCE_MARK != 0
    }
}

impl fmt::Display for MacAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g] = self.0;
        write!(f, "{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}")
    }
}

impl fmt::Debug for MacAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MacAddress({self})")
    }
}

/// How the EtherCAT data are wrapped.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wrapping {
    /// EtherType 0x88A4 directly.
    Raw,
    /// EtherType 0x88A4 behind one or two VLAN tags.
    Tagged,
    /// In UDP over IPv4, possibly tagged.
    Udp,
}

/// Finds the EtherCAT data of an Ethernet frame: the wrapping, and the offset of the two-byte
/// EtherCAT header. `None` when the frame carries something else or ends before it.
#[must_use]
#[inline]
pub fn locate(frame: &[u8]) -> Option<(Wrapping, usize)> {
    let mut at = 12;
    let mut tagged = false;
    // Two tags at most: more is no frame that a line would carry.
    for _ in 0..3 {
        match read_be(frame, at)? {
            ETHERTYPE_ETHERCAT => {
                let wrapping = if tagged { Wrapping::Tagged } else { Wrapping::Raw };
                return Some((wrapping, at + 2));
            }
            ETHERTYPE_VLAN | ETHERTYPE_QINQ => {
                tagged = true;
                at += 4;
            }
            ETHERTYPE_IPV4 => return locate_udp(frame, at + 2),
            _ => return None,
        }
    }
    None
}

/// IPv4 without options, UDP, destination port 0x88A4: all that a controller checks.
fn locate_udp(frame: &[u8], ip: usize) -> Option<(Wrapping, usize)> {
    const IPV4_NO_OPTIONS: u8 = 0x45;
    const PROTOCOL_UDP: u8 = 17;
    let udp = ip + 20;
    let matches = *frame.get(ip)? == IPV4_NO_OPTIONS
        && *frame.get(ip + 9)? == PROTOCOL_UDP
        && read_be(frame, udp + 2)? == UDP_PORT;
    matches.then_some((Wrapping::Udp, udp + 8))
}

#[inline]
fn read_be(frame: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes([*frame.get(at)?, *frame.get(at + 1)?]))
}

/// The source address, when the frame is long enough to have one.
#[must_use]
#[inline]
pub fn source(frame: &[u8]) -> Option<MacAddress> {
    frame.get(6..12)?.try_into().ok().map(MacAddress)
}

/// The destination address, when the frame is long enough to have one.
#[must_use]
#[inline]
pub fn destination(frame: &[u8]) -> Option<MacAddress> {
    frame.get(0..6)?.try_into().ok().map(MacAddress)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_type(tail: &[u8]) -> Vec<u8> {
        let mut frame = vec![0xFF; 6];
        frame.extend([2, 0, 0, 0, 0, 1]);
        frame.extend(tail);
        frame
    }

    // proves: FRM-01 partial
    #[test]
    fn ethercat_is_found_raw_tagged_and_in_udp() {
        assert_eq!(locate(&with_type(&[0x88, 0xA4, 0, 0])), Some((Wrapping::Raw, 14)));
        let tagged = with_type(&[0x81, 0x00, 0x20, 0x05, 0x88, 0xA4]);
        assert_eq!(locate(&tagged), Some((Wrapping::Tagged, 18)));

        let mut udp = with_type(&[0x08, 0x00, 0x45]);
        udp.extend([0; 8]);
        udp.push(17);
        udp.extend([0; 10]);
        udp.extend([0x12, 0x34, 0x88, 0xA4, 0, 0, 0, 0]);
        assert_eq!(locate(&udp), Some((Wrapping::Udp, 42)));
        let other_port = udp.len() - 5;
        udp[other_port] ^= 1;
        assert_eq!(locate(&udp), None, "another UDP port");
    }

    #[test]
    fn other_and_cut_off_frames_are_not_ethercat() {
        assert_eq!(locate(&with_type(&[0x08, 0x06, 0, 0])), None);
        let frame = with_type(&[0x81, 0x00, 0, 1, 0x81, 0x00, 0, 1, 0x81, 0x00, 0, 1, 0x88, 0xA4]);
        assert_eq!(locate(&frame), None, "three tags");
        for len in 0..14 {
            assert_eq!(locate(&with_type(&[0x88, 0xA4])[..len]), None);
        }
    }

    #[test]
    fn a_processed_frame_bears_the_source_mark() {
        let sent = MacAddress([0, 1, 2, 3, 4, 5]);
        assert!(!sent.is_marked());
        assert_eq!(sent.marked(), MacAddress([2, 1, 2, 3, 4, 5]));
        assert!(sent.marked().is_marked());
    }
}
