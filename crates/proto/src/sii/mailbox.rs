//! Mailbox in the fixed words: position, size, protocols.
//!
//! Reference: ETG.1000.6 §5.4, words 0x14..=0x1C. "Receive" and "send" are the SubDevice's view, as
//! in the specification: what it receives is what the MainDevice writes (SyncManager 0).

use crate::address::RegisterAddress;

/// One direction of a mailbox.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct MailboxArea {
    /// Where it begins in the controller's memory.
    pub offset: RegisterAddress,
    /// Its length in bytes; 0 means that there is none.
    pub size: u16,
}

/// Both directions of a mailbox, by default: SyncManager category and application may differ.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct MailboxPair {
    /// The SubDevice receives here, the MainDevice writes: "mailbox out", SyncManager 0.
    pub receive: MailboxArea,
    /// The SubDevice sends here, the MainDevice reads: "mailbox in", SyncManager 1.
    pub send: MailboxArea,
}

impl MailboxPair {
    /// The pair in four words of an image.
    #[must_use]
    pub const fn from_words(words: [u16; 4]) -> Self {
        let [receive_offset, receive_size, send_offset, send_size] = words;
        Self {
            receive: MailboxArea { offset: RegisterAddress(receive_offset), size: receive_size },
            send: MailboxArea { offset: RegisterAddress(send_offset), size: send_size },
        }
    }

    /// The four words of an image.
    #[must_use]
    pub const fn to_words(self) -> [u16; 4] {
        let Self { receive, send } = self;
        [receive.offset.value(), receive.size, send.offset.value(), send.size]
    }

    /// Whether there is a mailbox: both directions have a size.
    #[must_use]
    pub const fn is_present(self) -> bool {
        self.receive.size > 0 && self.send.size > 0
    }
}

/// Mailbox protocols a SubDevice says it speaks, word 0x1C.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Protocols(pub u16);

impl Protocols {
    /// ADS over EtherCAT.
    pub const AOE: u16 = 0x0001;
    /// Ethernet over EtherCAT.
    pub const EOE: u16 = 0x0002;
    /// CAN application protocol over EtherCAT.
    pub const COE: u16 = 0x0004;
    /// File access over EtherCAT.
    pub const FOE: u16 = 0x0008;
    /// Servo drive profile over EtherCAT.
    pub const SOE: u16 = 0x0010;
    /// Vendor-specific protocol over EtherCAT.
    pub const VOE: u16 = 0x0020;

    const NAMES: [(u16, &'static str); 6] = [
        (Self::AOE, "AoE"),
        (Self::EOE, "EoE"),
        (Self::COE, "CoE"),
        (Self::FOE, "FoE"),
        (Self::SOE, "SoE"),
        (Self::VOE, "VoE"),
    ];

    /// Whether all these bits are set.
    #[must_use]
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The bit of a protocol by its name, in small or capital letters.
    #[must_use]
    pub fn bit_of(name: &str) -> Option<u16> {
        let mut known = Self::NAMES.into_iter();
        known.find(|(_, known)| known.eq_ignore_ascii_case(name)).map(|(bit, _)| bit)
    }

    /// Names of the protocols that are spoken, in the order of their bits.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.has(*bit)).map(|(_, name)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn protocols_are_named_in_the_order_of_their_bits() {
        let names: Vec<&str> =
            Protocols(Protocols::COE | Protocols::FOE | 0x8000).names().collect();
        assert_eq!(names, ["CoE", "FoE"]);
        assert_eq!(Protocols(0x3F).names().count(), 6);
    }

    #[test]
    fn half_a_mailbox_is_none() {
        let pair = MailboxPair::from_words([0x1000, 0x80, 0x1080, 0]);
        assert!(!pair.is_present());
        assert_eq!(pair.to_words(), [0x1000, 0x80, 0x1080, 0]);
    }
}
