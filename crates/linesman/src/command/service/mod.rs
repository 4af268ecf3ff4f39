//! What the commands for single SubDevices share: a line that is served without being driven.

mod address;
mod cards;
mod mailbox;
mod refusal;
mod segment;

use linesman_config::inventory::{FoundDevice, Inventory};
use linesman_config::plan::{DevicePlan, Plan, PlanOptions};
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_runtime::selector::Selector;
use serde::Serialize;

use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;

pub(crate) use refusal::{Refusal, Report as RefusalReport};

/// Where the line is, and whom the service is for.
#[derive(clap::Args, Debug)]
pub(crate) struct Place {
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml
    #[arg(value_name = "WHERE")]
    pub(crate) line: String,
    /// The SubDevice: its number (3), station address (0x1003), alias (alias:7), or name
    #[arg(value_name = "DEVICE")]
    pub(crate) device: String,
}

/// A line whose SubDevices can be asked.
pub(crate) trait Line {
    /// Does one service, to its end.
    fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Result<ServiceAnswer, ServiceFailure>, Failure>;
    /// Emergencies that SubDevices sent meanwhile, in words.
    fn take_emergencies(&mut self) -> Vec<(DeviceId, String)>;
}

/// A line that was scanned and is served.
pub(crate) struct Session {
    line: Box<dyn Line>,
    inventory: Inventory,
    /// What people call the SubDevices, by index; empty without a project.
    names: Vec<String>,
    place: String,
    /// A virtual segment of a file begins anew with each command.
    passing: bool,
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
pub(crate) enum Trouble {
    /// The SubDevice says no: exit status 1.
    Refused(Box<Refusal>),
    /// Nothing could be done: exit status 2.
    Failed(Failure),
}

impl From<Failure> for Trouble {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

impl Session {
    /// Scans the line and begins to serve it.
    pub(crate) fn open(place: &str) -> Result<Self, Failure> {
        let selector: Selector = place.parse()?;
        let (line, inventory, names, passing): (Box<dyn Line>, _, _, _) = match &selector {
            Selector::Cards(names) => {
                let (line, inventory) = cards::open(names)?;
                (Box::new(line), inventory, Vec::new(), false)
            }
            Selector::Segment(path) => {
                let (line, inventory, names) = segment::open(path)?;
                (Box::new(line), inventory, names, true)
            }
            _ => {
                let reason =
                    format!("`{selector}`: a service sends frames, and nobody answers there");
                return Err(Failure::new(reason, "name a network card, or sim:plant.toml"));
            }
        };
        Ok(Self { line, inventory, names, place: place.to_owned(), passing })
    }

    /// Whether what is written is gone when the command ends.
    pub(crate) fn is_passing(&self) -> bool {
        self.passing
    }

    /// All SubDevices.
    pub(crate) fn devices(&self) -> impl Iterator<Item = DeviceId> + use<> {
        (0..self.inventory.devices.len() as u32).map(DeviceId)
    }

    /// The SubDevice that a word means.
    pub(crate) fn device(&self, word: &str) -> Result<DeviceId, Failure> {
        address::find(&self.inventory, &self.names, &self.place, word)
    }

    /// A SubDevice as it was found.
    pub(crate) fn found(&self, id: DeviceId) -> Option<&FoundDevice> {
        self.inventory.devices.get(id.index())
    }

    /// `3 (EL3204)`, or `3 (B3)` where it has a name.
    pub(crate) fn label(&self, id: DeviceId) -> String {
        match self.names.get(id.index()) {
            Some(name) => format!("{} ({name})", id.no()),
            None => self.found(id).map_or_else(|| id.no().to_string(), FoundDevice::label),
        }
    }

    /// A SubDevice for a report.
    pub(crate) fn report(&self, id: DeviceId) -> DeviceReport {
        let found = self.found(id);
        DeviceReport {
            no: id.no(),
            station: found.map_or(0, |found| found.station.0),
            name: self.names.get(id.index()).cloned(),
            r#type: found.map(|found| found.profile.type_name.clone()).unwrap_or_default(),
        }
    }

    /// Does one service.
    pub(crate) fn ask(&mut self, id: DeviceId, service: Service) -> Result<ServiceAnswer, Trouble> {
        match self.line.ask(id, service)? {
            Ok(answer) => Ok(answer),
            Err(failure) if failure.is_refusal() => {
                let device = self.report(id);
                Err(Trouble::Refused(Box::new(Refusal::new(device, &self.label(id), &failure))))
            }
            Err(failure) => {
                let mut failure = Failure::from_error(&failure);
                failure.reason = format!("{}: {}", self.place, self.named(id, &failure.reason));
                Err(Trouble::Failed(failure))
            }
        }
    }

    /// Does a service that gives bytes.
    pub(crate) fn bytes(&mut self, id: DeviceId, service: Service) -> Result<Vec<u8>, Trouble> {
        match self.ask(id, service)? {
            ServiceAnswer::Data(data) => Ok(data),
            ServiceAnswer::Done | ServiceAnswer::State { .. } | ServiceAnswer::Written { .. } => {
                Ok(Vec::new())
            }
        }
    }

    /// Emergencies that came meanwhile, in words.
    pub(crate) fn emergencies(&mut self) -> Vec<String> {
        let all = self.line.take_emergencies();
        all.into_iter().map(|(id, text)| format!("{}: {text}", self.label(id))).collect()
    }

    /// A text of the MainDevice, with the SubDevice as people call it.
    fn named(&self, id: DeviceId, text: &str) -> String {
        refusal::named(id, &self.label(id), text)
    }
}

/// What the SubDevices of an inventory are served by: their plans, each to stay where it is.
fn plan(inventory: &Inventory) -> Plan {
    let planned = inventory.planned(AlState::Op);
    let tree = inventory.tree().clone();
    match Plan::build(&planned, tree.clone(), &PlanOptions::default()) {
        Ok(plan) => plan,
        // A line that cannot exchange process data can be served all the same.
        Err(_) => {
            let device = |found: &FoundDevice| DevicePlan {
                name: found.label(),
                station: found.station,
                mailbox: found.profile.mailbox,
                device_emulation: found.profile.device_emulation,
                ..DevicePlan::bare(found.id)
            };
            Plan { devices: inventory.devices.iter().map(device).collect(), ..Plan::empty(tree) }
        }
    }
}

/// How a command ends: a refusal of the SubDevice is an answer, everything else is none.
pub(crate) fn end(
    outcome: Result<(), Trouble>,
    json: bool,
    output: &mut Output,
) -> Result<Status, Failure> {
    match outcome {
        Ok(()) => Ok(Status::Good),
        Err(Trouble::Failed(failure)) => Err(failure),
        Err(Trouble::Refused(refusal)) => {
            if json {
                output.json(&refusal.report);
            }
            output.complain(&refusal.failure);
            Ok(Status::Findings)
        }
    }
}
