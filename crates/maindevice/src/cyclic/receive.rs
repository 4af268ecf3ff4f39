//! Frames that come back, or do not: whether all is as it should be, and what follows if not.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use linesman_config::plan::Role;
use linesman_proto::address::WorkingCounter;
use linesman_proto::state::{AlState, OredStates};
use linesman_proto::time::{Instant, Span};

use super::datagram::Place;
use super::frame_batch::{LOST_IS_NEWS, earliest};
use super::system_time_distribution::Brought;
use super::{Cyclic, FrameStatus};
use crate::event::Event;
use crate::exchange::Exchange;
use crate::exchange::prebuilt::FIRST_INDEX;
use crate::executor::lock;
use crate::statistics::Statistics;
use crate::supervisor::DeviceTable;

impl Cyclic {
    /// Takes a frame if it is what comes back nearly always: one of ours, as it was sent, that is waited
    /// for. Says whether it was; if not, nothing has changed.
    #[inline]
    pub(crate) fn receive(
        &mut self,
        now: Instant,
        reply: &[u8],
        exchange: &mut Exchange,
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) -> bool {
        let Some(awaited) = exchange.awaited(reply) else { return false };
        let Some(frame) = self.frames.get_mut(awaited.frame as usize) else { return false };
        let withheld = awaited.withheld;
        if !frame.prebuilt.is_like(reply, awaited.number, withheld) {
            return false;
        }
        exchange.answered(awaited.slot);
        // Nearly always it is one datagram, and all is well: then that is all there is to do.
        if frame.version == self.live.load(Ordering::Relaxed)
            && !self.losing
            && let [batch] = self.batches.as_mut_slice()
            && let [only] = frame.datagrams.as_mut_slice()
            && let Some(wkc) = only.counter(reply)
            && only.is_usual(withheld, wkc)
        {
            batch.exchanged |= batch.came();
            frame.status.wrong_counter = 0;
            frame.status.input_toggle ^= frame.all;
            only.take(now, reply, &mut self.inputs);
        } else {
            self.received(now, awaited.frame, withheld, reply, statistics, events);
        }
        true
    }

    /// A frame came back.
    #[inline(never)]
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
        let Some(frame) = self.frames.get(index as usize) else { return };
        let (task, batch) = (frame.task, frame.batch);
        self.came_of(batch);
        if self.losing {
            self.found(task, events);
        }
        self.judge(now, index, withheld, reply, statistics, events);
    }

    /// What a frame has brought that came back, perhaps not for the first time.
    #[inline]
    pub(crate) fn judge(
        &mut self,
        now: Instant,
        index: u32,
        withheld: bool,
        reply: &[u8],
        statistics: &mut Statistics,
        events: &mut impl FnMut(Event),
    ) {
        let Some(frame) = self.frames.get_mut(index as usize) else { return };
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

    /// A frame of a batch is on its way no longer.
    #[inline]
    pub(super) fn came_of(&mut self, batch: usize) {
        let Some(one) = self.batches.get_mut(batch) else { return };
        if one.came() {
            let task = one.task;
            // Others of the same task may have left a little before.
            let out = self.batches.iter().any(|one| one.task == task && one.is_out());
            if let Some(one) = self.batches.get_mut(batch) {
                one.exchanged |= !out;
            }
        }
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
                        lock(&self.device_table).alert();
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
                        watch_line(&self.device_table, seen, events);
                    }
                } else if role == Role::ReferenceClock
                    && let Some(clock) = frame.clock.filter(|clock| clock.is_at(datagram.data_at))
                {
                    let index = reply.get(FIRST_INDEX).copied().unwrap_or_default();
                    let cycle = self.plan.tasks.get(frame.task).map(|task| task.cycle);
                    moved += match self.time_distribution.read(&clock, index, wkc, reply) {
                        Brought::Time => {
                            let cycle = cycle.unwrap_or_default();
                            let by = self.dc_servo.correction(now, data, cycle);
                            let departed = self.time_distribution.departed();
                            if let Some((departed, time)) = departed.zip(self.dc_servo.shown()) {
                                let speed = self.dc_servo.speed(cycle);
                                self.network_time.take(departed, time, speed);
                                if let Some((lead, pair)) =
                                    self.lead.as_ref().zip(self.network_time.pair())
                                {
                                    lead.tell(pair);
                                }
                            }
                            by
                        }
                        Brought::Nothing => self.dc_servo.as_before(cycle.unwrap_or_default()),
                    };
                } else if role == Role::MailboxStates && wkc.0 > 0 {
                    let data = data.get(..datagram.len).unwrap_or_default();
                    self.mailboxes.take(frame.planned, at, data);
                }
            }
        }
        frame.status.wrong_counter = wrong;
        frame.status.input_toggle ^= toggled;
        if moved != 0 {
            self.shift(moved);
        }
    }

    /// Moves all batches, by ns.
    fn shift(&mut self, by: i64) {
        for batch in &mut self.batches {
            let span = Span::ns(by.unsigned_abs());
            batch.next_at = if by < 0 { batch.next_at.before(span) } else { batch.next_at + span };
        }
        self.next_at = earliest(&self.batches);
        if self.left.is_empty() {
            self.due = self.next_at;
        }
    }

    /// A frame did not come back.
    pub(crate) fn lost(&mut self, index: u32, events: &mut impl FnMut(Event)) {
        let Some(frame) = self.frames.get_mut(index as usize) else { return };
        frame.status.wrong_counter = FrameStatus::WHOLE;
        for datagram in &mut frame.datagrams {
            datagram.refuse(&mut self.inputs);
        }
        let (task, batch) = (frame.task, frame.batch);
        self.came_of(batch);
        let Some(lost) = self.lost.get_mut(task) else { return };
        *lost += 1;
        self.losing = true;
        if *lost == LOST_IS_NEWS {
            events(Event::CyclicFramesLost { task });
            lock(&self.device_table).alert();
        }
    }

    /// A frame of a task came back, while those of some were lost.
    #[cold]
    fn found(&mut self, task: usize, events: &mut impl FnMut(Event)) {
        let lost = self.lost.get_mut(task).map_or(0, std::mem::take);
        self.losing = self.lost.iter().any(|lost| *lost > 0);
        if lost >= LOST_IS_NEWS {
            events(Event::CyclicFramesBack { task, lost });
            lock(&self.device_table).alert();
        }
    }
}

/// The broadcast read of the AL status tells how many are there and whether all is as it shall be.
#[cold]
fn watch_line(
    device_table: &Mutex<DeviceTable>,
    seen: Option<(WorkingCounter, u8)>,
    events: &mut impl FnMut(Event),
) {
    let Some((now, states)) = seen else { return };
    let states: OredStates = AlState::from_or(states);
    if let Some(before) = lock(device_table).broadcast(now, states) {
        events(Event::Responding { before, now });
    }
}
