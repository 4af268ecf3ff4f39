//! Bringing every SubDevice to its target, and keeping it there.
//!
//! [`locate`] finds the SubDevices of the plan on the line and gives them their addresses; one
//! [`device_supervisor`] per SubDevice drives it to its target, watches it, and drives it again when it fell
//! out; [`supervise`] starts them and looks for those that are lost. [`mod@device_table`] is what they know,
//! [`rounds`] finds out for all of them at once where they do not read by themselves.

mod alert_sleep;
mod align;
mod by_alias;
mod by_wiring;
mod clocks;
pub(crate) mod counters;
mod delays;
pub(crate) mod device_supervisor;
pub(crate) mod device_table;
mod group_table;
mod hot_connect;
mod locate;
pub(crate) mod loop_control;
mod modules;
mod numbers;
mod open_ring;
mod rounds;
mod shortest_cycle;
mod start_up;
mod state_change;
pub(crate) mod times;
mod watched_clock;

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex};

use linesman_config::plan::{AddressingChoice, DevicePlan, HotConnectGroup, Plan, TimeSource};
use linesman_proto::address::{DeviceId, Network, WorkingCounter};
use linesman_proto::register;
use linesman_proto::time::{DcTime, Instant, Span};

use crate::event::Event;
use crate::exchange::Target;
use crate::executor::{Wire, lock};
use crate::network_group::NetworkGroup;
use crate::options::{Options, Polling};
use crate::procedure::read_only_scan::AL_LEN;
use crate::procedure::scan::ScanCache;

pub(crate) use alert_sleep::AlertSleep;
pub(crate) use device_table::{DeviceTable, Reachability, ReferenceClock};
pub use group_table::GroupPlace;
pub use start_up::StartUpError;
pub use times::{BringUpTimes, DeviceTimes, Phase};

/// State that the SubDevice supervisors share.
#[derive(Clone)]
pub(crate) struct Context {
    pub(crate) wire: Wire,
    pub(crate) network: Network,
    pub(crate) plan: Arc<Plan>,
    pub(crate) device_table: Arc<Mutex<DeviceTable>>,
    pub(crate) options: Arc<Options>,
    pub(crate) mailboxes: crate::mailbox::MailboxQueues,
    /// Rounds in which not all was as wanted: after each all supervisors look.
    pub(crate) bad_rounds: Arc<AtomicU64>,
    /// The networks of the process that this one follows.
    pub(crate) follows: Option<NetworkGroup>,
}

impl Context {
    /// The system time when the run began, so that clocks that are set show that of the network that leads, if one does.
    pub(crate) fn epoch(&self) -> DcTime {
        let told = self.follows.as_ref().and_then(NetworkGroup::told);
        let at = self.wire.now();
        let of_lead = told.map(|told| DcTime(told.time_at(at).0.wrapping_sub(at.as_nanos())));
        of_lead.unwrap_or(self.options.clock_epoch)
    }

    /// True if the reference clock is led to this computer's time, or to that of another network, from the start.
    pub(crate) fn is_led_at_once(&self) -> bool {
        self.follows.is_some() || self.plan.time_source == Some(TimeSource::Host)
    }

    /// Sleeps until the next alert after `seen`, at most `span`.
    pub(crate) fn sleep_until_alert(&self, seen: u64, span: Span) -> AlertSleep {
        AlertSleep {
            device_table: Arc::clone(&self.device_table),
            seen,
            sleep: self.wire.sleep(span),
            place: None,
        }
    }

    /// Notes how long a phase of the whole network took that began then.
    pub(crate) fn note(&self, phase: Phase, began: Instant) {
        lock(&self.device_table).note_network_time(phase, self.wire.now().since(began));
    }

    pub(crate) fn alerts(&self) -> u64 {
        lock(&self.device_table).alerts()
    }

    /// Waits until lost SubDevices are to be looked for.
    async fn until_search(&self, seen: u64) {
        match self.options.polling {
            Polling::EachDevice => self.sleep_until_alert(seen, SEARCH_INTERVAL).await,
            Polling::Rounds(_) | Polling::Nothing => {
                self.wire.sleep(self.options.watch_interval).await;
            }
        }
    }

    /// Whether all that is left to do is to exchange process data.
    fn is_left_alone(&self) -> bool {
        self.options.polling == Polling::Nothing
            && self.plan.groups.is_empty()
            && lock(&self.device_table).all_have_been_reached()
    }
}

/// How often lost SubDevices are looked for.
const SEARCH_INTERVAL: Span = Span::ms(100);
/// How often they are looked for by position, which takes more reads, when nothing has changed.
const THOROUGH_INTERVAL: Span = Span::s(2);
/// Alerts are acted upon no more often than this.
pub(crate) const CALM: Span = Span::ms(5);

/// Runs a network according to its plan; does not end as long as anybody is to be looked for. Who a scan has just
/// identified need not be asked again.
pub(crate) async fn supervise(context: Context, scan_cache: Option<ScanCache>) {
    lock(&context.device_table).begin_times(context.wire.now());
    context.wire.forget_places();
    while locate::from_scratch(&context, scan_cache.as_ref()).await.is_err() {
        // The whole line is silent.
        for device in &context.plan.devices {
            lose(&context, device.id);
        }
        context.wire.sleep(SEARCH_INTERVAL).await;
    }
    if clocks::wanted(&context.plan) {
        let setting = context.clone();
        context.wire.spawn(async move { clocks::set_all(&setting).await });
        if context.plan.tree.closes_at().is_some() {
            context.wire.spawn(open_ring::keep_in_step(context.clone()));
        }
        context.wire.spawn(delays::keep_measured(context.clone()));
    } else {
        lock(&context.device_table).set_clocks_ready();
    }
    for device in &context.plan.devices {
        // Who is not there yet has its supervisor, too: it waits.
        context.wire.spawn(device_supervisor::supervise_device(context.clone(), device.id));
        if device.mailbox.is_some() {
            context.wire.spawn(crate::mailbox::serve_mailbox(context.clone(), device.id));
        }
    }
    if let Polling::Rounds(rounds) = context.options.polling {
        context.wire.spawn(rounds::make(context.clone(), rounds));
    }
    let mut thorough_at = context.wire.now() + THOROUGH_INTERVAL;
    let (mut located_at, mut placed_at, mut losses) = (None, None, 0);
    // Somebody came where groups may be plugged in, and all that are planned are there: it may be a copy of one.
    let mut are_newcomers = false;
    while !context.is_left_alone() {
        let seen = context.alerts();
        context.until_search(seen).await;
        if context.alerts() == seen && is_calm(&context, placed_at) {
            continue;
        }
        context.wire.sleep(CALM).await;
        let responding = lock(&context.device_table).responding();
        if responding != placed_at && placed_at.is_some() {
            // Places may have moved: who has nothing but its place is looked for anew.
            for device in context.plan.devices.iter().filter(|device| is_by_place(device)) {
                lose(&context, device.id);
            }
        }
        are_newcomers |= !context.plan.groups.is_empty()
            && placed_at.is_some_and(|before| responding > Some(before));
        placed_at = responding;
        if !search(&context).await && !are_newcomers {
            continue;
        }
        let now = context.wire.now();
        // A group that went and came between two looks counts as many as before.
        let lost_groups = lock(&context.device_table).groups.losses();
        let has_changed = responding != located_at || lost_groups != losses;
        if has_changed || now >= thorough_at {
            thorough_at = now + THOROUGH_INTERVAL;
            let ring_intact = context.wire.ring_intact();
            // A silent line is found out by the supervisors; the next round tries again.
            if locate::again(&context).await.is_ok() {
                // Of a ring that opened or closed meanwhile a half may not have been looked through.
                let is_whole = context.wire.ring_intact() == ring_intact;
                located_at = responding.filter(|_| is_whole);
                losses = lost_groups;
                are_newcomers &= !is_whole;
            }
        }
    }
}

/// Whether all are there, and as many answer as the last time.
fn is_calm(context: &Context, answered: Option<WorkingCounter>) -> bool {
    let device_table = lock(&context.device_table);
    device_table.responding() == answered && device_table.are_all_there()
}

/// Asks those that are lost at their addresses. Returns whether any is still lost.
async fn search(context: &Context) -> bool {
    if lock(&context.device_table).are_all_there() {
        return false;
    }
    by_alias::locate(context).await;
    let lost: Vec<_> = (context.plan.devices.iter())
        .filter(|device| lock(&context.device_table).found(device.id) == Reachability::Lost)
        .filter(|device| !is_by_place(device) && !is_by_number(context, device))
        .collect();
    let asked: Vec<_> = (lost.iter())
        .map(|device| {
            let target = Target::Station(device.station);
            let request =
                crate::exchange::Request::read(target, register::AL_STATUS.address, AL_LEN);
            (device.id, context.wire.submit(request))
        })
        .collect();
    let is_lost =
        |device: &DevicePlan| lock(&context.device_table).found(device.id) == Reachability::Lost;
    let is_sought = |one: &DevicePlan| is_by_place(one) || is_by_number(context, one);
    let mut missing = context.plan.devices.iter().any(|one| is_sought(one) && is_lost(one));
    for (id, reply) in asked {
        match reply.await {
            Ok(reply) if reply.wkc.0 == 1 => find(context, id, false),
            Ok(_) | Err(_) => missing = true,
        }
    }
    missing
}

/// Whether a SubDevice has nothing but its place to be reached by (FRM-28).
fn is_by_place(device: &DevicePlan) -> bool {
    device.settings.addressing == AddressingChoice::Position
}

/// Whether a SubDevice is taken by the number of its group only: its group is not there, and who answers at its
/// station address may be another one.
fn is_by_number(context: &Context, device: &DevicePlan) -> bool {
    let first = context.plan.group_of(device.id).map(HotConnectGroup::first);
    first.is_some_and(|first| !lock(&context.device_table).is_there(first))
}

/// A SubDevice does not answer.
pub(crate) fn lose(context: &Context, id: DeviceId) {
    let mut device_table = lock(&context.device_table);
    let before = device_table.set_found(id, Reachability::Lost);
    if before == Reachability::Lost {
        return;
    }
    // Who may be absent, and never was there, is not missed.
    let is_missed = before != Reachability::Unknown || !device_table.groups.is_optional(id);
    let group = device_table.groups.group_of(id);
    let is_first = |group: &usize| context.plan.groups[*group].first() == id;
    let left = group.filter(is_first).filter(|group| device_table.groups.leave(*group));
    device_table.alert();
    let all = device_table.have_all_reached() && device_table.set_all_reached(context.wire.now());
    drop(device_table);
    if is_missed {
        context.wire.emit(Event::DeviceLost { id });
    }
    if let Some(group) = left {
        context.wire.emit(Event::GroupLeft { group });
    }
    if all {
        context.wire.emit(Event::AllReached);
    }
}

/// A SubDevice answers.
pub(crate) fn find(context: &Context, id: DeviceId, restarted: bool) {
    let before = lock(&context.device_table).set_found(id, Reachability::There { restarted });
    if before == Reachability::Lost {
        context.wire.emit(Event::DeviceBack { id, restarted });
    }
    lock(&context.device_table).alert();
}

#[cfg(test)]
mod tests;
