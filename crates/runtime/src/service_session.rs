//! Session that serves single SubDevices of a line without driving it: scanned, then asked, one service at a time.

use std::collections::VecDeque;

use linesman_config::inventory::{FoundDevice, Inventory};
use linesman_config::plan::{DevicePlan, Plan, PlanOptions};
use linesman_diagnosis::{Diagnosis, Engine, FrameSeen, HostObservation, Setup};
use linesman_maindevice::mailbox::FileProgress;
use linesman_maindevice::procedure::ScanError;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_session::SessionHooks;

use crate::drive::Driver;
use crate::stop::Stop;
use crate::transport::Transport;

/// A line that is served.
pub struct ServiceSession<L> {
    driver: Driver<L, ServiceHooks>,
}

impl<L: Transport> ServiceSession<L> {
    /// A session that has sent nothing yet; its frames are judged where a setup of the diagnosis is given.
    pub fn new(line: L, setup: Option<Setup>) -> Self {
        let options = line.options();
        let hooks = ServiceHooks { engine: setup.map(Engine::new), ..ServiceHooks::default() };
        Self { driver: Driver::new(line, options, hooks) }
    }

    /// Finds out what is on the line: it gets station addresses, and keeps its states. `None` when that is not done
    /// after `patience`, or was stopped.
    ///
    /// # Errors
    /// Those of the line; inside, why it cannot be scanned.
    pub fn scan(
        &mut self,
        patience: Span,
        stop: &Stop,
    ) -> Result<Option<Result<Inventory, ScanError>>, L::Error> {
        self.hooks().order = Some(LineCommand::Scan);
        self.drive(patience, stop)?;
        Ok(self.hooks().scanned.take())
    }

    /// Serves the SubDevices of a plan from now on; [`service_plan`] makes one. Each stays in its state until a
    /// [`Service`] takes it elsewhere.
    pub fn serve_only(&mut self, plan: Plan) {
        self.hooks().order = Some(LineCommand::ServeOnly(Box::new(plan)));
    }

    /// Does one service, to its end. `None` when that is not done after `patience`, or was stopped.
    ///
    /// # Errors
    /// Those of the line; inside, why the service was not done.
    pub fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
        patience: Span,
        stop: &Stop,
    ) -> Result<Option<Result<ServiceAnswer, ServiceFailure>>, L::Error> {
        self.hooks().service = Some((id, service));
        self.drive(patience, stop)?;
        Ok(self.hooks().served.take())
    }

    /// Lets time pass, until `stop` at the latest.
    ///
    /// # Errors
    /// Those of the line.
    pub fn wait(&mut self, span: Span, stop: &Stop) -> Result<(), L::Error> {
        self.drive(span, stop)
    }

    /// The answer of the diagnosis so far, where there is one.
    pub fn diagnosis(&mut self) -> Option<Diagnosis> {
        let now = self.driver.now();
        let engine = self.hooks().engine.as_mut()?;
        engine.finish(now, true);
        Some(engine.diagnosis())
    }

    /// Emergencies that SubDevices sent since the last call, in words.
    pub fn take_emergencies(&mut self) -> Vec<(DeviceId, String)> {
        self.hooks().emergencies.drain(..).collect()
    }

    /// Calls this with the progress of files, from now on.
    pub fn on_file_progress(&mut self, told: impl FnMut(&FileProgress) + Send + 'static) {
        self.hooks().file_progress = Some(Box::new(told));
    }

    const fn hooks(&mut self) -> &mut ServiceHooks {
        self.driver.session_mut().hooks_mut()
    }

    fn drive(&mut self, span: Span, stop: &Stop) -> Result<(), L::Error> {
        let until = self.driver.now() + span;
        self.hooks().done = false;
        self.driver.run(until, stop)
    }
}

/// The plan by which the SubDevices of an inventory are served, each to stay where it is. A line that cannot exchange
/// process data can be served all the same.
#[must_use]
pub fn service_plan(inventory: &Inventory) -> Plan {
    let planned = inventory.planned(AlState::Op);
    let tree = inventory.tree().clone();
    Plan::build(&planned, tree.clone(), &PlanOptions::default()).unwrap_or_else(|_| {
        let device = |found: &FoundDevice| DevicePlan {
            name: found.label(),
            station: found.station,
            mailbox: found.profile.mailbox,
            device_emulation: found.profile.device_emulation,
            ..DevicePlan::bare(found.id)
        };
        Plan { devices: inventory.devices.iter().map(device).collect(), ..Plan::empty(tree) }
    })
}

/// A command that the MainDevice is to be given.
enum LineCommand {
    Scan,
    ServeOnly(Box<Plan>),
}

/// Hooks that give one command at a time and wait for its end.
#[derive(Default)]
struct ServiceHooks {
    /// Judges all frames.
    engine: Option<Engine>,
    order: Option<LineCommand>,
    service: Option<(DeviceId, Service)>,
    ticket: Option<ServiceTicket>,
    done: bool,
    scanned: Option<Result<Inventory, ScanError>>,
    served: Option<Result<ServiceAnswer, ServiceFailure>>,
    emergencies: VecDeque<(DeviceId, String)>,
    file_progress: Option<FileProgressHook>,
}

/// Whom progress of files is told.
type FileProgressHook = Box<dyn FnMut(&FileProgress) + Send>;

impl SessionHooks for ServiceHooks {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        if let Some(engine) = &mut self.engine {
            engine.handle_frame(frame);
        }
    }

    fn host(&mut self, observation: &HostObservation) {
        if let Some(engine) = &mut self.engine {
            engine.handle_host(observation);
        }
    }

    fn event(&mut self, _: Instant, event: Event, _: &mut MainDevice) {
        if let Event::Scanned(inventory) = event {
            (self.scanned, self.done) = (Some(Ok(*inventory)), true);
        } else if let Event::ScanFailed(error) = event {
            (self.scanned, self.done) = (Some(Err(error)), true);
        } else if let Event::Emergency { id, emergency } = event {
            self.emergencies.push_back((id, emergency.to_string()));
        } else if let Event::FileProgress { progress, .. } = &event {
            if let Some(told) = &mut self.file_progress {
                told(progress);
            }
        } else if let Event::Served { ticket, result, .. } = event
            && self.ticket == Some(ticket)
        {
            (self.served, self.done) = (Some(*result), true);
        }
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        if let Some(engine) = &mut self.engine {
            engine.handle_timeout(now);
        }
        match self.order.take() {
            // It looks, with nothing but reads, before it writes.
            Some(LineCommand::Scan) => main.scan(now),
            Some(LineCommand::ServeOnly(plan)) => main.serve_only(now, *plan),
            None => {}
        }
        if let Some((id, service)) = self.service.take() {
            self.ticket = Some(main.serve(now, id, service));
        }
        !self.done
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.engine.as_ref().and_then(Engine::poll_timeout)
    }
}
