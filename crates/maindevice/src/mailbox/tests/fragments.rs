//! Error replies to fragments of Ethernet frames, while another operation is under way.

use super::*;

/// An error reply with this code.
fn error_reply(code: u8) -> (u8, Vec<u8>) {
    (0, vec![1, 0, code, 0])
}

/// The answer to an upload of 0x2000:01: two bytes.
fn answer() -> (u8, Vec<u8>) {
    (COE, vec![0x00, 0x30, 0x4B, 0x00, 0x20, 1, 0x2A, 0, 0, 0])
}

fn upload_request() -> MailboxRequest {
    MailboxRequest::Upload { object: ObjectAddress::new(0x2000, 1), complete: false }
}

/// A frame of two fragments in a mailbox of 32 bytes is too short for Ethernet; one fragment of a longer one is enough
/// here, since the SubDevice of the tests does not read it.
fn frame() -> MailboxRequest {
    MailboxRequest::SendFrame { port: 0, number: 3, frame: vec![0x55; 20] }
}

#[test]
fn error_reply_to_a_fragment_is_not_taken_for_the_answer_to_the_upload_behind_it() {
    // The SubDevice refuses the fragment late: the upload is in its mailbox already.
    let silence = (EOE, Said::Several(Vec::new()));
    let late = (COE, Said::Several(vec![error_reply(7), answer()]));
    let mut scripted = Scripted::with(vec![silence, late]);
    let (outcomes, events) = run_all(&mut scripted, vec![frame(), upload_request()]);
    assert!(outcomes[0].is_ok(), "{outcomes:?}");
    assert_eq!(outcomes[1].as_ref().unwrap(), &[0x2A, 0]);
    let [Event::Mailbox { kind, data, .. }] = &events[..] else { panic!("{events:?}") };
    assert_eq!(
        (*kind, &data[..]),
        (linesman_proto::mailbox::MailboxType::Error, &[1, 0, 7, 0][..])
    );
}

#[test]
fn error_reply_after_that_to_each_fragment_is_the_answer() {
    let silence = (EOE, Said::Several(Vec::new()));
    let both = (COE, Said::Several(vec![error_reply(7), error_reply(4)]));
    let mut scripted = Scripted::with(vec![silence, both]);
    let (outcomes, _) = run_all(&mut scripted, vec![frame(), upload_request()]);
    let failure = outcomes[1].as_ref().unwrap_err();
    let Why::Mailbox { code } = failure.why else { panic!("{failure}") };
    assert_eq!(code.code(), 4);
}

#[test]
fn error_reply_that_may_be_about_a_fragment_is_told_when_no_answer_comes() {
    let silence = (EOE, Said::Several(Vec::new()));
    let one = (COE, Said::Several(vec![error_reply(7)]));
    let mut scripted = Scripted::with(vec![silence, one]);
    let (outcomes, _) = run_all(&mut scripted, vec![frame(), upload_request()]);
    let text = outcomes[1].as_ref().unwrap_err().to_string();
    assert!(text.contains("no answer within 2 s"), "{text}");
    assert!(text.contains("0x0007") && text.contains("Ethernet fragment"), "{text}");
}

#[test]
fn error_reply_after_an_answer_is_not_about_a_fragment_before_it() {
    // The fragment was done with when the first upload was answered.
    let silence = (EOE, Said::Several(Vec::new()));
    let says =
        vec![silence, (COE, Said::Several(vec![answer()])), (0, Said::Body(error_reply(6).1))];
    let mut scripted = Scripted::with(says);
    let requests = vec![frame(), upload_request(), upload_request()];
    let (outcomes, _) = run_all(&mut scripted, requests);
    assert!(outcomes[1].is_ok());
    let failure = outcomes[2].as_ref().unwrap_err();
    assert!(matches!(failure.why, Why::Mailbox { .. }), "{failure}");
}
