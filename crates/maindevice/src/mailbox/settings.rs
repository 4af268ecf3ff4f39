//! Settings that are brought by other protocols than CoE: addresses of an Ethernet port (EoE), identification
//! numbers of a drive (SoE), which are read, too.
//!
//! Reference: ETG.1000.6, EoE (set IP parameter) and SoE (read request, write request).

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::eoe::{self, EoeResult, Setting};
use linesman_proto::mailbox::soe::{self, Idn, Operation, SOE_HEADER_LEN};

use super::failure::{Step, Why};
use super::transaction::MailboxTransaction;

/// Sets the addresses of a port.
pub(crate) async fn set_addresses(
    transaction: &mut MailboxTransaction<'_>,
    port: u8,
    parameters: &[u8],
) -> Result<(), Why> {
    let request = eoe::Message::Request { port, about: Setting::SetIp, parameters };
    transaction.say(MailboxType::Eoe, |body| request.write(body)).await?;
    let answer = transaction.hear(MailboxType::Eoe).await?;
    match eoe::Message::parse(&answer) {
        Ok(eoe::Message::Response { about: Setting::SetIp, result, .. }) => match result {
            EoeResult::SUCCESS => Ok(()),
            result => Err(Why::Ethernet { result }),
        },
        other => {
            let found = format!("{other:?}");
            Err(Why::Protocol { expected: "the answer to new addresses", found })
        }
    }
}

/// The most that an element has: two lengths of two bytes, and as many bytes as they can tell.
const LONGEST_ELEMENT: usize = 4 + 0xFFFF;
/// Elements of an IDN.
const ELEMENTS: usize = 8;

/// Reads elements of an IDN, which come in as many messages as it takes.
pub(crate) async fn read_idn(
    transaction: &mut MailboxTransaction<'_>,
    drive: u8,
    elements: u8,
    idn: Idn,
) -> Result<Vec<u8>, Why> {
    let request = soe::Message {
        operation: Operation::ReadRequest,
        incomplete: false,
        error: false,
        drive,
        elements,
        number: idn.0,
        data: &[],
    };
    transaction.say(MailboxType::Soe, |body| request.write(body)).await?;
    let expected = "the answer to a read request";
    let mut data = Vec::new();
    let mut count = 0;
    loop {
        let answer = transaction.hear(MailboxType::Soe).await?;
        let Some(message) = soe::Message::parse(&answer) else {
            return Err(Why::Protocol { expected, found: format!("{} bytes", answer.len()) });
        };
        if message.operation != Operation::ReadResponse || message.drive != drive {
            let found = format!("{:?} of drive {}", message.operation, message.drive);
            return Err(Why::Protocol { expected, found });
        }
        if let Some(code) = message.refusal() {
            return Err(Why::Drive { code });
        }
        data.extend_from_slice(message.data);
        if data.len() > LONGEST_ELEMENT * ELEMENTS {
            let found = format!("{} bytes and more", data.len());
            return Err(Why::Protocol { expected: "elements of 64 KiB each at most", found });
        }
        if !message.incomplete {
            let found = Idn(message.number);
            return match found == idn {
                true => Ok(data),
                false => Err(Why::Protocol { expected, found: format!("that of {found}") }),
            };
        }
        count += 1;
        transaction.step = Step::Fragment(count);
        transaction.wait_anew();
    }
}

/// Writes elements of an IDN, in as many messages as it takes.
pub(crate) async fn write_idn(
    transaction: &mut MailboxTransaction<'_>,
    drive: u8,
    elements: u8,
    idn: u16,
    data: &[u8],
) -> Result<(), Why> {
    let header = linesman_proto::mailbox::HEADER_LEN + SOE_HEADER_LEN;
    let room = transaction.multiplexer.out_size().saturating_sub(header).max(1);
    let pieces = data.len().div_ceil(room).max(1);
    for at in 0..pieces {
        let left = pieces - at - 1;
        let piece = data.get(at * room..data.len().min((at + 1) * room)).unwrap_or_default();
        let message = soe::Message {
            operation: Operation::WriteRequest,
            incomplete: left > 0,
            error: false,
            drive,
            elements,
            number: if left > 0 { u16::try_from(left).unwrap_or(u16::MAX) } else { idn },
            data: piece,
        };
        transaction.say(MailboxType::Soe, |body| message.write(body)).await?;
        if pieces > 1 {
            transaction.step = Step::Fragment(at as u32 + 1);
        }
    }
    let answer = transaction.hear(MailboxType::Soe).await?;
    let expected = "the answer to a write request";
    match soe::Message::parse(&answer) {
        Some(answer) if answer.operation == Operation::WriteResponse && answer.drive == drive => {
            answer.refusal().map_or(Ok(()), |code| Err(Why::Drive { code }))
        }
        Some(other) => Err(Why::Protocol { expected, found: format!("{:?}", other.operation) }),
        None => Err(Why::Protocol { expected, found: format!("{} bytes", answer.len()) }),
    }
}
