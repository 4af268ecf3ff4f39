//! Common part of the commands for single SubDevices: a line that is served without being driven.

pub(crate) mod address;
mod cards;
mod known;
mod mailbox;
mod refusal;
mod segment;
mod socket;

use linesman_config::inventory::{Inventory, label};
use linesman_diagnosis::Diagnosis;
use linesman_maindevice::service::{RefusalKind, Service, ServiceAnswer, ServiceFailure};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::time::Span;
use linesman_runtime::selector::Selector;
use serde::Serialize;

use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::hint;
use crate::output::Output;
use crate::version;

pub(crate) use address::{DeviceNames, find};
pub(crate) use known::KnownDevice;
pub(crate) use refusal::{Refusal, Report as RefusalReport};
pub(crate) use socket::{is_one as is_socket, silent};

/// Where the line is, and whom the service is for.
#[derive(clap::Args, Debug)]
pub(crate) struct ServiceTarget {
    /// Where the line is: eth0, eth0+eth1 (a ring), sim:plant.toml, or the socket of `run --control`; or
    /// esi:FILE.xml#TYPE for a device as its maker describes it, without the device (DEVICE: offline)
    #[arg(value_name = "WHERE")]
    pub(crate) line: String,
    /// The SubDevice: its number (3), station address (0x1003), alias (alias:7), position (position:2),
    /// type, or name, also as answers write it ("Term 4 (EL3104)")
    #[arg(value_name = "DEVICE")]
    pub(crate) device: String,
}

/// A line whose SubDevices can be asked.
pub(crate) trait ServiceClient {
    /// Does one service, to its end.
    fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Result<ServiceAnswer, ServiceRefused>, Failure>;
    /// Lets time pass. `false` when the user ended it.
    fn wait(&mut self, span: Span) -> Result<bool, Failure>;
    /// What is wrong with the line, by all frames since it was opened; `None` where they were not seen.
    fn diagnosis(&mut self) -> Option<Diagnosis>;
    /// Emergencies that SubDevices sent meanwhile, in words.
    fn take_emergencies(&mut self) -> Vec<(DeviceId, String)>;
}

/// A service that was not done.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct ServiceRefused {
    /// Why, with what to do.
    told: Failure,
    /// The SubDevice's own code, if it has said no itself.
    refusal: Option<(RefusalKind, u32)>,
}

impl From<&ServiceFailure> for ServiceRefused {
    fn from(failure: &ServiceFailure) -> Self {
        Self { told: Failure::from_error(failure), refusal: failure.refusal() }
    }
}

/// A line that is served.
pub(crate) struct ServiceLine {
    client: Box<dyn ServiceClient>,
    devices: Vec<KnownDevice>,
    place: String,
    kind: Kind,
    inventory: Option<Inventory>,
}

/// What becomes of a line when the command ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    /// It stays as it is.
    Cards,
    /// A virtual segment of a file begins anew with each command.
    Passing,
    /// A running MainDevice drives it.
    Driven,
}

/// A SubDevice in a report.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DeviceReport {
    /// Its number, from 1.
    pub(crate) no: u32,
    /// Its station address.
    pub(crate) station: u16,
    /// What people call it; `null` without a project or segment file.
    pub(crate) name: Option<String>,
    /// Its order designation, as its SII says.
    pub(crate) r#type: String,
}

/// Why there is no answer.
#[derive(Debug)]
pub(crate) enum ServiceError {
    /// The SubDevice says no: exit status 1.
    Refused(Box<Refusal>),
    /// Nothing could be done: exit status 2.
    Failed(Failure),
}

impl ServiceError {
    /// Why, in words.
    pub(crate) fn reason(&self) -> &str {
        match self {
            Self::Refused(refusal) => &refusal.failure.reason,
            Self::Failed(failure) => &failure.reason,
        }
    }
}

impl From<Failure> for ServiceError {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

impl ServiceLine {
    /// Scans the line and begins to serve it.
    pub(crate) fn open(place: &str) -> Result<Self, Failure> {
        if socket::is_one(place) {
            let (client, devices) = socket::open(place)?;
            let client = Box::new(client);
            let (place, kind) = (place.to_owned(), Kind::Driven);
            return Ok(Self { client, devices, place, kind, inventory: None });
        }
        if place.starts_with("esi:") {
            let (client, inventory, names) = segment::open_described(place)?;
            let devices = known::all(&inventory, &names);
            let (client, inventory) = (Box::new(client), Some(inventory));
            return Ok(Self {
                client,
                devices,
                place: place.to_owned(),
                kind: Kind::Passing,
                inventory,
            });
        }
        line_access::refuse_missing_socket(place)?;
        let selector: Selector = place.parse()?;
        let (client, devices, kind, inventory): (Box<dyn ServiceClient>, _, _, _) = match &selector
        {
            Selector::Cards(names) => {
                let (client, inventory) = cards::open(names)?;
                (Box::new(client), known::all(&inventory, &[]), Kind::Cards, inventory)
            }
            Selector::Segment(path) => {
                let (client, inventory, names) = segment::open(path)?;
                (Box::new(client), known::all(&inventory, &names), Kind::Passing, inventory)
            }
            Selector::Listen(_) | Selector::File(_) => {
                return Err(line_access::not_drivable(place, &selector));
            }
        };
        Ok(Self { client, devices, place: place.to_owned(), kind, inventory: Some(inventory) })
    }

    /// Whether what is written is gone when the command ends.
    pub(crate) fn is_passing(&self) -> bool {
        self.kind == Kind::Passing
    }

    /// What the scan found; `None` of a line that another process drives.
    pub(crate) const fn inventory(&self) -> Option<&Inventory> {
        self.inventory.as_ref()
    }

    /// What is wrong with the line, by all frames since it was opened; `None` of a line that another process
    /// drives.
    pub(crate) fn diagnosis(&mut self) -> Option<Diagnosis> {
        let diagnosis = self.client.diagnosis()?;
        Some(Diagnosis { tool: version::tool(), source: self.place.clone(), ..diagnosis })
    }

    /// What the line was called.
    pub(crate) fn place(&self) -> &str {
        &self.place
    }

    /// The command that looks closer at the line.
    pub(crate) fn look_closer(&self) -> String {
        match self.kind {
            Kind::Cards | Kind::Passing => format!("linesman diagnose {}", self.place),
            Kind::Driven => format!("linesman online {}", self.place),
        }
    }

    /// Lets time pass. `false` when the user ended it.
    pub(crate) fn wait(&mut self, span: Span) -> Result<bool, Failure> {
        self.client.wait(span)
    }

    /// Reads registers; `None` when nothing came back.
    pub(crate) fn try_read(
        &mut self,
        id: DeviceId,
        address: RegisterAddress,
        len: u16,
    ) -> Result<Option<Vec<u8>>, Failure> {
        match self.client.ask(id, Service::ReadRegister { address, len })? {
            Ok(ServiceAnswer::Data(data)) => Ok(Some(data)),
            Ok(_) | Err(_) => Ok(None),
        }
    }

    /// All SubDevices.
    pub(crate) fn devices(&self) -> &[KnownDevice] {
        &self.devices
    }

    /// The SubDevice that a word means.
    pub(crate) fn device(&self, word: &str) -> Result<DeviceId, Failure> {
        let called: Vec<DeviceNames<'_>> = self.devices.iter().map(DeviceNames::from).collect();
        find(&called, &self.place, word)
    }

    /// What is known of a SubDevice.
    pub(crate) fn known(&self, id: DeviceId) -> Option<&KnownDevice> {
        self.devices.iter().find(|known| known.id == id)
    }

    /// `Term 4 (EL3104)`, or `SubDevice 4 (EL3104)` where it has no name.
    pub(crate) fn label(&self, id: DeviceId) -> String {
        self.known(id).map_or_else(|| label(id, "", ""), KnownDevice::label)
    }

    /// A SubDevice for a report.
    pub(crate) fn report(&self, id: DeviceId) -> DeviceReport {
        let nobody = || DeviceReport { no: id.no(), station: 0, name: None, r#type: String::new() };
        self.known(id).map_or_else(nobody, KnownDevice::report)
    }

    /// Does one service.
    pub(crate) fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<ServiceAnswer, ServiceError> {
        self.attempt(id, service)?
    }

    /// Does one service. The outer error is about the line: nobody else can be asked there either.
    pub(crate) fn attempt(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Result<ServiceAnswer, ServiceError>, Failure> {
        let ServiceRefused { mut told, refusal } = match self.client.ask(id, service)? {
            Ok(answer) => return Ok(Ok(answer)),
            Err(not_done) => not_done,
        };
        told.next_step = hint::complete(&told.next_step, &self.place);
        let label = self.label(id);
        Ok(Err(match refusal {
            Some(refusal) => {
                let device = self.report(id);
                ServiceError::Refused(Box::new(Refusal::new(device, &label, refusal, told)))
            }
            None => {
                let reason = refusal::named(id, &label, &told.reason);
                let reason = format!("{}: {reason}", self.place);
                ServiceError::Failed(Failure { reason, ..told })
            }
        }))
    }

    /// Does a service that gives bytes.
    pub(crate) fn bytes(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Vec<u8>, ServiceError> {
        match self.ask(id, service)? {
            ServiceAnswer::Data(data) => Ok(data),
            ServiceAnswer::Done | ServiceAnswer::State { .. } | ServiceAnswer::Written { .. } => {
                Ok(Vec::new())
            }
        }
    }

    /// Emergencies that came meanwhile, in words.
    pub(crate) fn emergencies(&mut self) -> Vec<String> {
        let all = self.client.take_emergencies();
        all.into_iter().map(|(id, text)| format!("{}: {text}", self.label(id))).collect()
    }
}

/// How a command ends: a refusal of the SubDevice is an answer, everything else is none.
pub(crate) fn end(
    outcome: Result<(), ServiceError>,
    json: bool,
    output: &mut Output,
) -> Result<Status, Failure> {
    match outcome {
        Ok(()) => Ok(Status::Good),
        Err(ServiceError::Failed(failure)) => Err(failure),
        Err(ServiceError::Refused(refusal)) => {
            if json {
                output.json(&refusal.report);
            }
            output.complain(&refusal.failure);
            Ok(Status::Findings)
        }
    }
}
