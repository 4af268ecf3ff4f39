//! Service client of a line on real cards: listen first, scan, then serve.

use std::collections::VecDeque;

use linesman_config::inventory::Inventory;
use linesman_diagnosis::{Diagnosis, Engine, FrameSeen, HostObservation, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::drive::Driver;
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::Cards;
use linesman_session::SessionHooks;

use super::{ServiceClient, ServiceRefused};
use crate::command::line_access;
use crate::failure::Failure;

/// A scan of a thousand SubDevices takes a few seconds.
const SCAN_PATIENCE: Span = Span::s(60);
/// Every step of a service has a limit of its own; a large file takes many of them.
const SERVICE_PATIENCE: Span = Span::s(24 * 3_600);

/// A line on cards.
pub(super) struct CardClient {
    driver: Driver<Cards, PendingCommand>,
    stop: Stop,
    name: String,
}

/// Opens and scans the line.
pub(super) fn open(names: &[String]) -> Result<(CardClient, Inventory), Failure> {
    line_access::refuse(names)?;
    let stop = line_access::stop()?;
    let clock = HostClock::start();
    let setup = Setup {
        input: InputKind::ReadOut,
        host_counters: true,
        start: clock.started_at().rfc3339(),
        clock: "host, monotonic".to_owned(),
        ..Setup::default()
    };
    let driver = Driver::open(names, clock, PendingCommand::new(Engine::new(setup)))?;
    let mut cards = CardClient { driver, stop, name: names.join("+") };
    cards.pending().order = Some(ClientOrder::Scan);
    cards.run(SCAN_PATIENCE)?;
    let inventory = match cards.pending().scanned.take() {
        Some(Ok(inventory)) => inventory,
        Some(Err(failure)) => {
            let reason = format!("{}: {}", cards.name, failure.reason);
            return Err(Failure { reason, ..failure });
        }
        None => return Err(cards.interrupted()),
    };
    cards.pending().order = Some(ClientOrder::Attend(Box::new(super::plan(&inventory))));
    Ok((cards, inventory))
}

impl CardClient {
    fn pending(&mut self) -> &mut PendingCommand {
        self.driver.session_mut().hooks_mut()
    }

    fn run(&mut self, patience: Span) -> Result<(), Failure> {
        let until = self.driver.clock().now() + patience;
        self.pending().done = false;
        self.driver.run(until, &self.stop)?;
        Ok(())
    }

    fn interrupted(&self) -> Failure {
        let reason = format!("{}: the command was ended before it was done", self.name);
        Failure::new(reason, "look at the SubDevice's state, then repeat the command")
    }
}

impl ServiceClient for CardClient {
    fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Result<ServiceAnswer, ServiceRefused>, Failure> {
        self.pending().service = Some((id, service));
        self.run(SERVICE_PATIENCE)?;
        let served = self.pending().served.take().ok_or_else(|| self.interrupted())?;
        Ok(served.map_err(|failure| ServiceRefused::from(&failure)))
    }

    fn wait(&mut self, span: Span) -> Result<bool, Failure> {
        self.run(span)?;
        Ok(!self.stop.is_set())
    }

    fn diagnosis(&mut self) -> Option<Diagnosis> {
        let now = self.driver.clock().now();
        let engine = &mut self.pending().engine;
        engine.finish(now, true);
        Some(engine.diagnosis())
    }

    fn take_emergencies(&mut self) -> Vec<(DeviceId, String)> {
        self.pending().emergencies.drain(..).collect()
    }
}

enum ClientOrder {
    Scan,
    Attend(Box<linesman_config::plan::Plan>),
}

/// Gives one command at a time and waits for its end.
struct PendingCommand {
    /// Judges all frames.
    engine: Engine,
    order: Option<ClientOrder>,
    service: Option<(DeviceId, Service)>,
    ticket: Option<ServiceTicket>,
    done: bool,
    scanned: Option<Result<Inventory, Failure>>,
    served: Option<Result<ServiceAnswer, ServiceFailure>>,
    emergencies: VecDeque<(DeviceId, String)>,
}

impl PendingCommand {
    fn new(engine: Engine) -> Self {
        Self {
            engine,
            order: None,
            service: None,
            ticket: None,
            done: false,
            scanned: None,
            served: None,
            emergencies: VecDeque::new(),
        }
    }
}

impl SessionHooks for PendingCommand {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.engine.handle_frame(frame);
    }

    fn host(&mut self, observation: &HostObservation) {
        self.engine.handle_host(observation);
    }

    fn event(&mut self, _: Instant, event: Event, _: &mut MainDevice) {
        if let Event::Scanned(inventory) = event {
            (self.scanned, self.done) = (Some(Ok(*inventory)), true);
        } else if let Event::ScanFailed(error) = event {
            (self.scanned, self.done) = (Some(Err(line_access::nobody(&error))), true);
        } else if let Event::Emergency { id, emergency } = event {
            self.emergencies.push_back((id, emergency.to_string()));
        } else if let Event::Served { ticket, result, .. } = event
            && self.ticket == Some(ticket)
        {
            (self.served, self.done) = (Some(*result), true);
        }
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        self.engine.handle_timeout(now);
        match self.order.take() {
            // It looks, with nothing but reads, before it writes.
            Some(ClientOrder::Scan) => main.scan(now),
            Some(ClientOrder::Attend(plan)) => main.attend(now, *plan),
            None => {}
        }
        if let Some((id, service)) = self.service.take() {
            self.ticket = Some(main.serve(now, id, service));
        }
        !self.done
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.engine.poll_timeout()
    }
}
