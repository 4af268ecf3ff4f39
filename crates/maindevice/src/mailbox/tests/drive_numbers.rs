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

#[test]
fn late_answers_to_other_requests_are_told_and_not_taken() {
    // A write, another drive, other elements, another IDN in fragments, a refusal of another IDN.
    let others: [&[u8]; 6] = [
        &[0x24, 0x40, 51, 0],
        &[0x42, 0x40, 51, 0, 1],
        &[0x22, 0x02, 51, 0, 1],
        &[0x2A, 0x40, 1, 0, 9, 9],
        &[0x22, 0x40, 52, 0, 9],
        &[0x32, 0x40, 52, 0, 0x01, 0x10],
    ];
    let mut messages = others.to_vec();
    messages.push(&[0x22, 0x40, 51, 0, 7]);
    let (outcome, events) = run(&mut says(&messages), read(Idn(51)));
    assert_eq!(outcome.unwrap(), [7]);
    // The part of the list may have been one of ours until its end was not.
    assert_eq!(events.len(), 5, "{events:?}");
    let failure = run(&mut says(&others), read(Idn(51))).0.unwrap_err().to_string();
    let words = "the answer to a read of drive 1: S-0-0052, value";
    assert!(failure.contains(words) && failure.contains("S-0-0051"), "{failure}");
}

#[test]
fn doubled_answer_is_not_taken_for_that_to_the_next_request() {
    let first: &[u8] = &[0x22, 0x40, 51, 0, 1];
    let mut scripted = says(&[first, first]);
    scripted.says.push((SOE, Said::Body(vec![0x22, 0x40, 52, 0, 2])));
    let (outcomes, _) = run_all(&mut scripted, vec![read(Idn(51)), read(Idn(52))]);
    let read: Vec<_> = outcomes.into_iter().map(Result::unwrap).collect();
    assert_eq!(read, [[1], [2]]);
}

#[test]
fn fragments_that_do_not_come_to_an_end_are_given_up() {
    let endless: Vec<&[u8]> = vec![&[0x2A, 0x40, 3, 0, 1]; 1_000];
    let failure = run(&mut says(&endless), read(Idn(51))).0.unwrap_err();
    let text = failure.to_string();
    assert!(matches!(failure.why, Why::Protocol { .. }), "{text}");
    assert!(text.contains("one that says 3 behind one that says 3"), "{text}");
    // A list that ends in the middle.
    let failure = run(&mut says(&endless[..1]), read(Idn(51))).0.unwrap_err();
    assert!(matches!(failure.why, Why::NoAnswer { .. }), "{failure}");
}

#[test]
fn write_is_refused_with_its_code_though_an_answer_to_another_came_before() {
    let messages: [&[u8]; 2] = [&[0x24, 0x40, 37, 0], &[0x34, 0x40, 36, 0, 0x0A, 0x70]];
    let request =
        MailboxRequest::WriteIdn { drive: DRIVE, idn: Idn(36), elements: VALUE, data: vec![1; 4] };
    let failure = run(&mut says(&messages), request).0.unwrap_err();
    assert_eq!(failure.why, Why::Drive { code: SoeError(0x700A) }, "{failure}");
}

#[test]
fn answer_without_one_of_its_fragments_is_asked_for_again() {
    let fragment = |left: u8, data: u8| (SOE, vec![0x2A, 0x40, left, 0, data]);
    let last = (SOE, vec![0x22, 0x40, 51, 0, 3]);
    let lossy = || (SOE, Said::Several(vec![fragment(2, 1), last.clone()]));
    let whole = Said::Several(vec![fragment(2, 1), fragment(1, 2), last.clone()]);
    let mut scripted = Scripted::with(vec![lossy(), (SOE, whole)]);
    assert_eq!(run(&mut scripted, read(Idn(51))).0.unwrap(), [1, 2, 3]);
    assert_eq!(scripted.heard.len(), 2);
    let mut scripted = Scripted::with((0..9).map(|_| lossy()).collect());
    let failure = run(&mut scripted, read(Idn(51))).0.unwrap_err().to_string();
    assert!(failure.contains("one that says 0 behind one that says 2"), "{failure}");
    assert_eq!(scripted.heard.len(), 4, "not without end");
}
