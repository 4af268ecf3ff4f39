//! Identification numbers of a drive (SoE), read and written.

use linesman_proto::mailbox::soe::{ALL_NUMBERS, Idn, SoeError, VALUE, numbers_of_list};

use super::*;

const SOE: u8 = 5;
const DRIVE: u8 = 1;

/// Answers of a drive to one request: bytes behind the mailbox header, one message after the other.
fn says(messages: &[&[u8]]) -> Scripted {
    let messages = messages.iter().map(|body| (SOE, body.to_vec())).collect();
    Scripted::with(vec![(SOE, Said::Several(messages))])
}

fn read(idn: Idn) -> MailboxRequest {
    MailboxRequest::ReadIdn { drive: DRIVE, idn, elements: VALUE }
}

#[test]
fn list_of_a_drive_comes_in_several_messages_with_a_notification_between() {
    // Two lengths and four numbers; the last message has the IDN where others tell how many follow.
    let mut scripted = says(&[
        &[0x2A, 0x40, 2, 0, 8, 0, 8, 0],
        &[0x25, 0x40, 99, 0, 7],
        &[0x2A, 0x40, 1, 0, 17, 0, 30, 0],
        &[0x22, 0x40, 17, 0, 36, 0, 1, 0x80],
    ]);
    let (outcome, events) = run(&mut scripted, read(ALL_NUMBERS));
    let numbers = numbers_of_list(&outcome.unwrap()).unwrap();
    assert_eq!(numbers, [ALL_NUMBERS, Idn(30), Idn(36), Idn(0x8001)]);
    assert_eq!(scripted.heard, [vec![0x21, 0x40, 17, 0]]);
    assert!(
        matches!(&events[..], [Event::Mailbox { data, .. }] if data[..] == [0x25, 0x40, 99, 0, 7]),
        "{events:?}"
    );
}

#[test]
fn number_that_a_drive_has_not_is_refused_with_its_code() {
    let failure = run(&mut says(&[&[0x32, 0x40, 51, 0, 0x01, 0x10]]), read(Idn(51))).0.unwrap_err();
    assert_eq!(failure.why, Why::Drive { code: SoeError(0x1001) }, "{failure}");
    assert!(failure.to_string().contains("S-0-0051"), "{failure}");
}

#[test]
fn answer_about_another_number_or_drive_is_not_taken() {
    for wrong in [&[0x22, 0x40, 52, 0, 1][..], &[0x42, 0x40, 51, 0, 1], &[0x24, 0x40, 51, 0]] {
        let failure = run(&mut says(&[wrong]), read(Idn(51))).0.unwrap_err();
        assert!(matches!(failure.why, Why::Protocol { .. }), "{failure}");
    }
}

#[test]
fn value_is_written_in_as_many_messages_as_it_takes() {
    let mut scripted = Scripted::with(vec![
        (SOE, Said::Several(Vec::new())),
        (SOE, Said::Body(vec![0x24, 0x40, 36, 0])),
    ]);
    let data: Vec<u8> = (0..30).collect();
    let request = MailboxRequest::WriteIdn {
        drive: DRIVE,
        idn: Idn(36),
        elements: VALUE,
        data: data.clone(),
    };
    run(&mut scripted, request).0.unwrap();
    let expected = [
        [&[0x2B, 0x40, 1, 0][..], &data[..22]].concat(),
        [&[0x23, 0x40, 36, 0][..], &data[22..]].concat(),
    ];
    assert_eq!(scripted.heard, expected);
}
