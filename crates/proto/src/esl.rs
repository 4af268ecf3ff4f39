//! ESL record (EtherCAT Switch Link): what a capture probe adds to each frame, 16 bytes in front of it or behind it.
//!
//! Layout: id `01 01 05 10 00 00` (or `11` in place of `10`), ports and flags in two bytes, time in ns, little-endian.
//! Reference: `docs/SOURCES.md`; the bits are those of the dissector `esl` of Wireshark.

use crate::frame::FrameView;

/// Length of a record in bytes.
pub const RECORD_LEN: usize = 16;
/// Ports of a probe that a record can name.
pub const PORTS: u8 = 12;

/// First bytes of a record; the fourth is one of two.
const ID: [u8; 6] = [0x01, 0x01, 0x05, 0x10, 0x00, 0x00];
const ID_OTHER: u8 = 0x11;
/// Bit of each port, from port 0 on.
const PORT_BITS: [u16; PORTS as usize] = [
    0x0080, 0x0040, 0x0020, 0x0010, 0x0008, 0x0004, 0x0002, 0x0001, 0x8000, 0x4000, 0x0400, 0x0200,
];
const ALIGNMENT_ERROR: u16 = 0x0800;
const CRC_ERROR: u16 = 0x1000;
const TIME_VALID: u16 = 0x2000;

/// A record of a capture probe about one frame.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct EslRecord {
    /// The port of the probe that received the frame, from 0; `None` when the record names none.
    pub port: Option<u8>,
    /// The check sequence of the frame was wrong when it came to the port.
    pub crc_error: bool,
    /// The frame did not end at a whole byte.
    pub alignment_error: bool,
    /// When the frame came, in ns of the probe's own clock.
    pub time_ns: u64,
}

/// Place of a record.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum EslPlace {
    /// In front of the frame.
    Front,
    /// Behind it.
    Behind,
}

impl EslRecord {
    /// The record in these bytes; `None` when they are none.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; RECORD_LEN]) -> Option<Self> {
        let (head, time) = bytes.split_first_chunk::<8>()?;
        let [id @ .., low, high] = head;
        let mut known = ID;
        if id[3] == ID_OTHER {
            known[3] = ID_OTHER;
        }
        if *id != known {
            return None;
        }
        let flags = u16::from_le_bytes([*low, *high]);
        let port = PORT_BITS.iter().position(|bit| flags & bit != 0);
        Some(Self {
            port: port.map(|port| port as u8),
            crc_error: flags & CRC_ERROR != 0,
            alignment_error: flags & ALIGNMENT_ERROR != 0,
            time_ns: u64::from_le_bytes(*time.first_chunk()?),
        })
    }

    /// The bytes of the record. A port beyond the twelfth is left out.
    #[must_use]
    pub fn to_bytes(self) -> [u8; RECORD_LEN] {
        let bit = self.port.and_then(|port| PORT_BITS.get(usize::from(port))).copied();
        let mut flags = bit.unwrap_or(0) | TIME_VALID;
        if self.crc_error {
            flags |= CRC_ERROR;
        }
        if self.alignment_error {
            flags |= ALIGNMENT_ERROR;
        }
        let mut bytes = [0; RECORD_LEN];
        bytes[..6].copy_from_slice(&ID);
        bytes[6..8].copy_from_slice(&flags.to_le_bytes());
        bytes[8..].copy_from_slice(&self.time_ns.to_le_bytes());
        bytes
    }

    /// True if the frame was damaged when it came to the port.
    #[must_use]
    pub const fn is_damaged(&self) -> bool {
        self.crc_error || self.alignment_error
    }

    /// The record of a captured frame, where it stands, and the frame without it. `None` when there is none.
    ///
    /// Behind a frame it counts only where the datagrams have ended before it: process data may look like a record.
    #[must_use]
    #[inline]
    pub fn find(captured: &[u8]) -> Option<(Self, EslPlace, &[u8])> {
        // Most captures have none: the bytes of the id are compared first.
        let starts_as_id = |bytes: &[u8]| bytes.starts_with(&ID[..3]);
        if starts_as_id(captured) {
            let (record, frame) = captured.split_first_chunk()?;
            return Self::from_bytes(record).map(|record| (record, EslPlace::Front, frame));
        }
        let (frame, record) = captured.split_last_chunk::<RECORD_LEN>()?;
        if !starts_as_id(record) {
            return None;
        }
        let record = Self::from_bytes(record)?;
        let is_behind = record.is_damaged() || are_datagrams_whole(frame);
        is_behind.then_some((record, EslPlace::Behind, frame))
    }
}

/// True if all datagrams of a frame end within it; true for a frame without any.
fn are_datagrams_whole(frame: &[u8]) -> bool {
    FrameView::parse(frame).map_or(true, |view| view.datagrams().all(|datagram| datagram.is_ok()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::address::RegisterAddress;
    use crate::command::Command;
    use crate::ethernet::MacAddress;
    use crate::frame::FrameBuilder;
    use crate::frame::builder::DatagramAddress;

    fn frame(data: &[u8]) -> Vec<u8> {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress([0, 1, 2, 3, 4, 5]));
        let address = DatagramAddress::Physical(0, RegisterAddress(0x1000));
        builder.push(Command::Fpwr, 0, address, data.len()).unwrap().copy_from_slice(data);
        let len = builder.finish();
        buffer[..len].to_vec()
    }

    // proves: WS-06
    #[test]
    fn published_trailer_gives_port_and_time() {
        let captured = [
            frame(&[7; 92]),
            vec![0x01, 0x01, 0x05, 0x10, 0, 0, 0x80, 0x20, 0x48, 0xDB, 0xA3, 0xBD, 0x2A, 0, 0, 0],
        ]
        .concat();
        assert_eq!(captured.len(), 136, "120 of the frame and 16 of the record");
        let (record, place, rest) = EslRecord::find(&captured).unwrap();
        assert_eq!((place, rest.len()), (EslPlace::Behind, 120));
        assert_eq!((record.port, record.time_ns), (Some(0), 183_570_258_760));
        assert!(!record.crc_error && !record.alignment_error);
    }

    // proves: WS-06
    #[test]
    fn record_is_read_back_in_both_forms() {
        for port in 0..PORTS {
            for (crc_error, alignment_error) in [(false, false), (true, false), (true, true)] {
                let record =
                    EslRecord { port: Some(port), crc_error, alignment_error, time_ns: 12_345 };
                let frame = frame(&[1, 2, 3]);
                let front = [record.to_bytes().as_slice(), &frame].concat();
                assert_eq!(EslRecord::find(&front), Some((record, EslPlace::Front, &frame[..])));
                let behind = [frame.as_slice(), &record.to_bytes()].concat();
                assert_eq!(EslRecord::find(&behind), Some((record, EslPlace::Behind, &frame[..])));
            }
        }
    }

    #[test]
    fn process_data_that_look_like_a_record_stay_data() {
        let record =
            EslRecord { port: Some(1), crc_error: false, alignment_error: false, time_ns: 1 };
        let mut data = [0; 64];
        data[50..].copy_from_slice(&record.to_bytes()[..14]);
        // The last two bytes of the record would be the working counter.
        assert_eq!(EslRecord::find(&frame(&data)), None);
        assert_eq!(EslRecord::find(&frame(&[0; 64])), None);
        assert_eq!(EslRecord::find(&[]), None);
        assert_eq!(EslRecord::find(&record.to_bytes()[..15]), None);
    }
}
