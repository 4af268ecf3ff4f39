//! Error replies (mailbox type 0): a SubDevice's answer to a message it cannot even hand to a
//! protocol.
//!
//! Reference: ETG.1000.4 (mailbox, error reply). Layout: u16 with the value 1, u16 detail.

use std::fmt;

use super::header::BufferTooSmall;

/// What is behind the header of an error reply.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ErrorReply {
    /// What was wrong.
    pub code: ErrorReplyCode,
}

impl ErrorReply {
    /// Length in bytes.
    pub const LEN: usize = 4;

    const REPLY: u16 = 1;

    /// Reads the data of a message of type 0.
    ///
    /// # Errors
    /// [`ErrorReplyError`] when they are cut off or no error reply.
    pub fn parse(data: &[u8]) -> Result<Self, ErrorReplyError> {
        let Some(&[reply_low, reply_high, low, high]) = data.first_chunk() else {
            return Err(ErrorReplyError::CutOff { len: data.len() });
        };
        let found = u16::from_le_bytes([reply_low, reply_high]);
        if found != Self::REPLY {
            return Err(ErrorReplyError::NoReply { found });
        }
        Ok(Self { code: ErrorReplyCode::from_code(u16::from_le_bytes([low, high])) })
    }

    /// Writes the data of a message of type 0 and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit.
    pub fn write(self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let [reply_low, reply_high] = Self::REPLY.to_le_bytes();
        let [low, high] = self.code.code().to_le_bytes();
        let bytes = [reply_low, reply_high, low, high];
        BufferTooSmall::check(buffer, Self::LEN)?.copy_from_slice(&bytes);
        Ok(Self::LEN)
    }
}

/// Why a message of type 0 is no error reply.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ErrorReplyError {
    /// Shorter than four bytes.
    #[error("mailbox error reply of {len} bytes, expected 4")]
    CutOff {
        /// Bytes there were.
        len: usize,
    },
    /// Its first word is not 1.
    #[error("mailbox error reply begins with 0x{found:04X}, expected 0x0001")]
    NoReply {
        /// The word found.
        found: u16,
    },
}

/// What was wrong with a message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ErrorReplyCode {
    /// 1: the six bytes of the header are wrong.
    Syntax,
    /// 2: the SubDevice does not speak this protocol.
    UnsupportedProtocol,
    /// 3: the channel field has a wrong value.
    InvalidChannel,
    /// 4: the protocol has no such service.
    ServiceNotSupported,
    /// 5: the header of the protocol is wrong.
    InvalidHeader,
    /// 6: the data are shorter than the service needs.
    SizeTooShort,
    /// 7: the SubDevice has no memory for it.
    NoMemory,
    /// 8: the length does not fit the content.
    InvalidSize,
    /// 9: the service is still being worked on.
    ServiceInWork,
    /// Another code.
    Other(u16),
}

impl ErrorReplyCode {
    /// The codes with a name, by number.
    pub const NAMED: [Self; 9] = [
        Self::Syntax,
        Self::UnsupportedProtocol,
        Self::InvalidChannel,
        Self::ServiceNotSupported,
        Self::InvalidHeader,
        Self::SizeTooShort,
        Self::NoMemory,
        Self::InvalidSize,
        Self::ServiceInWork,
    ];

    /// The code with this number.
    #[must_use]
    pub const fn from_code(code: u16) -> Self {
        match code {
            1 => Self::Syntax,
            2 => Self::UnsupportedProtocol,
            3 => Self::InvalidChannel,
            4 => Self::ServiceNotSupported,
            5 => Self::InvalidHeader,
            6 => Self::SizeTooShort,
            7 => Self::NoMemory,
            8 => Self::InvalidSize,
            9 => Self::ServiceInWork,
            other => Self::Other(other),
        }
    }

    /// Its number.
    #[must_use]
    pub const fn code(self) -> u16 {
        match self {
            Self::Syntax => 1,
            Self::UnsupportedProtocol => 2,
            Self::InvalidChannel => 3,
            Self::ServiceNotSupported => 4,
            Self::InvalidHeader => 5,
            Self::SizeTooShort => 6,
            Self::NoMemory => 7,
            Self::InvalidSize => 8,
            Self::ServiceInWork => 9,
            Self::Other(code) => code,
        }
    }

    /// What it means, for people.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Syntax => "syntax of the mailbox header is wrong",
            Self::UnsupportedProtocol => "mailbox protocol is not supported",
            Self::InvalidChannel => "channel field has a wrong value",
            Self::ServiceNotSupported => "service of the mailbox protocol is not supported",
            Self::InvalidHeader => "header of the mailbox protocol is wrong",
            Self::SizeTooShort => "message is too short",
            Self::NoMemory => "SubDevice has no memory left",
            Self::InvalidSize => "length does not fit the content",
            Self::ServiceInWork => "service is still being worked on",
            Self::Other(_) => "unknown mailbox error",
        }
    }
}

impl fmt::Display for ErrorReplyCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (mailbox error 0x{:04X})", self.text(), self.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_one_number_and_one_text() {
        for (code, number) in ErrorReplyCode::NAMED.into_iter().zip(1..) {
            assert_eq!(code.code(), number);
            assert_ne!(code.text(), ErrorReplyCode::Other(number).text());
        }
        for number in 0..=u16::MAX {
            assert_eq!(ErrorReplyCode::from_code(number).code(), number);
        }
    }

    #[test]
    fn replies_go_back_as_they_came() {
        let bytes = [1, 0, 2, 0];
        let reply = ErrorReply::parse(&bytes).unwrap();
        assert_eq!(reply.code, ErrorReplyCode::UnsupportedProtocol);
        let mut written = [0xAA; 6];
        assert_eq!(reply.write(&mut written), Ok(4));
        assert_eq!(written, [1, 0, 2, 0, 0xAA, 0xAA]);
        assert!(reply.write(&mut [0; 3]).is_err());
    }

    #[test]
    fn what_is_no_reply_is_refused() {
        assert_eq!(ErrorReply::parse(&[1, 0, 2]), Err(ErrorReplyError::CutOff { len: 3 }));
        assert_eq!(ErrorReply::parse(&[2, 0, 2, 0]), Err(ErrorReplyError::NoReply { found: 2 }));
    }
}
