//! A processor in step: what it does at the signals of its clock and in between.

use linesman_proto::register::AlEvents;
use linesman_proto::sii::Direction;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::Instant;

use super::synchronisation::Flow;
use super::{Processor, RequestedStep, StepOutcome};
use crate::controller::{Pdi, SyncSignal};
use crate::device::application_layer::ApplicationLayer;
use crate::device::software_fault::SoftwareFault;

impl Processor {
    /// Whether a SyncManager of a direction says that the MainDevice has been there. One that gives
    /// no events counts as visited.
    fn was_visited(&self, direction: Direction, pdi: &Pdi<'_>) -> bool {
        let events = pdi.events();
        self.process_data.lengths(direction).filter(|(_, len)| *len > 0).all(|(index, _)| {
            let tells = pdi.sync_manager(index).is_some_and(|manager| manager.control.al_event());
            !tells || events.contains(AlEvents::sync_manager(u16::from(index)))
        })
    }

    /// Takes outputs that came, if any, and drives them if it is time to.
    pub(super) fn serve_outputs(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        let fresh = self.has_outputs() && self.was_visited(Direction::Outputs, pdi);
        if fresh && self.take_outputs(pdi) {
            let at_once = self.synchronisation.outputs_came(&mut self.dictionary, pdi);
            if at_once && ApplicationLayer::is_operational(pdi) {
                self.drive_outputs(now, pdi.signals_mut());
            }
        }
    }

    /// What the synchronisation has put off until now.
    pub(super) fn serve_due(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        let operational = ApplicationLayer::is_operational(pdi);
        if operational && self.synchronisation.is_silent(now) {
            self.fall(pdi, AlState::SafeOp, AlStatusCode::FATAL_SYNC_ERROR);
        }
        let due = self.synchronisation.take_due(now);
        if due.drive && operational {
            self.drive_outputs(now, pdi.signals_mut());
        }
        let has_inputs = ApplicationLayer::state(pdi).has_inputs();
        if due.latch && has_inputs {
            self.latch_inputs(now, pdi);
        }
        if due.give && has_inputs {
            // Whoever has fetched the inputs of the cycle before since the signal has come in this cycle.
            self.fetched_early |= self.was_visited(Direction::Inputs, pdi);
            self.give_inputs(pdi);
        }
    }

    /// Takes inputs and puts them where frames fetch them.
    pub(super) fn sample_inputs(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.latch_inputs(now, pdi);
        self.give_inputs(pdi);
    }

    fn latch_inputs(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.next_sample = now + self.description.times.sample;
        let time = pdi.system_time();
        if !self.software_faults.has(SoftwareFault::FrozenApplication) {
            self.has_values = true;
            for channel in &mut self.description.channels {
                channel.tell_time(time);
                channel.sample(now, &mut self.dictionary, pdi.signals());
            }
        }
        self.hear_channels();
    }

    fn give_inputs(&mut self, pdi: &mut Pdi<'_>) {
        self.process_data.put_inputs(pdi, &self.dictionary, &mut self.buffer);
    }

    /// Begins to write the inputs of this cycle, which takes the events of those of the last one back.
    fn open_inputs(&self, pdi: &mut Pdi<'_>) {
        for (index, _) in self.process_data.lengths(Direction::Inputs).filter(|(_, len)| *len > 0) {
            pdi.open_sync_manager(index, false);
        }
    }

    /// A signal of the clock comes. Gives when to run next because of it.
    pub(super) fn keep_step(
        &mut self,
        signal: SyncSignal,
        now: Instant,
        pdi: &mut Pdi<'_>,
    ) -> Option<Instant> {
        pdi.acknowledge_sync(signal);
        let state = ApplicationLayer::state(pdi);
        if !state.has_inputs() || !self.synchronisation.follows(signal) {
            return None;
        }
        let flow = Flow {
            outputs: self.has_outputs(),
            inputs_fetched: self.fetched_early || self.was_visited(Direction::Inputs, pdi),
            operational: state == AlState::Op,
        };
        if let Some(code) = self.synchronisation.pulse(now, &mut self.dictionary, flow) {
            self.fall(pdi, AlState::SafeOp, code);
        }
        if self.synchronisation.will_latch() {
            self.fetched_early = false;
            self.open_inputs(pdi);
        }
        self.serve_due(now, pdi);
        if self.step.is_some_and(|step| step.due <= now) {
            return Some(now);
        }
        self.synchronisation.next(ApplicationLayer::is_operational(pdi))
    }

    /// Whether the clock lets it go to OP.
    pub(super) fn wait_for_clock(&self, step: RequestedStep, now: Instant) -> Option<StepOutcome> {
        match self.synchronisation.readiness(self.has_outputs()) {
            Ok(()) => None,
            Err(_) if now < step.deadline => Some(StepOutcome::Waits),
            Err(code) => Some(StepOutcome::Failed(AlState::SafeOp, code)),
        }
    }
}
