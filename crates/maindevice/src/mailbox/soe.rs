//! Identification numbers of drives, read and written through the mailbox (SoE).
//!
//! Reference: ETG.1000.6, SoE (read request, write request). A message with more to come tells how many follow where the last one
//! has the IDN: an answer is told from that to another request by operation, drive and elements, and by the IDN at its end.

use linesman_proto::mailbox::soe::{
    Idn, LIST_HEADER_LEN, Message, Operation, SOE_HEADER_LEN, elements_in_words,
};
use linesman_proto::mailbox::{HEADER_LEN, MailboxType};

use super::failure::{Step, Why};
use super::transaction::MailboxTransaction;

/// The most that an element has: two lengths of two bytes, and as many bytes as they can tell.
const LONGEST_ELEMENT: usize = LIST_HEADER_LEN + 0xFFFF;
/// Reads that are tried again as a fragment of the answer was lost.
const MOST_REPETITIONS: u32 = 3;
/// Expected fragments, as failures name them.
const COUNTS_DOWN: &str = "fragments that count down to the last";
/// Elements of an IDN.
const ELEMENT_COUNT: usize = 8;

/// One IDN of one drive, and which of its elements.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct IdnElements {
    pub(crate) drive: u8,
    pub(crate) idn: Idn,
    pub(crate) elements: u8,
}

/// Reads elements, which come in as many messages as it takes.
pub(crate) async fn read(
    transaction: &mut MailboxTransaction<'_>,
    about: IdnElements,
) -> Result<Vec<u8>, Why> {
    let request = about.message(Operation::ReadRequest, about.idn.0, &[]);
    let mut repetitions = 0;
    loop {
        transaction.say(MailboxType::Soe, |body| request.write(body)).await?;
        let answer = SoeAnswer { about, operation: Operation::ReadResponse, other: None };
        match answer.hear(transaction).await? {
            HeardAnswer::Whole(data) => return Ok(data),
            // A frame with a fragment was lost, and the next was in the mailbox already: reading anew does no harm.
            HeardAnswer::Gap(_) if repetitions < MOST_REPETITIONS => repetitions += 1,
            HeardAnswer::Gap(found) => {
                return Err(Why::Protocol { expected: COUNTS_DOWN, found });
            }
        }
    }
}

/// Writes elements, in as many messages as it takes.
pub(crate) async fn write(
    transaction: &mut MailboxTransaction<'_>,
    about: IdnElements,
    data: &[u8],
) -> Result<(), Why> {
    let header = HEADER_LEN + SOE_HEADER_LEN;
    let room = transaction.multiplexer.out_size().saturating_sub(header).max(1);
    let pieces = data.len().div_ceil(room).max(1);
    for at in 0..pieces {
        let left = pieces - at - 1;
        let piece = data.get(at * room..data.len().min((at + 1) * room)).unwrap_or_default();
        let number = if left > 0 { u16::try_from(left).unwrap_or(u16::MAX) } else { about.idn.0 };
        let message = about.message(Operation::WriteRequest, number, piece);
        let message = Message { incomplete: left > 0, ..message };
        transaction.say(MailboxType::Soe, |body| message.write(body)).await?;
        if pieces > 1 {
            transaction.step = Step::Fragment(at as u32 + 1);
        }
    }
    let answer = SoeAnswer { about, operation: Operation::WriteResponse, other: None };
    match answer.hear(transaction).await? {
        HeardAnswer::Whole(_) => Ok(()),
        HeardAnswer::Gap(found) => Err(Why::Protocol { expected: COUNTS_DOWN, found }),
    }
}

/// An answer to its end.
enum HeardAnswer {
    /// All its data.
    Whole(Vec<u8>),
    /// A fragment is missing; what came instead.
    Gap(String),
}

/// The answer that is waited for.
#[derive(Debug)]
struct SoeAnswer {
    about: IdnElements,
    operation: Operation,
    /// The last answer to something else, in words.
    other: Option<String>,
}

impl SoeAnswer {
    /// The data of the answer. Those to other requests are told as events; where none comes but these, the last is named.
    async fn hear(mut self, transaction: &mut MailboxTransaction<'_>) -> Result<HeardAnswer, Why> {
        let mut data = Vec::new();
        // Messages that are still to come, as the last one said.
        let mut left: Option<u16> = None;
        let mut gap: Option<String> = None;
        let mut count = 0;
        loop {
            let answer = match transaction.hear(MailboxType::Soe).await {
                Err(Why::NoAnswer { patience, rubbish }) => {
                    return Err(match self.other.take() {
                        Some(found) => self.wrong(found),
                        None => Why::NoAnswer { patience, rubbish },
                    });
                }
                answer => answer?,
            };
            if transaction.multiplexer.take_missing() {
                gap = Some("one behind a message that was lost".to_owned());
            }
            let Some(message) = Message::parse(&answer) else {
                return Err(self.wrong(format!("{} bytes", answer.len())));
            };
            if !self.is_met_by(&message) {
                self.other = Some(name(&message));
                transaction.multiplexer.unasked(MailboxType::Soe, answer);
                data.clear();
                left = None;
                continue;
            }
            if let Some(code) = message.refusal() {
                return Err(Why::Drive { code });
            }
            data.extend_from_slice(message.data);
            if data.len() > LONGEST_ELEMENT * ELEMENT_COUNT {
                let found = format!("{} bytes and more", data.len());
                return Err(Why::Protocol { expected: "elements of 64 KiB each at most", found });
            }
            let next = if message.incomplete { message.number } else { 0 };
            if let Some(before) = left.filter(|before| u32::from(next) + 1 != u32::from(*before)) {
                let found = format!("one that says {next} behind one that says {before}");
                if next >= before {
                    return Err(Why::Protocol { expected: COUNTS_DOWN, found });
                }
                gap.get_or_insert(found);
            }
            if !message.incomplete {
                return Ok(gap.map_or(HeardAnswer::Whole(data), HeardAnswer::Gap));
            }
            left = Some(message.number);
            count += 1;
            transaction.step = Step::Fragment(count);
            transaction.wait_anew();
        }
    }

    /// True if a message is this answer, or a part of it.
    fn is_met_by(&self, message: &Message<'_>) -> bool {
        let about = &self.about;
        message.operation == self.operation
            && (message.drive, message.elements) == (about.drive, about.elements)
            && (message.incomplete || message.number == about.idn.0)
    }

    fn wrong(&self, found: String) -> Why {
        let writes = self.operation == Operation::WriteResponse;
        let expected =
            if writes { "the answer to a write request" } else { "the answer to a read request" };
        Why::Protocol { expected, found }
    }
}

impl IdnElements {
    fn message(self, operation: Operation, number: u16, data: &[u8]) -> Message<'_> {
        let Self { drive, elements, .. } = self;
        Message { operation, incomplete: false, error: false, drive, elements, number, data }
    }
}

/// An answer, as messages name it.
fn name(message: &Message<'_>) -> String {
    let done = if message.operation == Operation::WriteResponse { "a write" } else { "a read" };
    let about = match message.incomplete {
        true => format!("{} messages to come", message.number),
        false => Idn(message.number).to_string(),
    };
    let (elements, drive) = (elements_in_words(message.elements), message.drive);
    format!("the answer to {done} of drive {drive}: {about}, {elements}")
}
