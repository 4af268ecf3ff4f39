//! Answers that lie in a mailbox until the MainDevice fetches them, by the bit that process data have of it.

use linesman_diagnosis::report::{Diagnosis, Severity};
use linesman_proto::address::LogicalAddress;
use linesman_proto::mailbox::coe::sdo::{Initial, Request, Response};
use linesman_proto::mailbox::coe::{Message, ObjectAddress};
use linesman_proto::mailbox::{Counter, Header, MailboxType};
use linesman_proto::register::FmmuConfig;

use crate::support::plant::codes;
use crate::support::script::{Script, fprd, fpwr, lrw};
use crate::support::text;

const PROCESS: u32 = 0x0100_0000;
const OBJECT: ObjectAddress = ObjectAddress::new(0x1018, 1);
/// The answer is fetched after so many cycles of 2 ms.
const FETCHED: u64 = 200;

fn mail(message: &Message<'_>) -> [u8; 64] {
    let mut mailbox = [0; 64];
    Header::new(MailboxType::Coe, Counter::FIRST, 0)
        .write_message(&mut mailbox, |body| message.write(body))
        .unwrap();
    mailbox
}

/// A request whose answer is fetched 400 ms later, and lies in the mailbox from a cycle on, as bit 2 of the last byte of
/// the process data tells.
fn asked(ready: u64) -> Diagnosis {
    let mut script = Script::scanned(2);
    let bit = FmmuConfig::mailbox_full(LogicalAddress(PROCESS + 7), 2, 1).unwrap();
    script.exchange(&[fpwr(0x1001, 0x0620, &bit.to_bytes())]);
    let cycle = |script: &mut Script, is_full: bool| {
        script.exchange(&[lrw(PROCESS, 8, 3).back(&[0, 0, 0, 0, 0, 0, 0, u8::from(is_full) << 2])]);
        script.now += 1_900_000;
    };
    (0..100).for_each(|_| cycle(&mut script, false));
    let request = Request::Upload { object: OBJECT, complete: false };
    script.exchange(&[fpwr(0x1001, 0x1000, &mail(&Message::SdoRequest(request)))]);
    (0..FETCHED).for_each(|number| cycle(&mut script, number >= ready));
    let initial = Initial::Normal { size: 4, data: &[2, 0, 0, 0] };
    let response = Response::Upload { object: OBJECT, complete: false, initial };
    script.exchange(&[fprd(0x1001, 0x1080, &mail(&Message::SdoResponse(response)))]);
    (0..100).for_each(|_| cycle(&mut script, false));
    script.finish();
    script.engine.diagnosis()
}

// fires: S251
#[test]
fn answer_is_late_by_when_its_bit_is_set_and_not_by_when_it_is_fetched() {
    let fetched_late = asked(5);
    assert!(codes(&fetched_late).is_empty(), "{}", text(&fetched_late));
    let notable = asked(75);
    assert_eq!(codes(&notable), ["S251"], "{}", text(&notable));
    assert_eq!(notable.findings[0].severity, Severity::Info);
    let slow = asked(175);
    assert_eq!(codes(&slow), ["S251"], "{}", text(&slow));
    assert_eq!(slow.findings[0].severity, Severity::Warning);
}
