//! Diagnosis engine: takes frames and host observations, and returns findings.

mod background_poll;
mod bisect;
mod fast_poll;
mod hot_connect;
mod intake;
mod known;
mod network_watch;
mod setup;

use std::collections::VecDeque;

use linesman_proto::address::{DeviceId, Network, RegisterAddress};
use linesman_proto::time::{Instant, Span};

use crate::ask::AskingReport;
use crate::coverage::{Coverage, InputKind};
use crate::finding::{Finding, FindingStore, Severity};
use crate::model::{NetworkModel, search};
use crate::observe::{Exchange, Fingerprint, FrameSeen, HostEvent, HostObservation, Pairing};
use crate::report::{
    self, Diagnosis, FindingReport, MainDeviceReport, NetworkReport, Number, Verdict,
};
use crate::rule::{RULES, View};

use network_watch::NetworkWatch;
pub use setup::{Asked, Event, EventKind, Probe, ProbeEffect, Setup};

/// The rules are asked at most this often; what they find keeps the time of its evidence.
const JUDGE_EVERY: Span = Span::ms(10);

/// But they are asked this soon where something has just gone wrong and nothing is said yet: what a frame
/// shows is told when it is back, not some cycles later.
const JUDGE_ALARM_AFTER: Span = Span::us(50);

/// Rules are asked again after so long although nothing new was learnt, while something is open: a
/// counter that did *not* rise since tells as much as one that did.
const JUDGE_AGAIN: Span = Span::ms(100);

/// The diagnosis of any number of networks.
#[derive(Clone, Debug)]
pub struct Engine {
    setup: Setup,
    networks: Vec<NetworkWatch>,
    book: FindingStore,
    events: VecDeque<Event>,
    probes: VecDeque<Probe>,
    now: Instant,
    next_judgement: Instant,
    has_ended: bool,
    is_complete: bool,
    asking: Option<AskingReport>,
}

impl Engine {
    /// Most events and probes kept for somebody who does not fetch them.
    const MOST_WAITING: usize = 1024;
    /// Between two rounds of probes.
    const PROBE_EVERY: Span = Span::ms(200);

    /// An engine that has seen nothing.
    #[must_use]
    pub fn new(setup: Setup) -> Self {
        let mut model = match &setup.project {
            Some(project) => NetworkModel::planned(Network(0), project),
            None => NetworkModel::new(Network(0)),
        };
        model.expect_exchange(&setup.exchange);
        model.host.is_watched = setup.host_counters;
        model.sees_all_orders = setup.input == InputKind::Driven;
        model.reported.exchanges.clone_from(&setup.exchanges);
        let mut watched = NetworkWatch::new(model);
        watched.capture_probe.tell_places(&setup.tap_places);
        Self {
            setup,
            networks: vec![watched],
            book: FindingStore::default(),
            events: VecDeque::new(),
            probes: VecDeque::new(),
            now: Instant::default(),
            next_judgement: Instant::default(),
            has_ended: false,
            is_complete: true,
            asking: None,
        }
    }

    /// An engine for a line that was filled in by other means, such as an observation file.
    #[must_use]
    pub fn with_line(setup: Setup, mut model: NetworkModel) -> Self {
        model.reported.exchanges.extend_from_slice(&setup.exchanges);
        let now = model.now;
        let mut engine = Self { networks: vec![NetworkWatch::new(model)], now, ..Self::new(setup) };
        engine.judge();
        engine
    }

    /// Takes a frame.
    pub fn handle_frame(&mut self, frame: &FrameSeen<'_>) {
        self.handle_frame_with(frame, None, &mut |_, _| {});
    }

    /// Takes a frame, with its fingerprint where another thread has worked it out, and shows each exchange that it
    /// completes or settles to `observe`, with what is known of the network then. Questions of this program are not shown.
    pub fn handle_frame_with(
        &mut self,
        frame: &FrameSeen<'_>,
        print: Option<&Fingerprint>,
        observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
    ) {
        self.now = self.now.max(frame.time);
        let now = self.now;
        let watched = self.watched(frame.network);
        intake::take_copy(watched, frame, print, now, observe);
        self.background_poll();
        self.judge_if_due();
    }

    /// Takes an observation of the host.
    pub fn handle_host(&mut self, observation: &HostObservation) {
        self.now = self.now.max(observation.time);
        let now = self.now;
        let model = &mut self.watched(observation.network).model;
        if let HostEvent::CardErrors { crc: 1.., .. } = observation.what {
            model.note_errors(observation.time, observation.time);
        }
        model.host.record(observation);
        model.now = now;
        model.touch();
        self.judge_if_due();
    }

    /// So many frames passed up to `at` and were not shown to the engine, because whoever judges did not keep up.
    ///
    /// Requests that are still out are given up, since their returns may be among them: nothing says that the line
    /// lost them.
    pub fn handle_missed(&mut self, network: Network, count: u64, at: Instant) {
        if count == 0 {
            return;
        }
        self.now = self.now.max(at);
        let NetworkWatch { model, pairing, questions, .. } = self.watched(network);
        pairing.forget();
        questions.forget();
        model.traffic.recording.record_missed(count);
        // The time to the next one says nothing.
        for cyclic in &mut model.cyclic {
            cyclic.sent.skip();
            cyclic.returned.skip();
        }
        model.touch();
    }

    /// The counters of the host's cards are about this line from now on, so that their silence means zero: the host was
    /// seen to send on it.
    pub fn watch_host(&mut self) {
        self.setup.host_counters = true;
        for watched in &mut self.networks {
            watched.model.host.is_watched = true;
            watched.model.touch();
        }
    }

    /// How it stands with questions beside another MainDevice.
    pub fn note_asking(&mut self, asking: AskingReport) {
        self.asking = Some(asking);
    }

    /// Time passes. Only for live input: the time of captures comes with their frames.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.now = self.now.max(now);
        for watched in &mut self.networks {
            watched.model.now = watched.model.now.max(now);
            watched.expire(now, false, &mut |_, _| {});
        }
        self.background_poll();
        self.judge_if_due();
    }

    /// When [`Engine::handle_timeout`] has something to do.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let pairings = self.networks.iter().flat_map(|one| [&one.pairing, &one.questions]);
        let lost = pairings.filter_map(Pairing::timeout).min();
        let again = self.networks.iter().filter_map(|watched| watched.again).min();
        let news = self.has_news().then_some(self.next_judgement);
        let judgement = match (news, again) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        let surveys = self
            .networks
            .iter()
            .flat_map(|watched| [watched.background_poll.next(), watched.close.next()]);
        let background_poll =
            surveys.flatten().min().filter(|_| self.setup.probes && !self.has_ended);
        [lost, judgement, background_poll].into_iter().flatten().min()
    }

    /// What happened to findings, in order.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// What the engine would like to have read.
    pub fn poll_probe(&mut self) -> Option<Probe> {
        self.probes.pop_front()
    }

    /// The input ends at `at`. `complete` is whether all of it could be read.
    pub fn finish(&mut self, at: Instant, complete: bool) {
        self.finish_with(at, complete, &mut |_, _| {});
    }

    /// Ends the input as [`finish`](Self::finish), and shows each exchange that is settled by it to `observe`.
    pub fn finish_with(
        &mut self,
        at: Instant,
        complete: bool,
        observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
    ) {
        self.now = self.now.max(at);
        self.has_ended = true;
        self.is_complete &= complete;
        for watched in &mut self.networks {
            intake::finish_copies(watched, at, observe);
            watched.expire(at, true, observe);
            watched.model.touch();
        }
        self.judge();
    }

    /// The whole answer so far.
    #[must_use]
    pub fn diagnosis(&self) -> Diagnosis {
        let roots = self.book.roots();
        let coverage = self.coverage();
        let mut findings: Vec<FindingReport> =
            roots.into_iter().map(|finding| report::build::finding(&self.book, finding)).collect();
        if let Some(model) = self.model(Network(0)) {
            report::reading::advise(&mut findings, model, self.setup.input);
        }
        Diagnosis {
            schema: report::SCHEMA.to_owned(),
            tool: concat!("linesman ", env!("CARGO_PKG_VERSION")).to_owned(),
            start: self.setup.start.clone(),
            clock: self.setup.clock.clone(),
            source: self.setup.source.clone(),
            complete: self.is_complete,
            verdict: self.verdict(&coverage),
            network: self.network_report(),
            main_device: self.main_device(),
            devices: report::device::reports(self.model(Network(0))),
            asking: self.asking.clone(),
            coverage: report::coverage::report(&coverage),
            understood: None,
            second_look: None,
            findings,
        }
    }

    /// The findings so far.
    #[must_use]
    pub const fn book(&self) -> &FindingStore {
        &self.book
    }

    fn watched(&mut self, network: Network) -> &mut NetworkWatch {
        let known = self.networks.iter().position(|watched| watched.model.network == network);
        let index = known.unwrap_or_else(|| {
            let mut model = NetworkModel::new(network);
            model.host.is_watched = self.setup.host_counters;
            model.sees_all_orders = self.setup.input == InputKind::Driven;
            self.networks.push(NetworkWatch::new(model));
            self.networks.len() - 1
        });
        &mut self.networks[index]
    }

    fn has_news(&self) -> bool {
        self.networks.iter().any(|watched| watched.model.revision() != watched.judged)
    }

    fn judge_if_due(&mut self) {
        let now = self.now;
        let is_due = self.networks.iter().any(|watched| watched.is_due(now));
        if is_due && (now >= self.next_judgement || self.is_alarmed()) {
            self.judge();
        }
    }

    /// Whether something has gone wrong since the rules were last asked, and nothing is said of anything.
    fn is_alarmed(&self) -> bool {
        let is_new = |watched: &NetworkWatch| watched.alarms() != watched.judged_alarms;
        let is_early = self.now + JUDGE_EVERY < self.next_judgement + JUDGE_ALARM_AFTER;
        !is_early && !self.book.has_open() && self.networks.iter().any(is_new)
    }

    fn judge(&mut self) {
        self.next_judgement = self.now + JUDGE_EVERY;
        let (now, has_ended) = (self.now, self.has_ended);
        let is_active = self.setup.probes && self.setup.active;
        for watched in &mut self.networks {
            if !watched.is_due(now) {
                continue;
            }
            if self.book.names_devices() {
                watched.learner.name();
            }
            watched.learner.settle(&mut watched.model);
            if watched.learner.is_settled() {
                watched.model.derive_tree();
            }
            if !is_active {
                // Somebody else may have searched.
                let seen = search::seen(&watched.model);
                watched.model.hole = seen.as_ref().map(|(hole, _)| *hole);
                watched.model.hole_left = seen.map_or_else(Vec::new, |(_, left)| left);
            }
            watched.judged = watched.model.revision();
            watched.judged_alarms = watched.alarms();
            watched.conditions.clear();
            let view = View { model: &watched.model, now, has_ended };
            for rule in RULES {
                (rule.judge)(&view, &mut watched.conditions);
            }
            hot_connect::excuse(&watched.model, &mut watched.conditions);
            let is_curious = is_active && (watched.bisect.is_some() || watched.lacks_controls());
            let is_watched = (watched.is_watched(now) || is_curious) && !has_ended;
            // A search waits for a moment after each step, whatever comes back.
            let again = if watched.bisect.is_some() { JUDGE_EVERY } else { JUDGE_AGAIN };
            watched.again = is_watched.then_some(now + again);
        }
        let all = self.networks.iter().flat_map(|watched| watched.conditions.iter().cloned());
        let room = Self::MOST_WAITING.saturating_sub(self.events.len());
        let mut news = Vec::new();
        self.book.update(all.collect(), now, |kind, finding: &Finding| {
            if news.len() < room {
                news.push((finding.id, kind, report::build::alone(finding)));
            }
        });
        // What follows from what is known when all is known.
        for (id, kind, finding) in news {
            let follows_from = self.book.cause_of(id).map(report::build::name);
            self.events.push_back(Event { at: now, kind, finding, follows_from });
        }
        self.ask();
    }

    /// Asks for what would tell more, where something has just gone wrong.
    fn ask(&mut self) {
        if !self.setup.probes || self.has_ended {
            return;
        }
        let now = self.now;
        if self.setup.active {
            for watched in &mut self.networks {
                self.probes.extend(watched.search(now));
            }
        }
        for watched in &mut self.networks {
            let alarms = watched.alarms();
            let is_due = watched.probed.is_none_or(|at| now.since(at) >= Self::PROBE_EVERY);
            if alarms == watched.probed_for || !is_due || watched.is_silent() {
                continue;
            }
            watched.probed_for = alarms;
            watched.probed = Some(now);
            for device in watched.model.devices.iter().filter(|device| device.answered.is_some()) {
                for (address, len) in ASKED {
                    let what = Asked::Register { address: RegisterAddress(address), len };
                    push(&mut self.probes, &watched.model, device.id, what, now);
                }
            }
        }
        for watched in &mut self.networks {
            for (device, object) in watched.background_poll.objects(&watched.model) {
                push(&mut self.probes, &watched.model, device, Asked::Object(object), now);
            }
        }
    }

    /// Asks by turns for what shows trouble early and nobody reads.
    fn background_poll(&mut self) {
        if !self.setup.probes || self.has_ended {
            return;
        }
        let now = self.now;
        for watched in &mut self.networks {
            let is_searching = watched.bisect.is_some();
            let closely = watched.close.turn(&watched.model, now);
            for (device, (address, len)) in
                watched.background_poll.turn(&watched.model, now).into_iter().chain(closely)
            {
                // While nothing comes back, questions only stand in the way of a search.
                if is_searching {
                    continue;
                }
                let what = Asked::Register { address: RegisterAddress(address), len };
                push(&mut self.probes, &watched.model, device, what, now);
            }
        }
    }

    /// What could be judged of all networks, so far.
    #[must_use]
    pub fn coverage(&self) -> Coverage {
        let mut coverage = Coverage::default();
        for watched in &self.networks {
            coverage.merge(Coverage::of(&watched.model, self.setup.input));
        }
        if let Some(asking) = &self.asking {
            coverage.note_asking(asking);
        }
        coverage
    }

    fn verdict(&self, coverage: &Coverage) -> Verdict {
        if self.book.worst().is_some_and(|worst| worst >= Severity::Warning) {
            Verdict::Faulty
        } else if coverage.suffices() {
            Verdict::Healthy
        } else {
            Verdict::Inconclusive
        }
    }

    /// The MainDevice, where it is another program.
    fn main_device(&self) -> Option<MainDeviceReport> {
        let is_other = matches!(self.setup.input, InputKind::Listened | InputKind::Recorded);
        self.model(Network(0)).filter(|_| is_other).and_then(report::main_device::report)
    }

    fn network_report(&self) -> NetworkReport {
        let lines = || self.networks.iter().map(|watched| &watched.model);
        let sum = |count: fn(&NetworkModel) -> u64| Number(lines().map(count).sum());
        let highest = lines().map(NetworkModel::highest_state).max().flatten();
        NetworkReport {
            devices: sum(|model| model.device_count() as u64),
            al_state_highest: highest.map(|state| state.name().to_owned()),
            datagrams: sum(|model| model.traffic.datagrams.judged()),
            unanswered: sum(|model| model.traffic.datagrams.unanswered()),
            frames: sum(|model| model.traffic.recording.frames()),
            lost: sum(|model| model.traffic.losses.frames().sum),
            damaged: sum(|model| model.traffic.losses.damaged().sum),
        }
    }
}

fn push(
    probes: &mut VecDeque<Probe>,
    model: &NetworkModel,
    device: DeviceId,
    what: Asked,
    now: Instant,
) {
    // Who has no address cannot be asked for sure.
    let Some(station) = model.device(device).and_then(|device| device.station) else { return };
    if probes.len() < Engine::MOST_WAITING {
        let (network, deadline) = (model.network, now + Engine::PROBE_EVERY);
        let effect = ProbeEffect::Reads;
        probes.push_back(Probe { network, device, station, what, deadline, effect });
    }
}

/// DL status, AL status with its code, all error counters.
const ASKED: [(u16, u16); 3] = [(0x0110, 2), (0x0130, 6), fast_poll::COUNTERS];
