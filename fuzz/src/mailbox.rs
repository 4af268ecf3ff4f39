//! Mailbox messages: header, protocol, answer.

use linesman_proto::mailbox::coe::Message as CoeMessage;
use linesman_proto::mailbox::coe::information::{EntryDescription, ObjectDescription, ObjectList};
use linesman_proto::mailbox::{ErrorReply, Message};

/// Any bytes may lie in a mailbox. A CoE message that is read and written again is the same one.
pub fn mailbox(data: &[u8]) {
    let Ok(message) = Message::parse(data) else { return };
    let _ = ErrorReply::parse(message.data);
    let _ = ObjectDescription::parse(message.data).map(|object| object.name_text().len());
    let _ = EntryDescription::parse(message.data).map(|entry| entry.name_text().len());
    let _ = ObjectList::parse(message.data).map(|list| list.indices().count());
    let Ok(coe) = CoeMessage::parse(message.data) else { return };
    let mut buffer = [0_u8; 0x1_0000];
    let Ok(len) = coe.write(&mut buffer) else { return };
    let again = CoeMessage::parse(&buffer[..len]).expect("what we write is a message");
    assert_eq!(again, coe);
}
