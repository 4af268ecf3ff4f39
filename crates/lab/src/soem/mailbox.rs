//! Objects of SubDevices as SOEM reads and writes them: the mailbox is emptied, the request written, the answer
//! polled for every 200 µs.

use linesman_proto::mailbox::coe::{self, ObjectAddress, sdo};
use linesman_proto::mailbox::{Counter, Header, MailboxType, Message};
use linesman_proto::time::Span;

use super::bus::{Bus, RETURN, SHORTLY, SURELY};
use super::device::{Device, Mailbox};

/// How long an answer is waited for: `EC_TIMEOUTRXM`.
const ANSWER: Span = Span::ms(700);
/// Status of the `SyncManager` that SubDevices send by.
const STATUS: u16 = 0x080D;
/// Its bit that tells of a message.
const FULL: u8 = 0x08;

/// Reads an object; `None` when it is refused or nothing comes (`ecx_SDOread`).
pub(super) async fn upload(
    bus: &Bus,
    device: &mut Device,
    object: ObjectAddress,
    complete: bool,
) -> Option<Vec<u8>> {
    let first = sdo::Request::Upload { object, complete };
    let message = exchange(bus, device, first).await?;
    let (mut data, size) = match response(&message)? {
        sdo::Response::Upload { object: about, initial, .. } if about == object => {
            (initial.data().to_vec(), initial.size() as usize)
        }
        sdo::Response::Upload { .. }
        | sdo::Response::UploadSegment(_)
        | sdo::Response::Download { .. }
        | sdo::Response::DownloadSegment { .. } => return None,
    };
    let mut toggle = false;
    while data.len() < size {
        let message = exchange(bus, device, sdo::Request::UploadSegment { toggle }).await?;
        let Some(sdo::Response::UploadSegment(segment)) = response(&message) else { return None };
        data.extend_from_slice(segment.data);
        if segment.last {
            break;
        }
        toggle = !toggle;
    }
    Some(data)
}

/// Writes an object; says whether it was taken. Only what fits into the mailbox at once is written.
pub(super) async fn download(
    bus: &Bus,
    device: &mut Device,
    object: ObjectAddress,
    complete: bool,
    data: &[u8],
) -> bool {
    let Some(Mailbox { out: (_, len), .. }) = device.mailbox else { return false };
    let initial = sdo::Initial::of(data, len.into());
    let request = sdo::Request::Download { object, complete, initial };
    let message = exchange(bus, device, request).await;
    let taken = message.as_deref().and_then(response);
    initial.is_complete() && matches!(taken, Some(sdo::Response::Download { .. }))
}

/// A byte, a word or a long word of an object as a number.
pub(super) async fn number(
    bus: &Bus,
    device: &mut Device,
    index: u16,
    subindex: u8,
) -> Option<u32> {
    let data = upload(bus, device, ObjectAddress::new(index, subindex), false).await?;
    let mut bytes = [0; 4];
    bytes.iter_mut().zip(&data).for_each(|(to, from)| *to = *from);
    Some(u32::from_le_bytes(bytes))
}

/// The answer of CoE in a message.
fn response(message: &[u8]) -> Option<sdo::Response<'_>> {
    let message = Message::parse(message).ok()?;
    if message.header.kind != MailboxType::Coe {
        return None;
    }
    match coe::Message::parse(message.data).ok()? {
        coe::Message::SdoResponse(response) => Some(response),
        coe::Message::Emergency(_)
        | coe::Message::SdoRequest(_)
        | coe::Message::Abort(_)
        | coe::Message::Information(_)
        | coe::Message::Pdo { .. } => None,
    }
}

/// One message out, one back.
async fn exchange(bus: &Bus, device: &mut Device, request: sdo::Request<'_>) -> Option<Vec<u8>> {
    let mailbox = device.mailbox.as_mut()?;
    let counter = mailbox.counter.map_or(Counter::FIRST, Counter::next);
    mailbox.counter = Some(counter);
    let mailbox = *mailbox;
    // What is still there from before is thrown away.
    receive(bus, device, mailbox, Span::ns(0)).await;
    let mut buffer = vec![0; mailbox.out.1.into()];
    Header::new(MailboxType::Coe, counter, 0)
        .write_message(&mut buffer, |body| coe::Message::SdoRequest(request).write(body))
        .ok()?;
    if !bus.write(device.target(), mailbox.out.0, &buffer, SURELY).await {
        return None;
    }
    receive(bus, device, mailbox, ANSWER).await
}

/// A message, if one comes in time (`ecx_mbxreceive`).
async fn receive(bus: &Bus, device: &Device, mailbox: Mailbox, timeout: Span) -> Option<Vec<u8>> {
    let end = bus.now() + timeout;
    loop {
        let status = bus.read(device.target(), STATUS, 1, RETURN).await;
        if status.answered() && status.bytes::<1>(0)[0] & FULL != 0 {
            break;
        }
        if bus.now() >= end {
            return None;
        }
        bus.sleep(SHORTLY).await;
    }
    let (at, len) = mailbox.back;
    let reply = bus.read(device.target(), at, len.into(), SURELY).await;
    reply.answered().then(|| reply.data.into_vec())
}
