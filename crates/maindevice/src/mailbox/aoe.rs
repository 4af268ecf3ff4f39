//! ADS through the mailbox: one request, and the answer to it.
//!
//! Reference: ETG.1020, AoE; header and services are those of `proto::ads`. A message goes into one mailbox: fragments
//! of AoE are not sent. An answer is told from a late or doubled one by its invoke id.

use linesman_proto::ads::{AdsAnswer, AdsCode, AdsCommand, AdsRequest, AmsAddress, AmsHeader};
use linesman_proto::mailbox::MailboxType;

use super::failure::Why;
use super::pass::copy;
use super::transaction::MailboxTransaction;

/// Expected answer, as failures name it.
const EXPECTED: &str = "the answer to an ADS request";

/// Sends a request, and gives what its answer has behind the result; of reading the bytes alone.
pub(crate) async fn ask(
    transaction: &mut MailboxTransaction<'_>,
    target: AmsAddress,
    source: AmsAddress,
    command: AdsCommand,
    data: &[u8],
) -> Result<Vec<u8>, Why> {
    let invoke_id = transaction.multiplexer.next_invoke_id();
    let header = AmsHeader::request(target, source, command.number(), invoke_id);
    let message = header.message(data);
    transaction.say(MailboxType::Aoe, |body| copy(&message, body)).await?;
    loop {
        let came = transaction.hear(MailboxType::Aoe).await?;
        let (answer, behind) = match AmsHeader::parse(&came) {
            Ok(parsed) => parsed,
            Err(error) => return Err(wrong(error.to_string())),
        };
        // A request of the SubDevice, or the answer to an earlier one of ours.
        if !answer.is_answer() || answer.invoke_id != invoke_id {
            transaction.multiplexer.unasked(MailboxType::Aoe, came);
            continue;
        }
        if (answer.source, answer.target) != (target, source) {
            let (from, to) = (answer.source, answer.target);
            return Err(wrong(format!("one from {from} to {to} instead of {target} to {source}")));
        }
        if answer.command != command.number() {
            let (found, asked) = (answer.command, command.number());
            return Err(wrong(format!("one to command {found} instead of {asked}")));
        }
        if answer.error != AdsCode::OK {
            return Err(Why::Ads { code: answer.error });
        }
        return match AdsAnswer::parse(command, behind) {
            Ok(AdsAnswer::Refused(code)) => Err(Why::Ads { code }),
            Ok(AdsAnswer::Read(read)) => match room(command, data) {
                Some(room) if read.len() > room => {
                    Err(wrong(format!("{} bytes, {room} were asked for", read.len())))
                }
                Some(_) | None => Ok(read),
            },
            Ok(AdsAnswer::DeviceInfo { .. } | AdsAnswer::State { .. } | AdsAnswer::Done) => {
                Ok(behind.get(AdsCode::LEN..).unwrap_or_default().to_vec())
            }
            Err(error) => Err(wrong(error.to_string())),
        };
    }
}

fn wrong(found: String) -> Why {
    Why::Protocol { expected: EXPECTED, found }
}

/// The most that may be read; `None` where the request does not say.
fn room(command: AdsCommand, data: &[u8]) -> Option<usize> {
    match AdsRequest::parse(command.number(), data) {
        Ok(AdsRequest::Read { len, .. } | AdsRequest::ReadWrite { len, .. }) => {
            usize::try_from(len).ok()
        }
        Ok(
            AdsRequest::DeviceInfo
            | AdsRequest::State
            | AdsRequest::Write { .. }
            | AdsRequest::Other(_),
        )
        | Err(_) => None,
    }
}
