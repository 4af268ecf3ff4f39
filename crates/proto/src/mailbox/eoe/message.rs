//! The messages of EoE.

use std::fmt;

use crate::mailbox::header::BufferTooSmall;

/// Bytes in front of the data of a fragment, or of the parameters.
pub const EOE_HEADER_LEN: usize = 4;
/// Lengths and places of fragments are told in units of so many bytes.
const UNIT: usize = 32;
/// The largest number of six bits.
const SIX_BITS: u16 = 0x3F;

const FRAGMENT: u8 = 0;
const TIME_STAMP: u8 = 1;
const SET_IP_REQUEST: u8 = 2;
const SET_IP_RESPONSE: u8 = 3;
const SET_FILTER_REQUEST: u8 = 4;
const SET_FILTER_RESPONSE: u8 = 5;
const GET_IP_REQUEST: u8 = 6;
const GET_IP_RESPONSE: u8 = 7;
const GET_FILTER_REQUEST: u8 = 8;
const GET_FILTER_RESPONSE: u8 = 9;

const LAST: u16 = 1 << 8;
const TIME_APPENDED: u16 = 1 << 9;
const TIME_REQUESTED: u16 = 1 << 10;

/// How a request about a port's settings ended.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct EoeResult(pub u16);

impl EoeResult {
    /// Done.
    pub const SUCCESS: Self = Self(0x0000);
    /// It failed for a reason that has no code.
    pub const UNSPECIFIED: Self = Self(0x0001);
    /// There is no such message.
    pub const UNSUPPORTED_TYPE: Self = Self(0x0002);
    /// The port has no IP settings.
    pub const NO_IP: Self = Self(0x0201);
    /// It does not fetch its address by DHCP.
    pub const NO_DHCP: Self = Self(0x0202);
    /// It has no filter of addresses.
    pub const NO_FILTER: Self = Self(0x0401);

    /// What it means.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::SUCCESS => "success",
            Self::UNSPECIFIED => "unspecified error",
            Self::UNSUPPORTED_TYPE => "unsupported frame type",
            Self::NO_IP => "IP settings not supported",
            Self::NO_DHCP => "DHCP not supported",
            Self::NO_FILTER => "address filter not supported",
            Self(_) => "unknown EoE result",
        }
    }
}

impl fmt::Display for EoeResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} {}", self.0, self.text())
    }
}

/// Where a fragment belongs.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum FragmentPlace {
    /// The first: how long the whole frame is, in units of 32 bytes, rounded up.
    First {
        /// Units of 32 bytes.
        total_units: u8,
    },
    /// A further one, and where it begins.
    Further {
        /// From 1 to 63.
        number: u8,
        /// Units of 32 bytes.
        offset_units: u8,
    },
}

/// A piece of an Ethernet frame, which is sent without its check sequence.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Fragment<'a> {
    /// The port of the device that it is for or from, 0..=15.
    pub port: u8,
    /// It is the last of its frame.
    pub last: bool,
    /// Four bytes with a time stamp follow the data, in the last fragment.
    pub time_appended: bool,
    /// The sender wants to know when the frame was sent.
    pub time_requested: bool,
    /// Where it belongs.
    pub place: FragmentPlace,
    /// Number of the frame, 0..=15.
    pub frame: u8,
    /// The piece, with the time stamp if there is one.
    pub data: &'a [u8],
}

impl Fragment<'_> {
    /// Where its data begin in the frame, in bytes.
    #[must_use]
    pub fn offset(&self) -> usize {
        match self.place {
            FragmentPlace::First { .. } => 0,
            FragmentPlace::Further { offset_units, .. } => usize::from(offset_units) * UNIT,
        }
    }
}

/// An EoE message: what follows the mailbox header of a message of type EoE.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Message<'a> {
    /// 0: a piece of a frame.
    Fragment(Fragment<'a>),
    /// 1: when a frame was sent.
    TimeStamp {
        /// The port.
        port: u8,
        /// Number of the frame, 0..=15.
        frame: u8,
        /// The time.
        time: u32,
    },
    /// 2, 4, 6, 8: a request about the settings of a port.
    Request {
        /// The port.
        port: u8,
        /// Which settings, and what is to be done with them.
        about: Setting,
        /// What is set; nothing for a request to read.
        parameters: &'a [u8],
    },
    /// 3, 5, 7, 9: its answer.
    Response {
        /// The port.
        port: u8,
        /// To which request.
        about: Setting,
        /// How it ended.
        result: EoeResult,
        /// What was asked for; nothing for a request to set.
        parameters: &'a [u8],
    },
}

/// Settings of a port, and what is done with them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Setting {
    /// Its addresses are set.
    SetIp,
    /// Its filter of addresses is set.
    SetFilter,
    /// Its addresses are read.
    GetIp,
    /// Its filter is read.
    GetFilter,
}

/// Bytes that are no EoE message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum EoeError {
    /// There are fewer bytes than the message needs.
    #[error("EoE message of {len} bytes, expected at least {needed}")]
    CutOff {
        /// How many there are.
        len: usize,
        /// How many it needs.
        needed: usize,
    },
    /// Its type is reserved.
    #[error("EoE message of type {0}, expected 0 to 9")]
    UnknownType(u8),
}

fn unit(value: u16) -> u8 {
    (value & SIX_BITS) as u8
}

impl<'a> Message<'a> {
    /// The message in these bytes.
    ///
    /// # Errors
    /// [`EoeError`].
    pub fn parse(bytes: &'a [u8]) -> Result<Self, EoeError> {
        let cut_off = |needed| EoeError::CutOff { len: bytes.len(), needed };
        let (header, rest) = bytes.split_first_chunk().ok_or_else(|| cut_off(EOE_HEADER_LEN))?;
        let [one, two, three, four] = *header;
        let flags = u16::from_le_bytes([one, two]);
        let word = u16::from_le_bytes([three, four]);
        let (kind, port) = (one & 0x0F, one >> 4);
        let request = |about| Self::Request { port, about, parameters: rest };
        let response =
            |about| Self::Response { port, about, result: EoeResult(word), parameters: rest };
        Ok(match kind {
            FRAGMENT => {
                let (number, units) = (unit(word), unit(word >> 6));
                let place = match number {
                    0 => FragmentPlace::First { total_units: units },
                    number => FragmentPlace::Further { number, offset_units: units },
                };
                Self::Fragment(Fragment {
                    port,
                    last: flags & LAST != 0,
                    time_appended: flags & TIME_APPENDED != 0,
                    time_requested: flags & TIME_REQUESTED != 0,
                    place,
                    frame: (word >> 12) as u8,
                    data: rest,
                })
            }
            TIME_STAMP => {
                let time = rest.first_chunk().ok_or_else(|| cut_off(EOE_HEADER_LEN + 4))?;
                let frame = (word >> 12) as u8;
                Self::TimeStamp { port, frame, time: u32::from_le_bytes(*time) }
            }
            SET_IP_REQUEST => request(Setting::SetIp),
            SET_IP_RESPONSE => response(Setting::SetIp),
            SET_FILTER_REQUEST => request(Setting::SetFilter),
            SET_FILTER_RESPONSE => response(Setting::SetFilter),
            GET_IP_REQUEST => request(Setting::GetIp),
            GET_IP_RESPONSE => response(Setting::GetIp),
            GET_FILTER_REQUEST => request(Setting::GetFilter),
            GET_FILTER_RESPONSE => response(Setting::GetFilter),
            other => return Err(EoeError::UnknownType(other)),
        })
    }

    /// Writes it to the start of a buffer and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when it does not fit; the buffer is untouched then.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let stamp;
        let (kind, port, flags, word, data): (u8, u8, u16, u16, &[u8]) = match *self {
            Self::Fragment(fragment) => {
                let (number, units) = match fragment.place {
                    FragmentPlace::First { total_units } => (0, total_units),
                    FragmentPlace::Further { number, offset_units } => (number, offset_units),
                };
                let word = u16::from(number) & SIX_BITS
                    | (u16::from(units) & SIX_BITS) << 6
                    | u16::from(fragment.frame) << 12;
                let flag = |on, bit| if on { bit } else { 0 };
                let flags = flag(fragment.last, LAST)
                    | flag(fragment.time_appended, TIME_APPENDED)
                    | flag(fragment.time_requested, TIME_REQUESTED);
                (FRAGMENT, fragment.port, flags, word, fragment.data)
            }
            Self::TimeStamp { port, frame, time } => {
                stamp = time.to_le_bytes();
                (TIME_STAMP, port, 0, u16::from(frame) << 12, &stamp)
            }
            Self::Request { port, about, parameters } => {
                let kind = match about {
                    Setting::SetIp => SET_IP_REQUEST,
                    Setting::SetFilter => SET_FILTER_REQUEST,
                    Setting::GetIp => GET_IP_REQUEST,
                    Setting::GetFilter => GET_FILTER_REQUEST,
                };
                (kind, port, LAST, 0, parameters)
            }
            Self::Response { port, about, result, parameters } => {
                let kind = match about {
                    Setting::SetIp => SET_IP_RESPONSE,
                    Setting::SetFilter => SET_FILTER_RESPONSE,
                    Setting::GetIp => GET_IP_RESPONSE,
                    Setting::GetFilter => GET_FILTER_RESPONSE,
                };
                (kind, port, LAST, result.0, parameters)
            }
        };
        let len = EOE_HEADER_LEN + data.len();
        let buffer = BufferTooSmall::check(buffer, len)?;
        let first = u16::from(kind) | u16::from(port & 0x0F) << 4 | flags;
        buffer[..2].copy_from_slice(&first.to_le_bytes());
        buffer[2..EOE_HEADER_LEN].copy_from_slice(&word.to_le_bytes());
        buffer[EOE_HEADER_LEN..].copy_from_slice(data);
        Ok(len)
    }
}

/// The pieces of a frame for mailboxes with room for `room` bytes behind their header, in order.
pub fn fragments(
    frame: &[u8],
    port: u8,
    number: u8,
    room: usize,
) -> impl Iterator<Item = Fragment<'_>> {
    // All pieces but the last are whole units.
    let piece = (room.saturating_sub(EOE_HEADER_LEN) / UNIT * UNIT).max(UNIT);
    let total_units = frame.len().div_ceil(UNIT).min(usize::from(SIX_BITS)) as u8;
    let pieces = frame.len().div_ceil(piece);
    frame.chunks(piece).zip(0u8..).map(move |(data, at)| Fragment {
        port,
        last: usize::from(at) + 1 == pieces,
        time_appended: false,
        time_requested: false,
        place: match at {
            0 => FragmentPlace::First { total_units },
            at => FragmentPlace::Further {
                number: at,
                offset_units: (usize::from(at) * piece / UNIT) as u8,
            },
        },
        frame: number & 0x0F,
        data,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn headers_are_these_bytes() {
        let fragment = Fragment {
            port: 1,
            last: true,
            time_appended: false,
            time_requested: true,
            place: FragmentPlace::Further { number: 2, offset_units: 5 },
            frame: 9,
            data: &[0xAA],
        };
        let mut buffer = [0; 8];
        assert_eq!(Message::Fragment(fragment).write(&mut buffer), Ok(5));
        assert_eq!(buffer[..5], [0x10, 0x05, 0x42, 0x91, 0xAA]);
        assert_eq!(fragment.offset(), 160);
        let answer = Message::Response {
            port: 0,
            about: Setting::SetIp,
            result: EoeResult::NO_IP,
            parameters: &[],
        };
        assert_eq!(answer.write(&mut buffer), Ok(4));
        assert_eq!(buffer[..4], [0x03, 0x01, 0x01, 0x02]);
        assert_eq!(Message::parse(&[0x0A, 0, 0, 0]), Err(EoeError::UnknownType(10)));
        assert_eq!(Message::parse(&[0, 0]), Err(EoeError::CutOff { len: 2, needed: 4 }));
        assert_eq!(Message::parse(&[1, 0, 0, 0, 7]), Err(EoeError::CutOff { len: 5, needed: 8 }));
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_again(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Ok(message) = Message::parse(&bytes) {
                let mut buffer = [0; 128];
                let len = message.write(&mut buffer).unwrap();
                prop_assert_eq!(Message::parse(&buffer[..len]), Ok(message));
            }
        }

        #[test]
        fn the_pieces_of_a_frame_are_the_frame(
            frame in prop::collection::vec(any::<u8>(), 1..1_518), room in 36usize..1_486,
        ) {
            let mut all = Vec::new();
            let pieces: Vec<_> = fragments(&frame, 2, 7, room).collect();
            for (at, piece) in pieces.iter().enumerate() {
                prop_assert_eq!(piece.offset(), all.len());
                prop_assert_eq!(piece.last, at + 1 == pieces.len());
                prop_assert!(piece.data.len() + EOE_HEADER_LEN <= room);
                all.extend_from_slice(piece.data);
            }
            prop_assert_eq!(all, frame);
        }
    }
}
