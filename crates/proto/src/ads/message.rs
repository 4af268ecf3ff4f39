//! Frames: the AMS/TCP header, and the AMS header behind it.

use super::address::AmsAddress;
use super::code::AdsCode;

/// TCP port of ADS: 48898.
pub const PORT: u16 = 48_898;
/// Bytes of the AMS/TCP header.
pub const AMS_TCP_HEADER_LEN: usize = 6;
/// Bytes of the AMS header.
pub const AMS_HEADER_LEN: usize = 32;
/// Longest message that is taken or given, AMS header included: the limit is ours, the length field has 32 bits.
pub const MAX_AMS_LEN: usize = 64 * 1024;

/// State flag: it is an answer.
const RESPONSE: u16 = 0x0001;
/// State flag: it is a command of ADS.
const COMMAND: u16 = 0x0004;

/// The AMS header of a request or of its answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct AmsHeader {
    /// Receiver.
    pub target: AmsAddress,
    /// Sender.
    pub source: AmsAddress,
    /// The command, by its number.
    pub command: u16,
    /// State flags: bit 0 an answer, bit 2 a command of ADS.
    pub flags: u16,
    /// Reason for which it did not reach its target; 0 in a request.
    pub error: AdsCode,
    /// Number by which the client finds the answer again.
    pub invoke_id: u32,
}

impl AmsHeader {
    /// Bytes behind an AMS/TCP header.
    ///
    /// # Errors
    /// [`AmsError`] when it announces something other than an AMS message, or one that is too short or too long.
    pub fn announced(header: [u8; AMS_TCP_HEADER_LEN]) -> Result<usize, AmsError> {
        let [low, high, len @ ..] = header;
        let kind = u16::from_le_bytes([low, high]);
        if kind != 0 {
            return Err(AmsError::OtherKind { kind });
        }
        let announced = u32::from_le_bytes(len);
        let bytes = usize::try_from(announced).unwrap_or(usize::MAX);
        if (AMS_HEADER_LEN..=MAX_AMS_LEN).contains(&bytes) {
            Ok(bytes)
        } else {
            Err(AmsError::Length { announced })
        }
    }

    /// The header of a message and what is behind it.
    ///
    /// # Errors
    /// [`AmsError`] when the message is cut off, or its header announces other data than there are; the header is part
    /// of that error, as it can be answered.
    pub fn parse(message: &[u8]) -> Result<(Self, &[u8]), AmsError> {
        let len = message.len();
        let cut_off = || AmsError::HeaderCutOff { len };
        let (target, rest) = message.split_first_chunk().ok_or_else(cut_off)?;
        let (source, rest) = rest.split_first_chunk().ok_or_else(cut_off)?;
        let (words, rest) = rest.split_first_chunk::<16>().ok_or_else(cut_off)?;
        let [c0, c1, f0, f1, l0, l1, l2, l3, e0, e1, e2, e3, i0, i1, i2, i3] = *words;
        let header = Self {
            target: AmsAddress::from_bytes(*target),
            source: AmsAddress::from_bytes(*source),
            command: u16::from_le_bytes([c0, c1]),
            flags: u16::from_le_bytes([f0, f1]),
            error: AdsCode(u32::from_le_bytes([e0, e1, e2, e3])),
            invoke_id: u32::from_le_bytes([i0, i1, i2, i3]),
        };
        let announced = u32::from_le_bytes([l0, l1, l2, l3]);
        if usize::try_from(announced) != Ok(rest.len()) {
            return Err(AmsError::DataLength { header, announced, found: rest.len() });
        }
        Ok((header, rest))
    }

    /// True if it is a request of ADS, which is to be answered.
    #[must_use]
    pub const fn is_request(&self) -> bool {
        self.flags & (RESPONSE | COMMAND) == COMMAND
    }

    /// True if it answers a request of ADS.
    #[must_use]
    pub const fn is_answer(&self) -> bool {
        self.flags & (RESPONSE | COMMAND) == RESPONSE | COMMAND
    }

    /// The message with this header, as a mailbox carries it: without an AMS/TCP header.
    #[must_use]
    pub fn message(&self, data: &[u8]) -> Vec<u8> {
        self.behind(Vec::with_capacity(AMS_HEADER_LEN + data.len()), data)
    }

    /// The frame of a message with this header, the AMS/TCP header included.
    #[must_use]
    pub fn frame(&self, data: &[u8]) -> Vec<u8> {
        let mut frame = Vec::with_capacity(AMS_TCP_HEADER_LEN + AMS_HEADER_LEN + data.len());
        frame.extend_from_slice(&[0, 0]);
        frame.extend_from_slice(&len_word(AMS_HEADER_LEN + data.len()));
        self.behind(frame, data)
    }

    /// The message behind what is there.
    fn behind(&self, mut bytes: Vec<u8>, data: &[u8]) -> Vec<u8> {
        bytes.extend_from_slice(&self.target.to_bytes());
        bytes.extend_from_slice(&self.source.to_bytes());
        bytes.extend_from_slice(&self.command.to_le_bytes());
        bytes.extend_from_slice(&self.flags.to_le_bytes());
        bytes.extend_from_slice(&len_word(data.len()));
        bytes.extend_from_slice(&self.error.0.to_le_bytes());
        bytes.extend_from_slice(&self.invoke_id.to_le_bytes());
        bytes.extend_from_slice(data);
        bytes
    }

    /// The header of a request.
    #[must_use]
    pub const fn request(
        target: AmsAddress,
        source: AmsAddress,
        command: u16,
        invoke_id: u32,
    ) -> Self {
        Self { target, source, command, flags: COMMAND, error: AdsCode::OK, invoke_id }
    }

    /// The header of the answer to a request: it goes back to where that came from.
    #[must_use]
    pub const fn answer(&self, error: AdsCode) -> Self {
        Self { target: self.source, source: self.target, flags: COMMAND | RESPONSE, error, ..*self }
    }
}

/// A length as headers have it; whoever calls has no more than [`MAX_AMS_LEN`].
const fn len_word(len: usize) -> [u8; 4] {
    (len as u32).to_le_bytes()
}

/// Reason for which bytes are no AMS message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum AmsError {
    /// The AMS/TCP header announces something else: ports of a local router, say.
    #[error("AMS/TCP header of kind 0x{kind:04X}, expected an AMS message (kind 0)")]
    OtherKind {
        /// The kind found.
        kind: u16,
    },
    /// It announces too little or too much.
    #[error(
        "AMS/TCP header announces {announced} bytes, expected {AMS_HEADER_LEN} to {MAX_AMS_LEN}"
    )]
    Length {
        /// Bytes behind the AMS/TCP header.
        announced: u32,
    },
    /// It ends within the AMS header.
    #[error("AMS message of {len} bytes ends within the AMS header of {AMS_HEADER_LEN}")]
    HeaderCutOff {
        /// Bytes there were.
        len: usize,
    },
    /// The AMS header announces other data than there are.
    #[error("AMS header announces {announced} bytes of data, there are {found}")]
    DataLength {
        /// The header, which can be answered.
        header: AmsHeader,
        /// Bytes of data announced.
        announced: u32,
        /// Bytes there were.
        found: usize,
    },
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::AmsNetId;
    use super::*;

    /// A client at 10.0.0.7.1.1:32905 reads the number of SubDevices of 10.0.0.1.2.1, byte for byte.
    const REQUEST: [u8; 50] = [
        0, 0, 44, 0, 0, 0, 10, 0, 0, 1, 2, 1, 0xFF, 0xFF, 10, 0, 0, 7, 1, 1, 0x89, 0x80, 2, 0, 4,
        0, 12, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 6, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0,
    ];

    #[test]
    fn a_request_is_read_and_written_as_these_bytes() {
        let (tcp, message) = REQUEST.split_first_chunk().unwrap();
        assert_eq!(AmsHeader::announced(*tcp), Ok(44));
        let (header, data) = AmsHeader::parse(message).unwrap();
        let target = AmsAddress { net_id: AmsNetId([10, 0, 0, 1, 2, 1]), port: 0xFFFF };
        let source = AmsAddress { net_id: AmsNetId([10, 0, 0, 7, 1, 1]), port: 32_905 };
        assert_eq!(header, AmsHeader::request(target, source, 2, 5));
        assert!(header.is_request());
        assert_eq!(data, [6, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(header.frame(data), REQUEST);
        assert_eq!(header.message(data), REQUEST[AMS_TCP_HEADER_LEN..]);
        let answer = header.answer(AdsCode::PORT_NOT_FOUND);
        assert_eq!((answer.target, answer.source, answer.flags), (source, target, 5));
        assert_eq!((answer.error, answer.invoke_id), (AdsCode(6), 5));
        assert!(!answer.is_request());
        assert!(answer.is_answer() && !header.is_answer());
    }

    #[test]
    fn what_is_no_ams_message_is_told_apart() {
        assert_eq!(
            AmsHeader::announced([0, 0x10, 2, 0, 0, 0]),
            Err(AmsError::OtherKind { kind: 0x1000 })
        );
        for announced in [0, 31, 65_537, u32::MAX] {
            let mut header = [0; 6];
            header[2..].copy_from_slice(&announced.to_le_bytes());
            assert_eq!(AmsHeader::announced(header), Err(AmsError::Length { announced }));
        }
        let message = &REQUEST[6..];
        for len in 0..AMS_HEADER_LEN {
            assert_eq!(AmsHeader::parse(&message[..len]), Err(AmsError::HeaderCutOff { len }));
        }
        let error = AmsHeader::parse(&message[..40]).unwrap_err();
        assert!(matches!(error, AmsError::DataLength { announced: 12, found: 8, .. }), "{error}");
    }

    proptest! {
        #[test]
        fn messages_that_are_read_are_written_as_they_came(
            mut bytes in proptest::collection::vec(any::<u8>(), 0..120),
        ) {
            let _ = AmsHeader::parse(&bytes);
            // With a length that fits, each is a message.
            if let Some(data) = bytes.len().checked_sub(AMS_HEADER_LEN) {
                bytes[20..24].copy_from_slice(&(data as u32).to_le_bytes());
                let (header, data) = AmsHeader::parse(&bytes).unwrap();
                prop_assert_eq!(&header.frame(data)[AMS_TCP_HEADER_LEN..], &bytes);
            }
        }
    }
}
