//! A dictionary of a few objects.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use proptest::prelude::*;

use super::*;
use linesman_proto::state::AlState::{self, Init, Op, PreOp, SafeOp};

/// 0x2000: a variable; 0x2001: bits and bytes; 0x2002: only to be written, in OP.
fn dictionary() -> Dictionary {
    let number = |subindex, bits, access, value| {
        Entry::number(subindex, "number", DataType::UDINT, bits, access, value)
    };
    let record = |index, entries| {
        Object::list(ObjectIndex(index), "record", ObjectCode::Record, DataType(0x2A), entries)
    };
    let write_in_op = Access(Access::WRITE_OP);
    Dictionary::new(
        vec![
            record(
                0x2001,
                vec![
                    number(1, 1, READ_WRITE, 1),
                    number(2, 3, READ_WRITE, 5),
                    number(4, 16, READ_WRITE, 0x1234),
                    number(5, 7, READ_ONLY, 0x55),
                ],
            ),
            Object::variable(ObjectIndex(0x2000), number(0, 32, READ_WRITE, 7)),
            Object::variable(ObjectIndex(0x2002), number(0, 8, write_in_op, 0)),
        ],
        true,
    )
}

fn at(index: u16, subindex: u8) -> ObjectAddress {
    ObjectAddress::new(index, subindex)
}

#[test]
fn objects_are_found_in_order() {
    let dictionary = dictionary();
    let indices: Vec<u16> = dictionary.objects().map(|object| object.index.0).collect();
    assert_eq!(indices, [0x2000, 0x2001, 0x2002]);
    assert_eq!(dictionary.number_at(at(0x2001, 4)), 0x1234);
    assert_eq!(dictionary.number_at(at(0x2001, 0)), 5, "the highest subindex");
    assert_eq!(dictionary.number_at(at(0x2001, 3)), 0, "a gap");
    assert_eq!(dictionary.find(at(0x2003, 0)), None);
}

#[test]
fn the_device_itself_may_set_everything_within_its_bits() {
    let mut dictionary = dictionary();
    let entry = dictionary.find(at(0x2001, 5)).unwrap();
    dictionary.set_number(entry, 0xFFFF);
    assert_eq!(dictionary.number(entry), 0x7F);
}

#[test]
fn bits_lie_side_by_side_and_words_at_bytes() {
    let dictionary = dictionary();
    let whole = dictionary.upload_all(at(0x2001, 0), PreOp).unwrap();
    assert_eq!(whole, [5, 0, 0b1011, 0x34, 0x12, 0x55]);
    assert_eq!(dictionary.upload_all(at(0x2001, 1), PreOp).unwrap(), whole[2..]);
}

#[test]
fn rights_depend_on_the_state() {
    let mut dictionary = dictionary();
    let table: [(u16, AlState, bool, Result<(), SdoAbortCode>); 8] = [
        (0x2000, PreOp, false, Ok(())),
        (0x2000, Init, false, Err(SdoAbortCode::DEVICE_STATE)),
        (0x2000, Op, true, Ok(())),
        (0x2002, PreOp, true, Err(SdoAbortCode::DEVICE_STATE)),
        (0x2002, SafeOp, true, Err(SdoAbortCode::DEVICE_STATE)),
        (0x2002, Op, true, Ok(())),
        (0x2002, Op, false, Err(SdoAbortCode::WRITE_ONLY)),
        (0x2001, Op, true, Err(SdoAbortCode::READ_ONLY)),
    ];
    for (index, state, write, expected) in table {
        let address = at(index, if index == 0x2001 { 5 } else { 0 });
        let found = if write {
            let len = if index == 0x2000 { 4 } else { 1 };
            dictionary.download(address, &[1; 4][..len], state)
        } else {
            dictionary.upload(address, state).map(|_| ())
        };
        assert_eq!(found, expected, "0x{index:04X} {state} {write}");
    }
}

#[test]
fn a_whole_object_with_a_part_that_cannot_be_written_stays_as_it_is() {
    let mut dictionary = dictionary();
    let before = dictionary.clone();
    let found = dictionary.download_all(at(0x2001, 1), &[0, 1, 2, 3], PreOp);
    assert_eq!(found, Err(SdoAbortCode::READ_ONLY));
    assert_eq!(dictionary, before);
    assert_eq!(dictionary.download_all(at(0x2001, 1), &[0, 1, 2], PreOp), Ok(()));
    assert_eq!(dictionary.number_at(at(0x2001, 4)), 0x0201);
}

proptest! {
    // Whatever is written, what is read afterwards is what was taken, and nothing panics.
    #[test]
    fn what_is_taken_can_be_read(
        subindex in 0u8..8, data in proptest::collection::vec(any::<u8>(), 0..8), complete: bool
    ) {
        let mut dictionary = dictionary();
        let before = dictionary.clone();
        let address = at(0x2001, subindex);
        let taken = if complete {
            dictionary.download_all(address, &data, Op)
        } else {
            dictionary.download(address, &data, Op)
        };
        match taken {
            Ok(()) if complete => {
                let whole = dictionary.upload_all(at(0x2001, subindex), Op).unwrap();
                let skip = if subindex == 0 { 2 } else { 0 };
                // Bits 4 to 7 of the first byte belong to nobody.
                for (at, (read, written)) in whole.iter().zip(&data).enumerate().skip(skip) {
                    let mask = if at == skip { 0x0F } else { 0xFF };
                    prop_assert_eq!(read & mask, written & mask);
                }
            }
            Ok(()) => prop_assert_eq!(dictionary.upload(address, Op).unwrap(), data),
            Err(_) => prop_assert_eq!(dictionary, before),
        }
    }
}
