//! SDO information: which objects a SubDevice has, and what they are.
//!
//! Reference: ETG.1000.6, SDO information. Answers come in fragments, of which only the first says
//! what it is about: so they are put together first, then looked at.

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::information::{
    self, Answer, Body, EntryDescription, ListKind, ObjectDescription, ObjectList, ValueInfo,
};
use linesman_proto::mailbox::coe::{CoeError, Message, ObjectAddress, ObjectIndex};

use super::failure::{Step, Why};
use super::transaction::MailboxTransaction;

/// No dictionary has a longer list, nor an object a longer description: 65,536 indices and a word.
const LONGEST: usize = 2 * 65_537;

/// The objects of a list.
pub(crate) async fn list(
    transaction: &mut MailboxTransaction<'_>,
    list: ListKind,
) -> Result<Vec<u8>, Why> {
    let about = |data: &[u8]| ObjectList::parse(data).map(|found| found.kind == list);
    ask(transaction, Body::ListRequest { list }, Answer::List, "the list that was asked for", about)
        .await
}

/// What an object is.
pub(crate) async fn object(
    transaction: &mut MailboxTransaction<'_>,
    index: ObjectIndex,
) -> Result<Vec<u8>, Why> {
    let about = |data: &[u8]| ObjectDescription::parse(data).map(|found| found.index == index);
    ask(
        transaction,
        Body::ObjectRequest { index },
        Answer::Object,
        "that object's description",
        about,
    )
    .await
}

/// What an entry is.
pub(crate) async fn entry(
    transaction: &mut MailboxTransaction<'_>,
    object: ObjectAddress,
    values: ValueInfo,
) -> Result<Vec<u8>, Why> {
    let about = |data: &[u8]| EntryDescription::parse(data).map(|found| found.object == object);
    let question = Body::EntryRequest { object, values };
    ask(transaction, question, Answer::Entry, "that entry's description", about).await
}

async fn ask(
    transaction: &mut MailboxTransaction<'_>,
    question: Body<'_>,
    wanted: Answer,
    expected: &'static str,
    is_about: impl Fn(&[u8]) -> Result<bool, CoeError>,
) -> Result<Vec<u8>, Why> {
    let message = Message::Information(information::Message::whole(question));
    transaction.say(MailboxType::Coe, |body| message.write(body)).await?;
    let (mut collected, mut number) = (Vec::new(), 0);
    loop {
        let data = transaction.hear(MailboxType::Coe).await?;
        let found = match Message::parse(&data) {
            Ok(Message::Information(found)) => found,
            // An SDO answer that comes late.
            Ok(
                Message::SdoResponse(_)
                | Message::Abort(_)
                | Message::Emergency(_)
                | Message::SdoRequest(_)
                | Message::Pdo { .. },
            ) => {
                transaction.multiplexer.unasked(MailboxType::Coe, data);
                continue;
            }
            Err(error) => return Err(Why::Protocol { expected, found: error.to_string() }),
        };
        match found.body {
            Body::Error { code } => return Err(Why::Aborted { code: SdoAbortCode(code) }),
            Body::Answer { to, fragment } if to == wanted => {
                collected.extend_from_slice(fragment);
                if collected.len() > LONGEST {
                    return Err(Why::TooLong { limit: LONGEST });
                }
                number += 1;
                transaction.step = Step::Fragment(number);
                transaction.wait_anew();
                if found.incomplete {
                    continue;
                }
                match is_about(&collected) {
                    Ok(true) => return Ok(collected),
                    // The end of an answer that was given up.
                    Ok(false) | Err(_) if transaction.multiplexer.may_be_late() => {
                        transaction.multiplexer.all_late_ones_came();
                        collected.clear();
                    }
                    Ok(false) => {
                        let found = "one about something else".to_owned();
                        return Err(Why::Protocol { expected, found });
                    }
                    Err(error) => {
                        return Err(Why::Protocol { expected, found: error.to_string() });
                    }
                }
            }
            Body::Answer { .. }
            | Body::ListRequest { .. }
            | Body::ObjectRequest { .. }
            | Body::EntryRequest { .. } => transaction.multiplexer.unasked(MailboxType::Coe, data),
        }
    }
}
