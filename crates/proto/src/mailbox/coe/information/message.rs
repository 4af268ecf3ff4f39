//! The messages of SDO information, and the cutting of answers into fragments.
//!
//! Reference: ETG.1000.6, SDO information. Behind the CoE header: opcode (7 bits) and "incomplete"
//! (1 bit), a reserved byte, number of fragments left (u16), then what the opcode asks for.

use super::description::ValueInfo;
use super::list::ListKind;
use crate::mailbox::coe::message::{COE_HEADER_LEN, CoeError};
use crate::mailbox::coe::object::{ObjectAddress, ObjectIndex};
use crate::mailbox::header::{BufferTooSmall, HEADER_LEN};

/// Bytes of the header of SDO information.
const INFORMATION_HEADER_LEN: usize = 4;
const INCOMPLETE: u8 = 0x80;

/// A message of SDO information: what follows the CoE header.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Message<'a> {
    /// More fragments of this answer follow.
    pub incomplete: bool,
    /// How many.
    pub fragments_left: u16,
    /// Question, fragment of an answer, or refusal.
    pub body: Body<'a>,
}

/// What a message of SDO information says.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Body<'a> {
    /// Opcode 1: which objects are there?
    ListRequest {
        /// Which of the lists.
        list: ListKind,
    },
    /// Opcode 3: what is this object?
    ObjectRequest {
        /// The object.
        index: ObjectIndex,
    },
    /// Opcode 5: what is this entry?
    EntryRequest {
        /// The entry.
        object: ObjectAddress,
        /// What the answer is to tell beyond the rest.
        values: ValueInfo,
    },
    /// Opcodes 2, 4, 6: an answer, or a fragment of one.
    Answer {
        /// To which question.
        to: Answer,
        /// The bytes of this fragment.
        fragment: &'a [u8],
    },
    /// Opcode 7: the question is refused.
    Error {
        /// An abort code.
        code: u32,
    },
}

/// Which question is answered.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Answer {
    /// The bytes of all fragments are an [`ObjectList`](super::ObjectList).
    List,
    /// They are an [`ObjectDescription`](super::ObjectDescription).
    Object,
    /// They are an [`EntryDescription`](super::EntryDescription).
    Entry,
}

impl Answer {
    const fn opcode(self) -> u8 {
        match self {
            Self::List => 2,
            Self::Object => 4,
            Self::Entry => 6,
        }
    }
}

impl<'a> Message<'a> {
    /// A question, or a refusal: always one message.
    #[must_use]
    pub const fn whole(body: Body<'a>) -> Self {
        Self { incomplete: false, fragments_left: 0, body }
    }

    pub(in crate::mailbox::coe) fn parse(bytes: &'a [u8]) -> Result<Self, CoeError> {
        let (&[first, _, low, high], rest) = CoeError::first(bytes, "SDO information header")?;
        let opcode = first & !INCOMPLETE;
        let answer = |to| Body::Answer { to, fragment: rest };
        let body = match opcode {
            1 => {
                let (code, _) = CoeError::first(rest, "SDO information: object list request")?;
                Body::ListRequest { list: ListKind::from_code(u16::from_le_bytes(*code)) }
            }
            2 => answer(Answer::List),
            3 => {
                let (index, _) = CoeError::first(rest, "SDO information: object request")?;
                Body::ObjectRequest { index: ObjectIndex(u16::from_le_bytes(*index)) }
            }
            4 => answer(Answer::Object),
            5 => {
                let (&[low, high, subindex, values], _) =
                    CoeError::first(rest, "SDO information: entry request")?;
                let object = ObjectAddress::from_bytes([low, high, subindex]);
                Body::EntryRequest { object, values: ValueInfo(values) }
            }
            6 => answer(Answer::Entry),
            7 => {
                let (code, _) = CoeError::first(rest, "SDO information: error")?;
                Body::Error { code: u32::from_le_bytes(*code) }
            }
            opcode => return Err(CoeError::UnknownOpcode { opcode }),
        };
        let fragments_left = u16::from_le_bytes([low, high]);
        Ok(Self { incomplete: first & INCOMPLETE != 0, fragments_left, body })
    }

    pub(in crate::mailbox::coe) fn write(&self, bytes: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let needed = INFORMATION_HEADER_LEN;
        let available = bytes.len();
        let Some((header, rest)) = bytes.split_first_chunk_mut() else {
            return Err(BufferTooSmall { needed, available });
        };
        let mut put = |data: &[u8]| {
            BufferTooSmall::check(rest, data.len())?.copy_from_slice(data);
            Ok(data.len())
        };
        let (opcode, len) = match self.body {
            Body::ListRequest { list } => (1, put(&list.code().to_le_bytes())?),
            Body::ObjectRequest { index } => (3, put(&index.value().to_le_bytes())?),
            Body::EntryRequest { object, values } => {
                let [low, high, subindex] = object.to_bytes();
                (5, put(&[low, high, subindex, values.0])?)
            }
            Body::Answer { to, fragment } => (to.opcode(), put(fragment)?),
            Body::Error { code } => (7, put(&code.to_le_bytes())?),
        };
        let incomplete = if self.incomplete { INCOMPLETE } else { 0 };
        let [low, high] = self.fragments_left.to_le_bytes();
        *header = [opcode | incomplete, 0, low, high];
        Ok(INFORMATION_HEADER_LEN + len)
    }
}

/// Cuts an answer into messages that fit into a mailbox.
#[derive(Clone, Debug)]
pub struct Fragments<'a> {
    to: Answer,
    rest: Option<&'a [u8]>,
    room: usize,
}

impl<'a> Fragments<'a> {
    /// The messages that carry this answer through a mailbox of `mailbox_size` bytes; at least one,
    /// also when the answer is empty. Fragments hold whole words, as lists consist of words.
    #[must_use]
    pub fn new(to: Answer, answer: &'a [u8], mailbox_size: usize) -> Self {
        let headers = HEADER_LEN + COE_HEADER_LEN + INFORMATION_HEADER_LEN;
        let room = (mailbox_size.saturating_sub(headers) & !1).max(2);
        Self { to, rest: Some(answer), room }
    }
}

impl<'a> Iterator for Fragments<'a> {
    type Item = Message<'a>;

    fn next(&mut self) -> Option<Message<'a>> {
        let rest = self.rest.take()?;
        let (fragment, rest) = rest.split_at(rest.len().min(self.room));
        let left = rest.len().div_ceil(self.room);
        let incomplete = left > 0;
        self.rest = incomplete.then_some(rest);
        let fragments_left = u16::try_from(left).unwrap_or(u16::MAX);
        let body = Body::Answer { to: self.to, fragment };
        Some(Message { incomplete, fragments_left, body })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_list_takes_fragments_that_count_down() {
        let answer: Vec<u8> = (0..100).collect();
        // 52 bytes less 12 of headers leave 40.
        let fragments: Vec<Message<'_>> = Fragments::new(Answer::List, &answer, 52).collect();
        let left: Vec<(bool, u16)> =
            fragments.iter().map(|message| (message.incomplete, message.fragments_left)).collect();
        assert_eq!(left, [(true, 2), (true, 1), (false, 0)]);
        let mut collected = Vec::new();
        for message in &fragments {
            let mut buffer = [0; 46];
            let len = message.write(&mut buffer).unwrap();
            let parsed = Message::parse(&buffer[..len]).unwrap();
            assert_eq!(parsed, *message);
            let Body::Answer { to: Answer::List, fragment } = parsed.body else {
                panic!("{parsed:?} is no list");
            };
            collected.extend_from_slice(fragment);
        }
        assert_eq!(collected, answer);
    }

    #[test]
    fn odd_mailboxes_and_empty_answers_are_served() {
        assert_eq!(Fragments::new(Answer::Entry, &[], 128).count(), 1);
        // No index of a list is torn apart by a mailbox of odd length.
        let first = Fragments::new(Answer::List, &[0; 100], 53).next().unwrap();
        let Body::Answer { fragment, .. } = first.body else { panic!("{first:?}") };
        assert_eq!(fragment.len(), 40);
        assert_eq!(Fragments::new(Answer::Entry, &[1, 2, 3], 0).count(), 2);
    }
}
