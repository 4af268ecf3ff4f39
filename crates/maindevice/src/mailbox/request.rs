//! Requests to a SubDevice through its mailbox, and the names that messages give them.

use std::fmt;

use linesman_proto::ads::{AdsCommand, AdsRequest, AmsAddress, AmsNetId};
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::coe::information::{ListKind, ValueInfo};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::soe::Idn;
use linesman_proto::time::Span;

/// Something to be asked. What each of them gives is said there, as bytes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum MailboxRequest {
    /// Fetch an object: its data.
    Upload {
        /// Which entry; with complete access the one to begin with, 0 or 1.
        object: ObjectAddress,
        /// All entries in one transfer.
        complete: bool,
    },
    /// Bring an object: nothing comes back.
    Download {
        /// Which entry; with complete access the one to begin with, 0 or 1.
        object: ObjectAddress,
        /// All entries in one transfer.
        complete: bool,
        /// The value, lowest byte first.
        data: Vec<u8>,
    },
    /// Ask which objects there are: an
    /// [`ObjectList`](linesman_proto::mailbox::coe::information::ObjectList).
    ObjectList {
        /// Which of the lists.
        list: ListKind,
    },
    /// Ask what an object is: an
    /// [`ObjectDescription`](linesman_proto::mailbox::coe::information::ObjectDescription).
    DescribeObject {
        /// Which.
        index: ObjectIndex,
    },
    /// Ask what an entry is: an
    /// [`EntryDescription`](linesman_proto::mailbox::coe::information::EntryDescription).
    DescribeEntry {
        /// Which.
        object: ObjectAddress,
        /// What the answer is to tell beyond the rest.
        values: ValueInfo,
    },
    /// Set the addresses of an Ethernet port by EoE: nothing comes back.
    SetAddresses {
        /// Which port of the SubDevice.
        port: u8,
        /// The addresses as the message carries them.
        parameters: Vec<u8>,
    },
    /// Send an Ethernet frame by EoE, in as many fragments as it takes: two numbers of four bytes, lowest byte
    /// first, how many fragments that were, and how often messages were sent or fetched again for it.
    SendFrame {
        /// Which port of the SubDevice, 0 to 15.
        port: u8,
        /// Number of the frame, 0 to 15.
        number: u8,
        /// The frame without check sequence, 14 to 1,518 bytes.
        frame: Vec<u8>,
    },
    /// Read an identification number by SoE: the data of its elements. The list of all that a drive has is the value of
    /// [`ALL_NUMBERS`](linesman_proto::mailbox::soe::ALL_NUMBERS).
    ReadIdn {
        /// Which drive of the SubDevice, 0 to 7.
        drive: u8,
        /// Which number.
        idn: Idn,
        /// Which of its elements; 0x40 is its value, 0x02 its name.
        elements: u8,
    },
    /// Write an identification number by SoE: nothing comes back.
    WriteIdn {
        /// Which drive of the SubDevice.
        drive: u8,
        /// Which number.
        idn: Idn,
        /// Which of its elements.
        elements: u8,
        /// What is written.
        data: Vec<u8>,
    },
    /// Fetch a file: its bytes.
    ReadFile {
        /// As the SubDevice knows it.
        name: String,
        /// 0 for none.
        password: u32,
    },
    /// Bring a file: nothing comes back.
    WriteFile {
        /// As the SubDevice is to know it.
        name: String,
        /// 0 for none.
        password: u32,
        /// The bytes.
        data: Vec<u8>,
    },
    /// Ask by ADS (AoE): what the answer has behind its result; of reading the bytes alone.
    Ads {
        /// Its NetId; `None`: that of the plan ([`DevicePlan::net_id`](linesman_config::plan::DevicePlan::net_id)), or
        /// one made of its station address.
        net_id: Option<AmsNetId>,
        /// The AMS port.
        port: u16,
        /// Address of the one who asks; `None`: the MainDevice.
        source: Option<AmsAddress>,
        /// Command of ADS.
        command: AdsCommand,
        /// Bytes behind the AMS header, as [`AdsRequest::to_bytes`] gives it.
        data: Vec<u8>,
    },
    /// Send a message of the vendor's own protocol (VoE): what answers it; nothing where it is not answered.
    SendVendorMessage {
        /// Bytes behind the mailbox header: vendor id, the vendor's number, data.
        data: Vec<u8>,
        /// Time in which an answer is waited for.
        answer_within: Span,
    },
    /// Pass on a message of a client of the mailbox gateway: the mailbox messages that answer it, each with its
    /// header, one behind the other; none for a message that is not answered.
    Pass {
        /// Tells clients apart: while a transfer of one is under way, the SubDevice is kept for it.
        client: u64,
        /// The protocol of the message.
        kind: MailboxType,
        /// What follows its mailbox header.
        data: Vec<u8>,
    },
}

impl MailboxRequest {
    /// The client of the mailbox gateway whose message it is; `None` for a request of our own.
    #[must_use]
    pub(crate) const fn client(&self) -> Option<u64> {
        match self {
            Self::Pass { client, .. } => Some(*client),
            Self::Upload { .. }
            | Self::Download { .. }
            | Self::ObjectList { .. }
            | Self::DescribeObject { .. }
            | Self::DescribeEntry { .. }
            | Self::SetAddresses { .. }
            | Self::SendFrame { .. }
            | Self::ReadIdn { .. }
            | Self::WriteIdn { .. }
            | Self::ReadFile { .. }
            | Self::WriteFile { .. }
            | Self::Ads { .. }
            | Self::SendVendorMessage { .. } => None,
        }
    }

    /// True for an Ethernet frame. It is part of no transfer, and disturbs none.
    #[must_use]
    pub(crate) const fn is_frame(&self) -> bool {
        matches!(self, Self::SendFrame { .. })
    }

    /// What is to be done, without data and password.
    #[must_use]
    pub fn operation(&self) -> MailboxOperation {
        match self {
            Self::Upload { object, complete } => {
                MailboxOperation::Read { object: *object, complete: *complete }
            }
            Self::Download { object, complete, .. } => {
                MailboxOperation::Write { object: *object, complete: *complete }
            }
            Self::ObjectList { list } => MailboxOperation::List { list: *list },
            Self::DescribeObject { index } => MailboxOperation::DescribeObject { index: *index },
            Self::DescribeEntry { object, .. } => {
                MailboxOperation::DescribeEntry { object: *object }
            }
            Self::SetAddresses { port, .. } => MailboxOperation::SetAddresses { port: *port },
            Self::SendFrame { frame, .. } => MailboxOperation::SendFrame { len: frame.len() },
            Self::ReadIdn { drive, idn, .. } => {
                MailboxOperation::ReadIdn { drive: *drive, idn: *idn }
            }
            Self::WriteIdn { drive, idn, .. } => {
                MailboxOperation::WriteIdn { drive: *drive, idn: *idn }
            }
            Self::ReadFile { name, .. } => MailboxOperation::ReadFile { name: name.clone() },
            Self::WriteFile { name, .. } => MailboxOperation::WriteFile { name: name.clone() },
            Self::Ads { port, command, data, .. } => MailboxOperation::Ads {
                port: *port,
                command: *command,
                place: match AdsRequest::parse(command.number(), data) {
                    Ok(
                        AdsRequest::Read { group, offset, .. }
                        | AdsRequest::Write { group, offset, .. }
                        | AdsRequest::ReadWrite { group, offset, .. },
                    ) => Some((group, offset)),
                    Ok(AdsRequest::DeviceInfo | AdsRequest::State | AdsRequest::Other(_))
                    | Err(_) => None,
                },
            },
            Self::SendVendorMessage { data, .. } => {
                MailboxOperation::SendVendorMessage { len: data.len() }
            }
            Self::Pass { kind, .. } => MailboxOperation::Pass { protocol: *kind },
        }
    }
}

/// What is to be done, as messages name it: "reading object 0x1018:01".
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum MailboxOperation {
    /// Fetching an object.
    Read {
        /// Which.
        object: ObjectAddress,
        /// With all entries.
        complete: bool,
    },
    /// Bringing an object.
    Write {
        /// Which.
        object: ObjectAddress,
        /// With all entries.
        complete: bool,
    },
    /// Asking for a list of objects.
    List {
        /// Which list.
        list: ListKind,
    },
    /// Asking what an object is.
    DescribeObject {
        /// Which.
        index: ObjectIndex,
    },
    /// Asking what an entry is.
    DescribeEntry {
        /// Which.
        object: ObjectAddress,
    },
    /// Setting the addresses of an Ethernet port.
    SetAddresses {
        /// Which port.
        port: u8,
    },
    /// Sending an Ethernet frame.
    SendFrame {
        /// How many bytes it has.
        len: usize,
    },
    /// Reading an identification number of a drive.
    ReadIdn {
        /// Which drive.
        drive: u8,
        /// Which number.
        idn: Idn,
    },
    /// Writing an identification number of a drive.
    WriteIdn {
        /// Which drive.
        drive: u8,
        /// Which number.
        idn: Idn,
    },
    /// Fetching a file.
    ReadFile {
        /// Which.
        name: String,
    },
    /// Bringing a file.
    WriteFile {
        /// Which.
        name: String,
    },
    /// Asking by ADS.
    Ads {
        /// The AMS port.
        port: u16,
        /// Command of ADS.
        command: AdsCommand,
        /// Index group and offset, where the command has them.
        place: Option<(u32, u32)>,
    },
    /// Sending a message of the vendor's own protocol.
    SendVendorMessage {
        /// Its length in bytes.
        len: usize,
    },
    /// Passing on a message of a client of the mailbox gateway.
    Pass {
        /// Its protocol.
        protocol: MailboxType,
    },
}

impl MailboxOperation {
    /// The protocol it takes.
    #[must_use]
    pub const fn protocol(&self) -> MailboxType {
        match self {
            Self::Read { .. }
            | Self::Write { .. }
            | Self::List { .. }
            | Self::DescribeObject { .. }
            | Self::DescribeEntry { .. } => MailboxType::Coe,
            Self::SetAddresses { .. } | Self::SendFrame { .. } => MailboxType::Eoe,
            Self::ReadIdn { .. } | Self::WriteIdn { .. } => MailboxType::Soe,
            Self::ReadFile { .. } | Self::WriteFile { .. } => MailboxType::Foe,
            Self::Ads { .. } => MailboxType::Aoe,
            Self::SendVendorMessage { .. } => MailboxType::Voe,
            Self::Pass { protocol } => *protocol,
        }
    }
}

impl fmt::Display for MailboxOperation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let whole = |complete: &bool| if *complete { " with complete access" } else { "" };
        match self {
            Self::Read { object, complete } => {
                write!(f, "reading object {object}{}", whole(complete))
            }
            Self::Write { object, complete } => {
                write!(f, "writing object {object}{}", whole(complete))
            }
            Self::List { list } => write!(f, "asking for object list {}", list.code()),
            Self::DescribeObject { index } => write!(f, "asking what object {index} is"),
            Self::DescribeEntry { object } => write!(f, "asking what entry {object} is"),
            Self::SetAddresses { port } => {
                write!(f, "setting the addresses of Ethernet port {port}")
            }
            Self::SendFrame { len } => write!(f, "sending an Ethernet frame of {len} bytes"),
            Self::ReadIdn { drive, idn } => write!(f, "reading {idn} of drive {drive}"),
            Self::WriteIdn { drive, idn } => write!(f, "writing {idn} of drive {drive}"),
            Self::ReadFile { name } => write!(f, "reading file `{name}`"),
            Self::WriteFile { name } => write!(f, "writing file `{name}`"),
            Self::Ads { port, command, place } => {
                write!(f, "asking AMS port {port} by ADS ({command}")?;
                if let Some((group, offset)) = place {
                    write!(f, ", index group 0x{group:X}, offset 0x{offset:X}")?;
                }
                f.write_str(")")
            }
            Self::SendVendorMessage { len } => {
                write!(f, "sending a vendor's message of {len} bytes (VoE)")
            }
            Self::Pass { protocol } => {
                write!(f, "passing on a message of {protocol} for a client of the mailbox gateway")
            }
        }
    }
}
