//! Mailbox messages: the identity as the object dictionary has it (SDO uploads of 0x1018), messages of
//! the diagnosis history (0x10F3), emergencies, fragments of Ethernet frames, and the outcome of requests.

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::mailbox::coe::diagnosis::DiagnosisMessage;
use linesman_proto::mailbox::coe::sdo::{Request, Response};
use linesman_proto::mailbox::coe::{Emergency, Message, ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::error_reply::ErrorReply;
use linesman_proto::mailbox::{Header, MailboxType, eoe};

use super::{Answer, mailbox_state};
use crate::model::mailbox::{HistoryMessage, MailboxRefusal};
use crate::model::{Device, NetworkModel, Seen};

/// The diagnosis history.
const HISTORY: ObjectIndex = ObjectIndex(0x10F3);
/// Its first message.
const FIRST_MESSAGE: u8 = 6;

/// A mailbox was read, or another part of the process RAM.
pub(super) fn read(model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
    let data = answer.reply.data();
    // Cheap checks first: this is asked of every read of process RAM.
    let Some((header, body)) = message(data) else { return };
    let (at, frame) = (answer.at, answer.frame);
    let Some(device) = model.devices.get_mut(id.index()) else { return };
    let is_its = is_mailbox(device, ANSWERS, answer.ado);
    let is_new = is_its && device.mailbox.ethernet.count(header.counter);
    let news = match header.kind {
        MailboxType::Error => match ErrorReply::parse(body) {
            // One about a fragment that is fetched once more is no second one.
            Ok(reply)
                if body.len() == ErrorReply::LEN && (is_new || device.mailbox.fragments == 0) =>
            {
                device.mailbox.error_reply(reply.code, at, frame);
                true
            }
            Ok(_) | Err(_) => false,
        },
        MailboxType::Coe => match Message::parse(body) {
            Ok(Message::SdoResponse(response)) => {
                let mut news = device.mailbox.answered(at, frame);
                if let Response::Upload { object, complete, initial } = response {
                    let (data, seen) = (initial.data(), Seen::new((), at, Some(frame)));
                    let is_whole = initial.size() as usize == data.len();
                    news |= match (complete, object.index) {
                        (true, ObjectIndex::IDENTITY) => identified_whole(model, id, seen, data),
                        (true, _) => false,
                        (false, ObjectIndex::DEVICE_NAME) if is_whole => named(model, id, data),
                        (false, _) => uploaded(model, id, answer, object, data),
                    };
                }
                news
            }
            Ok(Message::Abort(abort)) if is_sync_object(abort.object.index) => {
                // Who does not keep step with a clock has no such object, and may say so.
                device.mailbox.answered(at, frame)
            }
            Ok(Message::Abort(abort)) => {
                device.mailbox.answered(at, frame);
                let reads_whole = device.mailbox.reads_whole;
                let (object, code) = (abort.object, abort.code);
                let refusal = MailboxRefusal::Abort { object, code, reads_whole };
                device.mailbox.refused(refusal, at, frame);
                true
            }
            // Other process data may begin like a message by chance; an emergency has one length only.
            Ok(Message::Emergency(emergency)) if body.len() == EMERGENCY_LEN => {
                device.record_emergency(Seen::new(emergency, at, Some(frame)));
                true
            }
            Ok(_) | Err(_) => false,
        },
        MailboxType::Eoe => match eoe::Message::parse(body) {
            Ok(eoe::Message::Fragment(fragment)) if is_new => {
                device.mailbox.ethernet.take(&fragment, at, frame)
            }
            Ok(_) | Err(_) => false,
        },
        MailboxType::Foe
        | MailboxType::Soe
        | MailboxType::Aoe
        | MailboxType::Voe
        | MailboxType::Reserved(_) => false,
    };
    let device = model.devices.get_mut(id.index());
    if device.is_some_and(|device| device.mailbox.fetched_other(at)) {
        mailbox_state::expect(model, id);
    }
    if news {
        model.touch();
    }
}

/// A mailbox was written to, or another part of the process RAM; or was not, if `taken` is false.
pub(super) fn written(model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>, taken: bool) {
    let Some((header, body)) = message(answer.written()) else { return };
    if header.kind == MailboxType::Eoe {
        return frame_written(model, id, answer, body, taken);
    }
    if header.kind != MailboxType::Coe {
        return;
    }
    let (object, reads_whole) = match Message::parse(body) {
        Ok(Message::SdoRequest(Request::Upload { object, complete })) => (Some(object), complete),
        Ok(Message::SdoRequest(Request::Download { object, .. })) => (Some(object), false),
        Ok(Message::SdoRequest(Request::UploadSegment { .. } | Request::DownloadSegment(_))) => {
            (None, false)
        }
        Ok(_) | Err(_) => return,
    };
    let Some(device) = model.devices.get_mut(id.index()) else { return };
    if taken {
        device.mailbox.asked(object, reads_whole, answer.at, answer.frame);
        mailbox_state::expect(model, id);
    } else {
        device.mailbox.not_taken(answer.at, answer.frame);
    }
    // Whether it stays unanswered is told by time alone.
    model.touch();
}

/// A fragment of an Ethernet frame was written into the mailbox, or was not, if `taken` is false.
fn frame_written(
    model: &mut NetworkModel,
    id: DeviceId,
    answer: &Answer<'_>,
    body: &[u8],
    taken: bool,
) {
    let Ok(eoe::Message::Fragment(_)) = eoe::Message::parse(body) else { return };
    let Some(device) = model.devices.get_mut(id.index()) else { return };
    if !is_mailbox(device, REQUESTS, answer.ado) {
        return;
    }
    if taken {
        if !device.mailbox.frame_taken(answer.at, answer.frame) {
            return;
        }
    } else {
        device.mailbox.not_taken(answer.at, answer.frame);
    }
    model.touch();
}

/// SyncManager of the mailbox that the MainDevice writes.
const REQUESTS: u8 = 0;
/// SyncManager of the mailbox that it reads.
const ANSWERS: u8 = 1;

/// True if the memory from an address on is the mailbox that a SyncManager guards, as it was seen set up.
fn is_mailbox(device: &Device, manager: u8, address: RegisterAddress) -> bool {
    device.set_up.sync_managers.get(&manager).is_some_and(|known| known.start == address)
}

/// Header and body of a mailbox message, if the bytes can be one.
fn message(data: &[u8]) -> Option<(Header, &[u8])> {
    let header = Header::parse(data).ok()?;
    let end = HEADER_LEN + usize::from(header.length);
    Some((header, data.get(HEADER_LEN..end)?))
}

/// An object was read: the identity, perhaps, or a message of the history. Says whether it is news.
fn uploaded(
    model: &mut NetworkModel,
    id: DeviceId,
    answer: &Answer<'_>,
    object: ObjectAddress,
    data: &[u8],
) -> bool {
    let Some(device) = model.devices.get_mut(id.index()) else { return false };
    if object.index == HISTORY && object.subindex >= FIRST_MESSAGE {
        let Some(message) = DiagnosisMessage::parse(data) else { return false };
        let message = HistoryMessage {
            code: message.code,
            severity: message.severity,
            text: message.text,
            time_ns: message.time_ns,
            parameters: message.parameters.to_vec(),
        };
        return device.mailbox.note(message, answer.at, answer.frame);
    }
    if is_sync_object(object.index) {
        // Event missed, cycle exceeded, shift too short: numbers of 16 bits.
        let (Some(bytes), 0x0B..=0x0D) = (data.first_chunk(), object.subindex) else {
            return false;
        };
        let seen = Seen::new(u16::from_le_bytes(*bytes), answer.at, Some(answer.frame));
        device.sync_counts.insert((object.index.0, object.subindex), seen);
        return true;
    }
    if object.index != ObjectIndex::IDENTITY {
        return false;
    }
    let seen = Seen::new((), answer.at, Some(answer.frame));
    identified(device, seen, object.subindex, data)
}

/// The object of the identity was read at once: the number of its entries in two bytes, then the entries.
fn identified_whole(model: &mut NetworkModel, id: DeviceId, seen: Seen<()>, data: &[u8]) -> bool {
    let Some(device) = model.devices.get_mut(id.index()) else { return false };
    let entries = data.get(2..).unwrap_or_default().chunks_exact(4);
    let mut is_new = false;
    for (subindex, entry) in (1..=4).zip(entries) {
        is_new |= identified(device, seen, subindex, entry);
    }
    is_new
}

/// The name of the device (0x1008) was read: its type, where nothing else says it.
fn named(model: &mut NetworkModel, id: DeviceId, data: &[u8]) -> bool {
    let Some(device) = model.devices.get_mut(id.index()) else { return false };
    let text = String::from_utf8_lossy(data);
    let name = text.trim_matches(|letter: char| letter == '\0' || letter.is_whitespace());
    let is_new = device.type_name.is_none() && !name.is_empty() && !name.contains(char::is_control);
    if is_new {
        device.type_name = Some(name.to_owned());
    }
    is_new
}

/// An entry of the identity was read.
fn identified(device: &mut Device, seen: Seen<()>, subindex: u8, data: &[u8]) -> bool {
    let Some(bytes) = data.first_chunk() else { return false };
    let seen = Some(Seen::new(u32::from_le_bytes(*bytes), seen.at, seen.frame));
    let field = match subindex {
        1 => &mut device.identity.vendor_id,
        2 => &mut device.identity.product_code,
        3 => &mut device.identity.revision,
        4 => &mut device.identity.serial,
        _ => return false,
    };
    let is_new = field.is_none();
    if is_new {
        *field = seen;
    }
    is_new
}

const fn is_sync_object(index: ObjectIndex) -> bool {
    index.0 == ObjectIndex::OUTPUT_SYNC.0 || index.0 == ObjectIndex::INPUT_SYNC.0
}

const HEADER_LEN: usize = 6;
/// CoE header and emergency.
const EMERGENCY_LEN: usize = 2 + Emergency::LEN;

#[cfg(test)]
mod tests {
    use linesman_proto::address::Network;
    use linesman_proto::time::Instant;

    use super::*;

    fn model() -> (NetworkModel, DeviceId) {
        let mut model = NetworkModel::new(Network(0));
        let id = model.add_device();
        (model, id)
    }

    #[test]
    fn identity_read_at_once_is_that_of_its_entries() {
        let (mut model, id) = model();
        let mut data = vec![4, 0];
        for value in [0x2u32, 0x0BBC_3052, 0x0015_0000, 77] {
            data.extend(value.to_le_bytes());
        }
        let seen = Seen::new((), Instant::ZERO, Some(9));
        assert!(identified_whole(&mut model, id, seen, &data));
        assert!(!identified_whole(&mut model, id, seen, &data), "nothing new");
        let identity = model.devices[id.index()].identity.identity().unwrap();
        assert_eq!((identity.vendor_id, identity.product_code), (2, 0x0BBC_3052));
        assert_eq!((identity.revision, identity.serial_number), (0x0015_0000, 77));
    }

    #[test]
    fn device_name_is_the_type_where_nothing_else_says_it() {
        let (mut model, id) = model();
        assert!(!named(&mut model, id, b"\0\0"), "no name");
        assert!(named(&mut model, id, b"EL3004\0"));
        assert!(!named(&mut model, id, b"Other"), "the first stays");
        assert_eq!(model.devices[id.index()].type_name.as_deref(), Some("EL3004"));
    }
}
