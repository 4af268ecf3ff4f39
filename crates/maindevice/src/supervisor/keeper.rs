//! One SubDevice: driven to its target, watched, driven again.

use linesman_config::plan::DevicePlan;
use linesman_proto::address::DeviceId;
use linesman_proto::register::{self, AlStatus, DlStatus, ErrorCounters};
use linesman_proto::state::transition::next_step;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::Span;

use super::{CALM, Context, Found, lose};
use crate::event::Event;
use crate::exchange::{Reply, Target};
use crate::executor::lock;
use crate::procedure::look::{AL_LEN, al_of};
use crate::procedure::set_up;
use crate::procedure::state::{self, StepError};

/// What is known of the SubDevice, so that only changes are told.
#[derive(Default)]
struct Known {
    al: Option<(AlStatus, AlStatusCode)>,
    dl: Option<DlStatus>,
    counters: Option<ErrorCounters>,
}

/// Why the SubDevice has to be driven again.
enum Trouble {
    Lost,
    Fell,
}

/// A SubDevice that stayed well for so long starts with short waits again.
const FORGIVEN_AFTER: Span = Span::s(10);

struct Keeper<'a> {
    context: &'a Context,
    device: &'a DevicePlan,
    known: Known,
    backoff: Span,
}

/// Keeps one SubDevice at its target; never ends.
pub(crate) async fn keep(context: Context, id: DeviceId) {
    let plan = std::sync::Arc::clone(&context.plan);
    let Some(device) = plan.device(id) else { return };
    let mut keeper =
        Keeper { context: &context, device, known: Known::default(), backoff: Span::ZERO };
    loop {
        let restarted = keeper.until_found().await;
        keeper.while_there(restarted).await;
        lose(&context, id);
    }
}

impl Keeper<'_> {
    fn target(&self) -> Target {
        Target::Station(self.device.station)
    }

    async fn until_found(&self) -> bool {
        loop {
            let seen = self.context.alerts();
            if let Found::There { restarted } = lock(&self.context.line).found(self.device.id) {
                return restarted;
            }
            self.context.nap(seen, Span::s(1)).await;
        }
    }

    /// Drives and watches until the SubDevice is lost.
    async fn while_there(&mut self, mut set_up_anew: bool) {
        loop {
            let began = self.context.wire.now();
            match self.drive(set_up_anew).await {
                Ok(()) => {
                    set_up_anew = false;
                    self.reached();
                }
                Err(StepError::Gone(_)) => return,
                Err(StepError::Refused { to, status, code }) => {
                    let id = self.device.id;
                    self.learn_state(status, code);
                    self.context.wire.emit(Event::Refused { id, to, status, code });
                    if !self.wait_before_retry(status).await {
                        return;
                    }
                    continue;
                }
                Err(StepError::TimedOut { to, status }) => {
                    let id = self.device.id;
                    self.context.wire.emit(Event::StepTimedOut { id, to, status });
                    if !self.wait_before_retry(status).await {
                        return;
                    }
                    continue;
                }
            }
            match self.watch().await {
                Trouble::Lost => return,
                Trouble::Fell => {}
            }
            lock(&self.context.line).set_moving(self.device.id, None);
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

    /// Waits, longer each time, and goes on watching. False when the SubDevice got lost.
    async fn wait_before_retry(&mut self, status: AlStatus) -> bool {
        let [first, longest] = self.context.options.retry_after;
        let wait = self.backoff.max(first);
        self.backoff = (wait * 2).min(longest);
        lock(&self.context.line).set_moving(self.device.id, status.state().state());
        let until = self.context.wire.now() + wait;
        while self.context.wire.now() < until {
            self.context.wire.sleep(self.context.options.watch_interval.min(wait)).await;
            if !self.read().await {
                return false;
            }
        }
        true
    }

    fn reached(&mut self) {
        let (id, state) = (self.device.id, self.device.target);
        let mut line = lock(&self.context.line);
        line.set_reached(id, state);
        let all = line.have_all_reached() && line.set_all_reached();
        drop(line);
        self.context.wire.emit(Event::TargetReached { id, state });
        if all {
            self.context.wire.emit(Event::AllReached);
        }
    }

    /// Goes from wherever the SubDevice is to its target.
    async fn drive(&mut self, anew: bool) -> Result<(), StepError> {
        let (context, device) = (self.context, self.device);
        let (wire, target) = (&context.wire, self.target());
        let (status, code) = state::read(wire, target).await?;
        self.learn_state(status, code);
        if status.error() {
            state::acknowledge(wire, target, status, device.device_emulation).await?;
        }
        let mut current = match status.state() {
            StateValue::Known(AlState::Boot) | StateValue::Unknown(_) => None,
            StateValue::Known(state) => Some(state).filter(|_| !anew),
        };
        loop {
            lock(&context.line).set_moving(device.id, current);
            let next = match current {
                None => AlState::Init,
                Some(current) => match next_step(current, device.target) {
                    Some(next) => next,
                    None => return Ok(()),
                },
            };
            match (current, next) {
                (Some(AlState::Init), AlState::PreOp) => {
                    set_up::before_pre_op(wire, device).await?;
                }
                (Some(AlState::PreOp), AlState::SafeOp) => {
                    set_up::before_safe_op(wire, device).await?;
                }
                (
                    None
                    | Some(
                        AlState::Init
                        | AlState::Boot
                        | AlState::PreOp
                        | AlState::SafeOp
                        | AlState::Op,
                    ),
                    AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
                ) => {}
            }
            let from = current.unwrap_or(AlState::Op);
            let limit = context.options.state_timeouts.of(from, next);
            let step = state::Step { to: next, limit, emulated: device.device_emulation };
            state::request(wire, target, step).await?;
            self.learn_state(AlStatus::new(next), AlStatusCode::NO_ERROR);
            current = Some(next);
        }
    }

    /// Reads at intervals, and at once after an alert, until something is wrong.
    async fn watch(&mut self) -> Trouble {
        let id = self.device.id;
        loop {
            let seen = self.context.alerts();
            self.context.nap(seen, self.context.options.watch_interval).await;
            if lock(&self.context.line).found(id) == Found::Lost || !self.read().await {
                return Trouble::Lost;
            }
            let at_target = self.known.al.is_some_and(|(status, _)| {
                status.state() == StateValue::Known(self.device.target) && !status.error()
            });
            if !at_target {
                return Trouble::Fell;
            }
            // One look serves all alerts of that time.
            self.context.wire.sleep(CALM).await;
        }
    }

    /// Reads state, ports and counters and tells what has changed. False when it does not answer.
    async fn read(&mut self) -> bool {
        let (wire, target, id) = (&self.context.wire, self.target(), self.device.id);
        let al = wire.read(target, register::AL_STATUS.address, AL_LEN);
        let dl = wire.read(target, register::DL_STATUS.address, register::DL_STATUS.len);
        let counters = wire.read(target, ErrorCounters::START, ErrorCounters::LEN as u16);
        let (al, dl, counters) = (al.await, dl.await, counters.await);
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
            let status = DlStatus(reply.word(0));
            if self.known.dl.replace(status) != Some(status) {
                self.context.wire.emit(Event::Links { id, status });
            }
        }
        if let Some(reply) = counters {
            let counters = ErrorCounters::from_bytes(&reply.data, ErrorCounters::START);
            if self.known.counters.replace(counters) != Some(counters) {
                self.context.wire.emit(Event::Counters { id, counters });
            }
        }
        true
    }

    fn learn_state(&mut self, status: AlStatus, code: AlStatusCode) {
        // The code means something with the error bit only.
        let code = if status.error() { code } else { AlStatusCode::NO_ERROR };
        if self.known.al.replace((status, code)) != Some((status, code)) {
            let id = self.device.id;
            self.context.wire.emit(Event::DeviceState { id, status, code });
        }
    }
}
