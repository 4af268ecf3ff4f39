//! SDO information: which objects there are, and what they are.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::information::{
    Access, Answer, Body, EntryDescription, Fragments, ListKind, Message, ObjectDescription,
    ObjectList, ValueInfo,
};
use linesman_proto::mailbox::coe::{DataType, Message as CoeMessage, ObjectAddress, ObjectIndex};

use super::Answers;
use super::coe::write;
use crate::device::dictionary::{Dictionary, LARGEST, Object};

/// Answers a question, in as many messages as it takes.
pub(super) fn answer(
    question: Message<'_>,
    dictionary: &Dictionary,
    room: usize,
) -> Result<Answers, ErrorReplyCode> {
    // A list has a word of its kind and one for each object.
    let mut buffer = vec![0; LARGEST.max(2 + 2 * dictionary.objects().count())];
    let (to, answer) = match question.body {
        Body::ListRequest { list } => (Answer::List, object_list(list, dictionary, &mut buffer)),
        Body::ObjectRequest { index } => (Answer::Object, object(index, dictionary, &mut buffer)),
        Body::EntryRequest { object, values } => {
            (Answer::Entry, entry(object, values, dictionary, &mut buffer))
        }
        Body::Answer { .. } | Body::Error { .. } => {
            return Err(ErrorReplyCode::ServiceNotSupported);
        }
    };
    Ok(match answer {
        Ok(len) => {
            let fragments = Fragments::new(to, &buffer[..len], room);
            fragments.map(|message| write(&CoeMessage::Information(message))).collect()
        }
        Err(code) => refuse(code),
    })
}

/// The answer that a question is refused.
pub(super) fn refuse(code: SdoAbortCode) -> Answers {
    let body = Body::Error { code: code.value() };
    vec![write(&CoeMessage::Information(Message::whole(body)))]
}

fn object_list(
    kind: ListKind,
    dictionary: &Dictionary,
    buffer: &mut [u8],
) -> Result<usize, SdoAbortCode> {
    const LISTS: [ListKind; 5] = [
        ListKind::All,
        ListKind::RxPdoMappable,
        ListKind::TxPdoMappable,
        ListKind::Backup,
        ListKind::Settings,
    ];
    let words: Vec<u16> = match kind {
        ListKind::Counts => {
            LISTS.iter().map(|list| dictionary.list(*list).count() as u16).collect()
        }
        ListKind::Other(_) => return Err(SdoAbortCode::VALUE_RANGE),
        ListKind::All
        | ListKind::RxPdoMappable
        | ListKind::TxPdoMappable
        | ListKind::Backup
        | ListKind::Settings => dictionary.list(kind).map(|index| index.0).collect(),
    };
    ObjectList::write(kind, words, buffer).map_err(|_| SdoAbortCode::OUT_OF_MEMORY)
}

fn object(
    index: ObjectIndex,
    dictionary: &Dictionary,
    buffer: &mut [u8],
) -> Result<usize, SdoAbortCode> {
    let object = dictionary.object(index).ok_or(SdoAbortCode::NO_OBJECT)?;
    let description = ObjectDescription {
        index,
        data_type: object.data_type,
        max_subindex: object.entries.last().map_or(0, |entry| entry.subindex),
        object_code: object.code,
        name: object.name.as_bytes(),
    };
    description.write(buffer).map_err(|_| SdoAbortCode::OUT_OF_MEMORY)
}

fn entry(
    address: ObjectAddress,
    values: ValueInfo,
    dictionary: &Dictionary,
    buffer: &mut [u8],
) -> Result<usize, SdoAbortCode> {
    let object = dictionary.object(address.index).ok_or(SdoAbortCode::NO_OBJECT)?;
    let Some(entry) = object.entry(address.subindex) else {
        return gap(object, address, buffer);
    };
    let maximum = entry.maximum.map(u32::to_le_bytes);
    let maximum = maximum.as_ref().and_then(|bytes| bytes.get(..entry.value.len()));
    let description = EntryDescription {
        object: address,
        values: ValueInfo(
            values.0 & (ValueInfo::ACCESS | ValueInfo::CATEGORY | ValueInfo::MAPPABLE),
        ),
        data_type: entry.data_type,
        bits: entry.bits,
        access: entry.access,
        unit: None,
        default: None,
        minimum: None,
        maximum: maximum.filter(|_| values.has(ValueInfo::MAXIMUM)),
        name: entry.name.as_bytes(),
    };
    description.write(buffer).map_err(|_| SdoAbortCode::OUT_OF_MEMORY)
}

/// The description of a subindex that is left out: an entry of no type and no bits, so that whoever
/// walks from 0 to the highest subindex gets an answer to each question.
fn gap(object: &Object, address: ObjectAddress, buffer: &mut [u8]) -> Result<usize, SdoAbortCode> {
    let last = object.entries.last().map_or(0, |entry| entry.subindex);
    if address.subindex > last {
        return Err(SdoAbortCode::NO_SUBINDEX);
    }
    let description = EntryDescription {
        object: address,
        values: ValueInfo::default(),
        data_type: DataType(0),
        bits: 0,
        access: Access::default(),
        unit: None,
        default: None,
        minimum: None,
        maximum: None,
        name: &[],
    };
    description.write(buffer).map_err(|_| SdoAbortCode::OUT_OF_MEMORY)
}
