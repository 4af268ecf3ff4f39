//! Cyclic frames leave one by one, when they are asked for: no list of them has to be kept.

use linesman_proto::time::Instant;

use super::{Cyclic, FrameStatus};
use crate::event::Event;
use crate::exchange::{Exchange, Order};
use crate::statistics::Statistics;

impl Cyclic {
    /// Sends the next frame of those whose cycle has begun: it is written into `buffer`. Gives its
    /// length; `None` when all have left.
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
            if now < self.next_at {
                return None;
            }
            self.depart(now, statistics, events)?;
        }
        let index = *self.order.get(self.left.start)?;
        self.left.start += 1;
        let frame = self.frames.get_mut(index as usize)?;
        let task = self.tasks.get_mut(frame.task)?;
        let withheld = task.application.is_withheld();
        let was_out = std::mem::replace(&mut frame.out, true);
        task.out += u32::from(!was_out);
        frame.status.not_sent = if withheld { frame.carries } else { 0 };
        let order = Order { deadline: self.deadline, withheld };
        let (runs, outputs) = (&frame.outputs, &self.outputs);
        let fill = |bytes: &mut [u8]| match withheld {
            false => runs.fill(outputs, bytes),
            true => runs.clear_frame(bytes),
        };
        let sent = exchange.send_cyclic(index, order, fill, buffer);
        if sent.is_none() {
            if !was_out {
                frame.out = false;
                task.out -= 1;
            }
            self.left.start -= 1;
            self.leave_out(statistics);
        }
        sent
    }

    /// Too many frames are out: those that were to leave do not.
    #[cold]
    fn leave_out(&mut self, statistics: &mut Statistics) {
        let Some(departure) = self.departures.get(self.leaving) else { return };
        for index in self.order.get(self.left.clone()).unwrap_or_default() {
            let Some(frame) = self.frames.get_mut(*index as usize) else { continue };
            frame.status.not_sent = FrameStatus::WHOLE;
            statistics.cyclic_unsent += 1;
        }
        if let Some(task) = self.tasks.get_mut(departure.task) {
            task.exchanged |= task.out == 0;
        }
        self.left = 0..0;
    }

    /// The first departure that is due: its frames leave from now on.
    #[inline]
    fn depart(
        &mut self,
        now: Instant,
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) -> Option<()> {
        let (at, behind) = match self.departures.as_mut_slice() {
            [only] => {
                let behind = only.advance(now);
                self.next_at = only.next_at;
                (0, behind)
            }
            _ => self.first_due(now),
        };
        let departure = self.departures.get(at)?;
        self.leaving = at;
        self.left = departure.frames.clone();
        self.deadline = now + departure.cycle;
        if departure.begins {
            statistics.cycles += 1;
            if behind > 0 {
                statistics.cycles_missed += behind;
            }
            let task = departure.task;
            let application = self.tasks.get_mut(task).map(|task| &mut task.application);
            if let Some(judged) = application.and_then(|one| one.begin_cycle(self.given)) {
                judged.tell(task, statistics, events);
            }
        }
        Some(())
    }

    /// Which of several departures is due, and how many cycles of it were slept through. There is one:
    /// [`Cyclic::next_at`] has come.
    #[inline(never)]
    fn first_due(&mut self, now: Instant) -> (usize, u64) {
        let at = self.departures.iter().position(|one| one.next_at <= now).unwrap_or(usize::MAX);
        let behind = self.departures.get_mut(at).map_or(0, |one| one.advance(now));
        self.next_at = self.departures.iter().map(|one| one.next_at).min().unwrap_or(Instant::MAX);
        (at, behind)
    }
}
