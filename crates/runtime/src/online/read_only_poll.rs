//! Polling of a line that nobody drives, with nothing but reads.

use linesman_config::plan::{DevicePlan, Plan};
use linesman_diagnosis::{FrameSeen, HostObservation};
use linesman_maindevice::procedure::{DeviceReading, ReadOnlyScan};
use linesman_maindevice::watch::NetworkStatus;
use linesman_maindevice::{Event, MainDevice, Statistics};
use linesman_proto::address::{DeviceId, Path, StationAddress, WorkingCounter};
use linesman_proto::port::Port;
use linesman_proto::register::AlStatus;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{Reconstruction, SeenController};
use linesman_session::SessionHooks;

use super::build;
use super::report::OnlineReport;

/// Between two looks. Each is a few frames long, so that damage has something to hit.
const LOOK_EVERY: Span = Span::ms(20);

/// Somebody who looks. The [`SessionHooks`] of a [`Driver`](crate::drive::Driver).
pub struct ReadOnlyPoller {
    on: String,
    names: Vec<String>,
    next: Option<Instant>,
    known: Option<(Plan, NetworkStatus)>,
    failure: Option<String>,
    /// What the MainDevice has counted so far.
    statistics: Statistics,
    /// When counting began.
    base: Statistics,
    rates: super::Rates,
    /// It has seen enough when it has looked once.
    once: bool,
}

impl ReadOnlyPoller {
    /// Looks at the line that is called `on`, at SubDevices with these names in their order; those that
    /// have none are called by their numbers.
    #[must_use]
    pub fn new(on: &str, names: Vec<String>) -> Self {
        Self {
            on: on.to_owned(),
            names,
            next: Some(Instant::ZERO),
            known: None,
            failure: None,
            statistics: Statistics::default(),
            base: Statistics::default(),
            rates: super::Rates::default(),
            once: false,
        }
    }

    /// Looks only once.
    #[must_use]
    pub fn once(self) -> Self {
        Self { once: true, ..self }
    }

    /// The line as it was seen last; `None` before it was.
    #[must_use]
    pub fn report(&self, now: Instant) -> Option<OnlineReport> {
        let (plan, network_status) = self.known.as_ref()?;
        let mut report = build::known(plan, network_status, now);
        report.on.clone_from(&self.on);
        let queued = self.rates.last().map(|[_, queued]| queued);
        report.queued = build::queued_frames(&self.statistics, &self.base, queued);
        report.odd = build::odd(&self.statistics, &self.base);
        Some(report)
    }

    /// Why the last look came to nothing; `None` when it did not.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// All counters begin at 0 again; no register is touched.
    pub fn clear(&mut self) {
        self.base = self.statistics;
        if let Some((_, network_status)) = &mut self.known {
            network_status.clear();
        }
    }

    fn looked(&mut self, look: &ReadOnlyScan) {
        let at = look.at;
        let (plan, network_status) = self.known.get_or_insert_with(|| {
            let plan = seen(look, &self.names);
            let network_status = NetworkStatus::new(&plan);
            (plan, network_status)
        });
        let count = WorkingCounter(look.devices.len() as u16);
        if let Some(before) = network_status.responding().or(Some(count)) {
            network_status.handle_event(at, &Event::Responding { before, now: count });
        }
        let mut seen = vec![false; plan.devices.len()];
        for (place, device) in look.devices.iter().enumerate() {
            let Some(id) = who(plan, place, device) else { continue };
            if let Some(seen) = seen.get_mut(id.index()) {
                *seen = true;
            }
            tell(network_status, at, id, device);
        }
        for (id, seen) in (0..).map(DeviceId).zip(seen) {
            let there =
                network_status.device(id).is_some_and(|known| known.is_present() != Some(false));
            if !seen && there {
                network_status.handle_event(at, &Event::DeviceLost { id });
            }
        }
    }

    /// Nobody answers.
    fn silent(&mut self, at: Instant) {
        let nobody = ReadOnlyScan {
            network: linesman_proto::address::Network::default(),
            at,
            states: AlState::from_or(0),
            devices: Vec::new(),
        };
        if self.known.is_some() {
            self.looked(&nobody);
        }
    }
}

/// Whom a look has met: by station address where it has one of the first look, else by its place.
fn who(plan: &Plan, place: usize, device: &DeviceReading) -> Option<DeviceId> {
    let station = device.station.filter(|station| station.0 != 0);
    let by_station = |station: StationAddress| {
        let mut same = plan.devices.iter().filter(|device| device.station == station);
        same.next().filter(|_| same.next().is_none()).map(|device| device.id)
    };
    if let Some(found) = station.and_then(by_station) {
        return Some(found);
    }
    // Without addresses those behind a gap cannot be told from those within it: the last are missing.
    plan.devices.get(place).map(|device| device.id)
}

fn tell(network_status: &mut NetworkStatus, at: Instant, id: DeviceId, device: &DeviceReading) {
    if network_status.device(id).is_some_and(|known| known.is_present() == Some(false)) {
        network_status.handle_event(at, &Event::DeviceBack { id, restarted: false });
    }
    if let Some(status) = device.al_status {
        let code =
            if status.error() { device.al_code.unwrap_or_default() } else { AlStatusCode(0) };
        fell(network_status, at, id, status, code);
        network_status.handle_event(at, &Event::DeviceState { id, status, code });
    }
    if let Some(status) = device.dl_status {
        network_status.handle_event(at, &Event::Links { id, status });
    }
    if let Some(counters) = device.counters {
        network_status.handle_event(at, &Event::Counters { id, counters });
    }
}

/// A state that is left with an error while nobody drives the line is left by itself.
fn fell(
    network_status: &mut NetworkStatus,
    at: Instant,
    id: DeviceId,
    status: AlStatus,
    code: AlStatusCode,
) {
    let before = network_status.device(id).and_then(|known| known.al_status());
    let Some(before) = before.filter(|before| status.error() && before.state() != status.state())
    else {
        return;
    };
    if let Some(from) = before.state().state() {
        network_status.handle_event(at, &Event::AbnormalState { id, from, status, code });
    }
}

/// What was seen first, as a plan that nobody runs.
fn seen(look: &ReadOnlyScan, names: &[String]) -> Plan {
    let controllers: Vec<SeenController> = (look.devices.iter())
        .map(|device| {
            let open = |port: &Port| {
                device.dl_status.is_some_and(|status| status.port_state(*port).communication)
            };
            let ports: Vec<Port> = Port::ALL.into_iter().filter(open).collect();
            SeenController::open_at(&ports)
        })
        .collect();
    let mut plan = Plan::empty(Reconstruction::of(Path::A, &controllers).tree);
    for (place, device) in look.devices.iter().enumerate() {
        let id = DeviceId(place as u32);
        let mut planned = DevicePlan::bare(id);
        planned.station = device.station.unwrap_or(StationAddress(0));
        if let Some(name) = names.get(place) {
            planned.name.clone_from(name);
        }
        plan.devices.push(planned);
    }
    plan
}

impl SessionHooks for ReadOnlyPoller {
    fn frame(&mut self, _: &FrameSeen<'_>) {}

    fn host(&mut self, _: &HostObservation) {}

    fn event(&mut self, now: Instant, event: Event, _: &mut MainDevice) {
        if let Event::ReadOnlyScanned(look) = event {
            self.failure = None;
            self.looked(&look);
        } else if let Event::ReadOnlyScanFailed(error) = event {
            self.failure = Some(error.to_string());
            self.silent(now);
        } else {
            return;
        }
        self.next = Some(now + LOOK_EVERY);
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        self.statistics = main.statistics();
        let counts = self.statistics;
        self.rates.turn(now, || counts);
        if self.once && (self.known.is_some() || self.failure.is_some()) {
            return false;
        }
        if self.next.is_some_and(|next| next <= now) {
            self.next = None;
            main.read_only_scan(now);
        }
        true
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.next
    }
}
