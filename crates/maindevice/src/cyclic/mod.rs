//! The cyclic exchange of process data: a plain engine that allocates nothing once it runs.
//!
//! Each task of the plan sends its frames when its cycle begins. What comes back is judged datagram
//! by datagram against the expected working counter, which follows from who is present; inputs are
//! taken over only when it holds. What a SubDevice adds while it changes its state is not known: its
//! SyncManagers are on before it gives data. Until it has arrived the expectation is a range, so that
//! one SubDevice that comes back, or is stuck, does not stop the inputs of all others.
//!
//! [`send`] sends, [`receive`] takes in, [`copy_range`] copies, [`datagram`] judges, [`quality`] tells how good
//! and how old data are, [`application`] sees to it that old outputs are not sent as fresh ones, [`system_time_distribution`]
//! that clocks follow the reference clock and nothing else, [`dc_servo`] that the cycle does, [`network_time`] tells
//! programs that time, [`led_time`] leads the reference clock itself where it is not left alone.
//!
//! A frame that leaves or comes back is found once: all that sending and receiving need of it is in its
//! [`Frame`], all that is shared with those that leave together in their [`FrameBatch`].

mod application;
mod copy_range;
mod datagram;
mod dc_servo;
mod frame_batch;
mod led_time;
mod network_time;
mod quality;
mod receive;
mod send;
mod system_time_distribution;

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use linesman_config::plan::expect::Presence;
use linesman_config::plan::{FramePlan, Plan};
use linesman_proto::address::WorkingCounter;
use linesman_proto::sii::Direction;
use linesman_proto::time::{DcTime, Instant};

use self::application::Application;
use self::copy_range::CopyRanges;
use self::datagram::{Datagram, clear_lost};
use self::dc_servo::DcServo;
use self::frame_batch::{BatchFrame, FrameBatch, earliest, frame_batches};
use self::led_time::LedTime;
use self::network_time::{NetworkTime, base_tick};
use self::quality::Share;
use self::system_time_distribution::{ClockDatagram, ClockShiftDatagram, SystemTimeDistribution};
use crate::exchange::Exchange;
use crate::exchange::prebuilt::{Prebuilt, data_offsets};
use crate::executor::lock;
use crate::mailbox::{MailboxBits, MailboxQueues};
use crate::network_group::{GroupLead, NetworkGroup};
use crate::supervisor::DeviceTable;

pub use self::led_time::OutsideTime;
pub use self::network_time::TaskTimes;
pub use self::quality::{FrameStatus, Quality};

/// One frame of the plan.
#[derive(Debug)]
struct Frame {
    prebuilt: Prebuilt,
    /// Where outputs go into it.
    outputs: CopyRanges,
    /// Its outputs are withheld, as those of its whole task.
    withheld: bool,
    /// What [`FrameStatus::not_sent`] is when it is sent: the datagrams whose outputs are withheld.
    not_sent: u16,
    datagrams: Vec<Datagram>,
    /// The datagram that hands round the time of the reference clock.
    clock: Option<ClockDatagram>,
    /// The datagram that leads the reference clock.
    clock_shift: Option<ClockShiftDatagram>,
    /// More is to be done with it before it leaves than with most: it has such a datagram, or copies follow.
    more: bool,
    /// Bits of the datagrams that carry outputs, and of all.
    carries: u16,
    all: u16,
    /// Which version of the line's state its expectations are made of.
    version: u64,
    status: FrameStatus,
    /// With which frames it leaves.
    batch: usize,
    task: usize,
    /// Its number within the task, and among those of all tasks.
    number: usize,
    planned: usize,
}

/// The engine.
#[derive(Debug)]
pub(crate) struct Cyclic {
    plan: Arc<Plan>,
    device_table: Arc<Mutex<DeviceTable>>,
    /// The version of the line's state, to be looked at without a lock.
    live: Arc<AtomicU64>,
    batches: Vec<FrameBatch>,
    /// In the order of batches.
    frames: Vec<Frame>,
    /// When the next frame is due: now or before while some that leave together are left, else with the
    /// first batch.
    due: Instant,
    /// When the first batch is due.
    next_at: Instant,
    /// The frames that leave now.
    left: Range<usize>,
    /// When they are given up.
    deadline: Instant,
    /// How often the application has given the outputs of all tasks.
    given: u64,
    /// Outputs of all tasks are withheld after a link error.
    locked: bool,
    /// Frames lost in a row, by task; whether there are any.
    lost: Vec<u64>,
    losing: bool,
    /// Who surely serves process data, and who may.
    least: Presence,
    most: Presence,
    /// Which version of the line's state that is.
    version: u64,
    /// What the last broadcast read brought.
    responding: Option<(WorkingCounter, u8)>,
    shares: Vec<Share>,
    time_distribution: SystemTimeDistribution,
    dc_servo: DcServo,
    network_time: NetworkTime,
    led_time: Option<LedTime>,
    /// It leads other networks of the process.
    lead: Option<Arc<GroupLead>>,
    mailboxes: MailboxBits,
    pub(crate) outputs: Vec<u8>,
    pub(crate) inputs: Vec<u8>,
}

impl Cyclic {
    /// Gives its frames to the exchange, and begins at `now`.
    pub(crate) fn new(
        plan: Arc<Plan>,
        device_table: Arc<Mutex<DeviceTable>>,
        exchange: &mut Exchange,
        allowed_misses: Option<u32>,
        now: Instant,
    ) -> Self {
        let (batches, order) = frame_batches(&plan, Application::new(allowed_misses), now);
        let planned = |one: &BatchFrame| plan.tasks[one.task].frames[one.number].clone();
        let prebuilt = exchange.prebuild(order.iter().map(planned));
        let frame = |(one, prebuilt): (&BatchFrame, Prebuilt)| {
            Frame::new(&plan, one, &plan.tasks[one.task].frames[one.number], prebuilt)
        };
        let frames: Vec<Frame> = order.iter().zip(prebuilt).map(frame).collect();
        let next_at = earliest(&batches);
        let live = lock(&device_table).live_version();
        let mut cyclic = Self {
            batches,
            frames,
            due: next_at,
            next_at,
            left: 0..0,
            deadline: now,
            given: 0,
            locked: false,
            lost: vec![0; plan.tasks.len()],
            losing: false,
            least: Presence::none(plan.devices.len()),
            most: Presence::none(plan.devices.len()),
            version: u64::MAX,
            responding: None,
            shares: quality::shares(&plan, &order),
            time_distribution: SystemTimeDistribution::default(),
            dc_servo: DcServo::default(),
            network_time: NetworkTime::default(),
            led_time: None,
            lead: None,
            mailboxes: MailboxBits::default(),
            outputs: vec![0; plan.outputs_len],
            inputs: vec![0; plan.inputs_len],
            plan,
            device_table,
            live,
        };
        cyclic.refresh();
        cyclic
    }

    /// Tells those who serve mailboxes which of them hold something, where the plan reads that.
    pub(crate) fn serve(&mut self, mailboxes: MailboxQueues) {
        self.mailboxes = MailboxBits::new(&self.plan, mailboxes);
    }

    /// Leads its reference clock to the time that the plan wants, or that of the group that it follows.
    pub(crate) fn lead_reference(&mut self, follows: Option<NetworkGroup>, epoch: DcTime) {
        let (source, stamps) = (self.plan.time_source, self.plan.time_stamps);
        self.led_time = LedTime::new(source, stamps, follows, epoch);
        if self.led_time.is_none() && source.is_none() {
            // What another tool has planned goes out as it was planned.
            self.frames.iter_mut().for_each(|frame| frame.clock_shift = None);
        }
    }

    /// Leads other networks of the process.
    pub(crate) fn lead_group(&mut self, lead: Option<Arc<GroupLead>>) {
        self.lead = lead;
    }

    /// A program tells a time outside that was at `at`.
    pub(crate) fn take_outside_time(&mut self, at: Instant, time: DcTime) {
        let cycle = self.plan.tasks.first().map(|task| task.cycle).unwrap_or_default();
        let network = self.network_time.at(at);
        if let (Some(led), Some(network), None) =
            (&mut self.led_time, network, self.plan.time_stamps)
        {
            led.take_pair(network.0, time.0.wrapping_sub(network.0) as i64, cycle);
        }
    }

    /// Lead over the network that leads its group, in ns, if it follows one.
    pub(crate) fn ahead_of_group(&self) -> Option<i64> {
        self.led_time.as_ref()?.ahead_of_group()
    }

    /// How far the clock outside is ahead, if there is one.
    pub(crate) fn outside_time(&self) -> Option<OutsideTime> {
        self.led_time.as_ref()?.outside()
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
        let mut device_table = lock(&self.device_table);
        self.version = device_table.version();
        device_table.take_changes(&mut self.least, &mut self.most);
        let clock = device_table.clock();
        self.time_distribution.learn(clock);
        if self.dc_servo.set_base(clock.base) {
            self.network_time.forget();
            if let Some(led) = &mut self.led_time {
                led.restart();
            }
        }
    }

    /// When the next frames are due; [`Instant::MAX`]: never.
    #[inline]
    pub(crate) fn due(&self) -> Instant {
        self.due
    }

    /// The application gives its outputs: all of them, or those of one task.
    #[inline]
    pub(crate) fn give_outputs(&mut self, task: Option<usize>) {
        match task {
            Some(task) => {
                let mine = |one: &&mut FrameBatch| one.task == task && one.begins;
                self.batches.iter_mut().filter(mine).for_each(|one| one.application.give());
            }
            None => self.given += 1,
        }
    }

    /// Whether all frames of a task have come back, or were given up, since this was asked last.
    #[inline]
    pub(crate) fn take_exchanged(&mut self, task: usize) -> bool {
        let mine = self.batches.iter_mut().filter(|one| one.task == task);
        mine.fold(false, |any, one| any | std::mem::replace(&mut one.exchanged, false))
    }

    /// When the next cycle of a task begins.
    pub(crate) fn next_cycle(&self, task: usize) -> Option<Instant> {
        let begins = |one: &&FrameBatch| one.task == task && one.begins;
        self.batches.iter().find(begins).map(|one| one.next_at)
    }

    /// The time of the network at a time of the run; `None` before the reference clock has told it.
    pub(crate) fn network_time(&self, at: Instant) -> Option<DcTime> {
        self.network_time.at(at)
    }

    /// When the latest cycle of a task began that has begun by `now`, and the last base tick since then.
    pub(crate) fn begun(&self, task: usize, now: Instant) -> Option<(Instant, Instant)> {
        let begins = |one: &&FrameBatch| one.task == task && one.begins;
        let batch = self.batches.iter().find(begins)?;
        let start = if batch.next_at <= now { batch.next_at } else { batch.began_at.min(now) };
        Some((start, base_tick(start, now, batch.cycle, self.plan.base_tick)))
    }

    /// Whether a frame leaves at `now`.
    #[inline]
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        self.due <= now
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
    fn new(plan: &Plan, one: &BatchFrame, planned: &FramePlan, prebuilt: Prebuilt) -> Self {
        let (mut outputs, mut datagrams, mut carries) = (CopyRanges::default(), Vec::new(), 0);
        let (mut clock, mut clock_shift) = (None, None);
        for (at, (one, data_at)) in planned.datagrams.iter().zip(data_offsets(planned)).enumerate()
        {
            for owned in one.ownership.iter().filter(|one| one.direction == Direction::Outputs) {
                outputs.push(owned, data_at);
                carries |= FrameStatus::bit(at);
            }
            clock = clock.or(ClockDatagram::new(one, data_at));
            clock_shift = clock_shift.or(ClockShiftDatagram::new(one, data_at));
            datagrams.push(Datagram::new(plan, one, data_at));
        }
        let more = clock.is_some() || clock_shift.is_some() || prebuilt.is_copied();
        Self {
            prebuilt,
            outputs,
            withheld: false,
            not_sent: 0,
            datagrams,
            clock,
            clock_shift,
            more,
            carries,
            all: FrameStatus::before(planned.datagrams.len()),
            version: u64::MAX,
            status: FrameStatus::default(),
            batch: one.batch,
            task: one.task,
            number: one.number,
            planned: one.planned,
        }
    }

    /// Its outputs must not be sent as fresh ones from now on, or may again.
    fn withhold(&mut self, withheld: bool) {
        self.withheld = withheld;
        self.prebuilt.withhold(withheld);
        self.not_sent = if withheld { self.carries } else { 0 };
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
            let last = Some((datagram.good_at(), datagram.receipts));
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

#[cfg(test)]
mod tests;
