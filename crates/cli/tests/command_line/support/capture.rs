//! Captures made by hand: classic pcap, written byte by byte.

/// Length of the file header in bytes.
pub(crate) const HEADER: usize = 24;
/// Length of one record in bytes: header and a frame of 60.
pub(crate) const RECORD: usize = 16 + 60;

/// A pcap file with Ethernet frames in it.
pub(crate) struct Pcap(pub(crate) Vec<u8>);

impl Pcap {
    /// An empty one: microseconds, Ethernet.
    pub(crate) fn new() -> Self {
        let mut bytes = vec![0xD4, 0xC3, 0xB2, 0xA1, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        bytes.extend_from_slice(&65_535_u32.to_le_bytes());
        bytes.extend_from_slice(&1_u32.to_le_bytes());
        assert_eq!(bytes.len(), HEADER);
        Self(bytes)
    }

    /// Adds a frame, padded to 60 bytes, at so many µs after 2023-11-14.
    pub(crate) fn frame(&mut self, at_us: u64, bytes: &[u8]) {
        let len = bytes.len().max(60);
        let seconds = (1_700_000_000 + at_us / 1_000_000) as u32;
        self.0.extend_from_slice(&seconds.to_le_bytes());
        self.0.extend_from_slice(&((at_us % 1_000_000) as u32).to_le_bytes());
        self.0.extend_from_slice(&(len as u32).to_le_bytes());
        self.0.extend_from_slice(&(len as u32).to_le_bytes());
        self.0.extend_from_slice(bytes);
        self.0.resize(self.0.len() + len - bytes.len(), 0);
    }

    /// Adds `count` broadcast reads of AL status, one each ms, that 2 SubDevices in OP answer.
    pub(crate) fn exchanges(&mut self, count: u64) {
        for number in 0..count {
            let at_us = number * 1_000;
            self.frame(at_us, &broadcast(0x00, number as u8, 0, [0, 0], 0));
            self.frame(at_us + 40, &broadcast(0x02, number as u8, 2, [8, 0], 2));
        }
    }

    /// `count` exchanges, then as many of which nothing comes back, and `count` again.
    pub(crate) fn with_a_gap(count: u64) -> Self {
        let mut capture = Self::new();
        capture.exchanges(count);
        for number in count..2 * count {
            capture.frame(number * 1_000, &broadcast(0x00, number as u8, 0, [0, 0], 0));
        }
        for number in 2 * count..3 * count {
            let at_us = number * 1_000;
            capture.frame(at_us, &broadcast(0x00, number as u8, 0, [0, 0], 0));
            capture.frame(at_us + 40, &broadcast(0x02, number as u8, 2, [8, 0], 2));
        }
        capture
    }
}

/// A broadcast read of register 0x0130.
fn broadcast(source: u8, index: u8, adp: u8, data: [u8; 2], wkc: u8) -> Vec<u8> {
    let mut frame = vec![0xFF; 6];
    frame.extend_from_slice(&[source, 0x11, 0x22, 0x33, 0x44, 0x55, 0x88, 0xA4]);
    // 14 bytes of datagrams, type 1.
    frame.extend_from_slice(&[0x0E, 0x10]);
    frame.extend_from_slice(&[7, index, adp, 0, 0x30, 0x01, 2, 0, 0, 0]);
    frame.extend_from_slice(&[data[0], data[1], wkc, 0]);
    frame
}
