//! Pages about the bytes of messages: diagnosis messages, emergencies, mailbox messages.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::diagnosis::{CodeRange, DiagnosisMessage, text_number};
use linesman_proto::mailbox::coe::emergency::code;
use linesman_proto::mailbox::coe::{
    Emergency, EmergencyClass, ErrorRegister, Message, ObjectAddress, message,
};
use linesman_proto::mailbox::error_reply::ErrorReply;
use linesman_proto::mailbox::header::{self, MailboxType};

use super::bytes::Bytes;
use super::page::{Kind, Page};
use super::{codes, objects};
use crate::command::history::message::{system_time, values};
use crate::command::sdo::value::hex;

/// Fewest bytes from which a message can be told.
const FEWEST: usize = 3;

/// All messages that these bytes can be, the more likely first.
pub(super) fn pages(bytes: &Bytes) -> Vec<Page> {
    let data = bytes.data.as_slice();
    let mut pages = Vec::new();
    if data.len() < FEWEST || data.len() == FEWEST && !bytes.apart {
        return pages;
    }
    pages.extend(mailbox(data));
    let is_history = data.len() >= 2 && (0xE0..=0xEF).contains(&data[1]);
    let long_enough = data.len() >= DiagnosisMessage::HEADER_LEN;
    if pages.is_empty() && (is_history || long_enough) {
        pages.push(diagnosis(data, bytes.cut));
    }
    let is_emergency = data.len() == Emergency::LEN || bytes.apart && data.len() < Emergency::LEN;
    if !is_history && is_emergency {
        pages.push(emergency(data));
    }
    if pages.is_empty() && data.len() > Emergency::LEN {
        pages.extend(coe(data));
    }
    pages
}

/// A message of the diagnosis history, field by field, as far as it goes.
fn diagnosis(data: &[u8], cut: bool) -> Page {
    let missing = data.len() < DiagnosisMessage::HEADER_LEN;
    let mut whole = data.to_vec();
    whole.resize(data.len().max(DiagnosisMessage::HEADER_LEN), 0);
    let page = Page::new(Kind::Message, "Diagnosis message (an entry of object 0x10F3)");
    let Some(message) = DiagnosisMessage::parse(&whole) else { return page };
    let high = (message.code >> 16) as u16;
    let range = CodeRange::of(message.code);
    let code = match range {
        CodeRange::Manufacturer if high != 0 => format!(
            "code 0x{:08X}: {}; high word 0x{high:04X}, as a type number {high}",
            message.code,
            range.name()
        ),
        CodeRange::Emergency => format!(
            "code 0x{:08X}: {} 0x{high:04X} {}",
            message.code,
            range.name(),
            code::lookup(high).name
        ),
        CodeRange::Manufacturer
        | CodeRange::Unused
        | CodeRange::Reserved
        | CodeRange::Profile
        | CodeRange::Unassigned => format!("code 0x{:08X}: {}", message.code, range.name()),
    };
    let time = match (message.time_ns, message.local_time) {
        (0, _) => "none: the SubDevice has no clock, or it was not set".to_owned(),
        (ns, true) => {
            format!("{:.9} s of its own clock", std::time::Duration::from_nanos(ns).as_secs_f64())
        }
        (ns, false) => system_time(ns).unwrap_or_else(|| format!("{ns} ns since 2000")),
    };
    let general = match text_number::general(message.text) {
        Some(text) if range == CodeRange::Manufacturer => format!(" (Beckhoff: {})", text.text),
        Some(_) | None => String::new(),
    };
    let mut fields = vec![(0, 4, code)];
    fields.push((
        4,
        2,
        format!(
            "flags 0x{:04X}: {}, {} parameters, time of {}",
            u16::from_le_bytes([whole[4], whole[5]]),
            message.severity.name(),
            message.count,
            if message.local_time { "its own clock" } else { "the distributed clocks" }
        ),
    ));
    fields.push((6, 2, format!("text number 0x{:04X}{general}", message.text)));
    fields.push((8, 8, format!("time: {time}")));
    let rows = fields.into_iter().filter(|(at, len, _)| at + len <= data.len());
    let mut rows: Vec<String> = rows
        .map(|(at, len, text)| {
            format!("bytes {at} to {}: {} = {text}", at + len - 1, hex(&data[at..at + len]))
        })
        .collect();
    let parameters = values(&message, &[]);
    for (number, value) in parameters.iter().enumerate() {
        rows.push(format!("parameter {}: {}", number + 1, value.text()));
    }
    if !missing && parameters.len() < usize::from(message.count) {
        rows.push(format!(
            "{} of {} parameters can be read: the rest is cut off",
            parameters.len(),
            message.count
        ));
    }
    let told = match (missing, cut) {
        (true, _) => format!("Only {} of at least 16 bytes: what they tell so far.", data.len()),
        (false, true) => "The bytes were cut off at the end.".to_owned(),
        (false, false) => String::new(),
    };
    let severity = if missing { String::new() } else { message.severity.name().to_owned() };
    page.text(told)
        .fact("severity", severity)
        .list("bytes", rows)
        .fact(
            "do",
            "Look the text number up in the device description: `linesman history WHERE DEVICE --esi \
             FILE.xml` does that.",
        )
        .fact("see", "ETG.1020, diagnosis history")
}

/// An emergency, as far as it goes.
fn emergency(data: &[u8]) -> Page {
    let code = u16::from_le_bytes([data[0], data[1]]);
    let register = ErrorRegister(data[2]);
    let sorts: Vec<&str> = register.names().collect();
    let sorts = if sorts.is_empty() { "no error".to_owned() } else { sorts.join(", ") };
    let entry = code::lookup(code);
    let title = format!("Emergency message: 0x{code:04X} {}", entry.name);
    let data = data.get(3..Emergency::LEN.min(data.len())).unwrap_or_default();
    let more = if data.is_empty() { String::new() } else { hex(data) };
    Page::new(Kind::Message, title)
        .fact("code", format!("0x{code:04X}: {} (bytes 0 and 1, low byte first)", entry.name))
        .fact("errors", format!("error register 0x{:02X}: {sorts} (byte 2)", register.0))
        .fact(
            "data",
            if more.is_empty() { more } else { format!("{more}: as the manufacturer defines") },
        )
        .steps(EmergencyClass::of(code).actions().iter().map(|action| (*action).to_owned()))
        .fact("see", "ETG.1000.6, emergency; CiA 301")
}

/// A mailbox message, if the bytes begin with a header that fits them.
fn mailbox(data: &[u8]) -> Option<Page> {
    let parsed = header::Message::parse(data).ok()?;
    let header = parsed.header;
    let fits = usize::from(header.length) + header::HEADER_LEN <= data.len()
        && header.length >= 2
        && data[5] & 0x80 == 0;
    let known = matches!(
        header.kind,
        MailboxType::Error
            | MailboxType::Aoe
            | MailboxType::Eoe
            | MailboxType::Coe
            | MailboxType::Foe
            | MailboxType::Soe
            | MailboxType::Voe
    );
    // Those that fill a mailbox have zeros behind; a diagnosis message has a code that is no length.
    let rest = &data
        [header::HEADER_LEN + usize::from(header.length).min(data.len() - header::HEADER_LEN)..];
    if !fits || !known || rest.iter().any(|byte| *byte != 0) {
        return None;
    }
    let inner = match header.kind {
        MailboxType::Coe => coe(parsed.data),
        MailboxType::Error => {
            ErrorReply::parse(parsed.data).ok().map(|reply| codes::mailbox(reply.code))
        }
        MailboxType::Aoe
        | MailboxType::Eoe
        | MailboxType::Foe
        | MailboxType::Soe
        | MailboxType::Voe
        | MailboxType::Reserved(_) => {
            Some(Page::new(Kind::Message, format!("{} message", header.kind.name())))
        }
    }?;
    let counter = header.counter.value();
    let text = format!(
        "{}, {} bytes, address 0x{:04X}, counter {counter}",
        header.kind.name(),
        header.length,
        header.address.0
    );
    Some(inner.fact("mailbox", text))
}

/// A CoE message.
fn coe(data: &[u8]) -> Option<Page> {
    let parsed = Message::parse(data).ok()?;
    let word = u16::from_le_bytes(*data.first_chunk()?);
    let service = message::Header::from_word(word).service;
    let about = |address: ObjectAddress| {
        let pages = objects::pages(address.index, Some(address.subindex));
        pages.first().map(|page| page.title().to_owned())
    };
    match parsed {
        Message::Emergency(_) => data.get(2..2 + Emergency::LEN).map(emergency),
        Message::Abort(abort) => {
            let code = SdoAbortCode(abort.code);
            Some(codes::abort(code).fact("object", about(abort.object).unwrap_or_default()))
        }
        Message::SdoRequest(_)
        | Message::SdoResponse(_)
        | Message::Information(_)
        | Message::Pdo { .. } => {
            let page = Page::new(Kind::Message, format!("CoE message: {}", service.name()));
            let address = data.get(3..6).map(|address| {
                ObjectAddress::new(u16::from_le_bytes([address[0], address[1]]), address[2])
            });
            let is_sdo = matches!(parsed, Message::SdoRequest(_) | Message::SdoResponse(_));
            let object = address.filter(|_| is_sdo).and_then(about).unwrap_or_default();
            Some(page.fact("object", object).fact("bytes", hex(data)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::explain::bytes::parse;

    fn titles(text: &str) -> Vec<String> {
        let bytes = parse(text).unwrap();
        pages(&bytes).iter().map(|page| page.title().to_owned()).collect()
    }

    #[test]
    fn messages_are_told_apart() {
        // 0x1C21E000 warning, text 0x4411, no time.
        let message = "00 E0 21 1C 01 00 11 44 00 00 00 00 00 00 00 00";
        assert_eq!(titles(message), ["Diagnosis message (an entry of object 0x10F3)"]);
        assert_eq!(titles("00E0211C…"), ["Diagnosis message (an entry of object 0x10F3)"]);
        assert_eq!(
            titles("30 81 11 00 00 00 00 00"),
            ["Emergency message: 0x8130 life guard or heartbeat error"]
        );
        assert_eq!(
            titles("10 23 03"),
            ["Emergency message: 0x2310 continuous overcurrent at the output"]
        );
        // A mailbox with an emergency: header, CoE header, the emergency.
        assert_eq!(
            titles("0A 00 00 00 00 13 00 10 11 86 20 00 00 00 00 00"),
            ["Emergency message: 0x8611 following error"]
        );
        // The abort of an SDO, as MainDevices print it.
        assert_eq!(
            titles("0A 00 00 00 00 13 00 20 80 F0 10 01 02 00 01 06"),
            ["CoE abort code 0x06010002: Attempt to write a read only object"]
        );
    }

    #[test]
    fn every_field_of_a_message_is_told() {
        // The message of the public stack code with three parameters.
        let text =
            "00 E0 EA 0B 11 03 01 41 02 01 00 00 00 00 00 00 05 00 3C 02 20 61 62 00 40 34 12";
        let page = &pages(&parse(text).unwrap())[0];
        let shown = page.render(crate::output::Paint::PLAIN, 400);
        for part in [
            "0x0BEAE000",
            "type number 3050",
            "warning, 3 parameters",
            "text number 0x4101 (Beckhoff: terminal is too warm)",
            "its own clock",
            "parameter 1: 60",
            "parameter 2: ab",
            "parameter 3: text 0x1234",
        ] {
            assert!(shown.contains(part), "{part}: {shown}");
        }
    }

    #[test]
    fn any_bytes_are_read_without_harm() {
        for len in 0..40_u8 {
            for fill in [0x00, 0x7F, 0xE0, 0xFF] {
                let data: Vec<u8> = (0..len).map(|at| at.wrapping_mul(37) ^ fill).collect();
                let bytes = Bytes { data, cut: false, apart: true };
                for page in pages(&bytes) {
                    assert!(!page.render(crate::output::Paint::PLAIN, 60).is_empty());
                }
            }
        }
    }
}
