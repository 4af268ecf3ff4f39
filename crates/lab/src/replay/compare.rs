//! Two answers to the same datagram, field by field.
//!
//! Working counters must agree always, process data always. Data of registers must agree but for
//! fields that tell a time or count something. A mailbox is compared as far as its header says that it
//! is message; behind it lies what earlier messages left, and in its last byte what the device wrote
//! there to hand the mailbox over (ETG.1000.4, mailbox: full once its last byte was written).

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::mailbox::{Header, MailboxType};
use linesman_proto::register;

use super::recording::Datagram;

/// Why a field is not compared.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Class {
    /// It tells a time.
    Time,
    /// It counts what happened on the real line.
    Counter,
    /// It lies behind the end of a mailbox message.
    BehindMessage,
    /// It is the last byte of a mailbox whose message ends before: a device writes it, whatever is in
    /// it, so that the controller takes the mailbox for full.
    ClosingByte,
    /// It is a byte of an SDO response that carries nothing.
    Unused,
}

impl Class {
    /// For people and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Counter => "counter",
            Self::BehindMessage => "behind the message",
            Self::ClosingByte => "closing byte of a mailbox",
            Self::Unused => "unused byte of an SDO response",
        }
    }
}

/// Receive times, system time, its difference, speed difference, next SYNC, latches, event times.
const TIMES: &[std::ops::Range<u16>] = &[
    0x0900..0x0920,
    0x092C..0x0930,
    0x0932..0x0934,
    0x0990..0x09A0,
    0x09B0..0x09D0,
    0x09F0..0x0A00,
];
/// Error and watchdog counters.
const COUNTERS: &[std::ops::Range<u16>] = &[0x0300..0x0328, 0x0442..0x0445];

/// The class of a register byte that is not compared.
#[must_use]
pub fn class(address: u16) -> Option<Class> {
    let among = |list: &[std::ops::Range<u16>]| list.iter().any(|range| range.contains(&address));
    if among(TIMES) {
        Some(Class::Time)
    } else if among(COUNTERS) {
        Some(Class::Counter)
    } else {
        None
    }
}

/// What came of comparing two datagrams.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// They agree in everything.
    Equal,
    /// They agree but for fields that are not compared: the first of them, and its class.
    EqualBut(Class, RegisterAddress),
    /// They differ.
    Differs(Difference),
}

/// In what two datagrams differ.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Difference {
    /// In which field.
    pub what: What,
    /// As it was recorded.
    pub expected: String,
    /// As the segment gave it.
    pub received: String,
}

/// A field of a datagram.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum What {
    /// The working counter.
    WorkingCounter,
    /// Data, from this register or memory address on.
    Data(RegisterAddress),
    /// Process data, from this byte on.
    ProcessData(usize),
    /// The position behind all devices.
    Position,
    /// The event field.
    Events,
    /// The datagram did not come back.
    Missing,
}

/// Compares the recorded datagram with ours. Where it fetches a mailbox, `mailbox` is the length of
/// that, in bytes.
#[must_use]
pub fn compare(recorded: &Datagram<'_>, ours: &Datagram<'_>, mailbox: Option<u16>) -> Outcome {
    let differs = |what, expected: String, received: String| {
        Outcome::Differs(Difference { what, expected, received })
    };
    if recorded.wkc != ours.wkc {
        let (expected, received) = (recorded.wkc.to_string(), ours.wkc.to_string());
        return differs(What::WorkingCounter, expected, received);
    }
    let addressing = recorded.command.map(Command::addressing);
    if recorded.adp != ours.adp && addressing != Some(Addressing::Logical) {
        let hex = |adp: u16| format!("0x{adp:04X}");
        return differs(What::Position, hex(recorded.adp), hex(ours.adp));
    }
    let is_logical = addressing == Some(Addressing::Logical);
    let message_end = mailbox.map_or(usize::MAX, |_| message_len(recorded.data));
    let closing = mailbox.map(|len| usize::from(len.saturating_sub(1)));
    let unused = mailbox.map_or(0..0, |_| unused(recorded.data));
    let mut but = None;
    let bytes = recorded.data.iter().zip(ours.data).enumerate();
    for (offset, _) in bytes.filter(|(_, (recorded, ours))| recorded != ours) {
        let address = recorded.ado.0.wrapping_add(offset as u16);
        let skipped = match is_logical {
            true => None,
            false if offset >= message_end && closing == Some(offset) => Some(Class::ClosingByte),
            false if offset >= message_end => Some(Class::BehindMessage),
            false if unused.contains(&offset) => Some(Class::Unused),
            false => class(address),
        };
        match skipped {
            Some(skipped) => but = but.or(Some((skipped, address))),
            None => {
                let what = match is_logical {
                    true => What::ProcessData(offset),
                    false => What::Data(RegisterAddress(address)),
                };
                let expected = hex(&recorded.data[offset..]);
                return differs(what, expected, hex(&ours.data[offset..]));
            }
        }
    }
    if recorded.irq != ours.irq {
        let hex = |irq: u16| format!("0x{irq:04X}");
        return differs(What::Events, hex(recorded.irq), hex(ours.irq));
    }
    match but {
        Some((class, address)) => Outcome::EqualBut(class, RegisterAddress(address)),
        None => Outcome::Equal,
    }
}

/// Bytes of a mailbox that belong to its message.
fn message_len(buffer: &[u8]) -> usize {
    /// Length of the header.
    const HEADER: usize = 6;
    Header::parse(buffer).map_or(usize::MAX, |header| HEADER + usize::from(header.length))
}

/// Bytes of an SDO response that carry nothing (ETG.1000.6 5.6.2): the last four of the answer to a
/// download, what an expedited upload leaves of its four, what a short segment leaves of its seven.
fn unused(buffer: &[u8]) -> std::ops::Range<usize> {
    const COMMAND: usize = 8;
    const RESPONSE: u8 = 3;
    let is_coe = Header::parse(buffer).is_ok_and(|header| header.kind == MailboxType::Coe);
    let is_response = buffer.get(7).is_some_and(|byte| byte >> 4 == RESPONSE);
    let Some(command) = buffer.get(COMMAND).filter(|_| is_coe && is_response) else { return 0..0 };
    let end = 16;
    match command >> 5 {
        // Upload segment, seven bytes or more.
        0 => end - usize::from(command >> 1 & 0b111)..end,
        1 => COMMAND + 1..end,
        2 if command & 0b10 != 0 && command & 1 != 0 => end - usize::from(command >> 2 & 0b11)..end,
        3 => 12..end,
        _ => 0..0,
    }
}

/// The first bytes, as people read them.
fn hex(data: &[u8]) -> String {
    const SHOWN: usize = 16;
    let shown: Vec<String> = data.iter().take(SHOWN).map(|byte| format!("{byte:02X}")).collect();
    let more = if data.len() > SHOWN { " ..." } else { "" };
    format!("{}{more}", shown.join(" "))
}

/// What people call the register at an address.
#[must_use]
pub fn register_name(address: RegisterAddress) -> String {
    register::describe(address).map_or_else(
        || if address.0 >= 0x1000 { "memory".to_owned() } else { "unknown register".to_owned() },
        |description| description.title(),
    )
}
