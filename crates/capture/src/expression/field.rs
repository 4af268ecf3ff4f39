//! Fields that an expression can name: those of Wireshark by its names, and ours.

use linesman_proto::ethernet::{MacAddress, destination, source};
use linesman_proto::mailbox::MailboxType;

use super::value::ValueKind;
use crate::row::{CaptureRow, DatagramRow, FrameWay, MailboxView};

/// A field of a frame, of a datagram in it, or of a mailbox message in a datagram.
#[derive(Debug)]
pub struct FilterField {
    /// The name in an expression.
    pub name: &'static str,
    /// Kind of its values.
    pub kind: ValueKind,
    /// Meaning in one sentence.
    pub meaning: &'static str,
    pub(super) source: FieldSource,
    pub(super) need: Need,
}

/// Source of a field's values.
#[derive(Debug)]
pub(super) enum FieldSource {
    /// One value of the frame.
    Frame(fn(&CaptureRow<'_>) -> Option<i128>),
    /// Both addresses of the frame.
    Addresses,
    /// One value of each datagram.
    Datagram(fn(&DatagramRow<'_>) -> Option<i128>),
    /// One value of each mailbox message.
    Mailbox(fn(&MailboxView<'_>) -> Option<i128>),
    /// Each register that a datagram covers.
    Registers,
    /// Each SubDevice that a datagram is for.
    SubDevices,
}

/// Knowledge that a field needs beside the frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Need {
    Nothing,
    Facts,
    Whole,
}

const fn of(
    name: &'static str,
    kind: ValueKind,
    meaning: &'static str,
    source: FieldSource,
) -> FilterField {
    FilterField { name, kind, meaning, source, need: Need::Nothing }
}

const fn frame(
    name: &'static str,
    kind: ValueKind,
    meaning: &'static str,
    value: fn(&CaptureRow<'_>) -> Option<i128>,
) -> FilterField {
    of(name, kind, meaning, FieldSource::Frame(value))
}

const fn datagram(
    name: &'static str,
    kind: ValueKind,
    meaning: &'static str,
    value: fn(&DatagramRow<'_>) -> Option<i128>,
) -> FilterField {
    of(name, kind, meaning, FieldSource::Datagram(value))
}

const fn mailbox(
    name: &'static str,
    kind: ValueKind,
    meaning: &'static str,
    value: fn(&MailboxView<'_>) -> Option<i128>,
) -> FilterField {
    of(name, kind, meaning, FieldSource::Mailbox(value))
}

impl FilterField {
    /// True if its values are known after the whole capture was read.
    #[must_use]
    pub const fn needs_whole(&self) -> bool {
        matches!(self.need, Need::Whole)
    }

    const fn needing(mut self, need: Need) -> Self {
        self.need = need;
        self
    }
}

use ValueKind::{
    Boolean, Command, Hex16, Hex32, Mac, Number8, Number16, Number32, Number64, Presence, Seconds,
};

/// All fields, in the order of the documentation.
pub static FIELDS: [FilterField; 60] = [
    // The frame.
    frame("frame", Presence, "Any frame.", |_| Some(1)),
    frame("frame.number", Number32, "Number of the frame in the capture, from 1.", |row| {
        Some(row.frame.number.into())
    }),
    frame("frame.len", Number32, "Length on the wire in bytes.", |row| {
        Some(row.frame.original_len.into())
    }),
    frame("frame.cap_len", Number32, "Bytes that were recorded.", |row| {
        Some(row.frame.captured_len.into())
    }),
    frame("frame.time_relative", Seconds, "Time since the start of the capture.", |row| {
        Some(row.frame.time.as_nanos().into())
    }),
    frame("frame.time_delta", Seconds, "Time since the frame before.", |row| {
        Some(row.frame.since_previous_ns)
    }),
    frame("frame.time_epoch", Seconds, "Time since 1970 (UTC).", |row| row.frame.date_ns),
    frame("frame.interface_id", Number32, "Interface of the capture, from 0.", |row| {
        Some(row.frame.interface.into())
    }),
    frame("eth.dst", Mac, "Destination address.", |row| address(destination(row.frame.bytes))),
    frame("eth.src", Mac, "Source address.", |row| address(source(row.frame.bytes))),
    of("eth.addr", Mac, "Destination or source address.", FieldSource::Addresses),
    frame("eth.type", Hex16, "EtherType behind the addresses.", |row| {
        row.wrapping().ethertype.map(i128::from)
    }),
    frame("vlan", Presence, "Frame with a VLAN tag.", |row| there(row.wrapping().vlan.is_some())),
    frame("vlan.id", Number16, "Identifier of the outermost VLAN tag.", |row| {
        row.wrapping().vlan.map(i128::from)
    }),
    frame("udp", Presence, "EtherCAT in UDP, port 34980.", |row| there(row.wrapping().is_udp)),
    frame("ecatf", Presence, "Frame of EtherCAT, of any type.", |row| {
        there(row.wrapping().is_ethercat())
    }),
    frame("ecatf.length", Number16, "Length field of the EtherCAT header.", |row| {
        row.wrapping().ethercat_header.map(|word| i128::from(word & 0x07FF))
    }),
    frame(
        "ecatf.type",
        Number16,
        "Type in the EtherCAT header: 1 datagrams, 4 network variables, 5 mailbox.",
        |row| row.wrapping().ethercat_header.map(|word| i128::from(word >> 12)),
    ),
    frame("fcs.wrong", Presence, "Frame with a wrong check sequence.", |row| {
        there(row.frame.fcs == Some(false))
    }),
    // Its datagrams.
    frame("ecat", Presence, "Frame with EtherCAT datagrams.", |row| there(row.is_ethercat)),
    datagram("ecat.cmd", Command, "Command of a datagram.", |row| Some(row.datagram.code().into())),
    datagram("ecat.idx", Number8, "Index of a datagram.", |row| Some(row.datagram.index().into())),
    datagram(
        "ecat.adp",
        Hex16,
        "Station address or position of a datagram that is not logical.",
        |row| physical(row, row.datagram.adp()),
    ),
    datagram(
        "ecat.ado",
        Hex16,
        "Register or memory address of a datagram that is not logical.",
        |row| physical(row, row.datagram.ado().0),
    ),
    datagram("ecat.lad", Hex32, "Logical address of a datagram.", |row| {
        row.is_logical().then(|| row.datagram.logical().0.into())
    }),
    datagram("ecat.cnt", Number16, "Working counter of a datagram.", |row| {
        Some(row.datagram.wkc().0.into())
    }),
    datagram("ecat.int", Hex16, "Event field (IRQ) of a datagram.", |row| {
        Some(row.datagram.irq().into())
    }),
    datagram("ecat.subframe.length", Number16, "Length of a datagram's data in bytes.", |row| {
        Some(row.datagram.data_len() as i128)
    }),
    datagram("ecat.subframe.circulating", Boolean, "Bit: the frame has circulated.", |row| {
        Some(row.datagram.circulated().into())
    }),
    datagram("ecat.subframe.more", Boolean, "Bit: another datagram follows.", |row| {
        Some(row.datagram.more_follow().into())
    }),
    // Mailbox messages.
    mailbox("ecat_mailbox", Presence, "Mailbox message of a known protocol.", |_| Some(1)),
    mailbox("ecat_mailbox.length", Number16, "Length of the message behind its header.", |view| {
        Some(view.header.length.into())
    }),
    mailbox("ecat_mailbox.address", Hex16, "Address in the mailbox header.", |view| {
        Some(view.header.address.0.into())
    }),
    mailbox("ecat_mailbox.type", Number8, "Protocol: 1 AoE, 2 EoE, 3 CoE, 4 FoE, 5 SoE.", |view| {
        Some(view.header.kind.code().into())
    }),
    mailbox("ecat_mailbox.counter", Number8, "Counter in the mailbox header.", |view| {
        Some(view.header.counter.value().into())
    }),
    mailbox("aoe", Presence, "AoE message.", |view| is(view, MailboxType::Aoe)),
    mailbox("ecat_mailbox.coe", Presence, "CoE message.", |view| is(view, MailboxType::Coe)),
    mailbox("ecat_mailbox.coe.number", Number16, "Number in the CoE header.", |view| {
        view.coe().map(|coe| coe.number.into())
    }),
    mailbox(
        "ecat_mailbox.coe.type",
        Number16,
        "CoE service: 1 emergency, 2 SDO request, 3 SDO response, 8 SDO information.",
        |view| view.coe().map(|coe| coe.service.into()),
    ),
    mailbox("ecat_mailbox.coe.sdoidx", Hex16, "Object of an SDO transfer.", |view| {
        view.coe()?.index.map(i128::from)
    }),
    mailbox("ecat_mailbox.coe.sdosub", Number8, "Subindex of an SDO transfer.", |view| {
        view.coe()?.subindex.map(i128::from)
    }),
    mailbox("ecat_mailbox.coe.abortcode", Hex32, "Abort code of an SDO transfer.", |view| {
        view.coe()?.abort_code.map(i128::from)
    }),
    mailbox("ecat_mailbox.foe", Presence, "FoE message.", |view| is(view, MailboxType::Foe)),
    mailbox("ecat_mailbox.foe_opmode", Number8, "Operation of a FoE message.", |view| {
        view.foe_operation().map(i128::from)
    }),
    mailbox("ecat_mailbox.soe", Presence, "SoE message.", |view| is(view, MailboxType::Soe)),
    mailbox("ecat_mailbox.soe_opcode", Number16, "Operation of a SoE message.", |view| {
        view.soe_operation().map(i128::from)
    }),
    mailbox("ecat_mailbox.eoe", Presence, "EoE message.", |view| is(view, MailboxType::Eoe)),
    mailbox("ecat_mailbox.eoe.type", Number32, "Type of an EoE message.", |view| {
        view.eoe_type().map(i128::from)
    }),
    // Records of a capture probe.
    frame("esl", Presence, "Frame with the record of a capture probe.", |row| {
        there(row.frame.probe.is_some())
    }),
    frame("esl.port", Number16, "Port of the probe that received the frame.", |row| {
        row.frame.probe?.port.map(i128::from)
    }),
    frame("esl.crcerror", Boolean, "The probe saw a wrong check sequence.", |row| {
        Some(row.frame.probe?.crc_error.into())
    }),
    frame(
        "esl.alignerror",
        Boolean,
        "The probe saw a frame that does not end at a whole byte.",
        |row| Some(row.frame.probe?.alignment_error.into()),
    ),
    frame("esl.timestamp", Number64, "Time of the probe in ns.", |row| {
        Some(row.frame.probe?.time_ns.into())
    }),
    // What is known from other frames.
    datagram("cyclic", Presence, "Process data: LRD, LWR or LRW.", |row| there(row.is_logical())),
    of(
        "register",
        Hex16,
        "Addresses that a datagram reads or writes, from the first byte to the last.",
        FieldSource::Registers,
    ),
    of(
        "subdevice",
        ValueKind::SubDevice,
        "SubDevice that a datagram is for; of process data, each that has a part in them.",
        FieldSource::SubDevices,
    )
    .needing(Need::Whole),
    frame("out", Presence, "Frame on its way from the MainDevice.", |row| {
        there(row.way() == Some(FrameWay::Out))
    })
    .needing(Need::Facts),
    frame("back", Presence, "Frame on its way back to the MainDevice.", |row| {
        there(row.way() == Some(FrameWay::Back))
    })
    .needing(Need::Facts),
    datagram(
        "wkc.wrong",
        Presence,
        "Datagram that came back with another working counter than expected.",
        |row| there(row.is_wkc_wrong()),
    )
    .needing(Need::Facts),
    datagram(
        "wkc.expected",
        Number16,
        "Working counter that a datagram should come back with.",
        |row| row.expected_wkc.map(i128::from),
    )
    .needing(Need::Facts),
];

/// Shorter names, and what they stand for.
const SHORT: [(&str, &str); 9] = [
    ("mailbox", "ecat_mailbox"),
    ("coe", "ecat_mailbox.coe"),
    ("foe", "ecat_mailbox.foe"),
    ("soe", "ecat_mailbox.soe"),
    ("eoe", "ecat_mailbox.eoe"),
    ("cmd", "ecat.cmd"),
    ("ado", "ecat.ado"),
    ("adp", "ecat.adp"),
    ("wkc", "ecat.cnt"),
];

/// Fields that Wireshark also has for each of the first ten datagrams: `ecat.sub3.cnt`.
const NUMBERED: [&str; 6] = ["cmd", "idx", "adp", "ado", "lad", "cnt"];
/// As many datagrams have numbered fields.
const MOST_NUMBERED: u8 = 10;

fn there(is_there: bool) -> Option<i128> {
    is_there.then_some(1)
}

fn physical(row: &DatagramRow<'_>, value: u16) -> Option<i128> {
    (!row.is_logical()).then_some(i128::from(value))
}

fn is(view: &MailboxView<'_>, kind: MailboxType) -> Option<i128> {
    there(view.header.kind == kind)
}

/// An address as a number.
pub(super) fn address(address: Option<MacAddress>) -> Option<i128> {
    let value = |address: MacAddress| {
        address.0.iter().fold(0, |value: i128, byte| value << 8 | i128::from(*byte))
    };
    address.map(value)
}

/// A field, of any datagram or of one.
#[derive(Clone, Copy, Debug)]
pub struct FieldReference {
    /// The field.
    pub field: &'static FilterField,
    /// The datagram, from 0; `None` for any.
    pub datagram: Option<u8>,
}

impl FieldReference {
    /// The field with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let full = SHORT.iter().find(|(short, _)| *short == name).map_or(name, |(_, full)| full);
        if let Some(field) = by_name(full) {
            return Some(Self { field, datagram: None });
        }
        let (number, word) = name.strip_prefix("ecat.sub")?.split_once('.')?;
        let datagram = (1..=MOST_NUMBERED).find(|candidate| candidate.to_string() == number)?;
        let word = NUMBERED.iter().find(|numbered| **numbered == word)?;
        let field = by_name(&format!("ecat.{word}"))?;
        Some(Self { field, datagram: Some(datagram - 1) })
    }
}

fn by_name(name: &str) -> Option<&'static FilterField> {
    FIELDS.iter().find(|field| field.name == name)
}

/// The name most like one that is not known; `None` when none is.
#[must_use]
pub fn nearest(name: &str) -> Option<&'static str> {
    let lower = name.to_ascii_lowercase();
    let short = SHORT.iter().map(|(short, _)| *short);
    let all = FIELDS.iter().map(|field| field.name).chain(short);
    let measured = all.map(|other| (strsim::damerau_levenshtein(&lower, other), other));
    let (distance, nearest) = measured.min()?;
    (distance <= 3 && distance < nearest.len()).then_some(nearest)
}
