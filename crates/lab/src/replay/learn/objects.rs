//! The dictionary of a device as SDO transfers show it.

use std::collections::BTreeMap;

use linesman_proto::mailbox::coe::information::ObjectCode;
use linesman_proto::mailbox::coe::sdo::{Request, Response};
use linesman_proto::mailbox::coe::{DataType, Message as CoeMessage, ObjectIndex};
use linesman_proto::mailbox::{MailboxType, Message};
use linesman_sim::device::dictionary::{Dictionary, Entry, Object, READ_WRITE};

/// Index, subindex, complete access.
type Place = (u16, u8, bool);

/// What was asked for.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Asked {
    place: Place,
    /// Bytes that came so far.
    data: Vec<u8>,
    size: usize,
}

/// The dictionary of a device as SDO transfers show it.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct ObjectsSeen {
    /// Values as they were before anything wrote them.
    pub values: BTreeMap<(u16, u8, bool), Vec<u8>>,
    /// Values that were written, to places whose first value is not known.
    written: BTreeMap<Place, Vec<u8>>,
    /// Accesses to whole objects that succeeded.
    complete_access: bool,
    asked: Option<Asked>,
    /// Whether there was any CoE message.
    pub speaks: bool,
}

impl ObjectsSeen {
    /// A message went to the device.
    pub(super) fn asked(&mut self, buffer: &[u8]) {
        let Ok(message) = Message::parse(buffer) else { return };
        if message.header.kind != MailboxType::Coe {
            return;
        }
        self.speaks = true;
        let Ok(CoeMessage::SdoRequest(request)) = CoeMessage::parse(message.data) else { return };
        match request {
            Request::Upload { object, complete } => {
                let place = (object.index.0, object.subindex, complete);
                self.asked = Some(Asked { place, data: Vec::new(), size: 0 });
            }
            Request::Download { object, complete, initial } => {
                let place = (object.index.0, object.subindex, complete);
                self.asked = None;
                self.written.entry(place).or_insert_with(|| initial.data().to_vec());
            }
            Request::UploadSegment { .. } | Request::DownloadSegment(_) => {}
        }
    }

    /// A message came from the device.
    pub(super) fn answered(&mut self, buffer: &[u8]) {
        let Ok(message) = Message::parse(buffer) else { return };
        if message.header.kind != MailboxType::Coe {
            return;
        }
        match CoeMessage::parse(message.data) {
            Ok(CoeMessage::SdoResponse(Response::Upload { initial, .. })) => {
                if let Some(asked) = &mut self.asked {
                    asked.data = initial.data().to_vec();
                    asked.size = initial.size() as usize;
                }
                self.note_if_whole();
            }
            Ok(CoeMessage::SdoResponse(Response::UploadSegment(segment))) => {
                if let Some(asked) = &mut self.asked {
                    asked.data.extend_from_slice(segment.data);
                    if segment.last {
                        asked.size = asked.data.len();
                    }
                }
                self.note_if_whole();
            }
            Ok(CoeMessage::Abort(_)) => self.asked = None,
            Ok(_) | Err(_) => {}
        }
    }

    fn note_if_whole(&mut self) {
        let Some(asked) = self.asked.take_if(|asked| asked.data.len() >= asked.size) else {
            return;
        };
        self.complete_access |= asked.place.2;
        if !self.written.contains_key(&asked.place) {
            self.values.entry(asked.place).or_insert(asked.data);
        }
    }

    /// A dictionary of these objects. What was only ever written begins as 0; entries of an object
    /// that was only ever read whole are taken to be equally long.
    #[must_use]
    pub fn dictionary(&self) -> Dictionary {
        let mut values: BTreeMap<u16, BTreeMap<u8, Vec<u8>>> = BTreeMap::new();
        for ((index, subindex, complete), value) in &self.values {
            let entries = values.entry(*index).or_default();
            if !*complete {
                entries.insert(*subindex, value.clone());
                continue;
            }
            for (subindex, value) in split(*subindex, value) {
                entries.entry(subindex).or_insert(value);
            }
        }
        for ((index, subindex, complete), value) in &self.written {
            let entries = values.entry(*index).or_default();
            let parts =
                if *complete { split(*subindex, value) } else { vec![(*subindex, value.clone())] };
            for (subindex, value) in parts {
                entries.entry(subindex).or_insert_with(|| vec![0; value.len()]);
            }
            // What is assigned has to be there.
            if (0x1C10..=0x1C2F).contains(index)
                && *subindex > 0
                && let Some(pdo) = value.first_chunk().map(|word| u16::from_le_bytes(*word))
            {
                values.entry(pdo).or_insert_with(|| BTreeMap::from([(0, vec![0])]));
            }
        }
        let objects = values.into_iter().map(|(index, entries)| object(index, entries));
        Dictionary::new(objects.collect(), self.complete_access)
    }
}

/// A whole object as its entries.
fn split(first: u8, data: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let (mut parts, rest) = match data {
        [count, _, rest @ ..] if first == 0 => (vec![(0, vec![*count])], rest),
        _ => (Vec::new(), data),
    };
    let count = match parts.first() {
        Some((_, value)) => usize::from(value[0]),
        None => 1,
    };
    if count > 0 && rest.len() >= count && rest.len().is_multiple_of(count) {
        parts.extend(
            (1u8..).zip(rest.chunks(rest.len() / count)).map(|(n, part)| (n, part.to_vec())),
        );
    } else if !rest.is_empty() {
        parts.push((1, rest.to_vec()));
    }
    parts
}

fn object(index: u16, entries: BTreeMap<u8, Vec<u8>>) -> Object {
    let is_variable = entries.len() == 1 && entries.contains_key(&0);
    let entry = |(subindex, value): (u8, Vec<u8>)| Entry {
        subindex,
        name: format!("SubIndex {subindex:03}"),
        data_type: data_type(value.len()),
        bits: u16::try_from(value.len() * 8).unwrap_or(u16::MAX),
        access: READ_WRITE,
        value,
        maximum: None,
    };
    Object {
        index: ObjectIndex(index),
        name: format!("0x{index:04X}"),
        code: if is_variable { ObjectCode::Variable } else { ObjectCode::Record },
        data_type: DataType::UDINT,
        entries: entries.into_iter().map(entry).collect(),
    }
}

/// A type of this length.
fn data_type(bytes: usize) -> DataType {
    match bytes {
        1 => DataType::USINT,
        2 => DataType::UINT,
        4 => DataType::UDINT,
        8 => DataType::ULINT,
        _ => DataType::OCTET_STRING,
    }
}
