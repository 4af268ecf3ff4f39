//! Making a frame in a buffer of the caller's: no allocation, so that the cyclic path may use it.

use super::{
    DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD, ETHERCAT_HEADER_LEN, MAX_DATAGRAM_DATA, WKC_LEN,
};
use crate::address::{LogicalAddress, RegisterAddress};
use crate::command::Command;
use crate::ethernet::{
    ETHERTYPE_ETHERCAT, ETHERTYPE_IPV4, HEADER_LEN, MAX_LEN, MIN_LEN, MacAddress, UDP_PORT,
};

/// IPv4 header without options.
const IP_LEN: usize = 20;
/// UDP header.
const UDP_LEN: usize = 8;

/// The four address bytes of a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DatagramAddress {
    /// ADP (position or station) and ADO.
    Physical(u16, RegisterAddress),
    /// A logical address.
    Logical(LogicalAddress),
}

impl DatagramAddress {
    /// The bytes on the wire.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 4] {
        match self {
            Self::Physical(adp, ado) => {
                let [a, b] = adp.to_le_bytes();
                let [c, d] = ado.0.to_le_bytes();
                [a, b, c, d]
            }
            Self::Logical(address) => address.0.to_le_bytes(),
        }
    }
}

/// The datagram does not fit into the frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("datagram with {data_len} bytes of data needs {needed} bytes, the frame has {left} left")]
pub struct FrameFull {
    /// Data asked for.
    pub data_len: usize,
    /// Data plus overhead.
    pub needed: usize,
    /// What is left.
    pub left: usize,
}

/// Writes a frame of datagrams into a buffer.
///
/// ```
/// use linesman_proto::address::RegisterAddress;
/// use linesman_proto::command::Command;
/// use linesman_proto::ethernet::MacAddress;
/// use linesman_proto::frame::{FrameBuilder, FrameView, builder::DatagramAddress};
///
/// let mut buffer = [0; 1514];
/// let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
/// let address = DatagramAddress::Physical(0, RegisterAddress(0x0130));
/// builder.push(Command::Brd, 1, address, 2).unwrap();
/// let len = builder.finish();
/// let datagram = FrameView::parse(&buffer[..len]).unwrap().datagrams().next().unwrap().unwrap();
/// assert_eq!(datagram.command(), Some(Command::Brd));
/// ```
#[derive(Debug)]
pub struct FrameBuilder<'a> {
    buffer: &'a mut [u8],
    /// Where the EtherCAT header lies.
    header_at: usize,
    len: usize,
    /// Where the last datagram's header lies, to set its "more follows" bit.
    last_at: Option<usize>,
}

impl<'a> FrameBuilder<'a> {
    /// Starts a broadcast frame from `source`.
    ///
    /// # Panics
    /// When `buffer` is shorter than the shortest frame (60 bytes): our own mistake.
    #[must_use]
    pub fn new(buffer: &'a mut [u8], source: MacAddress) -> Self {
        assert!(buffer.len() >= MIN_LEN, "a frame buffer has at least {MIN_LEN} bytes");
        buffer[0..6].copy_from_slice(&MacAddress::BROADCAST.0);
        buffer[6..12].copy_from_slice(&source.0);
        buffer[12..14].copy_from_slice(&ETHERTYPE_ETHERCAT.to_be_bytes());
        Self::behind(buffer, HEADER_LEN)
    }

    /// Starts a frame from `source` to `destination` that carries its datagrams in UDP, as controllers process it, too
    /// (S1 chapter 2.1). It goes to the broadcast address of IP and is never routed.
    ///
    /// # Panics
    /// When `buffer` is shorter than the shortest frame (60 bytes): our own mistake.
    #[must_use]
    pub fn in_udp(buffer: &'a mut [u8], source: MacAddress, destination: MacAddress) -> Self {
        assert!(buffer.len() >= MIN_LEN, "a frame buffer has at least {MIN_LEN} bytes");
        buffer[0..6].copy_from_slice(&destination.0);
        buffer[6..12].copy_from_slice(&source.0);
        buffer[12..14].copy_from_slice(&ETHERTYPE_IPV4.to_be_bytes());
        let [high, low] = UDP_PORT.to_be_bytes();
        // Version and length, lengths and checksum as `finish` sets them; not to be cut, one hop, UDP.
        let ip = [0x45, 0, 0, 0, 0, 0, 0x40, 0, 1, 17, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        let udp = [high, low, high, low, 0, 0, 0, 0];
        let header_at = HEADER_LEN + IP_LEN + UDP_LEN;
        buffer[HEADER_LEN..HEADER_LEN + IP_LEN].copy_from_slice(&ip);
        buffer[HEADER_LEN + IP_LEN..header_at].copy_from_slice(&udp);
        Self::behind(buffer, header_at)
    }

    const fn behind(buffer: &'a mut [u8], header_at: usize) -> Self {
        Self { buffer, header_at, len: header_at + ETHERCAT_HEADER_LEN, last_at: None }
    }

    /// Bytes of data that one more datagram could carry.
    #[must_use]
    pub fn room(&self) -> usize {
        let end = self.buffer.len().min(MAX_LEN);
        end.saturating_sub(self.len + DATAGRAM_OVERHEAD).min(MAX_DATAGRAM_DATA)
    }

    /// Whether nothing has been put in yet.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.last_at.is_none()
    }

    /// Appends a datagram with `data_len` bytes of zeroed data and gives them to fill in.
    ///
    /// # Errors
    /// [`FrameFull`] when it does not fit; the frame stays as it was.
    pub fn push(
        &mut self,
        command: Command,
        index: u8,
        address: DatagramAddress,
        data_len: usize,
    ) -> Result<&mut [u8], FrameFull> {
        let needed = data_len.saturating_add(DATAGRAM_OVERHEAD);
        let left = self.buffer.len().min(MAX_LEN) - self.len;
        // Where not even header and counter fit, `room` is 0 and so may `data_len` be.
        if needed > left || data_len > self.room() {
            return Err(FrameFull { data_len, needed, left });
        }
        if let Some(last) = self.last_at {
            self.buffer[last + 7] |= 0x80;
        }
        let at = self.len;
        let data_at = at + DATAGRAM_HEADER_LEN;
        self.buffer[at] = command.code();
        self.buffer[at + 1] = index;
        self.buffer[at + 2..at + 6].copy_from_slice(&address.to_bytes());
        self.buffer[at + 6..at + 8].copy_from_slice(&(data_len as u16).to_le_bytes());
        self.buffer[at + 8..at + 10].fill(0);
        self.buffer[data_at..data_at + data_len + WKC_LEN].fill(0);
        self.last_at = Some(at);
        self.len += needed;
        Ok(&mut self.buffer[data_at..data_at + data_len])
    }

    /// Completes header and padding and returns the frame's length without check sequence.
    pub fn finish(self) -> usize {
        let datagrams = self.len - self.header_at - ETHERCAT_HEADER_LEN;
        let word = (datagrams as u16 & 0x07FF) | 0x1000;
        self.buffer[self.header_at..self.header_at + 2].copy_from_slice(&word.to_le_bytes());
        if self.header_at > HEADER_LEN {
            let (ip, udp) = (HEADER_LEN, HEADER_LEN + IP_LEN);
            let (ip_len, udp_len) = ((self.len - ip) as u16, (self.len - udp) as u16);
            self.buffer[ip + 2..ip + 4].copy_from_slice(&ip_len.to_be_bytes());
            self.buffer[udp + 4..udp + 6].copy_from_slice(&udp_len.to_be_bytes());
            let sum = ip_checksum(&self.buffer[ip..udp]);
            self.buffer[ip + 10..ip + 12].copy_from_slice(&sum.to_be_bytes());
        }
        let padded = self.len.max(MIN_LEN);
        self.buffer[self.len..padded].fill(0);
        padded
    }
}

/// Checksum of an IPv4 header whose own field for it is 0. Reference: RFC 791, section 3.1.
fn ip_checksum(header: &[u8]) -> u16 {
    let words = header.chunks_exact(2).map(|word| u32::from(word[0]) << 8 | u32::from(word[1]));
    let sum: u32 = words.sum();
    let folded = (sum & 0xFFFF) + (sum >> 16);
    !((folded & 0xFFFF) + (folded >> 16)) as u16
}

#[cfg(test)]
mod tests {
    use super::super::{DatagramError, FrameError, FrameType, FrameView};
    use super::*;
    use crate::address::WorkingCounter;
    use proptest::prelude::*;

    const BRD_AL_STATUS: DatagramAddress = DatagramAddress::Physical(0, RegisterAddress(0x0130));

    // proves: FRM-01 partial, FRM-06 partial
    #[test]
    fn a_short_frame_is_padded_to_60_bytes() {
        let mut buffer = [0xEE; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress([0, 1, 1, 1, 1, 1]));
        assert!(builder.is_empty());
        builder.push(Command::Brd, 7, BRD_AL_STATUS, 2).unwrap();
        let len = builder.finish();
        assert_eq!(len, 60);
        assert!(buffer[30..60].iter().all(|byte| *byte == 0), "30 bytes of padding");

        let view = FrameView::parse(&buffer[..len]).unwrap();
        assert_eq!(view.announced_len(), 14);
        assert_eq!(view.source(), MacAddress([0, 1, 1, 1, 1, 1]));
        let datagrams: Vec<_> = view.datagrams().map(Result::unwrap).collect();
        assert_eq!(datagrams.len(), 1);
        let datagram = datagrams[0];
        assert_eq!(datagram.command(), Some(Command::Brd));
        assert_eq!(datagram.index(), 7);
        assert_eq!(datagram.ado(), RegisterAddress(0x0130));
        assert_eq!(datagram.data(), [0, 0]);
        assert_eq!(datagram.wkc(), WorkingCounter(0), "a working counter starts at 0");
        assert!(!datagram.more_follow() && !datagram.circulated());
    }

    #[test]
    fn frame_in_udp_has_the_lengths_and_the_checksum_of_its_headers() {
        let mut buffer = [0xEE; 128];
        let (source, destination) =
            (MacAddress([0, 1, 2, 3, 4, 5]), MacAddress([2, 0, 0, 0, 0, 1]));
        let mut builder = FrameBuilder::in_udp(&mut buffer, source, destination);
        builder.push(Command::Brd, 7, BRD_AL_STATUS, 2).unwrap();
        let len = builder.finish();
        assert_eq!(len, 60, "42 of headers, 2, 14, and padding");
        let view = FrameView::parse(&buffer[..len]).unwrap();
        assert_eq!((view.source(), view.destination()), (source, destination));
        assert_eq!(view.announced_len(), 14);
        let datagram = view.datagrams().next().unwrap().unwrap();
        assert_eq!((datagram.command(), datagram.index()), (Some(Command::Brd), 7));
        assert_eq!(buffer[16..18], 44_u16.to_be_bytes(), "length of the IP packet");
        assert_eq!(buffer[38..40], 24_u16.to_be_bytes(), "length of the UDP packet");
        assert_eq!(ip_checksum(&buffer[14..34]), 0, "a right checksum makes the sum 0");
    }

    // proves: FRM-13 partial
    #[test]
    fn the_length_field_of_seven_datagrams_with_416_bytes_is_500() {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
        for data_len in [4, 4, 3, 150, 33, 220, 2] {
            builder.push(Command::Nop, 0, BRD_AL_STATUS, data_len).unwrap();
        }
        let len = builder.finish();
        assert_eq!(len, 516);
        assert_eq!(buffer[14..16], [0xF4, 0x11], "length 500, type 1");
        let view = FrameView::parse(&buffer[..len]).unwrap();
        assert_eq!(view.datagrams().count(), 7);
    }

    #[test]
    fn what_does_not_fit_is_refused_and_changes_nothing() {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
        assert_eq!(builder.room(), 1486);
        builder.push(Command::Lrw, 0, DatagramAddress::Logical(LogicalAddress(0)), 1400).unwrap();
        assert_eq!(builder.room(), 74);
        let full = builder.push(Command::Brd, 0, BRD_AL_STATUS, 75).unwrap_err();
        assert_eq!(full, FrameFull { data_len: 75, needed: 87, left: 86 });
        assert_eq!(builder.finish(), 14 + 2 + 1412);
    }

    #[test]
    fn cut_off_frames_say_where() {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
        builder.push(Command::Brd, 0, BRD_AL_STATUS, 2).unwrap();
        builder.push(Command::Brd, 1, BRD_AL_STATUS, 40).unwrap();
        let len = builder.finish();
        assert_eq!(len, 82);
        assert!(matches!(FrameView::parse(&buffer[..15]), Err(FrameError::CutOff { len: 15 })));

        let walk = |len: usize| {
            let view = FrameView::parse(&buffer[..len]).unwrap();
            view.datagrams().collect::<Vec<_>>().pop().unwrap().map(|datagram| datagram.index())
        };
        assert_eq!(walk(82), Ok(1));
        let data = DatagramError::DataCutOff { number: 2, announced: 40, left: 39 };
        assert_eq!(walk(81), Err(data));
        let header = DatagramError::HeaderCutOff { number: 2, needed: 12, left: 11 };
        assert_eq!(walk(41), Err(header));
    }

    #[test]
    fn other_frame_types_are_named() {
        let mut buffer = [0; 60];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
        builder.push(Command::Nop, 0, BRD_AL_STATUS, 0).unwrap();
        builder.finish();
        buffer[15] = 0x50 | (buffer[15] & 0x0F);
        let error = FrameView::parse(&buffer).unwrap_err();
        assert_eq!(error, FrameError::OtherType { found: FrameType::Mailbox });
    }

    proptest! {
        #[test]
        fn what_is_built_is_read_back(
            datagrams in prop::collection::vec(
                (0u8..15, any::<u8>(), any::<u16>(), any::<u16>(),
                 prop::collection::vec(any::<u8>(), 0..120)), 1..9)
        ) {
            let mut buffer = [0; 1514];
            let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
            for (code, index, adp, ado, data) in &datagrams {
                let command = Command::from_code(*code).unwrap();
                let address = DatagramAddress::Physical(*adp, RegisterAddress(*ado));
                builder.push(command, *index, address, data.len()).unwrap().copy_from_slice(data);
            }
            let len = builder.finish();
            let view = FrameView::parse(&buffer[..len]).unwrap();
            let seen: Vec<_> = view.datagrams().map(|datagram| {
                let d = datagram.unwrap();
                (d.code(), d.index(), d.adp(), d.ado().0, d.data().to_vec())
            }).collect();
            prop_assert_eq!(seen, datagrams);
        }

        #[test]
        fn any_bytes_are_read_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut frame = vec![0; 12];
            frame.extend([0x88, 0xA4]);
            frame.extend(&bytes);
            if let Ok(view) = FrameView::parse(&frame) {
                for datagram in view.datagrams().flatten() {
                    prop_assert!(datagram.data_range().end + 2 <= frame.len());
                }
            }
            let _ = FrameView::parse(&bytes);
        }
    }
}
