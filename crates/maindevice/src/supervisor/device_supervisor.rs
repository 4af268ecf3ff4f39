//! Supervisor of one SubDevice: drives it to its target, watches it, drives it again.

use std::sync::atomic::Ordering;

use linesman_config::plan::DevicePlan;
use linesman_proto::address::DeviceId;
use linesman_proto::register::{self, AlStatus, DlStatus, ErrorCounters, EscInformation};
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::{Instant, Span};

use super::loop_control::LoopControl;
use super::state_change::Failed;
use super::times::Phase;
use super::watched_clock::WatchedClock;
use super::{CALM, Context, Reachability, lose};
use crate::event::Event;
use crate::exchange::{Reply, Target};
use crate::executor::lock;
use crate::options::Polling;
use crate::procedure::read_only_scan::{AL_LEN, al_of, counters_of};
use crate::procedure::state::StepError;

/// What is known of the SubDevice, so that only changes are told.
#[derive(Default)]
pub(super) struct ReportedState {
    al: Option<(AlStatus, AlStatusCode)>,
    dl: Option<DlStatus>,
    counters: Option<ErrorCounters>,
    /// How often in a row its counters stood as high after a clear as before.
    vain_clears: u8,
    /// Its controller: which counters it has.
    information: Option<EscInformation>,
}

/// Why the SubDevice has to be driven again.
enum SupervisionEnd {
    Lost,
    Fell,
    /// Another state is wanted than before.
    Redirected,
}

/// A controller whose counters do not let themselves be cleared is left alone after so many attempts.
const MOST_VAIN_CLEARS: u8 = 3;

/// Nobody looks at a SubDevice by itself for so long, unless there is a reason.
const UNWATCHED: Span = Span::s(3_600);

/// A SubDevice that stayed well for so long starts with short waits again.
const FORGIVEN_AFTER: Span = Span::s(10);

pub(super) struct SubDeviceSupervisor<'a> {
    pub(super) context: &'a Context,
    pub(super) device: &'a DevicePlan,
    known: ReportedState,
    clock: WatchedClock,
    loop_control: LoopControl,
    backoff: Span,
    /// How often a state had been asked for when it was lost.
    requests_at_loss: u32,
    /// The last round of all that it has followed up.
    round: u64,
}

/// Keeps one SubDevice at its target; never ends.
pub(crate) async fn supervise_device(context: Context, id: DeviceId) {
    let plan = std::sync::Arc::clone(&context.plan);
    let Some(device) = plan.device(id) else { return };
    let mut supervisor = SubDeviceSupervisor {
        context: &context,
        device,
        known: ReportedState::default(),
        clock: WatchedClock::default(),
        loop_control: LoopControl::new(&context, device),
        backoff: Span::ZERO,
        requests_at_loss: 0,
        round: 0,
    };
    loop {
        let restarted = supervisor.until_found().await;
        supervisor.loop_control.forget();
        supervisor.while_there(restarted).await;
        supervisor.requests_at_loss = lock(&context.device_table).requests(id);
        lose(&context, id);
    }
}

impl SubDeviceSupervisor<'_> {
    pub(super) fn target(&self) -> Target {
        Target::Station(self.device.station)
    }

    /// The state in which it shall be now.
    pub(super) fn wanted(&self) -> AlState {
        lock(&self.context.device_table).wanted(self.device.id)
    }

    /// Notes how long a phase took that began then.
    pub(super) fn note(&self, phase: Phase, began: Instant) {
        let took = self.context.wire.now().since(began);
        lock(&self.context.device_table).note_time(self.device.id, phase, took);
    }

    async fn until_found(&self) -> bool {
        loop {
            let seen = self.context.alerts();
            let found = lock(&self.context.device_table).found(self.device.id);
            match found {
                Reachability::There { restarted } if self.may_be_set_up() => return restarted,
                Reachability::There { .. } | Reachability::Lost | Reachability::Unknown => {}
            }
            self.context.sleep_until_alert(seen, Span::s(1)).await;
        }
    }

    /// Whether it may be brought up: for the first time always, later unless that is left to the user.
    fn may_be_set_up(&self) -> bool {
        let device_table = lock(&self.context.device_table);
        let lost_before = device_table.losses(self.device.id) > 0;
        let asked = device_table.requests(self.device.id) > self.requests_at_loss;
        let may = self.context.options.reinitialise && self.device.settings.keeping.reinitialise;
        // A group that joins is brought up, whatever is wanted of those that should always be there.
        !lost_before || asked || may || device_table.groups.is_optional(self.device.id)
    }

    /// Drives and watches until the SubDevice is lost.
    async fn while_there(&mut self, mut set_up_anew: bool) {
        loop {
            let began = self.context.wire.now();
            let reached = match self.drive(set_up_anew).await {
                Ok(()) => {
                    set_up_anew = false;
                    self.reached()
                }
                Err(failed) => {
                    let Some(status) = self.tell(failed) else { return };
                    if !self.wait_before_retry(status).await {
                        return;
                    }
                    continue;
                }
            };
            let is_running = reached >= AlState::SafeOp;
            self.loop_control.set(self.context, self.device, is_running).await;
            match self.watch(reached).await {
                SupervisionEnd::Lost => return,
                SupervisionEnd::Redirected => {
                    lock(&self.context.device_table).set_moving(self.device.id, None);
                    continue;
                }
                SupervisionEnd::Fell => {
                    let Some((status, code)) = self.known.al else { return };
                    let (id, from) = (self.device.id, reached);
                    self.context.wire.emit(Event::AbnormalState { id, from, status, code });
                    let keeping = self.device.settings.keeping;
                    let may = self.context.options.restore_states && keeping.restore_state;
                    if !may && !self.wait_for_request().await {
                        return;
                    }
                }
            }
            lock(&self.context.device_table).set_moving(self.device.id, None);
            let well_for = self.context.wire.now().since(began);
            if well_for >= FORGIVEN_AFTER {
                self.backoff = Span::ZERO;
            } else if self.backoff > Span::ZERO {
                let status = self.known.al.map_or(AlStatus(0), |(status, _)| status);
                if !self.wait_before_retry(status).await {
                    return;
                }
            } else {
                self.backoff = self.context.options.retry_after[0];
            }
        }
    }

    /// Tells of a step that was not made. `None` when the SubDevice does not answer any more.
    fn tell(&mut self, failed: Failed) -> Option<AlStatus> {
        let Failed { from, to, error } = failed;
        let (id, wire) = (self.device.id, &self.context.wire);
        match error {
            StepError::Gone(_) => None,
            StepError::Refused { to, status, code } => {
                self.learn_state(status, code);
                wire.emit(Event::Refused { id, from, to, status, code });
                Some(status)
            }
            StepError::TimedOut { to, status } => {
                wire.emit(Event::StepTimedOut { id, from, to, status });
                Some(status)
            }
            StepError::ClockOff { difference, limit, patience } => {
                let status = self.known.al.map_or(AlStatus::default(), |(status, _)| status);
                wire.emit(Event::ClockOff { id, to, difference, limit, patience });
                Some(status)
            }
            StepError::Module { slot, expected, found } => {
                let status = self.known.al.map_or(AlStatus::default(), |(status, _)| status);
                wire.emit(Event::WrongModule { id, to, status, slot, expected, found });
                Some(status)
            }
            StepError::CycleTooShort { cycle, shortest, object } => {
                let status = self.known.al.map_or(AlStatus::default(), |(status, _)| status);
                wire.emit(Event::CycleTooShort { id, to, status, cycle, shortest, object });
                Some(status)
            }
            StepError::Unread(error) => {
                let status = self.known.al.map_or(AlStatus::default(), |(status, _)| status);
                wire.emit(Event::ModulesUnread { id, to, status, error });
                Some(status)
            }
            StepError::StartUp { command, error } => {
                let status = self.known.al.map_or(AlStatus::default(), |(status, _)| status);
                wire.emit(Event::StartUpFailed { id, to, status, command, error });
                Some(status)
            }
        }
    }

    /// Watches a SubDevice that is left in the state it has fallen to until another one is asked
    /// for. False when it got lost.
    async fn wait_for_request(&mut self) -> bool {
        let status = self.known.al.map_or(AlStatus::default(), |(status, _)| status);
        lock(&self.context.device_table).set_moving(self.device.id, status.state().state());
        let before = lock(&self.context.device_table).requests(self.device.id);
        while lock(&self.context.device_table).requests(self.device.id) == before {
            let seen = self.context.alerts();
            self.context.sleep_until_alert(seen, self.context.options.watch_interval).await;
            if !self.read().await {
                return false;
            }
            self.context.wire.sleep(CALM).await;
        }
        true
    }

    /// Waits, longer each time, and goes on watching. False when the SubDevice got lost.
    async fn wait_before_retry(&mut self, status: AlStatus) -> bool {
        let [first, longest] = self.context.options.retry_after;
        let wait = self.backoff.max(first);
        self.backoff = (wait * 2).min(longest);
        lock(&self.context.device_table).set_moving(self.device.id, status.state().state());
        let until = self.context.wire.now() + wait;
        let before = lock(&self.context.device_table).requests(self.device.id);
        // Whoever asks for a state now does not want to wait.
        while self.context.wire.now() < until
            && lock(&self.context.device_table).requests(self.device.id) == before
        {
            self.context.wire.sleep(self.context.options.watch_interval.min(wait)).await;
            if !self.read().await {
                return false;
            }
        }
        true
    }

    fn reached(&mut self) -> AlState {
        let id = self.device.id;
        let mut device_table = lock(&self.context.device_table);
        let state = device_table.wanted(id);
        device_table.set_reached(id, state);
        let all = device_table.have_all_reached()
            && device_table.set_all_reached(self.context.wire.now());
        let group = device_table.groups.group_of(id).filter(|group| {
            let members = &self.context.plan.groups[*group].members;
            members.iter().all(|member| device_table.has_reached(*member))
        });
        let joined = group.and_then(|group| Some((group, device_table.groups.join(group)?)));
        drop(device_table);
        self.context.wire.emit(Event::TargetReached { id, state });
        if let Some((group, place)) = joined {
            self.context.wire.emit(Event::GroupJoined { group, place });
        }
        if all {
            self.context.wire.emit(Event::AllReached);
        }
        state
    }

    /// Waits until it is to be read: at intervals and after alerts; or, where rounds are made, when one has shown
    /// that something is wrong.
    async fn until_look(&mut self, reached: AlState) {
        if self.context.options.polling == Polling::EachDevice {
            let seen = self.context.alerts();
            return self.context.sleep_until_alert(seen, self.context.options.watch_interval).await;
        }
        loop {
            let (seen, round, is_other) = self.reasons(reached);
            if is_other || round != self.round {
                self.round = round;
                return;
            }
            self.context.sleep_until_alert(seen, UNWATCHED).await;
        }
    }

    /// Alerts and bad rounds so far, and whether it is lost or wanted in another state.
    fn reasons(&self, reached: AlState) -> (u64, u64, bool) {
        let (id, device_table) = (self.device.id, lock(&self.context.device_table));
        let is_other =
            device_table.found(id) == Reachability::Lost || device_table.wanted(id) != reached;
        (device_table.alerts(), self.context.bad_rounds.load(Ordering::Relaxed), is_other)
    }

    /// Reads when it is time, until something is wrong.
    async fn watch(&mut self, reached: AlState) -> SupervisionEnd {
        let id = self.device.id;
        loop {
            self.until_look(reached).await;
            if lock(&self.context.device_table).found(id) == Reachability::Lost
                || !self.read().await
            {
                return SupervisionEnd::Lost;
            }
            let status = self.known.al.map(|(status, _)| status);
            if reached != self.wanted() {
                return SupervisionEnd::Redirected;
            }
            let at_target = status.is_some_and(|status| {
                status.state() == StateValue::Known(reached) && !status.error()
            });
            if !at_target {
                return SupervisionEnd::Fell;
            }
            // One look serves all alerts of that time.
            self.context.wire.sleep(CALM).await;
        }
    }

    /// Reads what is watched and tells what has changed. False when it does not answer.
    async fn read(&mut self) -> bool {
        match self.context.options.polling {
            Polling::EachDevice => self.read_all().await,
            Polling::Rounds(_) | Polling::Nothing => self.read_states().await,
        }
    }

    /// Reads state, and ports where these are watched.
    async fn read_states(&mut self) -> bool {
        let (wire, target) = (&self.context.wire, self.target());
        let links = self.context.options.polling.reads_links() || self.loop_control.are_set();
        let (address, len) = (register::DL_STATUS.address, register::DL_STATUS.len);
        let dl = links.then(|| wire.read(target, address, len));
        let Ok(al) = wire.read_one(target, register::AL_STATUS.address, AL_LEN).await else {
            return false;
        };
        let (status, code) = al_of(&al);
        if let Some(dl) = dl
            && let Ok(reply) = dl.await
            && reply.answered()
        {
            self.learn_links(DlStatus(reply.word(0))).await;
        }
        self.learn_state(status, code);
        true
    }

    /// Reads state, ports and counters.
    async fn read_all(&mut self) -> bool {
        let (wire, target, id) = (&self.context.wire, self.target(), self.device.id);
        if self.known.information.is_none() {
            let len = EscInformation::LEN as u16;
            let reply = wire.read(target, register::ESC_TYPE.address, len).await.ok();
            let reply = reply.filter(Reply::answered);
            self.known.information = reply.map(|reply| EscInformation::from_bytes(reply.bytes(0)));
        }
        let clears = lock(&self.context.device_table).clears(id);
        let al = wire.read(target, register::AL_STATUS.address, AL_LEN);
        let dl = wire.read(target, register::DL_STATUS.address, register::DL_STATUS.len);
        let counters = wire.read(target, ErrorCounters::START, ErrorCounters::LEN as u16);
        // In the same frame as the others.
        let clock = self.clock.look(self.context, self.device);
        let (al, dl, counters) = (al.await, dl.await, counters.await);
        if let Some(clock) = clock {
            self.clock.tell(self.context, self.device, clock.await);
        }
        let answered = |reply: &Reply| reply.wkc.0 > 0;
        let (al, dl, counters) =
            (al.ok().filter(answered), dl.ok().filter(answered), counters.ok().filter(answered));
        if al.is_none() && dl.is_none() && counters.is_none() {
            // Once more: a single frame may have been lost together with its repetitions.
            let again = wire.read_one(target, register::AL_STATUS.address, AL_LEN).await;
            return again.is_ok();
        }
        if let Some(reply) = al {
            let (status, code) = al_of(&reply);
            self.learn_state(status, code);
        }
        if let Some(reply) = dl {
            self.learn_links(DlStatus(reply.word(0))).await;
        }
        let cleared = lock(&self.context.device_table).clears(id) != clears;
        if let Some(reply) = counters.filter(|_| !cleared) {
            let counters = counters_of(&reply, self.known.information);
            if self.known.counters.replace(counters) != Some(counters) {
                self.context.wire.emit(Event::Counters { id, counters });
            }
            self.clear_when_full(counters).await;
        }
        true
    }

    /// Clears the counters before one of them stops counting. If the answer gets lost, the next reading tells.
    async fn clear_when_full(&mut self, counters: ErrorCounters) {
        let limit = self.context.options.clear_counters_at;
        let limit = limit.filter(|_| self.device.settings.keeping.clear_counters);
        let Some(limit) = limit else { return };
        if counters.iter().all(|(_, value)| value < limit) {
            self.known.vain_clears = 0;
        } else if self.known.vain_clears < MOST_VAIN_CLEARS {
            self.known.vain_clears += 1;
            let Context { wire, device_table, .. } = self.context;
            // It fails or not: the next reading tells.
            let _ = super::counters::clear(wire, device_table, self.device.id, self.target()).await;
            self.known.counters = None;
        }
    }

    async fn learn_links(&mut self, status: DlStatus) {
        let id = self.device.id;
        if self.known.dl.replace(status) != Some(status) {
            self.context.wire.emit(Event::Links { id, status });
        }
        self.loop_control.tend(self.context, self.device, status).await;
    }

    pub(super) fn learn_state(&mut self, status: AlStatus, code: AlStatusCode) {
        // The code means something with the error bit only.
        let code = if status.error() { code } else { AlStatusCode::NO_ERROR };
        if self.known.al.replace((status, code)) != Some((status, code)) {
            let id = self.device.id;
            self.context.wire.emit(Event::DeviceState { id, status, code });
        }
    }
}
