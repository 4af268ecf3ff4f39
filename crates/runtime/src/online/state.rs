//! State of a line so far, shared by the threads that report to it and those that ask.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use linesman_config::plan::Plan;
use linesman_diagnosis::HostObservation;
use linesman_diagnosis::observe::HostEvent;
use linesman_maindevice::watch::{LogEntry, TopologyEntry};
use linesman_maindevice::{Event, Statistics, Watch};
use linesman_proto::time::{Instant, Span};

use super::build;
use super::report::{Card, OnlineReport};
use super::snapshot::Snapshot;
use crate::ads::AdsWatch;
use crate::ethernet::EthernetWatch;
use crate::gateway::GatewayWatch;
use crate::run::NetworkPlace;

/// So long after the last frame that a card did not take it counts as taking them again.
const FORGIVEN_AFTER: Span = Span::s(1);

/// What has happened on a line. Clones mean the same one.
#[derive(Clone, Debug, Default)]
pub struct OnlineState {
    inner: Arc<Mutex<OnlineShared>>,
}

#[derive(Debug, Default)]
struct OnlineShared {
    on: String,
    watch: Option<Watch>,
    cards: Vec<Card>,
    /// When a card took no frame the last time.
    failed_at: Option<Instant>,
    /// Where the counts of frames began when they were cleared last.
    base: Statistics,
    /// Counts of the virtual switch beside the run.
    ethernet: Option<EthernetWatch>,
    /// Counts of the mailbox gateway beside the run.
    gateway: Option<GatewayWatch>,
    /// Counts and NetId of the ADS server beside the run.
    ads: Option<AdsWatch>,
    /// Its place among the networks of the run.
    group: Option<NetworkPlace>,
}

impl OnlineState {
    /// Of the line that is called so.
    #[must_use]
    pub fn new(on: &str) -> Self {
        let inner = OnlineShared { on: on.to_owned(), ..OnlineShared::default() };
        Self { inner: Arc::new(Mutex::new(inner)) }
    }

    fn lock(&self) -> MutexGuard<'_, OnlineShared> {
        // Whoever panicked with it was counting: the counts are whole.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// This plan is run from now on.
    pub fn begin(&self, plan: Arc<Plan>) {
        let mut watch = Watch::new(plan);
        watch.begin_reset();
        self.lock().watch = Some(watch);
    }

    /// A virtual switch passes frames of SubDevices on.
    pub fn set_ethernet(&self, watch: EthernetWatch) {
        self.lock().ethernet = Some(watch);
    }

    /// It is one of several networks of a run.
    pub fn set_group(&self, place: NetworkPlace) {
        self.lock().group = Some(place);
    }

    /// A mailbox gateway is open.
    pub(crate) fn set_gateway(&self, watch: GatewayWatch) {
        self.lock().gateway = Some(watch);
    }

    /// An ADS server is open.
    pub(crate) fn set_ads(&self, watch: AdsWatch) {
        self.lock().ads = Some(watch);
    }

    /// The topology list in the vendor's form, 64 bytes for each SubDevice; `None` before a plan is run.
    #[must_use]
    pub fn topology(&self) -> Option<Vec<u8>> {
        let inner = self.lock();
        let watch = inner.watch.as_ref()?;
        let entries = watch.network_status().topology(watch.plan());
        Some(entries.iter().flat_map(TopologyEntry::to_bytes).collect())
    }

    /// Something happened; gives the entries of the log that it leads to.
    pub fn event(&self, at: Instant, event: &Event) -> Vec<LogEntry> {
        let mut inner = self.lock();
        let Some(watch) = &mut inner.watch else { return Vec::new() };
        watch.handle_event(at, event);
        entries(watch)
    }

    /// The host noticed something.
    pub fn host(&self, observation: &HostObservation) -> Vec<LogEntry> {
        let mut inner = self.lock();
        let OnlineShared { cards, watch, failed_at, .. } = &mut *inner;
        let path = observation.path;
        while cards.len() <= path.index() {
            let path = if cards.is_empty() { "A" } else { "B" };
            cards.push(Card { path: path.to_owned(), ..Card::default() });
        }
        let Some(card) = cards.get_mut(path.index()) else { return Vec::new() };
        match observation.what {
            HostEvent::Carrier(carrier) => {
                let before = card.carrier.replace(carrier);
                // That a card has a link when the run begins is no news.
                if (before.is_some() || !carrier)
                    && let Some(watch) = watch
                {
                    watch.handle_carrier(observation.time, path, carrier);
                }
            }
            HostEvent::CardErrors { crc, other } => card.rx_errors += crc + other,
            HostEvent::CardDrops(drops) | HostEvent::SocketDrops(drops) => card.rx_drops += drops,
            HostEvent::SendFailures(failures) => {
                card.tx_errors += failures;
                *failed_at = Some(observation.time);
                if let Some(watch) = watch {
                    watch.handle_send_failure(true);
                }
            }
            HostEvent::Late(_) | HostEvent::ClockStep(_) => {}
        }
        watch.as_mut().map(entries).unwrap_or_default()
    }

    /// Nothing has come for a while: what was waited with is told.
    pub fn flush(&self) -> Vec<LogEntry> {
        let mut inner = self.lock();
        let Some(watch) = &mut inner.watch else { return Vec::new() };
        watch.flush();
        entries(watch)
    }

    /// Error and change counters begin at 0 again; no register is touched.
    pub fn clear_errors(&self) {
        let mut inner = self.lock();
        inner.watch.iter_mut().for_each(Watch::clear);
        for card in &mut inner.cards {
            (card.rx_errors, card.rx_drops, card.tx_errors) = (0, 0, 0);
        }
    }

    /// Counts of frames begin at 0 again.
    pub fn clear_frames(&self, statistics: Statistics) {
        self.lock().base = statistics;
    }

    /// The line as it is. `None` before a plan is run.
    #[must_use]
    pub fn report(&self, snapshot: &Snapshot) -> Option<OnlineReport> {
        let mut inner = self.lock();
        // A card that has taken all frames for a while takes them again.
        if inner.failed_at.is_some_and(|at| snapshot.now >= at + FORGIVEN_AFTER) {
            inner.failed_at = None;
            inner.watch.iter_mut().for_each(|watch| watch.handle_send_failure(false));
        }
        let watch = inner.watch.as_ref()?;
        let mut report = build::driven(
            watch.plan(),
            watch.network_status(),
            snapshot,
            &inner.base,
            inner.ads.as_ref().map(AdsWatch::net_id),
        );
        report.on.clone_from(&inner.on);
        report.cards.clone_from(&inner.cards);
        let ethernet = inner.ethernet.as_ref().map(EthernetWatch::report);
        report.ethernet = ethernet.filter(|one| !one.is_idle());
        let group = inner.group.as_ref();
        report.group = group.map(|it| it.time(snapshot.leads_group, snapshot.ahead_of_group));
        report.gateway = inner.gateway.as_ref().map(GatewayWatch::report);
        report.ads = inner.ads.as_ref().map(AdsWatch::report);
        Some(report)
    }

    /// For each SubDevice its number and the sum of its errors; `None` before a plan is run.
    #[must_use]
    pub fn error_sums(&self) -> Option<Vec<u64>> {
        let inner = self.lock();
        Some(inner.watch.as_ref()?.network_status().error_sums().collect())
    }
}

fn entries(watch: &mut Watch) -> Vec<LogEntry> {
    std::iter::from_fn(|| watch.poll_entry()).collect()
}
