//! The six messages of FoE.

use super::error_code::FoeErrorCode;
use crate::mailbox::header::{BufferTooSmall, HEADER_LEN};

/// Bytes in front of the name, the data or the text.
pub const FOE_HEADER_LEN: usize = 6;

const READ: u8 = 1;
const WRITE: u8 = 2;
const DATA: u8 = 3;
const ACK: u8 = 4;
const ERROR: u8 = 5;
const BUSY: u8 = 6;

/// How many bytes of a file a packet holds in a mailbox of `mailbox_len` bytes; one that holds fewer
/// is the last.
#[must_use]
pub const fn chunk_len(mailbox_len: usize) -> usize {
    mailbox_len.saturating_sub(HEADER_LEN + FOE_HEADER_LEN)
}

/// An FoE message: what follows the mailbox header of a message of type FoE.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Message<'a> {
    /// 1: the MainDevice wants to read a file.
    Read {
        /// 0 for none.
        password: u32,
        /// As the SubDevice knows it.
        name: &'a [u8],
    },
    /// 2: the MainDevice wants to write a file.
    Write {
        /// 0 for none.
        password: u32,
        /// As the SubDevice is to know it.
        name: &'a [u8],
    },
    /// 3: a piece of the file, from whoever has it.
    Data {
        /// From 1 up.
        packet: u32,
        /// Shorter than [`chunk_len`] in the last one.
        data: &'a [u8],
    },
    /// 4: a piece arrived.
    Ack {
        /// Which; 0 answers the request to write.
        packet: u32,
    },
    /// 5: the transfer is over.
    Error {
        /// Why.
        code: FoeErrorCode,
        /// More about it, for people; may be empty.
        text: &'a [u8],
    },
    /// 6: not yet: the packet has to be sent again later.
    Busy {
        /// How much of `total` is done.
        done: u16,
        /// All that is to be done, in any unit; 0 when nobody knows.
        total: u16,
        /// What is being done, for people; may be empty.
        text: &'a [u8],
    },
}

impl<'a> Message<'a> {
    /// Reads the data of a mailbox message of type FoE.
    ///
    /// # Errors
    /// [`FoeError`] when they are cut off or of a kind that is not defined.
    pub fn parse(data: &'a [u8]) -> Result<Self, FoeError> {
        let Some((&[opcode, _, a, b, c, d], rest)) = data.split_first_chunk() else {
            return Err(FoeError::CutOff { len: data.len() });
        };
        let number = u32::from_le_bytes([a, b, c, d]);
        Ok(match opcode {
            READ => Self::Read { password: number, name: rest },
            WRITE => Self::Write { password: number, name: rest },
            DATA => Self::Data { packet: number, data: rest },
            ACK => Self::Ack { packet: number },
            ERROR => Self::Error { code: FoeErrorCode(number), text: rest },
            BUSY => Self::Busy {
                done: u16::from_le_bytes([a, b]),
                total: u16::from_le_bytes([c, d]),
                text: rest,
            },
            opcode => return Err(FoeError::UnknownOpcode { opcode }),
        })
    }

    /// Writes the data of a mailbox message of type FoE and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let (opcode, number, rest): (u8, u32, &[u8]) = match *self {
            Self::Read { password, name } => (READ, password, name),
            Self::Write { password, name } => (WRITE, password, name),
            Self::Data { packet, data } => (DATA, packet, data),
            Self::Ack { packet } => (ACK, packet, &[]),
            Self::Error { code, text } => (ERROR, code.0, text),
            Self::Busy { done, total, text } => {
                (BUSY, u32::from(total) << 16 | u32::from(done), text)
            }
        };
        let len = FOE_HEADER_LEN + rest.len();
        let buffer = BufferTooSmall::check(buffer, len)?;
        buffer[0] = opcode;
        buffer[1] = 0;
        buffer[2..FOE_HEADER_LEN].copy_from_slice(&number.to_le_bytes());
        buffer[FOE_HEADER_LEN..].copy_from_slice(rest);
        Ok(len)
    }
}

/// Why bytes are no FoE message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FoeError {
    /// They end within the header.
    #[error("FoE message of {len} bytes ends within its header of 6 bytes")]
    CutOff {
        /// Bytes there were.
        len: usize,
    },
    /// An opcode that is not defined.
    #[error("FoE opcode {opcode}, expected 1..=6")]
    UnknownOpcode {
        /// The opcode found.
        opcode: u8,
    },
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn messages_are_these_bytes() {
        let code = FoeErrorCode::DISK_FULL;
        let table: [(Message<'_>, &[u8]); 7] = [
            (
                Message::Read { password: 0xBEEF, name: b"log.txt" },
                &[1, 0, 0xEF, 0xBE, 0, 0, b'l', b'o', b'g', b'.', b't', b'x', b't'],
            ),
            (Message::Write { password: 0, name: b"a" }, &[2, 0, 0, 0, 0, 0, b'a']),
            (Message::Data { packet: 1, data: &[7, 8] }, &[3, 0, 1, 0, 0, 0, 7, 8]),
            (Message::Data { packet: 0x0102_0304, data: &[] }, &[3, 0, 4, 3, 2, 1]),
            (Message::Ack { packet: 300 }, &[4, 0, 0x2C, 1, 0, 0]),
            (Message::Error { code, text: b"no" }, &[5, 0, 3, 0x80, 0, 0, b'n', b'o']),
            (Message::Busy { done: 1, total: 515, text: b"" }, &[6, 0, 1, 0, 3, 2]),
        ];
        for (message, bytes) in table {
            let mut written = [0xAA; 20];
            let len = message.write(&mut written).unwrap();
            assert_eq!(&written[..len], bytes, "{message:?}");
            assert_eq!(Message::parse(bytes), Ok(message));
            assert!(message.write(&mut written[..len - 1]).is_err());
        }
    }

    #[test]
    fn what_is_none_says_so() {
        assert_eq!(Message::parse(&[1, 0, 0, 0, 0]), Err(FoeError::CutOff { len: 5 }));
        for opcode in [0, 7, 255] {
            let bytes = [opcode, 0, 0, 0, 0, 0];
            assert_eq!(Message::parse(&bytes), Err(FoeError::UnknownOpcode { opcode }));
        }
    }

    #[test]
    fn a_packet_fills_the_mailbox() {
        assert_eq!(chunk_len(128), 116);
        assert_eq!(chunk_len(11), 0);
    }

    proptest! {
        #[test]
        fn messages_go_back_as_they_came(mut bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            if let Some(reserved) = bytes.get_mut(1) {
                *reserved = 0;
            }
            if let Ok(message) = Message::parse(&bytes) {
                let mut written = vec![0; bytes.len()];
                let len = message.write(&mut written).unwrap();
                // An acknowledgement has nothing behind its number.
                prop_assert_eq!(&written[..len], &bytes[..len]);
                prop_assert_eq!(Message::parse(&written[..len]), Ok(message));
            }
        }
    }
}
