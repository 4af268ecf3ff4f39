//! State changes of one SubDevice, from wherever it is to its target.

use linesman_config::start_up::Transition;
use linesman_proto::register::AlStatus;
use linesman_proto::state::transition::next_step;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};

use super::clocks;
use super::device_supervisor::SubDeviceSupervisor;
use super::modules;
use super::shortest_cycle;
use super::start_up::{Moment, execute};
use super::times::Phase;
use crate::executor::lock;
use crate::procedure::state::{self, StepError};
use crate::procedure::{set_up, sync_signal};

/// A step that was not made.
pub(super) struct Failed {
    /// Where it began; `None` when the state was not known.
    pub(super) from: Option<AlState>,
    /// Where it should have led.
    pub(super) to: AlState,
    pub(super) error: StepError,
}

impl SubDeviceSupervisor<'_> {
    /// Goes from wherever the SubDevice is to its target.
    pub(super) async fn drive(&mut self, anew: bool) -> Result<(), Failed> {
        let at_begin = |error| Failed { from: None, to: AlState::Init, error };
        let (context, device) = (self.context, self.device);
        let (wire, target) = (&context.wire, self.target());
        let (status, code) =
            state::read(wire, target).await.map_err(|error| at_begin(error.into()))?;
        self.learn_state(status, code);
        if status.error() {
            let emulated = device.device_emulation;
            state::acknowledge(wire, target, status, emulated).await.map_err(at_begin)?;
        }
        let mut current = match status.state() {
            StateValue::Known(AlState::Boot) if self.wanted() == AlState::Boot => {
                Some(AlState::Boot)
            }
            StateValue::Known(AlState::Boot) | StateValue::Unknown(_) => None,
            StateValue::Known(state) => Some(state).filter(|_| !anew),
        };
        if anew {
            lock(&context.device_table).forget_times(device.id);
        }
        loop {
            lock(&context.device_table).set_moving(device.id, current);
            let next = match current {
                None => AlState::Init,
                Some(current) => match next_step(current, self.wanted()) {
                    Some(next) => next,
                    None => return Ok(()),
                },
            };
            let failed = |error| Failed { from: current, to: next, error };
            self.step(current, next).await.map_err(failed)?;
            current = Some(next);
        }
    }

    /// One step with all that belongs to it.
    async fn step(&mut self, current: Option<AlState>, next: AlState) -> Result<(), StepError> {
        let (context, device) = (self.context, self.device);
        let (wire, target) = (&context.wire, self.target());
        let began = wire.now();
        match (current, next) {
            (Some(AlState::Init), AlState::PreOp) => {
                let areas = device.mailbox.map(|mailbox| mailbox.areas);
                set_up::before_mailbox(wire, device, areas).await?;
                self.note(Phase::SetUp(next), began);
            }
            (Some(AlState::Init), AlState::Boot) => {
                let areas = device.mailbox.and_then(|mailbox| mailbox.bootstrap);
                set_up::before_mailbox(wire, device, areas).await?;
                self.note(Phase::SetUp(next), began);
            }
            (Some(AlState::PreOp), AlState::SafeOp) => {
                modules::compare(context, device).await?;
                shortest_cycle::compare(context, device).await?;
                self.commands(current, next, Moment::Before).await?;
                let began = wire.now();
                clocks::ready(context).await;
                clocks::set_one(context, device.id).await;
                if let Some(settings) = &device.settings.clock {
                    let shift_ns = context.plan.sync0_start_ns(device);
                    sync_signal::set(wire, device.station, settings, shift_ns).await?;
                }
                if wire.now() > began {
                    self.note(Phase::Clocks, began);
                }
                let began = wire.now();
                set_up::before_safe_op(wire, device).await?;
                self.note(Phase::SetUp(next), began);
            }
            (Some(AlState::SafeOp), AlState::Op) => {
                clocks::settle(context, device.id).await?;
                if wire.now() > began {
                    self.note(Phase::ClockSettling, began);
                }
            }
            (
                None
                | Some(
                    AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
                ),
                AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
            ) => {}
        }
        if (current, next) != (Some(AlState::PreOp), AlState::SafeOp) {
            self.commands(current, next, Moment::Before).await?;
        }
        let from = current.unwrap_or(AlState::Op);
        let limit = context.options.state_timeouts.of(from, next);
        let began = wire.now();
        let step = state::Step { to: next, limit, emulated: device.device_emulation };
        state::request(wire, target, step).await?;
        self.note(Phase::Step(next), began);
        if current.is_some_and(AlState::has_inputs) && !next.has_inputs() {
            set_up::after_process_data(wire, device).await?;
        }
        self.learn_state(AlStatus::new(next), AlStatusCode::NO_ERROR);
        lock(&context.device_table).set_moving(device.id, Some(next));
        self.commands(current, next, Moment::After).await
    }

    /// The start-up commands of a step. From a state that is not known there are none.
    async fn commands(
        &self,
        from: Option<AlState>,
        to: AlState,
        moment: Moment,
    ) -> Result<(), StepError> {
        let Some(from) = from.filter(|_| !self.device.start_up.is_empty()) else { return Ok(()) };
        let began = self.context.wire.now();
        execute(self.context, self.device, Transition { from, to }, moment).await?;
        if self.context.wire.now() > began {
            self.note(Phase::StartUp(to), began);
        }
        Ok(())
    }
}
