//! Refusal by a SubDevice: told like a failure, and with `--json` as an object of its own.

use linesman_maindevice::service::RefusalKind;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::soe::SoeError;
use serde::Serialize;

use super::DeviceReport;
use crate::failure::Failure;
use crate::version;

/// A refusal.
#[derive(Debug)]
pub(crate) struct Refusal {
    /// In words.
    pub(crate) failure: Failure,
    /// For programs.
    pub(crate) report: Report,
}

/// A refusal as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.refusal/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Who refuses.
    device: DeviceReport,
    /// Kind of code: `sdo-abort`, `foe-error`, `soe-error`, `ads-error`, `mailbox-error`,
    /// `al-status`.
    kind: String,
    /// The SubDevice's own code.
    code: u32,
    /// What it means.
    reason: String,
    /// What to do next; `null` where there is nothing to advise.
    next_step: Option<String>,
}

impl Refusal {
    pub(super) fn new(
        device: DeviceReport,
        label: &str,
        (kind, code): (RefusalKind, u32),
        mut told: Failure,
    ) -> Self {
        if let Some(id) = DeviceId::from_no(device.no) {
            told.reason = named(id, label, &told.reason);
        }
        let next_step = (!told.next_step.is_empty()).then(|| told.next_step.clone());
        let report = Report {
            schema: "linesman.refusal/1".to_owned(),
            tool: version::tool(),
            device,
            kind: kind.name().to_owned(),
            code,
            reason: told.reason.clone(),
            next_step,
        };
        Self { failure: told, report }
    }

    /// The code, if a drive refuses an IDN.
    pub(crate) fn soe_error(&self) -> Option<SoeError> {
        let code = u16::try_from(self.report.code).ok();
        code.filter(|_| self.report.kind == RefusalKind::SoeError.name()).map(SoeError)
    }

    /// The code, if it is an SDO abort.
    pub(crate) fn abort_code(&self) -> Option<u32> {
        (self.report.kind == RefusalKind::SdoAbort.name()).then_some(self.report.code)
    }
}

/// A text of the MainDevice, which calls a SubDevice by its number, with the name that people use.
pub(super) fn named(id: DeviceId, label: &str, text: &str) -> String {
    let number = format!("SubDevice {}", id.no());
    match text.strip_prefix(&number) {
        Some(rest) if !rest.starts_with(|next: char| next.is_ascii_digit()) => {
            format!("{label}{rest}")
        }
        Some(_) | None => text.to_owned(),
    }
}
