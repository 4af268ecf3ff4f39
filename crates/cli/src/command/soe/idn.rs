//! Elements of the IDNs of one drive, asked for one by one: drives need not serve several at once.

use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::soe::{
    ATTRIBUTE, Idn, MAXIMUM, MINIMUM, NAME, SoeAttribute, SoeError, UNIT, VALUE, VariableData,
};

use super::report::IdnReport;
use super::value::{show, text};
use crate::command::service::{ServiceError, ServiceLine};

/// A drive of a SubDevice.
pub(super) struct DriveClient<'a> {
    pub(super) session: &'a mut ServiceLine,
    pub(super) id: DeviceId,
    pub(super) drive: u8,
}

impl DriveClient<'_> {
    /// The SubDevice, as people call it.
    pub(super) fn label(&self) -> String {
        self.session.label(self.id)
    }

    /// The command line that does this to the same drive.
    pub(super) fn command(&self, action: &str) -> String {
        let drive =
            if self.drive == 0 { String::new() } else { format!(" --drive {}", self.drive) };
        format!("`linesman soe {} {} {action}{drive}`", self.session.place(), self.id.no())
    }

    /// The data of an element.
    pub(super) fn element(&mut self, idn: Idn, elements: u8) -> Result<Vec<u8>, ServiceError> {
        let request = MailboxRequest::ReadIdn { drive: self.drive, idn, elements };
        self.session.bytes(self.id, Service::Mailbox(request))
    }

    /// The data of an element, or why the drive refuses it. The outer error is another one.
    pub(super) fn optional(
        &mut self,
        idn: Idn,
        elements: u8,
    ) -> Result<Result<Vec<u8>, SoeError>, ServiceError> {
        match self.element(idn, elements) {
            Ok(data) => Ok(Ok(data)),
            Err(ServiceError::Refused(refusal)) => match refusal.soe_error() {
                Some(error) => Ok(Err(error)),
                None => Err(ServiceError::Refused(refusal)),
            },
            Err(trouble) => Err(trouble),
        }
    }

    /// Writes the value.
    pub(super) fn write(&mut self, idn: Idn, data: Vec<u8>) -> Result<(), ServiceError> {
        let request = MailboxRequest::WriteIdn { drive: self.drive, idn, elements: VALUE, data };
        self.session.ask(self.id, Service::Mailbox(request)).map(drop)
    }

    /// The attribute; `None` where the drive refuses it, or gives fewer bytes.
    pub(super) fn attribute(&mut self, idn: Idn) -> Result<Option<SoeAttribute>, ServiceError> {
        let data = self.optional(idn, ATTRIBUTE)?;
        Ok(data.ok().and_then(|data| SoeAttribute::parse(&data)))
    }

    fn text(&mut self, idn: Idn, elements: u8) -> Result<Option<String>, ServiceError> {
        let data = self.optional(idn, elements)?;
        let told =
            data.ok().and_then(|data| VariableData::parse(&data).map(|told| text(told.bytes).0));
        Ok(told.filter(|told| !told.is_empty()))
    }

    /// An IDN with its name.
    pub(super) fn named(&mut self, idn: Idn) -> Result<IdnReport, ServiceError> {
        let name = self.text(idn, NAME)?;
        let mut report = IdnReport::new(idn);
        report.name = name;
        Ok(report)
    }

    /// An IDN with all that is told of it; a value that is refused is a refusal.
    pub(super) fn whole(&mut self, idn: Idn) -> Result<IdnReport, ServiceError> {
        let data = self.element(idn, VALUE)?;
        let mut report = self.described(idn)?;
        let attribute = report.attribute.as_ref().map(super::report::AttributeReport::attribute);
        report.holds(&data, attribute);
        Ok(report)
    }

    /// The same, with the reason in place of a value that is refused.
    pub(super) fn as_far_as_told(&mut self, idn: Idn) -> Result<IdnReport, ServiceError> {
        let data = self.optional(idn, VALUE)?;
        let mut report = self.described(idn)?;
        let attribute = report.attribute.as_ref().map(super::report::AttributeReport::attribute);
        match data {
            Ok(data) => report.holds(&data, attribute),
            Err(error) => report.refused(error),
        }
        Ok(report)
    }

    /// An IDN with name, attribute, unit and limits.
    fn described(&mut self, idn: Idn) -> Result<IdnReport, ServiceError> {
        let mut report = self.named(idn)?;
        let attribute = self.attribute(idn)?;
        report.attribute = attribute.map(Into::into);
        report.unit = self.text(idn, UNIT)?;
        if let Ok(data) = self.optional(idn, MINIMUM)? {
            let (text, value) = show(&data, attribute);
            (report.minimum, report.limits[0]) = (value, Some(text));
        }
        if let Ok(data) = self.optional(idn, MAXIMUM)? {
            let (text, value) = show(&data, attribute);
            (report.maximum, report.limits[1]) = (value, Some(text));
        }
        Ok(report)
    }
}
