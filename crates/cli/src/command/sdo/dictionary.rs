//! Dictionary of a SubDevice as it describes it, asked for once each.

use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::information::{
    Access, EntryDescription, ObjectCode, ObjectDescription, ValueInfo,
};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex};

use crate::command::service::{ServiceError, ServiceLine};

/// What an object is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct ObjectAbout {
    /// Its name.
    pub(crate) name: String,
    /// Its data type; of arrays that of an entry.
    pub(crate) data_type: DataType,
    /// Highest subindex.
    pub(crate) max_subindex: u8,
    /// Variable, array, record, ...
    pub(crate) object_code: ObjectCode,
}

/// What an entry is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct EntryAbout {
    /// Its name.
    pub(crate) name: String,
    /// Its data type.
    pub(crate) data_type: DataType,
    /// Its length in bits.
    pub(crate) bits: u16,
    /// Who may do what with it in which state.
    pub(crate) access: Access,
    /// Its unit.
    pub(crate) unit: Option<u32>,
    /// Its default value.
    pub(crate) default: Option<Vec<u8>>,
    /// The least value.
    pub(crate) minimum: Option<Vec<u8>>,
    /// The greatest value.
    pub(crate) maximum: Option<Vec<u8>>,
}

/// The dictionary of a SubDevice. One that tells nothing of it is asked once only.
pub(crate) struct Dictionary<'a> {
    pub(crate) session: &'a mut ServiceLine,
    id: DeviceId,
    silent: bool,
}

impl<'a> Dictionary<'a> {
    /// The dictionary of a SubDevice whose mailbox is open.
    pub(crate) fn new(session: &'a mut ServiceLine, id: DeviceId) -> Self {
        Self { session, id, silent: false }
    }

    /// What an object is; `None` when the SubDevice does not say.
    pub(crate) fn object(
        &mut self,
        index: ObjectIndex,
    ) -> Result<Option<ObjectAbout>, ServiceError> {
        let answer = self.ask(MailboxRequest::DescribeObject { index })?;
        Ok(answer.and_then(|bytes| {
            let told = ObjectDescription::parse(&bytes).ok()?;
            Some(ObjectAbout {
                name: told.name_text().into_owned(),
                data_type: told.data_type,
                max_subindex: told.max_subindex,
                object_code: told.object_code,
            })
        }))
    }

    /// What an entry is; `None` when the SubDevice does not say.
    pub(crate) fn entry(
        &mut self,
        object: ObjectAddress,
    ) -> Result<Option<EntryAbout>, ServiceError> {
        let values = ValueInfo(
            ValueInfo::UNIT | ValueInfo::DEFAULT | ValueInfo::MINIMUM | ValueInfo::MAXIMUM,
        );
        let answer = self.ask(MailboxRequest::DescribeEntry { object, values })?;
        let own = |bytes: Option<&[u8]>| bytes.map(<[u8]>::to_vec);
        Ok(answer.and_then(|bytes| {
            let told = EntryDescription::parse(&bytes).ok()?;
            Some(EntryAbout {
                name: told.name_text().into_owned(),
                data_type: told.data_type,
                bits: told.bits,
                access: told.access,
                unit: told.unit,
                default: own(told.default),
                minimum: own(told.minimum),
                maximum: own(told.maximum),
            })
        }))
    }

    /// `None` when it is refused: a SubDevice need not tell of its objects, nor of all of them.
    fn ask(&mut self, request: MailboxRequest) -> Result<Option<Vec<u8>>, ServiceError> {
        if self.silent {
            return Ok(None);
        }
        match self.session.bytes(self.id, Service::Mailbox(request)) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(ServiceError::Refused(refusal)) => {
                // Not even the service is known: then for no object.
                self.silent = refusal.abort_code().is_none();
                Ok(None)
            }
            Err(trouble) => Err(trouble),
        }
    }
}
