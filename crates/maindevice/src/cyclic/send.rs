//! Cyclic frames leave one by one, when they are asked for: no list of them has to be kept.

use linesman_proto::time::Instant;

use super::frame_batch::{FrameBatch, earliest};
use super::{Cyclic, FrameStatus};
use crate::event::Event;
use crate::exchange::{Exchange, Order};
use crate::statistics::Statistics;

impl Cyclic {
    /// Sends the next frame of those whose cycle has begun: it is written into `buffer`. Gives its
    /// length; `None` when all have left. To be asked when [`Cyclic::is_due`].
    #[inline]
    pub(crate) fn send_next(
        &mut self,
        now: Instant,
        exchange: &mut Exchange,
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
        buffer: &mut [u8],
    ) -> Option<usize> {
        if self.left.is_empty() {
            self.depart(now, statistics, events)?;
        }
        if exchange.is_next_taken() {
            return self.send_past_taken(exchange, statistics, buffer);
        }
        self.send(exchange, statistics, buffer)
    }

    /// Sends the next frame of those that are left, in the slot whose turn it is.
    #[inline(always)]
    fn send(
        &mut self,
        exchange: &mut Exchange,
        statistics: &mut Statistics,
        buffer: &mut [u8],
    ) -> Option<usize> {
        let index = self.left.start;
        let frame = self.frames.get_mut(index)?;
        let Some(sent) = buffer.get_mut(..frame.prebuilt.len()) else {
            return self.leave_out(statistics);
        };
        let order =
            Order { frame: index as u32, deadline: self.deadline, withheld: frame.withheld };
        let number = exchange.begin_cyclic(order, &frame.prebuilt);
        self.left.start = index + 1;
        if self.left.is_empty() {
            self.due = self.next_at;
        }
        frame.status.not_sent = frame.not_sent;
        frame.prebuilt.write(number, sent);
        match frame.withheld {
            false => frame.outputs.fill(&self.outputs, sent),
            true => frame.outputs.clear_frame(sent),
        }
        let len = sent.len();
        if frame.more {
            self.complete(index, number, exchange, sent);
        }
        Some(len)
    }

    /// What few frames need: the time of the reference clock, and to be kept for the copies that follow.
    #[inline(never)]
    fn complete(&mut self, index: usize, number: u32, exchange: &mut Exchange, sent: &mut [u8]) {
        let Self { frames, batches, time_distribution, deadline, network_time, .. } = self;
        let Some(frame) = frames.get(index) else { return };
        let batch = batches.get(frame.batch);
        let mut second_copy = None;
        if let (Some(clock), Some(batch)) = (&frame.clock, batch) {
            let [first, ..] = number.to_le_bytes();
            let departed = deadline.before(batch.cycle);
            second_copy = time_distribution.write(clock, first, departed, sent);
        }
        if let (Some(shift), Some(batch)) = (&frame.clock_shift, batch) {
            let departed = deadline.before(batch.cycle);
            let led = self.led_time.as_mut().filter(|_| time_distribution.is_handed());
            let time =
                led.and_then(|led| led.time(departed, network_time, &self.inputs, batch.cycle));
            shift.write(time, sent);
        }
        if frame.prebuilt.is_copied() {
            exchange.keep_copies(index as u32, number, sent, second_copy);
        }
    }

    /// The slot whose turn it is still waits for its answer: the frame takes the next one that is free.
    #[cold]
    fn send_past_taken(
        &mut self,
        exchange: &mut Exchange,
        statistics: &mut Statistics,
        buffer: &mut [u8],
    ) -> Option<usize> {
        match exchange.skip_taken() {
            true => self.send(exchange, statistics, buffer),
            false => self.leave_out(statistics),
        }
    }

    /// Too many frames are out: those that were to leave do not.
    #[cold]
    fn leave_out(&mut self, statistics: &mut Statistics) -> Option<usize> {
        for index in std::mem::take(&mut self.left) {
            let Some(frame) = self.frames.get_mut(index) else { continue };
            frame.status.not_sent = FrameStatus::WHOLE;
            statistics.cyclic_unsent += 1;
            let batch = frame.batch;
            self.came_of(batch);
        }
        self.due = self.next_at;
        None
    }

    /// The first batch that is due: its frames leave from now on.
    #[inline]
    fn depart(
        &mut self,
        now: Instant,
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) -> Option<()> {
        let (batch, behind) = match self.batches.as_mut_slice() {
            [only] => {
                let behind = only.depart(now);
                self.next_at = only.next_at;
                (only, behind)
            }
            several => first_due(several, now, &mut self.next_at)?,
        };
        self.left = batch.frames.clone();
        self.deadline = now + batch.cycle;
        if batch.begins {
            statistics.cycles += 1;
            if behind > 0 {
                statistics.cycles_missed += behind;
            }
            if let Some(judged) = batch.application.begin_cycle(self.given) {
                let task = batch.task;
                judged.tell(task, statistics, events);
                if judged.changed && !self.locked {
                    self.withhold(task, judged.withheld);
                }
            }
        }
        Some(())
    }

    /// Withholds the outputs of all tasks, or ends that: those of an application that is late stay withheld.
    #[cold]
    pub(crate) fn set_locked(&mut self, locked: bool) {
        self.locked = locked;
        let late = |one: &FrameBatch| one.begins && one.application.is_withheld();
        let late: Vec<usize> =
            self.batches.iter().filter(|one| late(one)).map(|one| one.task).collect();
        for task in 0..self.plan.tasks.len() {
            self.withhold(task, locked || late.contains(&task));
        }
    }

    /// Outputs of a task must not be sent as fresh ones from now on, or may again.
    #[cold]
    fn withhold(&mut self, task: usize, withheld: bool) {
        let mine = self.frames.iter_mut().filter(|frame| frame.task == task);
        mine.for_each(|frame| frame.withhold(withheld));
    }
}

/// Which of several batches is due, and how many cycles of it were slept through.
#[inline(never)]
fn first_due<'a>(
    batches: &'a mut [FrameBatch],
    now: Instant,
    next_at: &mut Instant,
) -> Option<(&'a mut FrameBatch, u64)> {
    let at = batches.iter().position(|one| one.next_at <= now)?;
    let behind = batches[at].depart(now);
    *next_at = earliest(batches);
    Some((&mut batches[at], behind))
}
