//! Requests to the drive and the bytes that answer them.

use linesman_proto::mailbox::soe::{DEFAULT, SoeAttribute, numbers_of_list};
use proptest::prelude::*;

use super::*;
use crate::device::dictionary::{Entry, Object, READ_WRITE};
use crate::device::files::Files;
use crate::device::software_fault::SoftwareFaults;
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};

/// A drive with what the application would have.
struct Drive {
    server: SoeServer,
    dictionary: Dictionary,
    files: Files,
    software_faults: SoftwareFaults,
    state: AlState,
    now: Instant,
}

impl Drive {
    fn new() -> Self {
        let number = |index, bits, value| {
            let entry = Entry::number(0, "value", DataType::UDINT, bits, READ_WRITE, value);
            Object::variable(ObjectIndex(index), entry)
        };
        let objects = vec![
            number(36, 32, 5),
            number(40, 32, 0),
            number(51, 32, 0xFFFF_FFFE),
            number(91, 32, 1_000),
            number(134, 16, 0xE000),
            number(135, 16, 0xC000),
            number(parameter::BRAKE_DELAY.0, 16, 500),
            Object::variable(ObjectIndex(parameter::NOTES.0), Entry::text("name", "axis")),
        ];
        Self {
            server: SoeServer::default(),
            dictionary: Dictionary::new(objects, false),
            files: Files::default(),
            software_faults: SoftwareFaults::default(),
            state: AlState::PreOp,
            now: Instant::ZERO,
        }
    }

    fn ask(&mut self, request: &[u8], room: usize) -> Vec<Vec<u8>> {
        let mut served = Served {
            dictionary: &mut self.dictionary,
            files: &mut self.files,
            software_faults: &mut self.software_faults,
            state: self.state,
        };
        self.server.answer(request, self.now, &mut served, room)
    }

    /// Data of an element, or the code of its refusal.
    fn read(&mut self, element: u8, idn: u16) -> Result<Vec<u8>, u16> {
        let [low, high] = idn.to_le_bytes();
        let answers = self.ask(&[0x01, element, low, high], 500);
        let [answer] = &answers[..] else { panic!("{answers:02X?}") };
        let message = Message::parse(answer).unwrap();
        assert_eq!(message.operation, Operation::ReadResponse);
        assert_eq!((message.elements, message.number), (element, idn));
        message.refusal().map_or(Ok(message.data.to_vec()), |code| Err(code.0))
    }

    /// Writes the value; the code of a refusal.
    fn write(&mut self, idn: u16, data: &[u8]) -> Result<(), u16> {
        let [low, high] = idn.to_le_bytes();
        let answers = self.ask(&[&[0x03, VALUE, low, high], data].concat(), 500);
        let [answer] = &answers[..] else { panic!("{answers:02X?}") };
        let message = Message::parse(answer).unwrap();
        assert_eq!((message.operation, message.number), (Operation::WriteResponse, idn));
        message.refusal().map_or(Ok(()), |code| Err(code.0))
    }
}

const BRAKE: u16 = parameter::BRAKE_DELAY.0;
const NOTES: u16 = parameter::NOTES.0;

#[test]
fn requests_for_what_it_has_not_are_refused_with_the_idn_they_ask_for() {
    let mut drive = Drive::new();
    // Read S-0-0051, value, drive 1; write S-0-0037; read S-0-0017 of a second drive.
    let mut refused = |request: &[u8]| drive.ask(request, 100);
    assert_eq!(refused(&[0x21, 0x40, 51, 0]), [[0x32, 0x40, 51, 0, 0x01, 0x10]]);
    assert_eq!(refused(&[0x03, 0x40, 37, 0, 9, 9]), [[0x14, 0x40, 37, 0, 0x01, 0x10]]);
    assert_eq!(refused(&[0x21, 0x40, 17, 0]), [[0x32, 0x40, 17, 0, 0x01, 0x10]]);
    for (element, code) in
        [(UNIT, 0x4001_u16), (MINIMUM, 0x5001), (MAXIMUM, 0x6001), (DEFAULT, 0x1009), (0, 0x1009)]
    {
        let code = code.to_le_bytes();
        assert_eq!(refused(&[1, element, 17, 0]), [[0x12, element, 17, 0, code[0], code[1]]]);
    }
    for unanswered in [&[0x05, 0, 0, 0][..], &[0x0B, 0x40, 1, 0, 9], &[0x01, 0]] {
        assert_eq!(drive.ask(unanswered, 100), Vec::<Vec<u8>>::new());
    }
}

#[test]
fn every_number_has_a_name_an_attribute_and_a_value_that_fits_it() {
    let mut drive = Drive::new();
    let numbers = numbers_of_list(&drive.read(VALUE, 17).unwrap()).unwrap();
    let commands = numbers_of_list(&drive.read(VALUE, 25).unwrap()).unwrap();
    assert!(numbers.is_sorted() && numbers.len() == parameter::PARAMETERS.len());
    assert_eq!(commands, [Idn(99), CALIBRATE]);
    for idn in numbers {
        let name = drive.read(NAME, idn.0).unwrap();
        assert!(!VariableData::parse(&name).unwrap().bytes.is_empty(), "{idn}");
        let attribute = SoeAttribute::parse(&drive.read(ATTRIBUTE, idn.0).unwrap()).unwrap();
        assert_eq!(attribute.is_command(), commands.contains(&idn), "{idn}");
        let value = drive.read(VALUE, idn.0).unwrap();
        match attribute.length() {
            ValueLength::Fixed(bytes) => assert_eq!(value.len(), usize::from(bytes), "{idn}"),
            ValueLength::List(_) => assert!(VariableData::parse(&value).is_some(), "{idn}"),
            ValueLength::Reserved => panic!("{idn}"),
        }
        assert_eq!(drive.read(DATA_STATE, idn.0), Ok(vec![0, 0]), "{idn}");
    }
    assert_eq!(drive.read(VALUE, 51), Ok(vec![0xFE, 0xFF, 0xFF, 0xFF]), "what the axis has");
    assert_eq!(drive.read(MAXIMUM, BRAKE), Ok(10_000_u16.to_le_bytes().to_vec()));
    // Name and unit in one go.
    let both = drive.read(NAME | UNIT, 36).unwrap();
    let name = VariableData::parse(&both).unwrap().bytes;
    let unit = VariableData::parse(&both[LIST_HEADER_LEN + name.len()..]).unwrap().bytes;
    assert_eq!((name, unit), (&b"Velocity command value"[..], &b"2^-18 rev/s"[..]));
    assert_eq!(drive.read(NAME | UNIT, 17), Err(0x4001));
}

#[test]
fn list_of_its_numbers_comes_in_as_many_messages_as_it_takes() {
    let mut drive = Drive::new();
    let whole = drive.ask(&[0x01, 0x40, 25, 0], 100);
    let list = [4, 0, 4, 0, 99, 0, 160, 0x80];
    assert_eq!(whole, [[&[0x02, 0x40, 25, 0][..], &list].concat()]);
    let in_two = [
        [&[0x0A, 0x40, 1, 0][..], &list[..5]].concat(),
        [&[0x02, 0x40, 25, 0][..], &list[5..]].concat(),
    ];
    assert_eq!(drive.ask(&[0x01, 0x40, 25, 0], 9), in_two);
}

#[test]
fn write_is_taken_or_refused_with_the_code_that_belongs() {
    let mut drive = Drive::new();
    let limit = |value: u32| value.to_le_bytes();
    assert_eq!(drive.write(91, &limit(2_000)), Ok(()));
    assert_eq!(drive.read(VALUE, 91), Ok(limit(2_000).to_vec()));
    let text = |text: &[u8]| of_variable_length(text, 240);
    let table: [(u16, &[u8], Result<(), u16>); 17] = [
        (91, &[1, 0], Err(0x7002)),
        (91, &[1, 0, 0, 0, 0], Err(0x7003)),
        (91, &limit(26_214_401), Err(0x7007)),
        (36, &limit(1), Err(0x700A)),
        (51, &limit(1), Err(0x7004)),
        (17, &[0; 4], Err(0x7004)),
        (15, &[7, 0], Ok(())),
        (15, &[5, 0], Err(0x7008)),
        (16, &[4, 0, 4, 0, 135, 0, 51, 0], Ok(())),
        (16, &[4, 0, 4, 0, 135, 0, 40, 0], Err(0x7008)),
        (16, &[3, 0, 4, 0, 135, 0, 40], Err(0x7002)),
        (16, &[8, 0, 8, 0, 135, 0, 51, 0], Err(0x7002)),
        (NOTES, &[0, 0], Err(0x7002)),
        (NOTES, &text(&[b'x'; 241]), Err(0x7003)),
        (NOTES, &[&text(b"lift")[..], b"er"].concat(), Err(0x7003)),
        (NOTES, &text(b"lift"), Ok(())),
        (0x8FFF, &[0; 2], Err(0x1001)),
    ];
    for (idn, data, outcome) in table {
        assert_eq!(drive.write(idn, data), outcome, "{} {data:02X?}", Idn(idn));
    }
    assert_eq!(drive.read(VALUE, NOTES), Ok(text(b"lift")));
    // What cannot be written at all, by its element.
    for (element, code) in
        [(NAME, 0x2004), (ATTRIBUTE, 0x3004), (UNIT, 0x4004), (MINIMUM, 0x5004), (MAXIMUM, 0x6004)]
    {
        let answer = drive.ask(&[0x03, element, 91, 0, 1], 100).concat();
        assert_eq!(Message::parse(&answer).unwrap().refusal().unwrap().0, code);
    }
    for elements in [DATA_STATE, DEFAULT, NAME | VALUE, 0] {
        let answer = drive.ask(&[0x03, elements, 91, 0, 1], 100).concat();
        assert_eq!(Message::parse(&answer).unwrap().refusal().unwrap().0, 0x1009);
    }
}

#[test]
fn value_for_preop_is_write_protected_in_other_states() {
    let mut drive = Drive::new();
    assert_eq!(drive.write(BRAKE, &[0x10, 0x27]), Ok(()));
    assert_eq!(drive.write(BRAKE, &[0x11, 0x27]), Err(0x7007));
    for state in [AlState::SafeOp, AlState::Op] {
        drive.state = state;
        assert_eq!(drive.write(BRAKE, &[1, 0]), Err(0x7005));
        assert_eq!(drive.write(16, &[4, 0, 4, 0, 135, 0, 51, 0]), Err(0x7005));
        assert_eq!(drive.write(91, &[1, 0, 0, 0]), Ok(()));
    }
}

#[test]
fn value_below_its_minimum_is_refused() {
    let signed = DriveParameter {
        limits: Some((-5, 5)),
        rule: WriteRule::Taken,
        ..*DriveParameter::find(Idn(36)).unwrap()
    };
    let write = |value: i32| checked(&signed, &value.to_le_bytes()).map(<[u8]>::to_vec);
    assert_eq!(write(-6), Err(0x7006));
    assert_eq!(write(-5), Ok((-5_i32).to_le_bytes().to_vec()));
    assert_eq!(write(6), Err(0x7007));
}

#[test]
fn write_in_fragments_is_put_together_and_answered_once() {
    let mut drive = Drive::new();
    let [low, high] = NOTES.to_le_bytes();
    assert!(drive.ask(&[0x0B, VALUE, 2, 0, 4, 0], 100).is_empty());
    assert!(drive.ask(&[0x0B, VALUE, 1, 0, 240, 0, b'l'], 100).is_empty());
    let answer = drive.ask(&[0x03, VALUE, low, high, b'i', b'f', b't'], 100);
    assert_eq!(answer, [[0x04, VALUE, low, high]]);
    assert_eq!(drive.read(VALUE, NOTES).unwrap()[4..], *b"lift");
    // A read between them ends it: what comes last is a write of its own.
    assert!(drive.ask(&[0x0B, VALUE, 1, 0, 4, 0], 100).is_empty());
    drive.read(VALUE, 36).unwrap();
    assert_eq!(drive.write(NOTES, b"x"), Err(0x7002));
    // Fragments without end are not kept.
    for _ in 0..2_000 {
        drive.ask(&[&[0x0B, VALUE, 9, 0][..], &[0; 100]].concat(), 100);
    }
    assert!(drive.server.write.as_ref().unwrap().data.len() <= LONGEST_WRITE + 100);
    assert_eq!(drive.write(91, &[]), Err(0x7003));
}

#[test]
fn procedure_command_runs_is_done_and_is_taken_back() {
    let mut drive = Drive::new();
    let state = |drive: &mut Drive| {
        let state = CommandState::parse(&drive.read(DATA_STATE, 99).unwrap()).unwrap();
        state.progress()
    };
    assert_eq!(state(&mut drive), CommandProgress::NotSet);
    assert_eq!(drive.write(99, &[1, 0]), Ok(()));
    assert_eq!(state(&mut drive), CommandProgress::Set);
    assert_eq!(drive.write(99, &[3, 0]), Ok(()));
    assert_eq!(state(&mut drive), CommandProgress::Running);
    assert_eq!(drive.write(99, &[3, 0]), Err(0x7010));
    assert_eq!(drive.write(99, &[1, 0]), Err(0x7011));
    assert_eq!(drive.write(99, &[2, 0]), Err(0x7008));
    drive.now += Span::ms(20);
    assert_eq!(state(&mut drive), CommandProgress::Done);
    assert_eq!(drive.read(VALUE, 99), Ok(vec![3, 0]));
    assert_eq!(drive.write(99, &[0, 0]), Ok(()));
    assert_eq!(state(&mut drive), CommandProgress::NotSet);
}

#[test]
fn calibration_fails_unless_the_axis_is_enabled() {
    for (state, told) in [(AlState::PreOp, 15), (AlState::Op, 7)] {
        let mut drive = Drive::new();
        drive.state = state;
        drive.write(CALIBRATE.0, &[3, 0]).unwrap();
        assert_eq!(drive.read(DATA_STATE, CALIBRATE.0), Ok(vec![told, 0]), "{state}");
    }
}

proptest! {
    #[test]
    fn bytes_of_chance_make_no_panic(
        requests in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 1..20),
        room in 0_usize..64,
    ) {
        let mut drive = Drive::new();
        for request in requests {
            for answer in drive.ask(&request, room) {
                prop_assert!(Message::parse(&answer).is_some());
            }
        }
    }
}
