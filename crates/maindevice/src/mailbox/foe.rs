//! Files: reading and writing over FoE.
//!
//! Reference: ETG.1000.6, FoE. Packets count from 1; each is acknowledged before the next is sent;
//! one that is shorter than the mailbox allows is the last. "Busy" asks for the same message again.

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::foe::{FoeErrorCode, Message, chunk_len};
use linesman_proto::time::Span;

use super::failure::{Step, Why};
use super::progress::FileBusy;
use super::transaction::MailboxTransaction;

/// The longest file that is fetched, in bytes.
const LONGEST: usize = 64 << 20;
/// After "busy": when the message is sent again.
const PAUSE: Span = Span::ms(20);
/// Erasing a large flash memory takes this long at most.
const BUSY_LIMIT: Span = Span::s(120);

/// Fetches a file.
pub(crate) async fn read(
    transaction: &mut MailboxTransaction<'_>,
    name: &str,
    password: u32,
) -> Result<Vec<u8>, Why> {
    let chunk = chunk_len(transaction.multiplexer.in_size());
    let mut file = Vec::new();
    let mut question = Message::Read { password, name: name.as_bytes() };
    let mut expected = 1_u32;
    loop {
        let answer = ask(transaction, &question).await?;
        match Message::parse(&answer) {
            Ok(Message::Data { packet, data }) if packet == expected => {
                file.extend_from_slice(data);
                transaction.step = Step::Packet { number: packet, done: file.len(), total: None };
                transaction.tell_progress(None);
                if file.len() > LONGEST {
                    give_up(transaction, FoeErrorCode::DISK_FULL).await;
                    return Err(Why::TooLong { limit: LONGEST });
                }
                question = Message::Ack { packet };
                expected = expected.wrapping_add(1);
                if data.len() < chunk {
                    transaction.say(MailboxType::Foe, |body| question.write(body)).await?;
                    return Ok(file);
                }
            }
            // It had not heard that the packet before arrived: it is told again.
            Ok(Message::Data { packet, .. })
                if expected > 1 && packet == expected.wrapping_sub(1) => {}
            Ok(Message::Data { packet, .. }) => {
                give_up(transaction, FoeErrorCode::WRONG_PACKET).await;
                let found = format!("packet {packet} instead of {expected}");
                return Err(Why::Protocol { expected: "the next packet", found });
            }
            other => return Err(unexpected(transaction, "a packet of the file", other).await),
        }
    }
}

/// Brings a file.
pub(crate) async fn write(
    transaction: &mut MailboxTransaction<'_>,
    name: &str,
    password: u32,
    data: &[u8],
) -> Result<(), Why> {
    let chunk = chunk_len(transaction.multiplexer.out_size());
    if chunk == 0 {
        let available = transaction.multiplexer.out_size();
        let needed = available.saturating_add(1);
        return Err(linesman_proto::mailbox::BufferTooSmall { needed, available }.into());
    }
    let request = Message::Write { password, name: name.as_bytes() };
    acknowledged(transaction, &request, 0).await?;
    let mut packet = 0_u32;
    let mut at = 0;
    loop {
        packet = packet.wrapping_add(1);
        transaction.step = Step::Packet { number: packet, done: at, total: Some(data.len()) };
        transaction.tell_progress(None);
        let rest = data.get(at..).unwrap_or_default();
        let piece = rest.get(..chunk).unwrap_or(rest);
        acknowledged(transaction, &Message::Data { packet, data: piece }, packet).await?;
        at += piece.len();
        if piece.len() < chunk {
            return Ok(());
        }
    }
}

/// Sends a message until it is acknowledged.
async fn acknowledged(
    transaction: &mut MailboxTransaction<'_>,
    message: &Message<'_>,
    number: u32,
) -> Result<(), Why> {
    let mut answer = ask(transaction, message).await?;
    loop {
        match Message::parse(&answer) {
            Ok(Message::Ack { packet }) if packet == number => return Ok(()),
            // The packet before is acknowledged once more.
            Ok(Message::Ack { packet }) if number > 0 && packet == number.wrapping_sub(1) => {
                answer = transaction.hear(MailboxType::Foe).await?;
            }
            Ok(Message::Ack { packet }) => {
                give_up(transaction, FoeErrorCode::WRONG_PACKET).await;
                let found = format!("that of packet {packet} instead of {number}");
                return Err(Why::Protocol { expected: "the acknowledgement", found });
            }
            other => return Err(unexpected(transaction, "an acknowledgement", other).await),
        }
    }
}

/// Sends a message and gives the answer that is not "busy".
async fn ask(
    transaction: &mut MailboxTransaction<'_>,
    message: &Message<'_>,
) -> Result<Vec<u8>, Why> {
    let began = transaction.multiplexer.now();
    loop {
        transaction.say(MailboxType::Foe, |body| message.write(body)).await?;
        let answer = transaction.hear(MailboxType::Foe).await?;
        let Ok(Message::Busy { done, total, text }) = Message::parse(&answer) else {
            return Ok(answer);
        };
        let busy = FileBusy { done, total, text: words(text) };
        if transaction.multiplexer.now().since(began) >= BUSY_LIMIT {
            return Err(Why::Busy { patience: BUSY_LIMIT, text: busy.to_string() });
        }
        transaction.tell_progress(Some(busy));
        transaction.multiplexer.pause(PAUSE).await;
    }
}

async fn give_up(transaction: &mut MailboxTransaction<'_>, code: FoeErrorCode) {
    let message = Message::Error { code, text: b"" };
    transaction.mention(MailboxType::Foe, |body| message.write(body)).await;
}

async fn unexpected(
    transaction: &mut MailboxTransaction<'_>,
    expected: &'static str,
    found: Result<Message<'_>, linesman_proto::mailbox::foe::FoeError>,
) -> Why {
    let found = match found {
        Ok(Message::Error { code, text }) => {
            // Some only repeat what the code says.
            let text = Some(words(text)).filter(|text| text != code.text());
            return Why::File { code, text: text.unwrap_or_default() };
        }
        Ok(Message::Read { .. }) => "a request to read".to_owned(),
        Ok(Message::Write { .. }) => "a request to write".to_owned(),
        Ok(Message::Data { packet, .. }) => format!("packet {packet}"),
        Ok(Message::Ack { packet }) => format!("the acknowledgement of packet {packet}"),
        Ok(Message::Busy { .. }) => "\"busy\"".to_owned(),
        Err(error) => error.to_string(),
    };
    give_up(transaction, FoeErrorCode::ILLEGAL).await;
    Why::Protocol { expected, found }
}

/// A text of the SubDevice for people: printable letters, no end of C strings.
fn words(text: &[u8]) -> String {
    let text = text.split(|letter| *letter == 0).next().unwrap_or_default();
    String::from_utf8_lossy(text).chars().filter(|letter| !letter.is_control()).collect()
}
