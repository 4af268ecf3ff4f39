//! The six bytes in front of every mailbox message, and the message as a whole.
//!
//! Reference: ETG.1000.4 (mailbox); ETG.8200 uses the same header. Layout: length (u16, of what
//! follows the header), address (u16), channel and priority (u8), type and counter (u8).

use std::fmt;

use crate::address::StationAddress;

/// Length of the header in bytes.
pub const HEADER_LEN: usize = 6;

/// The header of a mailbox message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Header {
    /// Length of what follows the header, in bytes.
    pub length: u16,
    /// Station the message comes from; 0 is the MainDevice. Through a gateway: station it is meant
    /// for.
    pub address: StationAddress,
    /// Channel, 0..=63; reserved, 0.
    pub channel: u8,
    /// Priority, 0 (lowest) ..=3.
    pub priority: u8,
    /// Protocol of what follows.
    pub kind: MailboxType,
    /// Counter against repetition.
    pub counter: Counter,
}

impl Header {
    /// A header of a message of the MainDevice, or of a SubDevice's answer to it: address, channel
    /// and priority 0.
    #[must_use]
    pub const fn new(kind: MailboxType, counter: Counter, length: u16) -> Self {
        let address = StationAddress(0);
        Self { length, address, channel: 0, priority: 0, kind, counter }
    }

    /// The header in six bytes.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; HEADER_LEN]) -> Self {
        let [len_low, len_high, address_low, address_high, channel, kind] = bytes;
        Self {
            length: u16::from_le_bytes([len_low, len_high]),
            address: StationAddress(u16::from_le_bytes([address_low, address_high])),
            channel: channel & 0x3F,
            priority: channel >> 6,
            kind: MailboxType::from_code(kind & 0x0F),
            counter: Counter((kind >> 4) & 0x07),
        }
    }

    /// The six bytes. Bits beyond channel and priority are cut off.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; HEADER_LEN] {
        let [len_low, len_high] = self.length.to_le_bytes();
        let [address_low, address_high] = self.address.value().to_le_bytes();
        let channel = self.channel & 0x3F | (self.priority & 0x03) << 6;
        let kind = self.kind.code() | self.counter.0 << 4;
        [len_low, len_high, address_low, address_high, channel, kind]
    }

    /// The header at the start of a mailbox buffer.
    ///
    /// # Errors
    /// [`MailboxError::HeaderCutOff`] when the buffer is shorter than a header.
    pub fn parse(buffer: &[u8]) -> Result<Self, MailboxError> {
        match buffer.first_chunk() {
            Some(bytes) => Ok(Self::from_bytes(*bytes)),
            None => Err(MailboxError::HeaderCutOff { len: buffer.len() }),
        }
    }

    /// Writes the header to the start of a buffer and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when it does not fit; the buffer is untouched then.
    pub fn write(self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        BufferTooSmall::check(buffer, HEADER_LEN)?.copy_from_slice(&self.to_bytes());
        Ok(HEADER_LEN)
    }

    /// Writes a whole message: `body` fills what follows the header and tells its length, which
    /// goes into the header in place of [`Header::length`]. Gives the length of the message.
    ///
    /// ```
    /// # use linesman_proto::mailbox::coe::{Message, ObjectAddress, sdo};
    /// # use linesman_proto::mailbox::{Counter, Header, MailboxType};
    /// let object = ObjectAddress::new(0x1018, 1);
    /// let upload = sdo::Request::Upload { object, complete: false };
    /// let mut buffer = [0; 128];
    /// let len = Header::new(MailboxType::Coe, Counter::FIRST, 0)
    ///     .write_message(&mut buffer, |body| Message::SdoRequest(upload).write(body))?;
    /// assert_eq!(buffer[..len], [10, 0, 0, 0, 0, 0x13, 0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    /// # Ok::<(), linesman_proto::mailbox::BufferTooSmall>(())
    /// ```
    ///
    /// # Errors
    /// [`BufferTooSmall`] when header or body do not fit.
    pub fn write_message(
        mut self,
        buffer: &mut [u8],
        body: impl FnOnce(&mut [u8]) -> Result<usize, BufferTooSmall>,
    ) -> Result<usize, BufferTooSmall> {
        let available = buffer.len();
        let Some((head, behind)) = buffer.split_at_mut_checked(HEADER_LEN) else {
            return Err(BufferTooSmall { needed: HEADER_LEN, available });
        };
        let len = body(behind)?;
        let too_long = |_| BufferTooSmall { needed: len, available: usize::from(u16::MAX) };
        self.length = u16::try_from(len).map_err(too_long)?;
        head.copy_from_slice(&self.to_bytes());
        Ok(HEADER_LEN + len)
    }
}

/// Protocol of a message.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum MailboxType {
    /// 0: error reply, see [`ErrorReply`](super::ErrorReply).
    Error,
    /// 1: ADS over EtherCAT.
    Aoe,
    /// 2: Ethernet over EtherCAT.
    Eoe,
    /// 3: CAN application protocol over EtherCAT.
    Coe,
    /// 4: file access over EtherCAT.
    Foe,
    /// 5: servo drive profile over EtherCAT.
    Soe,
    /// 15: vendor-specific protocol over EtherCAT.
    Voe,
    /// A reserved code, 6..=14.
    Reserved(u8),
}

impl MailboxType {
    /// The type with this code, of which four bits count.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code & 0x0F {
            0 => Self::Error,
            1 => Self::Aoe,
            2 => Self::Eoe,
            3 => Self::Coe,
            4 => Self::Foe,
            5 => Self::Soe,
            15 => Self::Voe,
            other => Self::Reserved(other),
        }
    }

    /// The code, 0..=15.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Error => 0,
            Self::Aoe => 1,
            Self::Eoe => 2,
            Self::Coe => 3,
            Self::Foe => 4,
            Self::Soe => 5,
            Self::Voe => 15,
            Self::Reserved(code) => code & 0x0F,
        }
    }

    /// Its short name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Error => "ERR",
            Self::Aoe => "AoE",
            Self::Eoe => "EoE",
            Self::Coe => "CoE",
            Self::Foe => "FoE",
            Self::Soe => "SoE",
            Self::Voe => "VoE",
            Self::Reserved(_) => "reserved",
        }
    }
}

impl fmt::Display for MailboxType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Counter of messages in one direction: 1..=7, then 1 again; 0 means that the sender does not
/// count. A receiver takes a message with the counter of the one before for a repetition.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Counter(u8);

impl Counter {
    /// The sender does not count.
    pub const NONE: Self = Self(0);
    /// The first of a sender that counts.
    pub const FIRST: Self = Self(1);

    /// A counter of this value, 0..=7.
    #[must_use]
    pub const fn new(value: u8) -> Option<Self> {
        if value <= 7 { Some(Self(value)) } else { None }
    }

    /// 0..=7.
    #[must_use]
    pub const fn value(self) -> u8 {
        self.0
    }

    /// The counter of the next message: 7 is followed by 1, as 0 means something else.
    #[must_use]
    pub const fn next(self) -> Self {
        Self(if self.0 >= 7 { 1 } else { self.0 + 1 })
    }

    /// Whether a message with this counter repeats the one before, whose counter was `last`.
    #[must_use]
    pub const fn repeats(self, last: Self) -> bool {
        self.0 != 0 && self.0 == last.0
    }

    /// True if one message is missing between the one with the counter `last` and this one.
    #[must_use]
    pub const fn skips(self, last: Self) -> bool {
        self.0 != 0 && last.0 != 0 && self.0 == last.next().next().0
    }
}

/// A message in its buffer.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Message<'a> {
    /// The header; its length is that of `data`.
    pub header: Header,
    /// What follows the header.
    pub data: &'a [u8],
}

impl<'a> Message<'a> {
    /// The message at the start of a mailbox buffer, which is usually longer.
    ///
    /// # Errors
    /// [`MailboxError`] when header or data are cut off.
    pub fn parse(buffer: &'a [u8]) -> Result<Self, MailboxError> {
        let header = Header::parse(buffer)?;
        let behind = &buffer[HEADER_LEN..];
        match behind.get(..usize::from(header.length)) {
            Some(data) => Ok(Self { header, data }),
            None => Err(MailboxError::DataCutOff { announced: header.length, left: behind.len() }),
        }
    }
}

/// Why a buffer holds no mailbox message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MailboxError {
    /// It ends within the header.
    #[error("mailbox buffer of {len} bytes ends within the header of 6 bytes")]
    HeaderCutOff {
        /// Bytes there were.
        len: usize,
    },
    /// It ends within the data.
    #[error("mailbox header announces {announced} bytes of data, {left} are left")]
    DataCutOff {
        /// Length the header announces.
        announced: u16,
        /// Bytes behind the header.
        left: usize,
    },
}

/// A message does not fit into the buffer it is to be written to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("mailbox message of {needed} bytes does not fit into {available} bytes")]
pub struct BufferTooSmall {
    /// Bytes the message takes.
    pub needed: usize,
    /// Bytes there are.
    pub available: usize,
}

impl BufferTooSmall {
    /// The first `needed` bytes of a buffer.
    pub(crate) fn check(buffer: &mut [u8], needed: usize) -> Result<&mut [u8], Self> {
        let available = buffer.len();
        buffer.get_mut(..needed).ok_or(Self { needed, available })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn counters_wrap_from_seven_to_one() {
        let mut counter = Counter::NONE;
        let mut seen = Vec::new();
        for _ in 0..9 {
            counter = counter.next();
            seen.push(counter.value());
        }
        assert_eq!(seen, [1, 2, 3, 4, 5, 6, 7, 1, 2]);
        assert_eq!(Counter::new(8), None);
    }

    #[test]
    fn only_counted_messages_can_be_repetitions() {
        let one = Counter::FIRST;
        assert!(one.repeats(one));
        assert!(!one.next().repeats(one));
        assert!(!Counter::NONE.repeats(Counter::NONE));
    }

    #[test]
    fn a_request_through_a_gateway_is_read() {
        // To station 1001: CoE, counter 2, ten bytes of SDO request.
        let buffer =
            [0x0A, 0x00, 0xE9, 0x03, 0x00, 0x23, 0x00, 0x20, 0x41, 0x80, 0xF9, 0x02, 0, 0, 0, 0];
        let message = Message::parse(&buffer).unwrap();
        assert_eq!(message.header.address, StationAddress(1001));
        assert_eq!(message.header.kind, MailboxType::Coe);
        assert_eq!(message.header.counter.value(), 2);
        assert_eq!(message.data, &buffer[6..]);
        let mut written = [0; 6];
        assert_eq!(message.header.write(&mut written), Ok(6));
        assert_eq!(written, buffer[..6]);
    }

    #[test]
    fn cut_off_message_is_an_error() {
        assert_eq!(Message::parse(&[0; 5]), Err(MailboxError::HeaderCutOff { len: 5 }));
        assert_eq!(
            Message::parse(&[4, 0, 0, 0, 0, 3, 1, 2, 3]),
            Err(MailboxError::DataCutOff { announced: 4, left: 3 })
        );
        let header = Header::new(MailboxType::Coe, Counter::FIRST, 0);
        let needed = BufferTooSmall { needed: 6, available: 5 };
        assert_eq!(header.write(&mut [0; 5]), Err(needed));
    }

    proptest! {
        #[test]
        fn headers_go_back_as_they_came(mut bytes: [u8; 6]) {
            // The last bit is reserved.
            bytes[5] &= 0x7F;
            prop_assert_eq!(Header::from_bytes(bytes).to_bytes(), bytes);
        }
    }
}
