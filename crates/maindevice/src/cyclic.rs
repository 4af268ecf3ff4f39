//! The cyclic exchange of process data: a plain engine that allocates nothing once it runs.
//!
//! Each task of the plan sends its frames when its cycle begins. What comes back is judged datagram
//! by datagram against the expected working counter, which follows from who is present; inputs are
//! taken over only when it holds. What a SubDevice adds while it changes its state is not known: its
//! SyncManagers are on before it gives data. Until it has arrived the expectation is a range, so that
//! one SubDevice that comes back, or is stuck, does not stop the inputs of all others.

use std::sync::{Arc, Mutex};

use linesman_config::plan::expect::{PathView, Presence, expect};
use linesman_config::plan::{DatagramPlan, Plan};
use linesman_proto::address::WorkingCounter;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::sii::Direction;
use linesman_proto::state::{AlState, OredStates};
use linesman_proto::time::Instant;

use crate::event::Event;
use crate::exchange::{Exchange, Purpose};
use crate::executor::lock;
use crate::statistics::Statistics;
use crate::supervisor::Line;

/// One datagram with what is known of it.
#[derive(Debug)]
struct Judged {
    /// What those that surely serve it add.
    least: WorkingCounter,
    /// What it is when those that are on their way between states add to it, too.
    most: WorkingCounter,
    /// The last one that was told of; `None` when all is well.
    told: Option<WorkingCounter>,
}

/// The datagrams of one frame.
#[derive(Debug)]
struct JudgedFrame {
    datagrams: Vec<Judged>,
    /// Which version of the line's state its expectations are made of.
    version: Option<u64>,
}

#[derive(Debug)]
struct TaskState {
    next_at: Instant,
    frames: Vec<JudgedFrame>,
    /// Frames lost in a row.
    lost: u64,
}

/// The engine.
#[derive(Debug)]
pub(crate) struct Cyclic {
    plan: Arc<Plan>,
    line: Arc<Mutex<Line>>,
    tasks: Vec<TaskState>,
    /// Who surely serves process data, and who may.
    least: Presence,
    most: Presence,
    /// Which version of the line's state that is.
    version: u64,
    pub(crate) outputs: Vec<u8>,
    pub(crate) inputs: Vec<u8>,
}

impl Cyclic {
    pub(crate) fn new(plan: Arc<Plan>, line: Arc<Mutex<Line>>, now: Instant) -> Self {
        let task = |task: &linesman_config::plan::Task| TaskState {
            next_at: now,
            frames: (task.frames.iter())
                .map(|frame| {
                    let fresh = |_: &DatagramPlan| Judged {
                        least: WorkingCounter(0),
                        most: WorkingCounter(0),
                        told: None,
                    };
                    let datagrams = frame.datagrams.iter().map(fresh).collect();
                    JudgedFrame { datagrams, version: None }
                })
                .collect(),
            lost: 0,
        };
        let mut cyclic = Self {
            tasks: plan.tasks.iter().map(task).collect(),
            least: Presence::none(plan.devices.len()),
            most: Presence::none(plan.devices.len()),
            version: u64::MAX,
            outputs: vec![0; plan.outputs_len],
            inputs: vec![0; plan.inputs_len],
            plan,
            line,
        };
        cyclic.refresh();
        cyclic
    }

    /// Takes over who is present, if that has changed.
    pub(crate) fn refresh(&mut self) {
        let mut line = lock(&self.line);
        if line.version() != self.version {
            self.version = line.version();
            line.take_changes(&mut self.least, &mut self.most);
        }
    }

    /// When the next cycle begins.
    pub(crate) fn poll_timeout(&self) -> Option<Instant> {
        self.tasks.iter().map(|task| task.next_at).min()
    }

    /// Sends the frames of all tasks whose cycle has begun. Returns whether any had.
    pub(crate) fn send_due(
        &mut self,
        now: Instant,
        exchange: &mut Exchange,
        statistics: &mut Statistics,
    ) -> bool {
        let mut any = false;
        for (index, (task, state)) in self.plan.tasks.iter().zip(&mut self.tasks).enumerate() {
            if state.next_at > now {
                continue;
            }
            any = true;
            statistics.cycles += 1;
            let cycle = task.cycle.as_nanos().max(1);
            // Cycles that were slept through are left out, not caught up: the grid stays.
            let behind = now.since(state.next_at).as_nanos() / cycle;
            statistics.cycles_missed += behind;
            state.next_at += linesman_proto::time::Span::ns(cycle) * (behind + 1);
            let deadline = now + task.cycle;
            for (frame_index, frame) in task.frames.iter().enumerate() {
                let purpose = Purpose::Cyclic { task: index, frame: frame_index };
                let outputs = &self.outputs;
                exchange.send(now, deadline, purpose, |builder, _, mark| {
                    for (at, datagram) in frame.datagrams.iter().enumerate() {
                        let (command, address) = (datagram.command, datagram.address);
                        // The plan packs no more than fits.
                        if let Ok(data) = builder.push(command, mark(at), address, datagram.len) {
                            fill(datagram, outputs, data);
                        }
                    }
                });
            }
        }
        any
    }

    /// A frame came back.
    pub(crate) fn received(
        &mut self,
        task: usize,
        frame: usize,
        reply: &[u8],
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) {
        self.refresh();
        let Some(state) = self.tasks.get_mut(task) else { return };
        if state.lost > 0 {
            let lost = std::mem::take(&mut state.lost);
            if lost >= LOST_IS_NEWS {
                events(Event::CyclicFramesBack { task, lost });
                lock(&self.line).alert();
            }
        }
        let plan = self.plan.tasks.get(task).and_then(|task| task.frames.get(frame));
        let (Some(plan), Some(judged)) = (plan, state.frames.get_mut(frame)) else { return };
        if judged.version.replace(self.version) != Some(self.version) {
            for (datagram, judged) in plan.datagrams.iter().zip(&mut judged.datagrams) {
                judged.least = expect(datagram, &self.least, PathView::Merged);
                judged.most = expect(datagram, &self.most, PathView::Merged);
            }
        }
        let Ok(view) = FrameView::parse(reply) else { return };
        let datagrams = view.datagrams().map_while(Result::ok);
        for (at, ((datagram, plan), judged)) in
            datagrams.zip(&plan.datagrams).zip(&mut judged.datagrams).enumerate()
        {
            let wkc = datagram.wkc();
            if plan.ownership.is_empty() && plan.command.addressing() == Addressing::Broadcast {
                watch_line(&self.line, wkc, datagram.data(), events);
                continue;
            }
            if !plan.role.is_judged() {
                continue;
            }
            if (judged.least..=judged.most).contains(&wkc) {
                copy_inputs(plan, datagram.data(), &self.least, &mut self.inputs);
                if judged.told.take().is_some() {
                    events(Event::WorkingCounterGood { task, frame, datagram: at });
                }
                continue;
            }
            statistics.working_counter_errors += 1;
            if judged.told != Some(wkc) {
                judged.told = Some(wkc);
                let expected = wkc.clamp(judged.least, judged.most);
                events(Event::WorkingCounter {
                    task,
                    frame,
                    datagram: at,
                    expected,
                    received: wkc,
                });
                lock(&self.line).alert();
            }
        }
    }

    /// A frame did not come back.
    pub(crate) fn lost(&mut self, task: usize, events: &mut impl FnMut(Event)) {
        let Some(state) = self.tasks.get_mut(task) else { return };
        state.lost += 1;
        if state.lost == LOST_IS_NEWS {
            events(Event::CyclicFramesLost { task });
            lock(&self.line).alert();
        }
    }
}

/// So many cyclic frames lost in a row are more than an accident.
const LOST_IS_NEWS: u64 = 3;

/// The broadcast read of the AL status tells how many are there and whether all is as it shall be.
fn watch_line(
    line: &Mutex<Line>,
    wkc: WorkingCounter,
    data: &[u8],
    events: &mut impl FnMut(Event),
) {
    let states: OredStates = AlState::from_or(data.first().copied().unwrap_or(0));
    if let Some(before) = lock(line).broadcast(wkc, states) {
        events(Event::Responding { before, now: wkc });
    }
}

/// Outputs into a datagram; what is read stays zero, so that copies can be merged.
fn fill(datagram: &DatagramPlan, outputs: &[u8], data: &mut [u8]) {
    for owned in &datagram.ownership {
        let len = owned.range.len();
        if owned.direction == Direction::Outputs
            && let Some(from) = outputs.get(owned.image_at..owned.image_at + len)
            && let Some(to) = data.get_mut(owned.range.clone())
        {
            to.copy_from_slice(from);
        }
    }
}

/// Inputs of those that surely gave theirs; what is of the others stays as it was.
fn copy_inputs(datagram: &DatagramPlan, data: &[u8], serving: &Presence, inputs: &mut [u8]) {
    if !matches!(datagram.command, Command::Lrw | Command::Lrd) {
        return;
    }
    for owned in &datagram.ownership {
        let len = owned.range.len();
        if owned.direction == Direction::Inputs
            && serving.of(owned.device).inputs
            && let Some(from) = data.get(owned.range.clone())
            && let Some(to) = inputs.get_mut(owned.image_at..owned.image_at + len)
        {
            to.copy_from_slice(from);
        }
    }
}

#[cfg(test)]
mod tests;
