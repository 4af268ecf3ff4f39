//! Datagrams that a device sends to all in its subnet, of its own accord.
//!
//! UDP over IPv4, without a checksum of UDP, to port 9 (discard), where nobody answers.

use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::{Instant, Span};

/// The most bytes in one, so that it is one frame.
pub const LONGEST_DATAGRAM: u16 = 1_472;
/// Port of sender and receiver: nobody answers.
const DISCARD: u16 = 9;
const ETHERNET_HEADER: usize = 14;
const IP_HEADER: u16 = 20;
const UDP_HEADER: u16 = 8;

/// What a device sends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct UdpDatagrams {
    /// Its IP address.
    pub from: [u8; 4],
    /// Bytes in each, at most [`LONGEST_DATAGRAM`].
    pub bytes: u16,
    /// Datagrams at once; at least one.
    pub burst: u16,
    /// From one burst to the next.
    pub every: Span,
}

/// Datagrams over time.
#[derive(Clone, Debug)]
pub(super) struct DatagramSource {
    what: UdpDatagrams,
    count: u16,
    due: Option<Instant>,
    /// Datagrams that are left of the burst.
    left: u16,
}

impl DatagramSource {
    pub(super) const fn new(what: UdpDatagrams) -> Self {
        Self { what, count: 0, due: None, left: 0 }
    }

    /// When the next one is due.
    pub(super) const fn due(&self) -> Option<Instant> {
        self.due
    }

    /// The next frame of those that are due, if there is one.
    pub(super) fn poll(&mut self, now: Instant, mac: MacAddress) -> Option<Vec<u8>> {
        let due = *self.due.get_or_insert(now + self.what.every);
        if due <= now {
            // What was missed meanwhile is not made up for.
            self.due = Some(now + self.what.every);
            self.left = self.what.burst.max(1);
        }
        self.left = self.left.checked_sub(1)?;
        self.count = self.count.wrapping_add(1);
        Some(self.frame(mac))
    }

    fn frame(&self, mac: MacAddress) -> Vec<u8> {
        let UdpDatagrams { from, bytes, .. } = self.what;
        let udp_len = UDP_HEADER + bytes;
        let mut header = vec![0x45, 0];
        header.extend((IP_HEADER + udp_len).to_be_bytes());
        header.extend(self.count.to_be_bytes());
        header.extend([0, 0, 64, 17, 0, 0]);
        header.extend(from);
        header.extend([0xFF; 4]);
        let words = header.chunks_exact(2).map(|two| u32::from(two[0]) << 8 | u32::from(two[1]));
        let sum: u32 = words.sum();
        let sum = (sum & 0xFFFF) + (sum >> 16);
        header[10..12].copy_from_slice(&(!(sum + (sum >> 16)) as u16).to_be_bytes());
        let mut frame = Vec::with_capacity(ETHERNET_HEADER + usize::from(IP_HEADER + udp_len));
        frame.extend([0xFF; 6]);
        frame.extend(mac.0);
        frame.extend([0x08, 0x00]);
        frame.extend(header);
        frame.extend(DISCARD.to_be_bytes());
        frame.extend(DISCARD.to_be_bytes());
        frame.extend(udp_len.to_be_bytes());
        frame.extend([0, 0]);
        frame.extend((0..bytes).map(|at| at as u8));
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn datagrams_come_at_their_times_with_a_right_header() {
        let every = Span::ms(10);
        let what = UdpDatagrams { from: [192, 168, 1, 11], bytes: 1_472, burst: 1, every };
        let mut source = DatagramSource::new(what);
        let mac = MacAddress([2, 0, 0, 0, 0, 1]);
        assert_eq!(source.poll(Instant::ZERO, mac), None);
        assert_eq!(source.poll(Instant::ZERO + Span::ms(9), mac), None);
        let frame = source.poll(Instant::ZERO + Span::ms(10), mac).unwrap();
        assert_eq!(source.poll(Instant::ZERO + Span::ms(10), mac), None);
        assert_eq!(source.due(), Some(Instant::ZERO + Span::ms(20)));
        assert_eq!(frame.len(), 1_514);
        let words = frame[14..34].chunks_exact(2);
        let sum: u32 = words.map(|two| u32::from(two[0]) << 8 | u32::from(two[1])).sum();
        assert_eq!((sum & 0xFFFF) + (sum >> 16), 0xFFFF, "check sum of the IP header");
        let mut three = DatagramSource::new(UdpDatagrams { burst: 3, ..what });
        let mut at = |ms| {
            let now = Instant::ZERO + Span::ms(ms);
            std::iter::from_fn(|| three.poll(now, mac)).count()
        };
        assert_eq!([0, 10, 15, 20].map(&mut at), [0, 3, 0, 3]);
    }
}
