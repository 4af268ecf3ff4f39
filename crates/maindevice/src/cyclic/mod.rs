//! The cyclic exchange of process data: a plain engine that allocates nothing once it runs.
//!
//! Each task of the plan sends its frames when its cycle begins. What comes back is judged datagram
//! by datagram against the expected working counter, which follows from who is present; inputs are
//! taken over only when it holds. What a SubDevice adds while it changes its state is not known: its
//! SyncManagers are on before it gives data. Until it has arrived the expectation is a range, so that
//! one SubDevice that comes back, or is stuck, does not stop the inputs of all others.
//!
//! [`send`] sends, [`run`] copies, [`datagram`] judges, [`quality`] tells how good and how old data are,
//! [`application`] sees to it that old outputs are not sent as fresh ones.

mod application;
mod datagram;
mod departure;
mod quality;
mod run;
mod send;
mod steer;

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use linesman_config::plan::expect::Presence;
use linesman_config::plan::{Plan, Role};
use linesman_proto::address::WorkingCounter;
use linesman_proto::sii::Direction;
use linesman_proto::state::{AlState, OredStates};
use linesman_proto::time::{Instant, Span};

use self::application::Application;
use self::datagram::{Datagram, Place, clear_lost};
use self::departure::{Departure, LOST_IS_NEWS, TaskState};
use self::quality::Share;
use self::run::Runs;
use self::steer::Steer;
use crate::event::Event;
use crate::exchange::Exchange;
use crate::exchange::prebuilt::data_offsets;
use crate::executor::lock;
use crate::mailbox::{MailboxBits, Queues};
use crate::statistics::Statistics;
use crate::supervisor::Line;

pub use self::quality::{FrameStatus, Quality};

/// One frame of the plan.
#[derive(Debug)]
struct Frame {
    task: usize,
    /// Its number within the task.
    number: usize,
    /// Where outputs go into it.
    outputs: Runs,
    datagrams: Vec<Datagram>,
    /// Bits of the datagrams that carry outputs, and of all.
    carries: u16,
    all: u16,
    /// Which version of the line's state its expectations are made of.
    version: u64,
    /// It is on its way.
    out: bool,
    status: FrameStatus,
}

/// The engine.
#[derive(Debug)]
pub(crate) struct Cyclic {
    plan: Arc<Plan>,
    line: Arc<Mutex<Line>>,
    /// The version of the line's state, to be looked at without a lock.
    live: Arc<AtomicU64>,
    tasks: Vec<TaskState>,
    departures: Vec<Departure>,
    frames: Vec<Frame>,
    /// When the first departure is due.
    next_at: Instant,
    /// The departure whose frames leave now, and which of them are left, as places in the order.
    leaving: usize,
    left: Range<usize>,
    /// The frames in the order of departures, by their indices among those of all tasks.
    order: Vec<u32>,
    /// When they are given up.
    deadline: Instant,
    /// How often the application has given the outputs of all tasks.
    given: u64,
    /// Who surely serves process data, and who may.
    least: Presence,
    most: Presence,
    /// Which version of the line's state that is.
    version: u64,
    /// What the last broadcast read brought.
    responding: Option<(WorkingCounter, u8)>,
    shares: Vec<Share>,
    steer: Steer,
    mailboxes: MailboxBits,
    pub(crate) outputs: Vec<u8>,
    pub(crate) inputs: Vec<u8>,
}

impl Cyclic {
    /// Gives its frames to the exchange, and begins at `now`.
    pub(crate) fn new(
        plan: Arc<Plan>,
        line: Arc<Mutex<Line>>,
        exchange: &mut Exchange,
        allowed_misses: Option<u32>,
        now: Instant,
    ) -> Self {
        exchange.prebuild(plan.tasks.iter().flat_map(|task| task.frames.iter().cloned()));
        let (mut frames, mut departures) = (Vec::new(), Vec::<(Departure, Vec<u32>)>::new());
        for (index, task) in plan.tasks.iter().enumerate() {
            let earliest = task.frames.iter().map(|frame| frame.ahead).max().unwrap_or_default();
            let latest = task.frames.iter().map(|frame| frame.ahead).min().unwrap_or_default();
            for (number, planned) in task.frames.iter().enumerate() {
                let next_at = now + earliest.saturating_sub(planned.ahead);
                let same = |(one, _): &&mut (Departure, Vec<u32>)| {
                    one.task == index && one.next_at == next_at
                };
                match departures.iter_mut().find(same) {
                    Some((_, leaving)) => leaving.push(frames.len() as u32),
                    None => {
                        let cycle = task.cycle.max(Span::ns(1));
                        let begins = planned.ahead == latest;
                        let departure =
                            Departure { task: index, next_at, cycle, begins, frames: 0..0 };
                        departures.push((departure, vec![frames.len() as u32]));
                    }
                }
                frames.push(Frame::new(&plan, index, number));
            }
        }
        let mut order = Vec::new();
        let place = |(mut departure, leaving): (Departure, Vec<u32>)| {
            let first = order.len();
            order.extend(leaving);
            departure.frames = first..order.len();
            departure
        };
        let departures: Vec<Departure> = departures.into_iter().map(place).collect();
        let task = |_| TaskState {
            lost: 0,
            out: 0,
            exchanged: false,
            application: Application::new(allowed_misses),
        };
        let live = lock(&line).live_version();
        let mut cyclic = Self {
            tasks: plan.tasks.iter().map(task).collect(),
            departures,
            frames,
            next_at: now,
            leaving: 0,
            left: 0..0,
            order,
            deadline: now,
            given: 0,
            least: Presence::none(plan.devices.len()),
            most: Presence::none(plan.devices.len()),
            version: u64::MAX,
            responding: None,
            shares: quality::shares(&plan),
            steer: Steer::default(),
            mailboxes: MailboxBits::default(),
            outputs: vec![0; plan.outputs_len],
            inputs: vec![0; plan.inputs_len],
            plan,
            line,
            live,
        };
        cyclic.next_at =
            cyclic.departures.iter().map(|one| one.next_at).min().unwrap_or(Instant::MAX);
        cyclic.refresh();
        cyclic
    }

    /// Tells those who serve mailboxes which of them hold something, where the plan reads that.
    pub(crate) fn serve(&mut self, mailboxes: Queues) {
        self.mailboxes = MailboxBits::new(&self.plan, mailboxes);
    }

    /// Takes over who is present, if that has changed.
    #[inline]
    pub(crate) fn refresh(&mut self) {
        if self.live.load(Ordering::Relaxed) != self.version {
            self.take_over_changes();
        }
    }

    #[cold]
    fn take_over_changes(&mut self) {
        let mut line = lock(&self.line);
        self.version = line.version();
        line.take_changes(&mut self.least, &mut self.most);
        self.steer.set_base(line.clock_base());
    }

    /// When the next frames are due; [`Instant::MAX`]: never.
    #[inline]
    pub(crate) fn next_at(&self) -> Instant {
        self.next_at
    }

    /// The application gives its outputs: all of them, or those of one task.
    #[inline]
    pub(crate) fn give_outputs(&mut self, task: Option<usize>) {
        match task {
            Some(task) => self.tasks.get_mut(task).into_iter().for_each(|t| t.application.give()),
            None => self.given += 1,
        }
    }

    /// Whether all frames of a task have come back, or were given up, since this was asked last.
    #[inline]
    pub(crate) fn take_exchanged(&mut self, task: usize) -> bool {
        self.tasks.get_mut(task).is_some_and(|task| std::mem::replace(&mut task.exchanged, false))
    }

    /// When the next cycle of a task begins.
    pub(crate) fn next_cycle(&self, task: usize) -> Option<Instant> {
        let begins = |one: &&Departure| one.task == task && one.begins;
        self.departures.iter().find(begins).map(|one| one.next_at)
    }

    /// Whether a frame leaves at `now`.
    #[inline]
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        !self.left.is_empty() || self.next_at <= now
    }

    /// A frame came back.
    #[inline]
    pub(crate) fn received(
        &mut self,
        now: Instant,
        index: u32,
        withheld: bool,
        reply: &[u8],
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) {
        let live = self.live.load(Ordering::Relaxed);
        if self.frames.get(index as usize).is_none_or(|frame| frame.version != live) {
            self.catch_up(index);
        }
        let more = !self.left.is_empty() && self.is_leaving(index);
        let Some(frame) = self.frames.get_mut(index as usize) else { return };
        let Some(state) = self.tasks.get_mut(frame.task) else { return };
        state.came(&mut frame.out, more);
        if state.lost > 0 {
            state.found(frame.task, &self.line, events);
        }
        if let [only] = frame.datagrams.as_mut_slice()
            && let Some(wkc) = only.counter(reply)
            && only.is_usual(withheld, wkc)
        {
            frame.status.wrong_counter = 0;
            frame.status.input_toggle ^= frame.all;
            only.take(now, reply, &mut self.inputs);
            return;
        }
        let mut datagrams = frame.datagrams.iter_mut();
        while let Some(datagram) = datagrams.next() {
            let Some(wkc) = datagram.counter(reply) else { return };
            if !datagram.is_usual(withheld, wkc) {
                let behind = datagrams.len();
                let at = frame.datagrams.len() - 1 - behind;
                return self
                    .received_otherwise(now, index, at, withheld, reply, statistics, events);
            }
            datagram.take(now, reply, &mut self.inputs);
        }
        frame.status.wrong_counter = 0;
        frame.status.input_toggle ^= frame.all;
    }

    /// A frame's expectations are made anew, of who is present now.
    #[cold]
    fn catch_up(&mut self, index: u32) {
        self.refresh();
        let Self { plan, least, most, shares, inputs, version, .. } = self;
        if let Some(frame) = self.frames.get_mut(index as usize)
            && frame.version != *version
        {
            frame.version = *version;
            frame.take_over(plan, index, least, most, shares, inputs);
        }
    }

    /// The datagrams from `first` on: those before it were as they should be.
    #[inline(never)]
    #[allow(clippy::too_many_arguments, reason = "what is known of a frame that came back")]
    fn received_otherwise(
        &mut self,
        now: Instant,
        index: u32,
        first: usize,
        withheld: bool,
        reply: &[u8],
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) {
        let Some(frame) = self.frames.get_mut(index as usize) else { return };
        let mut toggled = FrameStatus::before(first);
        let (mut wrong, mut moved) = (0, 0);
        for (at, datagram) in frame.datagrams.iter_mut().enumerate().skip(first) {
            let bit = FrameStatus::bit(at);
            let Some(wkc) = datagram.counter(reply) else { return };
            if datagram.is_usual(withheld, wkc) {
                datagram.take(now, reply, &mut self.inputs);
                toggled |= bit;
            } else if datagram.role == Role::ProcessData {
                let place = Place { task: frame.task, frame: frame.number, datagram: at };
                if datagram.expected(withheld).fits(wkc) {
                    datagram.take(now, reply, &mut self.inputs);
                    toggled |= bit;
                    datagram.tell_good(place, events);
                } else {
                    wrong |= bit;
                    datagram.refuse(&mut self.inputs);
                    statistics.working_counter_errors += 1;
                    if datagram.told != Some(wkc) {
                        datagram.tell_wrong(place, withheld, wkc, events);
                        lock(&self.line).alert();
                    }
                }
            } else {
                datagram.good = true;
                toggled |= bit;
                let data = reply.get(datagram.data_at..).unwrap_or_default();
                let seen = Some((wkc, data.first().copied().unwrap_or(0)));
                let role = datagram.role;
                if role == Role::Presence {
                    if self.responding != seen {
                        self.responding = seen;
                        watch_line(&self.line, seen, events);
                    }
                } else if role == Role::ReferenceClock && wkc.0 > 0 {
                    let cycle = self.plan.tasks.get(frame.task).map(|task| task.cycle);
                    moved += self.steer.correction(now, data, cycle.unwrap_or_default());
                } else if role == Role::MailboxStates && wkc.0 > 0 {
                    let data = data.get(..datagram.len).unwrap_or_default();
                    self.mailboxes.take(index as usize, at, data);
                }
            }
        }
        frame.status.wrong_counter = wrong;
        frame.status.input_toggle ^= toggled;
        if moved != 0 {
            self.shift(moved);
        }
    }

    /// Whether frames of the same task leave after this one in the same cycle.
    #[cold]
    fn is_leaving(&self, index: u32) -> bool {
        let task = self.frames.get(index as usize).map(|frame| frame.task);
        self.departures.get(self.leaving).map(|departure| departure.task) == task
    }

    /// Moves all departures, by ns.
    fn shift(&mut self, by: i64) {
        for departure in &mut self.departures {
            let span = Span::ns(by.unsigned_abs());
            departure.next_at =
                if by < 0 { departure.next_at.before(span) } else { departure.next_at + span };
        }
        self.next_at = self.departures.iter().map(|one| one.next_at).min().unwrap_or(Instant::MAX);
    }

    /// A frame did not come back.
    pub(crate) fn lost(&mut self, index: u32, events: &mut impl FnMut(Event)) {
        let more = !self.left.is_empty() && self.is_leaving(index);
        let Some(frame) = self.frames.get_mut(index as usize) else { return };
        frame.status.wrong_counter = FrameStatus::WHOLE;
        for datagram in &mut frame.datagrams {
            datagram.refuse(&mut self.inputs);
        }
        let task = frame.task;
        let Some(state) = self.tasks.get_mut(task) else { return };
        state.came(&mut frame.out, more);
        state.lost += 1;
        if state.lost == LOST_IS_NEWS {
            events(Event::CyclicFramesLost { task });
            lock(&self.line).alert();
        }
    }

    /// Whether the last answer of a frame was not as it should be.
    pub(crate) fn is_bad(&self, index: u32) -> bool {
        self.frames.get(index as usize).is_some_and(|frame| frame.status.wrong_counter != 0)
    }

    /// How many answered the last broadcast read of the cycle.
    pub(crate) fn responding(&self) -> Option<WorkingCounter> {
        self.responding.map(|(count, _)| count)
    }
}

impl Frame {
    fn new(plan: &Plan, task: usize, number: usize) -> Self {
        let planned = &plan.tasks[task].frames[number];
        let (mut outputs, mut datagrams, mut carries) = (Runs::default(), Vec::new(), 0);
        for (at, (one, data_at)) in planned.datagrams.iter().zip(data_offsets(planned)).enumerate()
        {
            for owned in one.ownership.iter().filter(|one| one.direction == Direction::Outputs) {
                outputs.push(owned, data_at);
                carries |= FrameStatus::bit(at);
            }
            datagrams.push(Datagram::new(plan, one, data_at));
        }
        Self {
            task,
            number,
            outputs,
            datagrams,
            carries,
            all: FrameStatus::before(planned.datagrams.len()),
            version: u64::MAX,
            out: false,
            status: FrameStatus::default(),
        }
    }

    /// Takes over who serves process data.
    #[cold]
    fn take_over(
        &mut self,
        plan: &Plan,
        index: u32,
        least: &Presence,
        most: &Presence,
        shares: &mut [Share],
        inputs: &mut [u8],
    ) {
        let planned = plan.tasks.get(self.task).and_then(|task| task.frames.get(self.number));
        let Some(planned) = planned else { return };
        for (at, (datagram, one)) in self.datagrams.iter_mut().zip(&planned.datagrams).enumerate() {
            let last = Some((datagram.good_at, datagram.receipts));
            for owned in &one.ownership {
                let Some(share) = shares.get_mut(owned.device.index()) else { continue };
                // Who has inputs is told by the first datagram with some; who has none, by any.
                let first = share.datagrams.iter().find(|one| one.2);
                let mine = first.is_none_or(|one| (one.0, one.1) == (index as usize, at));
                let stopped = mine && share.serve(least.of(owned.device).inputs, last);
                if stopped {
                    clear_lost(plan, one, owned.device, inputs);
                }
            }
            datagram.refresh(one, least, most);
        }
    }
}

/// The broadcast read of the AL status tells how many are there and whether all is as it shall be.
#[cold]
fn watch_line(
    line: &Mutex<Line>,
    seen: Option<(WorkingCounter, u8)>,
    events: &mut impl FnMut(Event),
) {
    let Some((now, states)) = seen else { return };
    let states: OredStates = AlState::from_or(states);
    if let Some(before) = lock(line).broadcast(now, states) {
        events(Event::Responding { before, now });
    }
}

#[cfg(test)]
mod tests;
