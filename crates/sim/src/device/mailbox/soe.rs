//! SoE server of a drive: it has a list of its IDNs, and its version; it answers all else with an error.
//!
//! Reference: ETG.1000.6, SoE (header and error codes); IEC 61800-7-204 for S-0-0017 and S-0-0030, and for data of variable
//! length. Its process data need no IDN to be read: MDT and AT are what they are.

use linesman_proto::mailbox::soe::{ALL_NUMBERS, Idn, Message, Operation, SOE_HEADER_LEN, VALUE};

/// Element 2: the name.
const NAME: u8 = 0x02;
/// S-0-0030: version of the manufacturer.
const VERSION: Idn = Idn(30);
const VERSION_TEXT: &[u8] = b"virtual drive 1";
/// The numbers, and their names.
const NUMBERS: [(Idn, &[u8]); 2] =
    [(ALL_NUMBERS, b"IDN-list of all operation data"), (VERSION, b"Manufacturer version")];
/// There is no such IDN.
const NO_IDN: u16 = 0x1001;
/// Elements of which more than one are asked for, or that are served by no answer of it.
const NO_ELEMENT: u16 = 0x1009;
/// It cannot be changed: the name, the value.
const NAME_FIXED: u16 = 0x2004;
const VALUE_FIXED: u16 = 0x7004;

/// The messages that answer a request, each with at most so many bytes; none to what asks for none.
pub(super) fn answer(request: &[u8], room: usize) -> Vec<Vec<u8>> {
    let Some(message) = Message::parse(request) else { return Vec::new() };
    let idn = Idn(message.number);
    // The device has one drive, the first.
    let known = NUMBERS.iter().find(|(known, _)| *known == idn && message.drive == 0);
    let (operation, result) = match message.operation {
        // Of a write in several messages the last is answered.
        Operation::WriteRequest if message.incomplete => return Vec::new(),
        Operation::WriteRequest => {
            let code = match known {
                None => NO_IDN,
                Some(_) if message.elements == NAME => NAME_FIXED,
                Some(_) => VALUE_FIXED,
            };
            (Operation::WriteResponse, Err(code))
        }
        Operation::ReadRequest => {
            let result = known.ok_or(NO_IDN).and_then(|(idn, name)| element(*idn, name, &message));
            (Operation::ReadResponse, result)
        }
        Operation::ReadResponse
        | Operation::WriteResponse
        | Operation::Notification
        | Operation::Emergency
        | Operation::Reserved(_) => return Vec::new(),
    };
    let begin = Message { operation, incomplete: false, data: &[], ..message };
    match result {
        Err(code) => vec![write(&Message { error: true, data: &code.to_le_bytes(), ..begin })],
        Ok(data) => {
            let room = room.saturating_sub(SOE_HEADER_LEN).max(1);
            let pieces: Vec<_> = data.chunks(room).collect();
            let left = |at: usize| pieces.len() - at - 1;
            let piece = |(at, data): (usize, &&[u8])| match u16::try_from(left(at)) {
                Ok(left @ 1..) => write(&Message { incomplete: true, number: left, data, ..begin }),
                Ok(0) | Err(_) => write(&Message { data, ..begin }),
            };
            pieces.iter().enumerate().map(piece).collect()
        }
    }
}

/// Data of the element that is asked for.
fn element(idn: Idn, name: &[u8], message: &Message<'_>) -> Result<Vec<u8>, u16> {
    match message.elements {
        NAME => Ok(of_variable_length(name)),
        VALUE if idn == VERSION => Ok(of_variable_length(VERSION_TEXT)),
        VALUE => {
            let list: Vec<u8> = NUMBERS.iter().flat_map(|(idn, _)| idn.0.to_le_bytes()).collect();
            Ok(of_variable_length(&list))
        }
        _ => Err(NO_ELEMENT),
    }
}

/// The length now, the most it can have, and the data.
fn of_variable_length(data: &[u8]) -> Vec<u8> {
    let len = u16::try_from(data.len()).unwrap_or(u16::MAX).to_le_bytes();
    [&len, &len, data].concat()
}

fn write(message: &Message<'_>) -> Vec<u8> {
    let mut buffer = vec![0; SOE_HEADER_LEN + message.data.len()];
    let len = message.write(&mut buffer).unwrap_or(0);
    buffer.truncate(len);
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_for_what_it_has_not_are_refused_with_the_idn_they_ask_for() {
        // Read S-0-0051, value, drive 1; write S-0-0036; read S-0-0017 of a second drive.
        let no_such = |request: &[u8]| answer(request, 100);
        assert_eq!(no_such(&[0x21, 0x40, 51, 0]), [[0x32, 0x40, 51, 0, 0x01, 0x10]]);
        assert_eq!(no_such(&[0x03, 0x40, 36, 0, 9, 9]), [[0x14, 0x40, 36, 0, 0x01, 0x10]]);
        assert_eq!(no_such(&[0x21, 0x40, 17, 0]), [[0x32, 0x40, 17, 0, 0x01, 0x10]]);
        assert_eq!(no_such(&[0x01, 0x08, 17, 0]), [[0x12, 0x08, 17, 0, 0x09, 0x10]], "its unit");
        assert_eq!(no_such(&[0x03, 0x40, 17, 0, 1]), [[0x14, 0x40, 17, 0, 0x04, 0x70]]);
        assert_eq!(no_such(&[0x03, 0x02, 17, 0, 1]), [[0x14, 0x02, 17, 0, 0x04, 0x20]]);
        for unanswered in [&[0x05, 0, 0, 0][..], &[0x0B, 0x40, 1, 0, 9], &[0x01, 0]] {
            assert_eq!(answer(unanswered, 100), Vec::<Vec<u8>>::new());
        }
    }

    #[test]
    fn list_of_its_numbers_comes_in_as_many_messages_as_it_takes() {
        let list = [4, 0, 4, 0, 17, 0, 30, 0];
        let whole = [&[0x02, 0x40, 17, 0][..], &list].concat();
        assert_eq!(answer(&[0x01, 0x40, 17, 0], 100), [whole]);
        let in_two = [
            [&[0x0A, 0x40, 1, 0][..], &list[..5]].concat(),
            [&[0x02, 0x40, 17, 0][..], &list[5..]].concat(),
        ];
        assert_eq!(answer(&[0x01, 0x40, 17, 0], 9), in_two);
        let named = answer(&[0x01, 0x02, 30, 0], 100).concat();
        assert_eq!(named[8..], *b"Manufacturer version");
    }
}
