//! Service client of a line on real cards: listen first, scan, then serve.

use std::sync::{Arc, Mutex, PoisonError};

use linesman_config::inventory::Inventory;
use linesman_diagnosis::{Diagnosis, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use linesman_runtime::service_session::{ServiceSession, service_plan};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::Cards;

use super::{ServiceClient, ServiceRefused};
use crate::command::line_access;
use crate::failure::Failure;
use crate::output::Progress;

/// A scan of a thousand SubDevices takes a few seconds.
const SCAN_PATIENCE: Span = Span::s(60);
/// Every step of a service has a limit of its own; a large file takes many of them.
const SERVICE_PATIENCE: Span = Span::s(24 * 3_600);

/// A line on cards.
pub(super) struct CardClient {
    session: ServiceSession<Cards>,
    stop: Stop,
    name: String,
    progress: Arc<Mutex<Progress>>,
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
    let session = ServiceSession::new(Cards::open(names, clock)?, Some(setup));
    let progress = Arc::new(Mutex::new(Progress::new()));
    let mut cards =
        CardClient { session, stop, name: names.join("+"), progress: Arc::clone(&progress) };
    cards.session.on_file_progress(move |file| {
        let mut progress = progress.lock().unwrap_or_else(PoisonError::into_inner);
        progress.show(|| file.to_string());
    });
    let inventory = match cards.session.scan(SCAN_PATIENCE, &cards.stop)? {
        Some(Ok(inventory)) => inventory,
        Some(Err(error)) => {
            let failure = line_access::nobody(&error);
            let reason = format!("{}: {}", cards.name, failure.reason);
            return Err(Failure { reason, ..failure });
        }
        None => return Err(cards.interrupted()),
    };
    cards.session.serve_only(service_plan(&inventory));
    Ok((cards, inventory))
}

impl CardClient {
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
        let served = self.session.ask(id, service, SERVICE_PATIENCE, &self.stop);
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).clear();
        let served = served?;
        let served = served.ok_or_else(|| self.interrupted())?;
        Ok(served.map_err(|failure| ServiceRefused::from(&failure)))
    }

    fn wait(&mut self, span: Span) -> Result<bool, Failure> {
        self.session.wait(span, &self.stop)?;
        Ok(!self.stop.is_set())
    }

    fn diagnosis(&mut self) -> Option<Diagnosis> {
        self.session.diagnosis()
    }

    fn take_emergencies(&mut self) -> Vec<(DeviceId, String)> {
        self.session.take_emergencies()
    }
}
