//! Requests by ADS (AoE), and what a SubDevice may answer to them.

use linesman_proto::ads::{
    AdsAnswer, AdsCode, AdsCommand, AdsRequest, AmsAddress, AmsHeader, AmsNetId,
};

use super::*;

const AOE: u8 = 1;
const TARGET: AmsAddress = AmsAddress { net_id: AmsNetId([10, 0, 0, 1, 3, 1]), port: 0x1000 };
const SOURCE: AmsAddress = AmsAddress { net_id: AmsNetId([10, 0, 0, 1, 2, 1]), port: 0xFFFF };

/// The read of four bytes.
fn read() -> MailboxRequest {
    let request = AdsRequest::Read { group: 0xF302, offset: 0x1018_0001, len: 4 };
    let (net_id, port, source) = (Some(TARGET.net_id), TARGET.port, Some(SOURCE));
    let data = request.to_bytes().1;
    MailboxRequest::Ads { net_id, port, source, command: AdsCommand::Read, data }
}

/// A message of the SubDevice that answers a request with this number.
fn answer(invoke_id: u32, error: AdsCode, data: &[u8]) -> Vec<u8> {
    let header = AmsHeader::request(TARGET, SOURCE, AdsCommand::Read.number(), invoke_id);
    header.answer(error).message(data)
}

fn good(invoke_id: u32, read: &[u8]) -> Vec<u8> {
    let data = AdsAnswer::Read(read.to_vec()).to_bytes(AdsCommand::Read.number());
    answer(invoke_id, AdsCode::OK, &data)
}

/// A SubDevice that says all this when it is asked.
fn says(messages: &[Vec<u8>]) -> Scripted {
    let messages = messages.iter().map(|body| (AOE, body.clone())).collect();
    Scripted { size: 128, ..Scripted::with(vec![(AOE, Said::Several(messages))]) }
}

#[test]
fn read_is_these_bytes_and_a_late_answer_is_not_taken_for_its_own() {
    let late = good(77, &[9, 9, 9, 9]);
    let mut scripted = says(&[late.clone(), good(1, &[2, 0, 0, 0])]);
    let (outcome, events) = run(&mut scripted, read());
    assert_eq!(outcome.unwrap(), [2, 0, 0, 0]);
    let header = [
        10, 0, 0, 1, 3, 1, 0x00, 0x10, 10, 0, 0, 1, 2, 1, 0xFF, 0xFF, 2, 0, 4, 0, 12, 0, 0, 0, 0,
        0, 0, 0, 1, 0, 0, 0,
    ];
    let asked = [&header[..], &[0x02, 0xF3, 0, 0, 1, 0, 0x18, 0x10, 4, 0, 0, 0]].concat();
    assert_eq!(scripted.heard, [asked]);
    assert!(
        matches!(&events[..], [Event::Mailbox { data, .. }] if data[..] == late[..]),
        "{events:?}"
    );
}

#[test]
fn doubled_answer_is_not_taken_for_that_to_the_next_request() {
    let mut scripted = says(&[good(1, &[1]), good(1, &[1])]);
    scripted.says.push((AOE, Said::Body(good(2, &[2]))));
    let (outcomes, _) = run_all(&mut scripted, vec![read(), read()]);
    let read: Vec<_> = outcomes.into_iter().map(Result::unwrap).collect();
    assert_eq!(read, [[1], [2]]);
}

#[test]
fn refusal_of_the_service_and_of_the_address_are_told_by_their_code() {
    let refused = AdsAnswer::Refused(AdsCode::NOT_FOUND).to_bytes(2);
    for (message, code, words) in [
        (answer(1, AdsCode::OK, &refused), AdsCode::NOT_FOUND, "0x70C not found"),
        (answer(1, AdsCode::MACHINE_NOT_FOUND, &[]), AdsCode::MACHINE_NOT_FOUND, "NetId"),
    ] {
        let failure = run(&mut says(&[message]), read()).0.unwrap_err();
        assert_eq!(failure.why, Why::Ads { code }, "{failure}");
        let text = failure.to_string();
        for words in [words, "SubDevice 5", "index group 0xF302, offset 0x10180001", "port 4096"] {
            assert!(text.contains(words), "{words} in {text}");
        }
    }
}

#[test]
fn answer_that_does_not_belong_there_is_told_with_what_was_expected() {
    let mut elsewhere = good(1, &[1]);
    elsewhere[13] = 9;
    let mut other_command = good(1, &[1]);
    other_command[16] = 3;
    let mut announced = good(1, &[1]);
    announced[20] = 200;
    for (message, words) in [
        (elsewhere, "one from 10.0.0.1.3.9:4096 to 10.0.0.1.2.1:65535"),
        (other_command, "one to command 3 instead of 2"),
        (announced, "AMS header announces 200 bytes of data, there are 9"),
        (good(1, &[1, 2, 3, 4, 5]), "5 bytes, 4 were asked for"),
        (answer(1, AdsCode::OK, &[0, 0]), "2 bytes answer ADS command 2"),
        (vec![1, 2, 3], "AMS message of 3 bytes ends within"),
    ] {
        let failure = run(&mut says(&[message]), read()).0.unwrap_err();
        assert!(matches!(failure.why, Why::Protocol { .. }), "{failure}");
        let text = failure.to_string();
        assert!(text.contains(words) && text.contains("the answer to an ADS request"), "{text}");
    }
}

#[test]
fn silence_and_a_message_that_is_longer_than_the_mailbox_are_told() {
    let failure = run(&mut says(&[]), read()).0.unwrap_err();
    assert!(matches!(failure.why, Why::NoAnswer { .. }), "{failure}");
    let small = &mut Scripted::with(Vec::new());
    let failure = run(small, read()).0.unwrap_err();
    assert!(matches!(failure.why, Why::TooSmall(_)), "{failure}");
    assert!(small.heard.is_empty());
}
