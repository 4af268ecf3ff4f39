//! What mailboxes tell: the identity as the object dictionary has it (SDO uploads of 0x1018), and
//! emergencies.

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::sdo::Response;
use linesman_proto::mailbox::coe::{Emergency, Message, ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::{Header, MailboxType};

use super::Answer;
use crate::line::{Line, Seen};

/// A mailbox was read, or another part of the process RAM.
pub(super) fn read(line: &mut Line, id: DeviceId, answer: &Answer<'_>) {
    let data = answer.reply.data();
    // Cheap checks first: this is asked of every read of process RAM.
    let Ok(header) = Header::parse(data) else { return };
    if header.kind != MailboxType::Coe {
        return;
    }
    let end = HEADER_LEN + usize::from(header.length);
    let Some(body) = data.get(HEADER_LEN..end) else { return };
    match Message::parse(body) {
        Ok(Message::SdoResponse(Response::Upload { object, complete: false, initial })) => {
            identity(line, id, answer, object, initial.data());
        }
        // Other process data may begin like a message by chance; an emergency has one length only.
        Ok(Message::Emergency(emergency)) if body.len() == EMERGENCY_LEN => {
            let Some(device) = line.devices.get_mut(id.index()) else { return };
            device.record_emergency(Seen::new(emergency, answer.at, Some(answer.frame)));
            line.touch();
        }
        Ok(_) | Err(_) => {}
    }
}

/// An object was read: the identity, perhaps.
fn identity(
    line: &mut Line,
    id: DeviceId,
    answer: &Answer<'_>,
    object: ObjectAddress,
    data: &[u8],
) {
    let Some(bytes) = data.first_chunk() else { return };
    if object.index != ObjectIndex::IDENTITY {
        return;
    }
    let Some(device) = line.devices.get_mut(id.index()) else { return };
    let seen = Some(Seen::new(u32::from_le_bytes(*bytes), answer.at, Some(answer.frame)));
    let field = match object.subindex {
        1 => &mut device.identity.vendor_id,
        2 => &mut device.identity.product_code,
        3 => &mut device.identity.revision,
        4 => &mut device.identity.serial,
        _ => return,
    };
    if field.is_none() {
        *field = seen;
        line.touch();
    }
}

const HEADER_LEN: usize = 6;
/// CoE header and emergency.
const EMERGENCY_LEN: usize = 2 + Emergency::LEN;
