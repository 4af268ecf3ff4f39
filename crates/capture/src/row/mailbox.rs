//! Mailbox message of a datagram, as far as the datagram alone tells that it carries one.
//!
//! The same condition as in Wireshark: a datagram to one SubDevice, at an address of process RAM, that writes or came
//! back with working counter 1, whose first bytes are a header with a known protocol. Where the mailboxes really lie
//! only the SyncManagers say, and their set-up need not be in the capture.

use linesman_proto::command::Command;
use linesman_proto::frame::Datagram;
use linesman_proto::mailbox::{HEADER_LEN, Header, MailboxType};

/// Process RAM begins here.
const FIRST_RAM: u16 = 0x1000;
/// Longest message that is taken for one, in bytes.
const MOST: u16 = 1500;
/// Header of a CoE message: number and service, in bytes.
const COE_HEADER_LEN: usize = 2;

/// A mailbox message.
#[derive(Clone, Copy, Debug)]
pub struct MailboxView<'a> {
    /// Its header.
    pub header: Header,
    /// Bytes behind the header, as far as they are in the datagram.
    pub body: &'a [u8],
}

/// Fields of a CoE message.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct CoeFields {
    /// Number of the PDO, 9 bits.
    pub number: u16,
    /// Service: 1 emergency, 2 SDO request, 3 SDO response, 8 SDO information.
    pub service: u8,
    /// Object, where the message names one.
    pub index: Option<u16>,
    /// Entry of the object.
    pub subindex: Option<u8>,
    /// Abort code of a transfer that was ended.
    pub abort_code: Option<u32>,
}

impl<'a> MailboxView<'a> {
    /// The message in a datagram; `None` when it carries none.
    #[must_use]
    pub fn of(datagram: &Datagram<'a>) -> Option<Self> {
        use Command::{Aprd, Aprw, Apwr, Fprd, Fprw, Fpwr};
        let command = datagram.command()?;
        let is_carrier = match command {
            Apwr | Aprw | Fpwr | Fprw => true,
            Aprd | Fprd => datagram.wkc().0 == 1,
            Command::Nop
            | Command::Brd
            | Command::Bwr
            | Command::Brw
            | Command::Lrd
            | Command::Lwr
            | Command::Lrw
            | Command::Armw
            | Command::Frmw => false,
        };
        if !is_carrier || datagram.ado().0 < FIRST_RAM {
            return None;
        }
        let (head, body) = datagram.data().split_first_chunk::<HEADER_LEN>()?;
        let header = Header::from_bytes(*head);
        let is_known = matches!(
            header.kind,
            MailboxType::Aoe
                | MailboxType::Eoe
                | MailboxType::Coe
                | MailboxType::Foe
                | MailboxType::Soe
        );
        if !is_known || header.length > MOST {
            return None;
        }
        Some(Self { header, body: &body[..body.len().min(header.length.into())] })
    }

    /// Fields of a CoE message; `None` for another protocol or one that is cut off.
    #[must_use]
    pub fn coe(&self) -> Option<CoeFields> {
        if self.header.kind != MailboxType::Coe {
            return None;
        }
        let (head, rest) = self.body.split_first_chunk::<COE_HEADER_LEN>()?;
        let word = u16::from_le_bytes(*head);
        let (number, service) = (word & 0x01FF, (word >> 12) as u8);
        let mut fields = CoeFields { number, service, ..CoeFields::default() };
        if matches!(service, 2 | 3)
            && let Some([control, low, high, subindex, code @ ..]) = rest.first_chunk::<8>()
        {
            let specifier = control >> 5;
            let names_object = match service {
                // Initiate download, initiate upload.
                2 => matches!(specifier, 1 | 2),
                _ => matches!(specifier, 2 | 3),
            };
            if names_object {
                fields.index = Some(u16::from_le_bytes([*low, *high]));
                fields.subindex = Some(*subindex);
            }
            // An abort is a request in both directions.
            if service == 2 && specifier == 4 {
                fields.abort_code = Some(u32::from_le_bytes(*code));
            }
        }
        Some(fields)
    }

    /// First byte of a FoE message: its operation.
    #[must_use]
    pub fn foe_operation(&self) -> Option<u8> {
        self.first_byte(MailboxType::Foe)
    }

    /// Operation of a SoE message: 1 read request to 6 emergency.
    #[must_use]
    pub fn soe_operation(&self) -> Option<u8> {
        self.first_byte(MailboxType::Soe).map(|byte| byte & 0x07)
    }

    /// Type of an EoE message: 0 fragment.
    #[must_use]
    pub fn eoe_type(&self) -> Option<u8> {
        self.first_byte(MailboxType::Eoe).map(|byte| byte & 0x0F)
    }

    fn first_byte(&self, kind: MailboxType) -> Option<u8> {
        self.body.first().copied().filter(|_| self.header.kind == kind)
    }
}
