//! Commands: what is asked, and what is answered.

use std::fmt;

use super::code::AdsCode;

/// A command by its number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AdsCommand {
    /// Name and version of the device (1).
    ReadDeviceInfo,
    /// Read bytes (2).
    Read,
    /// Write bytes (3).
    Write,
    /// State of the device (4).
    ReadState,
    /// Change the state of the device (5).
    WriteControl,
    /// Begin to be notified (6).
    AddNotification,
    /// End to be notified (7).
    DeleteNotification,
    /// Notification of a device, which is no request (8).
    Notification,
    /// Write bytes and read others in one go (9).
    ReadWrite,
}

impl AdsCommand {
    /// All of them, by their numbers from 1.
    const ALL: [Self; 9] = [
        Self::ReadDeviceInfo,
        Self::Read,
        Self::Write,
        Self::ReadState,
        Self::WriteControl,
        Self::AddNotification,
        Self::DeleteNotification,
        Self::Notification,
        Self::ReadWrite,
    ];

    /// The command with this number.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        Self::ALL.get(usize::from(number).checked_sub(1)?).copied()
    }

    /// Its number.
    #[must_use]
    pub const fn number(self) -> u16 {
        self as u16 + 1
    }
}

impl fmt::Display for AdsCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ReadDeviceInfo => "read device info",
            Self::Read => "read",
            Self::Write => "write",
            Self::ReadState => "read state",
            Self::WriteControl => "write control",
            Self::AddNotification => "add notification",
            Self::DeleteNotification => "delete notification",
            Self::Notification => "notification",
            Self::ReadWrite => "read and write",
        })
    }
}

/// Request of a client.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AdsRequest<'a> {
    /// Name and version.
    DeviceInfo,
    /// State.
    State,
    /// Bytes to be read.
    Read {
        /// Index group.
        group: u32,
        /// Index offset.
        offset: u32,
        /// Greatest number of bytes.
        len: u32,
    },
    /// Bytes to be written.
    Write {
        /// Index group.
        group: u32,
        /// Index offset.
        offset: u32,
        /// The bytes.
        data: &'a [u8],
    },
    /// Bytes to be written, and others to be read.
    ReadWrite {
        /// Index group.
        group: u32,
        /// Index offset.
        offset: u32,
        /// Greatest number of bytes that are read.
        len: u32,
        /// The bytes.
        data: &'a [u8],
    },
    /// A command that is known, and not offered: control of the device's state, notifications.
    Other(AdsCommand),
}

impl<'a> AdsRequest<'a> {
    /// The request of a command with these data.
    ///
    /// # Errors
    /// The code by which it is refused: the command is unknown, or the data are longer or shorter than it has.
    pub fn parse(command: u16, data: &'a [u8]) -> Result<Self, AdsCode> {
        let command = AdsCommand::from_number(command).ok_or(AdsCode::UNKNOWN_COMMAND)?;
        match command {
            AdsCommand::ReadDeviceInfo if data.is_empty() => Ok(Self::DeviceInfo),
            AdsCommand::ReadState if data.is_empty() => Ok(Self::State),
            AdsCommand::Read => match words(data) {
                Some(([group, offset, len], [])) => Ok(Self::Read { group, offset, len }),
                _ => Err(AdsCode::BAD_SIZE),
            },
            AdsCommand::Write => match words(data) {
                Some(([group, offset, len], data)) if fits(len, data) => {
                    Ok(Self::Write { group, offset, data })
                }
                _ => Err(AdsCode::BAD_SIZE),
            },
            AdsCommand::ReadWrite => match words(data) {
                Some(([group, offset, len, written], data)) if fits(written, data) => {
                    Ok(Self::ReadWrite { group, offset, len, data })
                }
                _ => Err(AdsCode::BAD_SIZE),
            },
            AdsCommand::ReadDeviceInfo | AdsCommand::ReadState => Err(AdsCode::BAD_SIZE),
            AdsCommand::WriteControl
            | AdsCommand::AddNotification
            | AdsCommand::DeleteNotification
            | AdsCommand::Notification => Ok(Self::Other(command)),
        }
    }

    /// The number of its command and the data that ask it.
    #[must_use]
    pub fn to_bytes(&self) -> (u16, Vec<u8>) {
        let of = |words: &[u32], data: &[u8]| {
            let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            bytes.extend_from_slice(data);
            bytes
        };
        let (command, bytes) = match *self {
            Self::DeviceInfo => (AdsCommand::ReadDeviceInfo, Vec::new()),
            Self::State => (AdsCommand::ReadState, Vec::new()),
            Self::Read { group, offset, len } => (AdsCommand::Read, of(&[group, offset, len], &[])),
            Self::Write { group, offset, data } => {
                (AdsCommand::Write, of(&[group, offset, data.len() as u32], data))
            }
            Self::ReadWrite { group, offset, len, data } => {
                (AdsCommand::ReadWrite, of(&[group, offset, len, data.len() as u32], data))
            }
            Self::Other(command) => (command, Vec::new()),
        };
        (command.number(), bytes)
    }
}

fn fits(len: u32, data: &[u8]) -> bool {
    usize::try_from(len) == Ok(data.len())
}

/// The words at the beginning, and what is behind them.
fn words<const N: usize>(mut data: &[u8]) -> Option<([u32; N], &[u8])> {
    let mut words = [0; N];
    for word in &mut words {
        let (bytes, rest) = data.split_first_chunk()?;
        *word = u32::from_le_bytes(*bytes);
        data = rest;
    }
    Some((words, data))
}

/// Answer of a device.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum AdsAnswer {
    /// Name and version.
    DeviceInfo {
        /// Major version.
        major: u8,
        /// Minor version.
        minor: u8,
        /// Build.
        build: u16,
        /// The name, of which 16 bytes are told.
        name: String,
    },
    /// State of the device, as ADS has it, and one of its own.
    State {
        /// State as ADS numbers it: 5 is RUN.
        ads: u16,
        /// State of the device.
        device: u16,
    },
    /// Bytes that were read.
    Read(Vec<u8>),
    /// It was done.
    Done,
    /// It was refused.
    Refused(AdsCode),
}

impl AdsAnswer {
    /// State of ADS: the device is being initialised.
    pub const INIT: u16 = 3;
    /// State of ADS: the device runs.
    pub const RUN: u16 = 5;

    /// The result that it begins with.
    #[must_use]
    pub const fn result(&self) -> AdsCode {
        match self {
            Self::Refused(code) => *code,
            Self::DeviceInfo { .. } | Self::State { .. } | Self::Read(_) | Self::Done => {
                AdsCode::OK
            }
        }
    }

    /// The answer to a command, from its data.
    ///
    /// # Errors
    /// [`AdsAnswerError`] when they are shorter or longer than an answer to this command is.
    pub fn parse(command: AdsCommand, data: &[u8]) -> Result<Self, AdsAnswerError> {
        let len = data.len();
        let wrong = |expected| AdsAnswerError { command, expected, len };
        let (result, rest) = words::<1>(data).ok_or_else(|| wrong("the result, 4 bytes"))?;
        let code = AdsCode(result[0]);
        if code != AdsCode::OK {
            return Ok(Self::Refused(code));
        }
        match (command, rest) {
            (AdsCommand::ReadDeviceInfo, [major, minor, low, high, name @ ..])
                if name.len() == 16 =>
            {
                let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
                Ok(Self::DeviceInfo {
                    major: *major,
                    minor: *minor,
                    build: u16::from_le_bytes([*low, *high]),
                    name: String::from_utf8_lossy(name).into_owned(),
                })
            }
            (AdsCommand::ReadDeviceInfo, _) => Err(wrong("the result, version and name, 24 bytes")),
            (AdsCommand::ReadState, [a, b, c, d]) => Ok(Self::State {
                ads: u16::from_le_bytes([*a, *b]),
                device: u16::from_le_bytes([*c, *d]),
            }),
            (AdsCommand::ReadState, _) => Err(wrong("the result and two states, 8 bytes")),
            (AdsCommand::Read | AdsCommand::ReadWrite | AdsCommand::AddNotification, rest) => {
                match words(rest) {
                    // The answer to a notification has a handle in place of a length.
                    Some(([_], [])) if command == AdsCommand::AddNotification => {
                        Ok(Self::Read(rest.to_vec()))
                    }
                    Some(([len], read))
                        if command != AdsCommand::AddNotification && fits(len, read) =>
                    {
                        Ok(Self::Read(read.to_vec()))
                    }
                    _ => Err(wrong("the result, a length and as many bytes")),
                }
            }
            (
                AdsCommand::Write
                | AdsCommand::WriteControl
                | AdsCommand::DeleteNotification
                | AdsCommand::Notification,
                [],
            ) => Ok(Self::Done),
            (
                AdsCommand::Write
                | AdsCommand::WriteControl
                | AdsCommand::DeleteNotification
                | AdsCommand::Notification,
                _,
            ) => Err(wrong("the result, 4 bytes")),
        }
    }

    /// The data that answer a request. One that is refused has what others have, all 0 or empty.
    #[must_use]
    pub fn to_bytes(&self, command: u16) -> Vec<u8> {
        let mut bytes = self.result().0.to_le_bytes().to_vec();
        match self {
            Self::DeviceInfo { major, minor, build, name } => {
                bytes.extend_from_slice(&[*major, *minor]);
                bytes.extend_from_slice(&build.to_le_bytes());
                let mut room = [0; 16];
                // The last byte ends the text.
                let taken = name.bytes().take(15);
                room.iter_mut().zip(taken).for_each(|(to, from)| *to = from);
                bytes.extend_from_slice(&room);
            }
            Self::State { ads, device } => {
                bytes.extend_from_slice(&ads.to_le_bytes());
                bytes.extend_from_slice(&device.to_le_bytes());
            }
            Self::Read(data) => {
                bytes.extend_from_slice(&(data.len() as u32).to_le_bytes());
                bytes.extend_from_slice(data);
            }
            Self::Done => {}
            Self::Refused(_) => {
                let more = match AdsCommand::from_number(command) {
                    Some(AdsCommand::ReadDeviceInfo) => 20,
                    Some(
                        AdsCommand::ReadState
                        | AdsCommand::Read
                        | AdsCommand::ReadWrite
                        | AdsCommand::AddNotification,
                    ) => 4,
                    Some(
                        AdsCommand::Write
                        | AdsCommand::WriteControl
                        | AdsCommand::DeleteNotification
                        | AdsCommand::Notification,
                    )
                    | None => 0,
                };
                bytes.resize(bytes.len() + more, 0);
            }
        }
        bytes
    }
}

/// Reason for which data are no answer to a command.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{len} bytes answer ADS command {}, expected {expected}", .command.number())]
pub struct AdsAnswerError {
    /// The command that was asked.
    pub command: AdsCommand,
    /// Its answer in words.
    pub expected: &'static str,
    /// Bytes there were.
    pub len: usize,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn requests_whose_length_does_not_match_are_refused() {
        let read = [6, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0];
        assert_eq!(
            AdsRequest::parse(2, &read),
            Ok(AdsRequest::Read { group: 6, offset: 0, len: 2 })
        );
        assert_eq!(AdsRequest::parse(2, &read[..11]), Err(AdsCode::BAD_SIZE));
        assert_eq!(AdsRequest::parse(2, &[&read[..], &[0]].concat()), Err(AdsCode::BAD_SIZE));
        // Two bytes are announced.
        let written = [&read[..], &[8, 0]].concat();
        let write = AdsRequest::Write { group: 6, offset: 0, data: &[8, 0] };
        assert_eq!(AdsRequest::parse(3, &written), Ok(write));
        assert_eq!(AdsRequest::parse(3, &written[..13]), Err(AdsCode::BAD_SIZE));
        assert_eq!(AdsRequest::parse(4, &[0]), Err(AdsCode::BAD_SIZE));
        for unknown in [0, 10, 0xFFFF] {
            assert_eq!(AdsRequest::parse(unknown, &read), Err(AdsCode::UNKNOWN_COMMAND));
        }
        let notified = AdsRequest::parse(6, &[0; 40]);
        assert_eq!(notified, Ok(AdsRequest::Other(AdsCommand::AddNotification)));
    }

    #[test]
    fn answers_have_the_bytes_of_their_command() {
        let name = "Linesman MainDevice".to_owned();
        let info = AdsAnswer::DeviceInfo { major: 1, minor: 2, build: 0x304, name };
        let bytes = info.to_bytes(1);
        assert_eq!(bytes[..8], [0, 0, 0, 0, 1, 2, 4, 3]);
        assert_eq!(&bytes[8..], b"Linesman MainDe\0");
        let state = AdsAnswer::State { ads: AdsAnswer::RUN, device: 8 };
        assert_eq!(state.to_bytes(4), [0, 0, 0, 0, 5, 0, 8, 0]);
        assert_eq!(AdsAnswer::Read(vec![7]).to_bytes(2), [0, 0, 0, 0, 1, 0, 0, 0, 7]);
        assert_eq!(AdsAnswer::Done.to_bytes(3), [0; 4]);
        let refused = AdsAnswer::Refused(AdsCode::BAD_INDEX_GROUP);
        for (command, len) in [(1, 24), (2, 8), (3, 4), (4, 8), (5, 4), (6, 8), (7, 4), (9, 8)] {
            let bytes = refused.to_bytes(command);
            assert_eq!((&bytes[..4], bytes.len()), (&[2, 7, 0, 0][..], len), "{command}");
        }
    }

    #[test]
    fn answers_are_read_as_they_are_written() {
        let info =
            AdsAnswer::DeviceInfo { major: 1, minor: 2, build: 3, name: "EL6692".to_owned() };
        let state = AdsAnswer::State { ads: AdsAnswer::RUN, device: 8 };
        let table = [
            (AdsCommand::ReadDeviceInfo, info),
            (AdsCommand::ReadState, state),
            (AdsCommand::Read, AdsAnswer::Read(vec![1, 2, 3])),
            (AdsCommand::ReadWrite, AdsAnswer::Read(Vec::new())),
            (AdsCommand::Write, AdsAnswer::Done),
            (AdsCommand::Read, AdsAnswer::Refused(AdsCode::NOT_FOUND)),
        ];
        for (command, answer) in table {
            let bytes = answer.to_bytes(command.number());
            assert_eq!(AdsAnswer::parse(command, &bytes), Ok(answer.clone()));
            let longer = [&bytes[..], &[0]].concat();
            let refused = matches!(answer, AdsAnswer::Refused(_));
            assert_eq!(AdsAnswer::parse(command, &longer).is_ok(), refused, "{answer:?}");
            for len in 0..4 {
                let error = AdsAnswer::parse(command, &bytes[..len]).unwrap_err();
                assert!(error.to_string().contains("expected the result"), "{error}");
            }
        }
        // Three bytes are announced, two are there.
        assert!(AdsAnswer::parse(AdsCommand::Read, &[0, 0, 0, 0, 3, 0, 0, 0, 1, 2]).is_err());
    }

    proptest! {
        #[test]
        fn requests_that_are_read_are_written_as_they_came(
            command in 0_u16..12,
            bytes in proptest::collection::vec(any::<u8>(), 0..40),
            len in 0_u32..40,
        ) {
            let mut likely = bytes.clone();
            for at in [8, 12] {
                if let Some(room) = likely.get_mut(at..at + 4) {
                    room.copy_from_slice(&len.to_le_bytes());
                }
            }
            for bytes in [bytes, likely] {
                match AdsRequest::parse(command, &bytes) {
                    // Their data are not looked at.
                    Ok(AdsRequest::Other(other)) => prop_assert_eq!(other.number(), command),
                    Ok(request) => prop_assert_eq!(request.to_bytes(), (command, bytes)),
                    Err(code) => prop_assert!(
                        [AdsCode::UNKNOWN_COMMAND, AdsCode::BAD_SIZE].contains(&code)
                    ),
                }
            }
        }
    }
}
