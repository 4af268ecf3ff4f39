//! Requests to a running MainDevice and its answers: lines of JSON.

use linesman_maindevice::mailbox::{FileProgress, MailboxRequest};
use linesman_maindevice::service::{RefusalKind, Service, ServiceAnswer};
use linesman_proto::address::RegisterAddress;
use linesman_proto::ads::{AdsCommand, AmsAddress, AmsNetId};
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::coe::information::{ListKind, ValueInfo};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::soe::Idn;
use linesman_proto::register::AlStatus;
use linesman_proto::sii::WordAddress;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

use crate::online::report::OnlineReport;
use crate::run::report::RunReport;

/// Name and version of the answer.
pub const SCHEMA: &str = "linesman.service/1";

/// What can be asked.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Request {
    /// How the run goes.
    Status,
    /// How the line is now: states, counters, frames, mailboxes.
    Online,
    /// The sum of the errors of each SubDevice, by number: to be asked often, and the line as it is when
    /// one has risen.
    Errors,
    /// Counts begin at 0 again; no register is touched.
    Clear {
        /// Those of errors and changes.
        #[serde(default)]
        errors: bool,
        /// Those of frames.
        #[serde(default)]
        frames: bool,
    },
    /// Files that are under way between SubDevices and whoever asked here.
    Files,
    /// Reset the network: outputs that are locked after a link error are sent again.
    Reset,
    /// A service for one SubDevice, beside the cycle.
    Serve {
        /// Its number in the plan, from 1.
        no: u32,
        /// What is to be done.
        service: Asked,
    },
}

/// A service. Bytes are hexadecimal, lowest first: `"0a00"`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "what", rename_all = "kebab-case")]
#[allow(
    missing_docs,
    reason = "the fields are those of Service and MailboxRequest, explained there"
)]
pub enum Asked {
    /// Fetch an object.
    Upload {
        index: u16,
        subindex: u8,
        #[serde(default)]
        complete: bool,
    },
    /// Bring an object.
    Download {
        index: u16,
        subindex: u8,
        #[serde(default)]
        complete: bool,
        data: String,
    },
    /// Which objects there are.
    ObjectList { list: u16 },
    /// What an object is.
    DescribeObject { index: u16 },
    /// What an entry is.
    DescribeEntry { index: u16, subindex: u8, values: u8 },
    /// Set the addresses of an Ethernet port by EoE.
    SetAddresses { port: u8, data: String },
    /// Send an Ethernet frame by EoE.
    SendFrame { port: u8, number: u8, data: String },
    /// Read elements of an identification number by SoE.
    ReadIdn { drive: u8, idn: u16, elements: u8 },
    /// Write an identification number by SoE.
    WriteIdn { drive: u8, idn: u16, elements: u8, data: String },
    /// Fetch a file.
    ReadFile {
        name: String,
        #[serde(default)]
        password: u32,
    },
    /// Bring a file.
    WriteFile {
        name: String,
        #[serde(default)]
        password: u32,
        data: String,
    },
    /// Ask by ADS (AoE), by the number of the command. Without a NetId it is that of the plan, without a sender (NetId
    /// and port) the MainDevice.
    Ads {
        #[serde(default)]
        net_id: Option<String>,
        port: u16,
        #[serde(default)]
        source: Option<(String, u16)>,
        command: u16,
        data: String,
    },
    /// Send a message of the vendor's own protocol (VoE).
    SendVendorMessage { data: String, answer_within_ms: u32 },
    /// Pass on a message of a client of the mailbox gateway, by the number of its protocol.
    Pass { client: u64, protocol: u8, data: String },
    /// Look at its state.
    State,
    /// Take it to a state, by its number: 1, 2, 3, 4 or 8.
    Enter { state: u8 },
    /// Acknowledge an error.
    Acknowledge,
    /// Read the error counters and clear them in one go.
    ClearCounters,
    /// Read registers.
    ReadRegister { address: u16, len: u16 },
    /// Write registers.
    WriteRegister { address: u16, data: String },
    /// Read the EEPROM.
    ReadSii {
        #[serde(default)]
        whole: bool,
    },
    /// Write words of the EEPROM.
    WriteSii { word: u32, data: String },
}

/// What is answered.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// `linesman.service/1`.
    pub schema: String,
    /// Why it was not done, with what to do; `null` when it was.
    pub error: Option<String>,
    /// The SubDevice's own code, if it has said no itself; `null` for any other reason.
    pub refusal: Option<RefusalCode>,
    /// Bytes, hexadecimal; `null` where the service gives none.
    pub data: Option<String>,
    /// Its AL status and AL status code; `null` where the service does not tell.
    pub state: Option<[u16; 2]>,
    /// How many words of the EEPROM were different; `null` where none were written.
    pub words: Option<u32>,
    /// How the run goes; `null` unless that was asked.
    pub run: Option<Box<RunReport>>,
    /// How the line is now; `null` unless that was asked.
    pub online: Option<Box<OnlineReport>>,
    /// The sum of the errors of each SubDevice, by number; `null` unless that was asked.
    pub errors: Option<Vec<u64>>,
    /// Files that are under way; `null` unless that was asked.
    pub files: Option<Vec<FileUnderWay>>,
}

/// A file that is under way.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FileUnderWay {
    /// Number of the SubDevice in the plan, from 1.
    pub no: u32,
    /// Bytes of the file that are through.
    pub done: u64,
    /// Bytes of the whole file; `null` while nobody knows, as in reading.
    pub total: Option<u64>,
    /// The same in words, with what keeps the SubDevice busy: "0 of 5000 bytes, the SubDevice is busy: erasing,
    /// 25 %".
    pub text: String,
}

impl FileUnderWay {
    pub(crate) fn of(no: u32, progress: &FileProgress) -> Self {
        Self {
            no,
            done: progress.done as u64,
            total: progress.total.map(|total| total as u64),
            text: progress.to_string(),
        }
    }
}

/// By what code a SubDevice has said no.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RefusalCode {
    /// Whose code it is: `sdo-abort`, `foe-error`, `eoe-result`, `soe-error`, `ads-error`, `mailbox-error` or
    /// `al-status`.
    pub kind: String,
    /// The code.
    pub code: u32,
}

impl Answer {
    fn empty() -> Self {
        Self { schema: SCHEMA.to_owned(), ..Self::default() }
    }

    /// It was not done.
    pub(crate) fn refusal(why: String) -> Self {
        Self { error: Some(why), ..Self::empty() }
    }

    /// How the run goes.
    pub(crate) fn status(report: RunReport) -> Self {
        Self { run: Some(Box::new(report)), ..Self::empty() }
    }

    /// How the line is now.
    pub(crate) fn online(report: OnlineReport) -> Self {
        Self { online: Some(Box::new(report)), ..Self::empty() }
    }

    /// The sum of the errors of each SubDevice.
    pub(crate) fn errors(sums: Vec<u64>) -> Self {
        Self { errors: Some(sums), ..Self::empty() }
    }

    /// Files that are under way.
    pub(crate) fn files(files: Vec<FileUnderWay>) -> Self {
        Self { files: Some(files), ..Self::empty() }
    }

    /// It is done, and there is nothing to tell.
    pub(crate) fn done() -> Self {
        Self::empty()
    }

    /// What a service gave.
    pub(crate) fn of(
        result: &Result<ServiceAnswer, linesman_maindevice::service::ServiceFailure>,
    ) -> Self {
        match result {
            Ok(ServiceAnswer::Done) => Self::empty(),
            Ok(ServiceAnswer::Data(data)) => Self { data: Some(to_hex(data)), ..Self::empty() },
            Ok(ServiceAnswer::State { status, code }) => {
                Self { state: Some([status.0, code.0]), ..Self::empty() }
            }
            Ok(ServiceAnswer::Written { words }) => Self { words: Some(*words), ..Self::empty() },
            Err(failure) => {
                let refusal = failure.refusal();
                let refusal =
                    refusal.map(|(kind, code)| RefusalCode { kind: kind.name().to_owned(), code });
                Self { error: Some(failure.to_string()), refusal, ..Self::empty() }
            }
        }
    }

    /// What the service gave, as if it had been asked for in this process; or why it was not done.
    ///
    /// # Errors
    /// The words of whoever refused, and the code, if that was the SubDevice itself.
    pub fn given(&self) -> Result<ServiceAnswer, (String, Option<(RefusalKind, u32)>)> {
        if let Some(error) = &self.error {
            let known = |refusal: &RefusalCode| {
                let kind = RefusalKind::ALL.into_iter().find(|kind| kind.name() == refusal.kind)?;
                Some((kind, refusal.code))
            };
            return Err((error.clone(), self.refusal.as_ref().and_then(known)));
        }
        if let Some([status, code]) = self.state {
            return Ok(ServiceAnswer::State { status: AlStatus(status), code: AlStatusCode(code) });
        }
        if let Some(words) = self.words {
            return Ok(ServiceAnswer::Written { words });
        }
        match &self.data {
            Some(data) => from_hex(data).map(ServiceAnswer::Data).map_err(|why| (why, None)),
            None => Ok(ServiceAnswer::Done),
        }
    }
}

impl From<&Service> for Asked {
    fn from(service: &Service) -> Self {
        match service {
            Service::Mailbox(request) => Self::from(request),
            Service::State => Self::State,
            Service::Enter(state) => Self::Enter { state: state.bits() },
            Service::Acknowledge => Self::Acknowledge,
            Service::ClearCounters => Self::ClearCounters,
            Service::ReadRegister { address, len } => {
                Self::ReadRegister { address: address.0, len: *len }
            }
            Service::WriteRegister { address, data } => {
                Self::WriteRegister { address: address.0, data: to_hex(data) }
            }
            Service::ReadSii { whole } => Self::ReadSii { whole: *whole },
            Service::WriteSii { at, data } => Self::WriteSii { word: at.0, data: to_hex(data) },
        }
    }
}

impl From<&MailboxRequest> for Asked {
    fn from(request: &MailboxRequest) -> Self {
        match request {
            MailboxRequest::Upload { object, complete } => {
                let (index, subindex) = (object.index.0, object.subindex);
                Self::Upload { index, subindex, complete: *complete }
            }
            MailboxRequest::Download { object, complete, data } => {
                let (index, subindex) = (object.index.0, object.subindex);
                Self::Download { index, subindex, complete: *complete, data: to_hex(data) }
            }
            MailboxRequest::ObjectList { list } => Self::ObjectList { list: list.code() },
            MailboxRequest::DescribeObject { index } => Self::DescribeObject { index: index.0 },
            MailboxRequest::DescribeEntry { object, values } => {
                let (index, subindex) = (object.index.0, object.subindex);
                Self::DescribeEntry { index, subindex, values: values.0 }
            }
            MailboxRequest::SetAddresses { port, parameters } => {
                Self::SetAddresses { port: *port, data: to_hex(parameters) }
            }
            MailboxRequest::SendFrame { port, number, frame } => {
                Self::SendFrame { port: *port, number: *number, data: to_hex(frame) }
            }
            MailboxRequest::ReadIdn { drive, idn, elements } => {
                Self::ReadIdn { drive: *drive, idn: idn.0, elements: *elements }
            }
            MailboxRequest::WriteIdn { drive, idn, elements, data } => {
                let (drive, idn, elements) = (*drive, idn.0, *elements);
                Self::WriteIdn { drive, idn, elements, data: to_hex(data) }
            }
            MailboxRequest::ReadFile { name, password } => {
                Self::ReadFile { name: name.clone(), password: *password }
            }
            MailboxRequest::WriteFile { name, password, data } => {
                let (name, data) = (name.clone(), to_hex(data));
                Self::WriteFile { name, password: *password, data }
            }
            MailboxRequest::Ads { net_id, port, source, command, data } => Self::Ads {
                net_id: net_id.map(|net_id| net_id.to_string()),
                port: *port,
                source: source.map(|source| (source.net_id.to_string(), source.port)),
                command: command.number(),
                data: to_hex(data),
            },
            MailboxRequest::SendVendorMessage { data, answer_within } => {
                let ms = answer_within.as_nanos() / 1_000_000;
                let answer_within_ms = u32::try_from(ms).unwrap_or(u32::MAX);
                Self::SendVendorMessage { data: to_hex(data), answer_within_ms }
            }
            MailboxRequest::Pass { client, kind, data } => {
                Self::Pass { client: *client, protocol: kind.code(), data: to_hex(data) }
            }
        }
    }
}

impl Asked {
    /// The service that is meant.
    ///
    /// # Errors
    /// What is wrong with the request.
    pub(crate) fn service(self) -> Result<Service, String> {
        Ok(match self {
            Self::Upload { index, subindex, complete } => {
                Service::Mailbox(MailboxRequest::Upload {
                    object: ObjectAddress::new(index, subindex),
                    complete,
                })
            }
            Self::Download { index, subindex, complete, data } => {
                let (object, data) = (ObjectAddress::new(index, subindex), from_hex(&data)?);
                Service::Mailbox(MailboxRequest::Download { object, complete, data })
            }
            Self::ObjectList { list } => {
                Service::Mailbox(MailboxRequest::ObjectList { list: ListKind::from_code(list) })
            }
            Self::DescribeObject { index } => {
                Service::Mailbox(MailboxRequest::DescribeObject { index: ObjectIndex(index) })
            }
            Self::DescribeEntry { index, subindex, values } => {
                let (object, values) = (ObjectAddress::new(index, subindex), ValueInfo(values));
                Service::Mailbox(MailboxRequest::DescribeEntry { object, values })
            }
            Self::SetAddresses { port, data } => {
                let parameters = from_hex(&data)?;
                Service::Mailbox(MailboxRequest::SetAddresses { port, parameters })
            }
            Self::SendFrame { port, number, data } => {
                let frame = from_hex(&data)?;
                Service::Mailbox(MailboxRequest::SendFrame { port, number, frame })
            }
            Self::ReadIdn { drive, idn, elements } => {
                let idn = Idn(idn);
                Service::Mailbox(MailboxRequest::ReadIdn { drive, idn, elements })
            }
            Self::WriteIdn { drive, idn, elements, data } => {
                let (idn, data) = (Idn(idn), from_hex(&data)?);
                Service::Mailbox(MailboxRequest::WriteIdn { drive, idn, elements, data })
            }
            Self::ReadFile { name, password } => {
                Service::Mailbox(MailboxRequest::ReadFile { name, password })
            }
            Self::WriteFile { name, password, data } => {
                let data = from_hex(&data)?;
                Service::Mailbox(MailboxRequest::WriteFile { name, password, data })
            }
            Self::Ads { net_id, port, source, command, data } => {
                let net_id = net_id.as_deref().map(known_net_id).transpose()?;
                let source = source.map(|(net_id, port)| {
                    known_net_id(&net_id).map(|net_id| AmsAddress { net_id, port })
                });
                let command = AdsCommand::from_number(command)
                    .ok_or_else(|| format!("ADS command {command}: expected 1 to 9"))?;
                let (source, data) = (source.transpose()?, from_hex(&data)?);
                Service::Mailbox(MailboxRequest::Ads { net_id, port, source, command, data })
            }
            Self::SendVendorMessage { data, answer_within_ms } => {
                let answer_within = Span::ms(u64::from(answer_within_ms));
                let data = from_hex(&data)?;
                Service::Mailbox(MailboxRequest::SendVendorMessage { data, answer_within })
            }
            Self::Pass { client, protocol, data } => {
                let (kind, data) = (MailboxType::from_code(protocol), from_hex(&data)?);
                Service::Mailbox(MailboxRequest::Pass { client, kind, data })
            }
            Self::State => Service::State,
            Self::Enter { state } => Service::Enter(known(state)?),
            Self::Acknowledge => Service::Acknowledge,
            Self::ClearCounters => Service::ClearCounters,
            Self::ReadRegister { address, len } => {
                Service::ReadRegister { address: RegisterAddress(address), len }
            }
            Self::WriteRegister { address, data } => {
                Service::WriteRegister { address: RegisterAddress(address), data: from_hex(&data)? }
            }
            Self::ReadSii { whole } => Service::ReadSii { whole },
            Self::WriteSii { word, data } => {
                Service::WriteSii { at: WordAddress(word), data: from_hex(&data)? }
            }
        })
    }
}

fn known_net_id(text: &str) -> Result<AmsNetId, String> {
    text.parse().map_err(|error| format!("`{text}`: {error}"))
}

fn known(state: u8) -> Result<AlState, String> {
    let all = [AlState::Init, AlState::PreOp, AlState::Boot, AlState::SafeOp, AlState::Op];
    let found = all.into_iter().find(|known| known.bits() == state);
    found.ok_or_else(|| format!("state {state}: expected 1, 2, 3, 4 or 8"))
}

pub(crate) fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn from_hex(text: &str) -> Result<Vec<u8>, String> {
    let wrong = || format!("`{text}`: expected pairs of hexadecimal digits, lowest byte first");
    if !text.bytes().all(|one| one.is_ascii_hexdigit()) || !text.len().is_multiple_of(2) {
        return Err(wrong());
    }
    let digits = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).map_err(|_| wrong());
    (0..text.len()).step_by(2).map(digits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_service_says_the_same_on_the_other_side() {
        let object = ObjectAddress::new(0x1018, 1);
        let data = vec![0, 10, 255];
        let (name, password) = ("fw".to_owned(), 7);
        let services = [
            Service::Mailbox(MailboxRequest::Upload { object, complete: true }),
            Service::Mailbox(MailboxRequest::Download {
                object,
                complete: false,
                data: data.clone(),
            }),
            Service::Mailbox(MailboxRequest::ObjectList { list: ListKind::Backup }),
            Service::Mailbox(MailboxRequest::DescribeObject { index: object.index }),
            Service::Mailbox(MailboxRequest::DescribeEntry { object, values: ValueInfo(0x10) }),
            Service::Mailbox(MailboxRequest::ReadFile { name: name.clone(), password }),
            Service::Mailbox(MailboxRequest::WriteFile { name, password, data: data.clone() }),
            Service::Mailbox(MailboxRequest::Ads {
                net_id: Some(AmsNetId([10, 0, 0, 1, 3, 1])),
                port: 0x1000,
                source: Some(AmsAddress { net_id: AmsNetId([10, 0, 0, 1, 2, 1]), port: 7 }),
                command: AdsCommand::ReadWrite,
                data: data.clone(),
            }),
            Service::Mailbox(MailboxRequest::SendVendorMessage {
                data: data.clone(),
                answer_within: Span::ms(30),
            }),
            Service::Mailbox(MailboxRequest::Pass {
                client: 3,
                kind: MailboxType::Voe,
                data: data.clone(),
            }),
            Service::State,
            Service::Enter(AlState::Boot),
            Service::Acknowledge,
            Service::ClearCounters,
            Service::ReadRegister { address: RegisterAddress(0x130), len: 2 },
            Service::WriteRegister { address: RegisterAddress(0x300), data: data.clone() },
            Service::ReadSii { whole: true },
            Service::WriteSii { at: WordAddress(4), data },
        ];
        for service in services {
            let request = Request::Serve { no: 3, service: Asked::from(&service) };
            let line = serde_json::to_string(&request).unwrap();
            let back: Request = serde_json::from_str(&line).unwrap();
            assert_eq!(back, request, "{line}");
            let Request::Serve { service: asked, .. } = back else { panic!("{line}") };
            assert_eq!(asked.service(), Ok(service));
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        let wrong = |data: &str| {
            let data = data.to_owned();
            Asked::WriteRegister { address: 0, data }.service().unwrap_err()
        };
        for data in ["0", "0g", "äö", "+1"] {
            assert!(wrong(data).contains("hexadecimal"), "{data}");
        }
        assert!(Asked::Enter { state: 5 }.service().is_err());
    }
}
