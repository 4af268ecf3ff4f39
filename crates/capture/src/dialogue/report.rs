//! Transfers in the report.

use std::fmt::Write as _;

use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::report::Number;
use serde::{Deserialize, Serialize};

use super::transfer::{MailboxTransfer, SeenAt};
use crate::network::states::named;

/// A mailbox transfer: a request with its answer, all segments and fragments of it, or a message that stands for itself.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TransferReport {
    /// Number of the SubDevice.
    pub no: Option<u32>,
    /// Its station address, where datagrams name it.
    pub station: Option<u16>,
    /// Its position from 1, where datagrams name it.
    pub position_no: Option<u32>,
    /// The protocol.
    pub protocol: MailboxProtocol,
    /// What is done: `upload`, `download`, `object-list`, `object-description`, `entry-description`, `emergency`, `pdo`,
    /// `read-file`, `write-file`, `frame-in`, `frame-out`, `set-ip`, `get-ip`, `set-filter`, `get-filter`, `time-stamp`,
    /// `read-idn`, `write-idn`, `notification`, `message`, `error-reply`.
    pub what: String,
    /// When it was asked for; `null` where that was not recorded, or nobody has.
    pub asked_ns: Option<Number>,
    /// The frame that shows the request.
    pub asked_frame: Option<Number>,
    /// When its last answer came.
    pub answered_ns: Option<Number>,
    /// The frame that shows it.
    pub answered_frame: Option<Number>,
    /// Number of messages.
    pub messages: u32,
    /// Of CoE: index of the object; of SoE the IDN.
    pub index: Option<u16>,
    /// Of CoE: subindex.
    pub subindex: Option<u8>,
    /// Of CoE: all entries at once (complete access).
    pub complete: bool,
    /// Of an SDO: `expedited`, `normal`, `segmented`.
    pub form: Option<String>,
    /// Bytes of data.
    pub size: Number,
    /// The data as hexadecimal digits, at most 4,096 bytes.
    pub data: String,
    /// Meaning of the data, name of a file, or reason; of SoE the elements and the drive: `value of drive 0`.
    pub text: Option<String>,
    /// The end it came to.
    pub outcome: TransferOutcome,
    /// SDO abort code, or error code of the protocol.
    pub code: Option<u32>,
}

/// A protocol of the mailbox.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum MailboxProtocol {
    /// CAN application protocol.
    CoE,
    /// Files.
    FoE,
    /// Ethernet.
    EoE,
    /// Servo drive profile.
    SoE,
    /// ADS.
    #[serde(rename = "AoE")]
    Aoe,
    /// A vendor's own.
    #[serde(rename = "VoE")]
    Voe,
    /// The mailbox itself.
    #[serde(rename = "mailbox")]
    Mailbox,
}

impl MailboxProtocol {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::CoE => "CoE",
            Self::FoE => "FoE",
            Self::EoE => "EoE",
            Self::SoE => "SoE",
            Self::Aoe => "AoE",
            Self::Voe => "VoE",
            Self::Mailbox => "mailbox",
        }
    }
}

/// End of a transfer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TransferOutcome {
    /// It was answered to its end.
    Done,
    /// It was refused: `code` says why.
    Refused,
    /// No answer was recorded.
    Unanswered,
    /// It was answered, but not to its end.
    Unfinished,
    /// A message that wants no answer.
    Told,
}

impl TransferOutcome {
    /// As a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Refused => "refused",
            Self::Unanswered => "unanswered",
            Self::Unfinished => "unfinished",
            Self::Told => "told",
        }
    }
}

/// A transfer as a report.
pub(super) fn of(transfer: &MailboxTransfer, model: &NetworkModel) -> TransferReport {
    let at = |when: Option<SeenAt>| when.map(|when| Number(when.at.as_nanos()));
    let frame = |when: Option<SeenAt>| when.map(|when| Number(when.frame));
    let (station, position_no) = named(transfer.target);
    TransferReport {
        no: transfer.target.device(model).map(|id| id.no()),
        station,
        position_no,
        protocol: transfer.protocol,
        what: transfer.what.to_owned(),
        asked_ns: at(transfer.asked),
        asked_frame: frame(transfer.asked),
        answered_ns: at(transfer.answered),
        answered_frame: frame(transfer.answered),
        messages: transfer.messages,
        index: transfer.object.map(|object| object.index.value()),
        subindex: transfer
            .object
            .filter(|_| transfer.protocol == MailboxProtocol::CoE)
            .map(|object| object.subindex),
        complete: transfer.complete,
        form: transfer.form.map(str::to_owned),
        size: Number(transfer.size),
        data: hex(&transfer.data),
        text: transfer.text.clone(),
        outcome: transfer.outcome,
        code: transfer.code,
    }
}

fn hex(data: &[u8]) -> String {
    data.iter().fold(String::with_capacity(2 * data.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
