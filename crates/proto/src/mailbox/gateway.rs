//! Frames of the mailbox gateway: an EtherCAT header and one mailbox message, in a UDP datagram or one behind the
//! other in a TCP stream.
//!
//! Reference: ETG.8200. The EtherCAT header is one word: length of the rest (bits 0..=10), type 5 (bits 12..=15). In
//! the mailbox header the address is the station that is meant, in a request and in its answer; 0 is the MainDevice
//! itself. There is no answer that says "no": a request that cannot be served is not answered.

use super::header::{BufferTooSmall, HEADER_LEN, Header, MailboxError, Message};
use crate::ethernet::UDP_PORT;
use crate::frame::{ETHERCAT_HEADER_LEN, FrameType};

/// Port of the gateway, UDP and TCP: 34980.
pub const PORT: u16 = UDP_PORT;
/// Longest frame in bytes: the length field has eleven bits.
pub const MAX_LEN: usize = ETHERCAT_HEADER_LEN + LENGTH as usize;
/// Longest mailbox message, header included, whose frame goes into a UDP datagram over IPv4 without being cut up on
/// Ethernet: 1,500 bytes less the headers of IP (20), UDP (8) and EtherCAT (2).
pub const MAX_UDP_MESSAGE: usize = 1_470;

const LENGTH: u16 = 0x07FF;
const TYPE_AT: u32 = 12;

/// Bytes of the frame that begins with this EtherCAT header, the header included.
///
/// # Errors
/// [`GatewayError`] when it announces something other than a mailbox, or less than a mailbox header has.
pub fn frame_len(header: [u8; ETHERCAT_HEADER_LEN]) -> Result<usize, GatewayError> {
    let word = u16::from_le_bytes(header);
    let found = FrameType::from_bits((word >> TYPE_AT) as u8);
    if found != FrameType::Mailbox {
        return Err(GatewayError::OtherType { found });
    }
    let announced = usize::from(word & LENGTH);
    if announced < HEADER_LEN {
        return Err(GatewayError::TooShort { announced });
    }
    Ok(ETHERCAT_HEADER_LEN + announced)
}

/// The message in a frame. Bytes behind the frame, and behind the message in it, are padding.
///
/// # Errors
/// [`GatewayError`] when it is cut off, or no frame of the gateway.
pub fn parse(frame: &[u8]) -> Result<Message<'_>, GatewayError> {
    let len = frame.len();
    let header = frame.first_chunk().ok_or(GatewayError::HeaderCutOff { len })?;
    let announced = frame_len(*header)?;
    let mailbox =
        frame.get(ETHERCAT_HEADER_LEN..announced).ok_or(GatewayError::CutOff { announced, len })?;
    Ok(Message::parse(mailbox)?)
}

/// Writes a frame and tells how many bytes that were. The length in `header` is made that of `data`.
///
/// # Errors
/// [`BufferTooSmall`] when it does not fit, or is longer than a frame may be ([`MAX_LEN`]).
pub fn write(header: Header, data: &[u8], buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
    let needed = ETHERCAT_HEADER_LEN + HEADER_LEN + data.len();
    if needed > MAX_LEN {
        return Err(BufferTooSmall { needed, available: MAX_LEN });
    }
    let frame = BufferTooSmall::check(buffer, needed)?;
    let (head, mailbox) = frame.split_at_mut(ETHERCAT_HEADER_LEN);
    let word =
        (needed - ETHERCAT_HEADER_LEN) as u16 | u16::from(FrameType::Mailbox.bits()) << TYPE_AT;
    head.copy_from_slice(&word.to_le_bytes());
    header.write_message(mailbox, |body| {
        BufferTooSmall::check(body, data.len())?.copy_from_slice(data);
        Ok(data.len())
    })?;
    Ok(needed)
}

/// Why bytes are no frame of the gateway.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum GatewayError {
    /// They end within the EtherCAT header.
    #[error("gateway frame of {len} bytes ends within the EtherCAT header of 2 bytes")]
    HeaderCutOff {
        /// Bytes there were.
        len: usize,
    },
    /// The EtherCAT header announces something other than a mailbox.
    #[error("EtherCAT header type {found:?}, expected a mailbox (type 5)")]
    OtherType {
        /// The type found.
        found: FrameType,
    },
    /// It announces less than a mailbox header has.
    #[error("EtherCAT header announces {announced} bytes, a mailbox header alone has 6")]
    TooShort {
        /// Bytes behind the EtherCAT header.
        announced: usize,
    },
    /// They end before the frame does.
    #[error("EtherCAT header announces a frame of {announced} bytes, there are {len}")]
    CutOff {
        /// Bytes of the whole frame.
        announced: usize,
        /// Bytes there were.
        len: usize,
    },
    /// The mailbox message is longer than the frame.
    #[error(transparent)]
    Mailbox(#[from] MailboxError),
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::address::StationAddress;
    use crate::mailbox::MailboxType;

    /// To station 1001: CoE, counter 2, ten bytes: upload of 0xF980:02. As a public gateway was asked.
    const REQUEST: [u8; 18] = [
        0x10, 0x50, 0x0A, 0x00, 0xE9, 0x03, 0x00, 0x23, 0x00, 0x20, 0x41, 0x80, 0xF9, 0x02, 0, 0,
        0, 0,
    ];

    #[test]
    fn a_request_is_read_and_written_as_these_bytes() {
        let message = parse(&REQUEST).unwrap();
        assert_eq!(message.header.address, StationAddress(1001));
        assert_eq!(message.header.kind, MailboxType::Coe);
        assert_eq!(message.header.counter.value(), 2);
        assert_eq!(message.data, &REQUEST[8..]);
        assert_eq!(frame_len([0x10, 0x50]), Ok(REQUEST.len()));
        let mut written = [0xAA; 20];
        assert_eq!(write(message.header, message.data, &mut written), Ok(18));
        assert_eq!(written[..18], REQUEST);
    }

    #[test]
    fn padding_behind_frame_and_message_is_no_part_of_it() {
        let mut padded = [0; 60];
        padded[..18].copy_from_slice(&REQUEST);
        assert_eq!(parse(&padded), parse(&REQUEST));
        // 44 bytes behind the EtherCAT header, of which the message has 16.
        padded[0] = 44;
        assert_eq!(parse(&padded).unwrap().data.len(), 10);
    }

    #[test]
    fn what_is_no_frame_of_the_gateway_is_told_apart() {
        let with = |word: u16| {
            let mut frame = REQUEST;
            frame[..2].copy_from_slice(&word.to_le_bytes());
            parse(&frame).unwrap_err()
        };
        assert_eq!(parse(&[]), Err(GatewayError::HeaderCutOff { len: 0 }));
        assert_eq!(parse(&[0x10]), Err(GatewayError::HeaderCutOff { len: 1 }));
        assert_eq!(with(0x1010), GatewayError::OtherType { found: FrameType::Datagrams });
        assert_eq!(with(0x0010), GatewayError::OtherType { found: FrameType::Other(0) });
        assert_eq!(with(0x5005), GatewayError::TooShort { announced: 5 });
        assert_eq!(with(0x5011), GatewayError::CutOff { announced: 19, len: 18 });
        assert_eq!(with(0x57FF), GatewayError::CutOff { announced: 2_049, len: 18 });
        // The mailbox header announces more than the frame has.
        let announced = MailboxError::DataCutOff { announced: 10, left: 9 };
        assert_eq!(with(0x500F), GatewayError::Mailbox(announced));
        for cut in 0..REQUEST.len() {
            assert!(parse(&REQUEST[..cut]).is_err(), "{cut} bytes");
        }
    }

    #[test]
    fn a_frame_has_at_most_eleven_bits_of_length() {
        let header = parse(&REQUEST).unwrap().header;
        let mut buffer = [0; 4_096];
        let longest = vec![7; MAX_LEN - 8];
        assert_eq!(write(header, &longest, &mut buffer), Ok(MAX_LEN));
        assert_eq!(parse(&buffer[..MAX_LEN]).unwrap().data, longest);
        let longer = vec![7; MAX_LEN - 7];
        let error = BufferTooSmall { needed: MAX_LEN + 1, available: MAX_LEN };
        assert_eq!(write(header, &longer, &mut buffer), Err(error));
        assert!(write(header, &[1, 2], &mut [0; 9]).is_err());
    }

    proptest! {
        #[test]
        fn frames_that_are_read_are_written_as_they_came(
            bytes in proptest::collection::vec(any::<u8>(), 0..80),
            announced in 0_u16..80,
        ) {
            // Any bytes at all, and bytes with a header that fits them more often.
            let mut likely = bytes.clone();
            if let Some(head) = likely.first_chunk_mut::<2>() {
                *head = (0x5000 | announced).to_le_bytes();
            }
            for bytes in [bytes, likely] {
                if let Ok(message) = parse(&bytes) {
                    let mut written = vec![0; MAX_LEN];
                    let len = write(message.header, message.data, &mut written).unwrap();
                    prop_assert_eq!(parse(&written[..len]), Ok(message));
                    prop_assert!(len <= bytes.len());
                }
            }
        }
    }
}
