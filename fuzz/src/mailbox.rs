//! Mailbox messages: header, protocol, answer; and a device that gets them.

use linesman_proto::ads::{AdsAnswer, AdsCommand, AmsHeader};
use linesman_proto::mailbox::coe::information::{EntryDescription, ObjectDescription, ObjectList};
use linesman_proto::mailbox::coe::{DiagnosisMessage, Message as CoeMessage};
use linesman_proto::mailbox::foe::Message as FoeMessage;
use linesman_proto::mailbox::{ErrorReply, Message};

/// Any bytes may lie in a mailbox. A CoE message that is read and written again is the same one.
pub fn mailbox(data: &[u8]) {
    // A switch terminal has files and Ethernet, a bridge speaks AoE and VoE.
    crate::device::drive("EL6601", data);
    crate::device::drive("EL6692", data);
    codec(data);
}

fn codec(data: &[u8]) {
    let Ok(message) = Message::parse(data) else { return };
    let _ = ErrorReply::parse(message.data);
    let _ = ObjectDescription::parse(message.data).map(|object| object.name_text().len());
    let _ = EntryDescription::parse(message.data).map(|entry| entry.name_text().len());
    let _ = ObjectList::parse(message.data).map(|list| list.indices().count());
    if let Ok(file) = FoeMessage::parse(message.data) {
        let mut buffer = [0_u8; 0x1_0000];
        let len = file.write(&mut buffer).expect("no longer than it was");
        assert_eq!(FoeMessage::parse(&buffer[..len]), Ok(file));
    }
    if let Ok((header, data)) = AmsHeader::parse(message.data) {
        assert_eq!(header.message(data), message.data);
        let command = AdsCommand::from_number(header.command);
        let _ = command.map(|command| AdsAnswer::parse(command, data));
    }
    let _ = DiagnosisMessage::parse(message.data).map(|note| note.parameters().count());
    let Ok(coe) = CoeMessage::parse(message.data) else { return };
    let mut buffer = [0_u8; 0x1_0000];
    let Ok(len) = coe.write(&mut buffer) else { return };
    let again = CoeMessage::parse(&buffer[..len]).expect("what we write is a message");
    assert_eq!(again, coe);
}

#[cfg(test)]
mod tests {
    use super::mailbox;

    #[test]
    fn requests_of_ads_leave_the_device_at_work() {
        mailbox(include_bytes!("../corpus/mailbox/ads-device"));
        mailbox(include_bytes!("../corpus/mailbox/ads-message"));
    }
}
