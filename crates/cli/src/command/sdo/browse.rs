//! The dictionary of a SubDevice as a whole, and single objects of it in full.

use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::information::{ListKind, ObjectCode, ObjectList};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use super::dictionary::Dictionary;
use super::report::{EntryReport, ListReport, ListedObject};
use super::upload;
use crate::command::service::{ServiceError, ServiceLine};

/// How much of each object is asked for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Depth {
    /// What it is.
    Objects,
    /// What its entries are.
    Entries,
    /// What they hold.
    Values,
}

/// The objects of one of the SubDevice's lists.
pub(super) fn list(
    session: &mut ServiceLine,
    id: DeviceId,
    list: ListKind,
    depth: Depth,
) -> Result<ListReport, ServiceError> {
    let bytes = session.bytes(id, Service::Mailbox(MailboxRequest::ObjectList { list }))?;
    let indices: Vec<ObjectIndex> =
        ObjectList::parse(&bytes).map(|list| list.indices().collect()).unwrap_or_default();
    let mut objects = Vec::with_capacity(indices.len());
    for index in indices {
        objects.push(object(session, id, index, None, depth)?);
    }
    Ok(ListReport::new(session.report(id), objects))
}

/// One object with its entries, or one of them, and their values.
pub(super) fn info(
    session: &mut ServiceLine,
    id: DeviceId,
    index: ObjectIndex,
    subindex: Option<u8>,
) -> Result<ListReport, ServiceError> {
    // Asked for by itself, so that a refusal is told and not passed over.
    session.bytes(id, Service::Mailbox(MailboxRequest::DescribeObject { index }))?;
    let object = object(session, id, index, subindex, Depth::Values)?;
    Ok(ListReport::new(session.report(id), vec![object]))
}

fn object(
    session: &mut ServiceLine,
    id: DeviceId,
    index: ObjectIndex,
    only: Option<u8>,
    depth: Depth,
) -> Result<ListedObject, ServiceError> {
    let mut dictionary = Dictionary::new(session, id);
    let about = dictionary.object(index)?;
    let mut listed = ListedObject::new(index, about.as_ref());
    if depth < Depth::Entries {
        return Ok(listed);
    }
    let last = about.as_ref().map_or(0, |about| {
        if about.object_code == ObjectCode::Variable { 0 } else { about.max_subindex }
    });
    let range = only.map_or(0..=last, |only| only..=only);
    for subindex in range {
        let address = ObjectAddress { index, subindex };
        // Records have gaps, some of which are described as nothing.
        let Some(entry) = dictionary.entry(address)?.filter(|entry| entry.bits > 0) else {
            continue;
        };
        let mut report = EntryReport::new(address, &entry);
        if depth == Depth::Values {
            match upload(dictionary.session, id, address, false) {
                Ok(data) => report.holds(&data, &entry),
                Err(ServiceError::Refused(refusal)) => report.refused(&refusal),
                Err(trouble) => return Err(trouble),
            }
        }
        listed.entries.push(report);
    }
    Ok(listed)
}
