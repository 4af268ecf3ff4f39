//! Pages about the numbers by which SubDevices say why: AL status codes, aborts, emergencies, errors
//! of file transfer and of other mailbox protocols.

use linesman_proto::ads::AdsCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::EmergencyClass;
use linesman_proto::mailbox::coe::diagnosis::{CodeRange, text_number};
use linesman_proto::mailbox::coe::emergency::code;
use linesman_proto::mailbox::error_reply::ErrorReplyCode;
use linesman_proto::mailbox::foe::FoeErrorCode;
use linesman_proto::mailbox::soe::SoeError;
use linesman_proto::state::AlStatusCode;

use super::page::{Kind, Page};
use super::topic;

fn owned(items: &[&str]) -> Vec<String> {
    items.iter().map(|item| (*item).to_owned()).collect()
}

/// A page about an AL status code, with the page of the guide that leads to its causes.
pub(super) fn status(code: AlStatusCode) -> Page {
    let entry = code.explain();
    let title = format!("AL status code 0x{:04X}: {}", code.value(), entry.name);
    let topic = topic::of_status(code);
    let page = Page::new(Kind::AlStatusCode, title)
        .text(entry.cause)
        .fact("class", entry.class.name())
        .fact("occurs", entry.occurs);
    match topic {
        None => page.steps(owned(entry.actions)).fact("see", entry.reference),
        Some(topic) => {
            let first = entry.actions.first().copied().unwrap_or_default();
            page.fact("first", first).fact("see", entry.reference).markdown(topic.body())
        }
    }
}

/// A page about the abort of an SDO transfer.
pub(super) fn abort(code: SdoAbortCode) -> Page {
    let entry = code.explain();
    let known = if entry.known { "" } else { " (not in the specifications; this is its class)" };
    let title = format!("CoE abort code 0x{:08X}: {}{known}", code.value(), entry.text);
    Page::new(Kind::AbortCode, title)
        .text(entry.cause)
        .fact("do", entry.action)
        .fact("see", entry.reference)
}

/// A page about the code of an emergency.
pub(super) fn emergency(code: u16) -> Page {
    let entry = code::lookup(code);
    let class = EmergencyClass::of(code);
    let known = if entry.known { "" } else { " (not in the specifications; this is its class)" };
    let text = match entry.known {
        true => String::new(),
        false => format!(
            "The manufacturer gave this number its meaning; its class is: {}.",
            class.text()
        ),
    };
    Page::new(Kind::EmergencyCode, format!("Emergency code 0x{code:04X}: {}{known}", entry.name))
        .text(text)
        .fact("class", class.text())
        .fact("where", "in an emergency message, and in object 0x603F of a drive")
        .steps(owned(class.actions()))
        .fact("see", entry.reference)
}

/// A page about the reason why a file was refused.
pub(super) fn foe(code: FoeErrorCode) -> Page {
    Page::new(Kind::FoeError, format!("FoE error 0x{:04X}: {}", code.0, code.text()))
        .text("The SubDevice refuses a transfer of a file, such as its firmware.")
        .fact("do", code.action())
        .fact("see", "ETG.1000.6, FoE, error codes")
}

/// A page about the reason why an access by SoE was refused.
pub(super) fn soe(code: SoeError) -> Page {
    Page::new(Kind::SoeError, format!("SoE error 0x{:04X}: {}", code.0, code.text()))
        .text("The drive refuses an access to an identification number (IDN).")
        .fact("do", format!("{}.", code.action()))
        .fact("see", "ETG.1000.6, SoE; IEC 61800-7-204")
}

/// A page about a return code of ADS.
pub(super) fn ads(code: AdsCode) -> Page {
    let meaning = code.meaning().unwrap_or("none that a SubDevice is known to give");
    Page::new(Kind::AdsCode, format!("ADS return code 0x{:X} ({}): {meaning}", code.0, code.0))
        .text("Result of a request by ADS: of the service, or of the way to it.")
        .fact("do", code.action())
        .fact("see", "Beckhoff Information System, ADS return codes")
}

/// Tells if a number is one of the errors of SoE.
pub(super) fn is_soe(code: u16) -> bool {
    SoeError(code).text() != SoeError(0).text()
}

/// A page about the reason why a mailbox message was refused.
pub(super) fn mailbox(code: ErrorReplyCode) -> Page {
    let title = format!("Mailbox error 0x{:04X}: {}", code.code(), code.text());
    Page::new(Kind::MailboxError, title)
        .text("The SubDevice could not even hand the message to a protocol.")
        .fact(
            "do",
            "Check that it speaks the protocol (SII word 0x1C), and take a capture of the request.",
        )
        .fact("see", "ETG.1000.4, mailbox, error reply")
}

/// A page about the code of a diagnosis message.
pub(super) fn diagnosis(code: u32) -> Page {
    let high = (code >> 16) as u16;
    let range = CodeRange::of(code);
    let mut page = Page::new(
        Kind::DiagnosisCode,
        format!("Code of a diagnosis message 0x{code:08X}: {}", range.name()),
    )
    .text(
        "The first four bytes of a message of object 0x10F3. The low word says whose code it is; what \
         happened stands in the text that the message names.",
    );
    page = match range {
        CodeRange::Emergency => {
            page.fact("emergency", format!("0x{high:04X} {}", code::lookup(high).name))
        }
        CodeRange::Manufacturer if high != 0 => {
            page.fact("product", format!("0x{high:04X}, as a type number {high}"))
        }
        CodeRange::Manufacturer
        | CodeRange::Unused
        | CodeRange::Reserved
        | CodeRange::Profile
        | CodeRange::Unassigned => page,
    };
    page.fact(
        "do",
        "Read the whole message: `linesman history WHERE DEVICE --esi FILE.xml`, or paste its bytes here.",
    )
    .fact("see", "ETG.1020, diagnosis history")
}

/// A page about the number of a text of a diagnosis message, as one manufacturer counts them.
pub(super) fn text(number: u16) -> Page {
    let general = text_number::general(number);
    let what = general.map_or("not one of the general texts", |text| text.text);
    let kind = text_number::kind(number).unwrap_or_default();
    let place = text_number::place(number).unwrap_or_default();
    Page::new(Kind::TextNumber, format!("Text number 0x{number:04X} of Beckhoff: {what}"))
        .text(
            "A diagnosis message (object 0x10F3) names its text by number. The numbers belong to the \
             device description; those of another manufacturer mean something else.",
        )
        .fact("kind", kind)
        .fact("place", place)
        .fact(
            "do",
            "`linesman history WHERE DEVICE --esi FILE.xml` puts the text of the description in.",
        )
        .fact("see", "ETG.1020, diagnosis history; documentation of the manufacturer")
}
