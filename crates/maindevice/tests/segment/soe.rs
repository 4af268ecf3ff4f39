//! SoE with a virtual drive: IDNs read and written in fragments, refusals, procedure commands.

use crate::bench::{Bench, Fate};
use linesman_maindevice::Event;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{RefusalKind, ServiceFailure};
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::soe::{
    ALL_COMMANDS, ALL_NUMBERS, ATTRIBUTE, CommandProgress, CommandState, DATA_STATE, Idn, MAXIMUM,
    NAME, SoeAttribute, UNIT, VALUE, VariableData, numbers_of_list,
};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

const PLANT: &str =
    "name = \"drive\"\n[[device]]\nname = \"X1\"\ntype = \"AX5103-0012\"\non = \"maindevice\"\n";

/// P-0-0150 can be written in PREOP alone, P-0-0151 is a text of 240 bytes at most.
const BRAKE_DELAY: Idn = Idn(0x8000 | 150);
const NOTES: Idn = Idn(0x8000 | 151);

fn ask(bench: &mut Bench, request: MailboxRequest) -> Result<Vec<u8>, ServiceFailure> {
    bench.ask_mailbox("X1", request)
}

fn read(bench: &mut Bench, idn: Idn, elements: u8) -> Result<Vec<u8>, ServiceFailure> {
    ask(bench, MailboxRequest::ReadIdn { drive: 0, idn, elements })
}

fn write(bench: &mut Bench, idn: Idn, data: &[u8]) -> Result<Vec<u8>, ServiceFailure> {
    ask(bench, MailboxRequest::WriteIdn { drive: 0, idn, elements: VALUE, data: data.to_vec() })
}

fn code(outcome: Result<Vec<u8>, ServiceFailure>) -> u32 {
    let failure = outcome.unwrap_err();
    let (kind, code) = failure.refusal().unwrap_or_else(|| panic!("{failure}"));
    assert_eq!(kind, RefusalKind::SoeError, "{failure}");
    code
}

fn text(bytes: &[u8], most: u16) -> Vec<u8> {
    VariableData { most, bytes }.to_bytes().unwrap()
}

#[test]
fn all_numbers_of_a_drive_are_listed_and_read_by_their_elements() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::PreOp);
    let numbers = numbers_of_list(&read(&mut bench, ALL_NUMBERS, VALUE).unwrap()).unwrap();
    assert!(numbers.contains(&ALL_NUMBERS) && numbers.len() >= 15, "{numbers:?}");
    for idn in numbers {
        let name = read(&mut bench, idn, NAME).unwrap();
        assert!(!VariableData::parse(&name).unwrap().bytes.is_empty(), "{idn}");
        let attribute = read(&mut bench, idn, ATTRIBUTE).unwrap();
        assert!(SoeAttribute::parse(&attribute).is_some(), "{idn}");
        read(&mut bench, idn, VALUE).unwrap();
    }
    let commands = numbers_of_list(&read(&mut bench, ALL_COMMANDS, VALUE).unwrap()).unwrap();
    assert!(commands.contains(&Idn(99)), "{commands:?}");
    // Several elements in one message.
    let both = read(&mut bench, Idn(91), UNIT | MAXIMUM).unwrap();
    assert_eq!(both, [&text(b"2^-18 rev/s", 11)[..], &(100_u32 << 18).to_le_bytes()].concat());
    let failure = read(&mut bench, Idn(52), VALUE).unwrap_err().to_string();
    assert!(failure.contains("S-0-0052") && failure.contains("0x1001"), "{failure}");
}

#[test]
fn text_is_moved_in_fragments_while_frames_get_lost() {
    // A mailbox of 128 bytes carries 118 of a value.
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::PreOp);
    bench.tamper =
        Some(Box::new(|number| if number % 13 == 0 { Fate::Lost } else { Fate::Arrives }));
    for round in 0..10_u8 {
        let notes = text(&[b'a' + round; 236], 240);
        write(&mut bench, NOTES, &notes).unwrap();
        assert_eq!(read(&mut bench, NOTES, VALUE).unwrap(), notes);
    }
    assert_eq!(code(write(&mut bench, NOTES, &text(&[b'x'; 400], 400))), 0x7003);
}

#[test]
fn what_a_drive_refuses_to_write_is_told_with_its_code() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::PreOp);
    for (idn, data, expected) in [
        (Idn(91), &[0, 0, 0, 0x7F][..], 0x7007),
        (Idn(91), &[0, 0], 0x7002),
        (Idn(91), &[0; 5], 0x7003),
        (Idn(51), &[0; 4], 0x7004),
        (Idn(36), &[0; 4], 0x700A),
        (Idn(15), &[5, 0], 0x7008),
        (Idn(52), &[0; 4], 0x1001),
    ] {
        assert_eq!(code(write(&mut bench, idn, data)), expected, "{idn}");
    }
    write(&mut bench, BRAKE_DELAY, &[100, 0]).unwrap();
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    assert_eq!(code(write(&mut bench, BRAKE_DELAY, &[100, 0])), 0x7005);
    write(&mut bench, Idn(91), &[100, 0, 0, 0]).unwrap();
    let other = MailboxRequest::ReadIdn { drive: 1, idn: ALL_NUMBERS, elements: VALUE };
    assert_eq!(code(ask(&mut bench, other)), 0x1001);
}

#[test]
fn procedure_command_is_set_comes_to_its_end_and_is_taken_back() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::PreOp);
    let reset = Idn(99);
    let progress = |bench: &mut Bench| {
        let state = read(bench, reset, DATA_STATE).unwrap();
        CommandState::parse(&state).unwrap().progress()
    };
    write(&mut bench, reset, &[3, 0]).unwrap();
    assert_eq!(progress(&mut bench), CommandProgress::Running);
    assert_eq!(code(write(&mut bench, reset, &[3, 0])), 0x7010);
    // The drive notifies of the end, once.
    bench.run_until(Span::ms(200), |_| false);
    let notified: Vec<Vec<u8>> = bench
        .events
        .iter()
        .filter_map(|(_, event)| {
            let Event::Mailbox { kind: MailboxType::Soe, data, .. } = event else { return None };
            Some(data.clone())
        })
        .collect();
    assert_eq!(notified, [[0x05, DATA_STATE, 99, 0, 0x03, 0]]);
    assert_eq!(progress(&mut bench), CommandProgress::Done);
    write(&mut bench, reset, &[0, 0]).unwrap();
    assert_eq!(progress(&mut bench), CommandProgress::NotSet);
}
