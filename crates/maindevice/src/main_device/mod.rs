//! The engine: what comes in, what goes out. What its user can ask of it is in `command`.

mod acyclic_rx;
mod command;
mod io_lock;
mod time;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use linesman_config::plan::Plan;
use linesman_proto::address::{DeviceId, Network, Path, WorkingCounter};
use linesman_proto::ethernet::{MAX_LEN, MIN_LEN};
use linesman_proto::frame::FrameView;
use linesman_proto::frame::size::{BYTE_NS, WIRE_OVERHEAD};
use linesman_proto::time::Instant;

use self::io_lock::CardStates;
use crate::cyclic::{Cyclic, FrameStatus, Quality};
use crate::event::Event;
use crate::exchange::{
    DatagramData, Exchange, ExchangeError, Purpose, Queued, Reply, Request, SlotState, Ticket,
    Transmit,
};
use crate::executor::{Executor, Wire, lock};
use crate::mailbox::MailboxQueues;
use crate::network_group::{GroupLead, GroupTurn, NetworkGroup};
use crate::options::Options;
use crate::procedure::scan::ScanCache;
use crate::service::ServiceOnly;
use crate::statistics::Statistics;
use crate::supervisor::DeviceTable;
use crate::watch::NetworkStatus;

pub use command::ProbeRequest;

/// The MainDevice of one network.
///
/// After each `handle_*` and each command, fetch frames until [`MainDevice::poll_transmit`] gives
/// none and events until [`MainDevice::poll_event`] gives none; call
/// [`MainDevice::handle_timeout`] when [`MainDevice::poll_timeout`] has come.
#[derive(Debug)]
pub struct MainDevice {
    network: Network,
    options: Arc<Options>,
    exchange: Exchange,
    executor: Executor,
    statistics: Statistics,
    /// What is being done: one command at a time.
    control: Option<Wire>,
    /// Probes, which outlive commands.
    aside: Wire,
    running: Option<RunningPlan>,
    /// SubDevices that are served without being driven.
    service_only: Option<ServiceOnly>,
    /// Who the last scan has found: a plan that starts right behind it need not ask again.
    scan_cache: Arc<Mutex<Option<ScanCache>>>,
    next_service: u64,
    /// It leads the other networks of the process.
    lead: Option<Arc<GroupLead>>,
    /// Until it begins, those that come behind it in its group wait.
    turn: Option<GroupTurn>,
    /// The cards, and whether outputs are locked.
    cards: CardStates,
    /// Requests on their way from procedures to the exchange.
    submitted: VecDeque<(Ticket, Request)>,
    /// How many frames of procedures may still go out in this cycle.
    acyclic_left: usize,
}

#[derive(Debug)]
struct RunningPlan {
    cyclic: Cyclic,
    plan: Arc<Plan>,
    device_table: Arc<Mutex<DeviceTable>>,
    mailboxes: MailboxQueues,
    network_status: NetworkStatus,
}

impl MainDevice {
    /// A MainDevice that does nothing yet.
    #[must_use]
    pub fn new(network: Network, options: Options) -> Self {
        let mut executor = Executor::new();
        let aside = executor.group(options.repeats);
        let turn = options.group.as_ref().map(NetworkGroup::turn);
        Self {
            network,
            exchange: Exchange::new(options.sources, options.ring, options.patience),
            options: Arc::new(options),
            executor,
            statistics: Statistics::default(),
            control: None,
            aside,
            running: None,
            service_only: None,
            scan_cache: Arc::default(),
            next_service: 0,
            lead: None,
            turn,
            cards: CardStates::default(),
            submitted: VecDeque::new(),
            acyclic_left: 0,
        }
    }

    /// Which network it drives.
    #[must_use]
    pub fn network(&self) -> Network {
        self.network
    }

    // ---- frames and time ----

    /// The next frame to be sent, written into `buffer`, which must hold 1514 bytes.
    #[inline]
    pub fn poll_transmit(&mut self, now: Instant, buffer: &mut [u8]) -> Option<Transmit> {
        if !self.exchange.has_outgoing()
            && let Some(len) = self.transmit_cyclic(now, buffer)
        {
            return Some(Transmit { at: now, path: Path::A, len });
        }
        if self.executor.has_news() || self.exchange.has_any() {
            return self.transmit_other(now, buffer);
        }
        None
    }

    /// Whether [`MainDevice::poll_transmit`] may give a frame: false saves asking.
    #[inline]
    #[must_use]
    pub fn may_transmit(&self, now: Instant) -> bool {
        self.running.as_ref().is_some_and(|running| running.cyclic.is_due(now))
            || self.executor.has_news()
            || self.exchange.has_any()
    }

    /// The next frame of those whose cycle has begun: its length.
    #[inline(never)]
    fn transmit_cyclic(&mut self, now: Instant, buffer: &mut [u8]) -> Option<usize> {
        let Self { running, exchange, statistics, executor, .. } = self;
        let cyclic = &mut running.as_mut()?.cyclic;
        if !cyclic.is_due(now) {
            return None;
        }
        let emit = &mut |event| executor.emit(event);
        let len = cyclic.send_next(now, exchange, statistics, emit, buffer)?;
        self.acyclic_left = self.options.frames_at_once;
        self.statistics.frames_sent += 1;
        self.statistics.cyclic_sent += 1;
        Some(len)
    }

    /// A further copy of a cyclic frame, or a frame of procedures.
    #[inline(never)]
    fn transmit_other(&mut self, now: Instant, buffer: &mut [u8]) -> Option<Transmit> {
        self.executor.advance(now);
        self.submit();
        if !self.exchange.has_outgoing() {
            if !self.exchange.has_queued() {
                return None;
            }
            self.send_acyclic(now);
        }
        let (transmit, purpose) = self.exchange.poll_transmit(now, buffer)?;
        self.statistics.frames_sent += 1;
        self.statistics.cyclic_sent += u64::from(matches!(purpose, Purpose::Cyclic { .. }));
        Some(transmit)
    }

    /// Packs requests of procedures: beside a cycle so many frames each cycle, and none so long that
    /// it would still hold the wire when the next cycle begins.
    fn send_acyclic(&mut self, now: Instant) {
        if self.exchange.acyclic_out() >= self.options.frames_at_once {
            return;
        }
        let (mut room, mut left) = (MAX_LEN, self.acyclic_left);
        // Beside process data so many a cycle; before, as fast as they come back.
        let settled = |running: &&RunningPlan| lock(&running.device_table).all_have_been_reached();
        if let Some(running) = self.running.as_ref().filter(settled) {
            left = match left.checked_sub(1) {
                Some(left) => left,
                None => return,
            };
            let until = running.cyclic.due().since(now).as_nanos() / BYTE_NS;
            room = usize::try_from(until).unwrap_or(MAX_LEN);
            room = room.saturating_sub(WIRE_OVERHEAD).min(MAX_LEN);
            // Too late in this cycle, unless the cycle is too short for any frame at all.
            if room < MIN_LEN && self.acyclic_left < self.options.frames_at_once {
                return;
            }
        }
        if self.exchange.send_acyclic(now, room) {
            self.acyclic_left = left;
        }
    }

    #[inline]
    fn submit(&mut self) {
        if self.executor.take_news() {
            self.submit_news();
        }
    }

    fn submit_news(&mut self) {
        let mut shared = self.executor.shared();
        std::mem::swap(&mut shared.submitted, &mut self.submitted);
        let cancelled = std::mem::take(&mut shared.cancelled);
        drop(shared);
        while let Some((ticket, request)) = self.submitted.pop_front() {
            if let Err(queued) = self.exchange.submit(Queued { ticket, request, frames: 0 }) {
                self.fail(queued);
            }
        }
        if !cancelled.is_empty() {
            self.exchange.forget(|ticket| cancelled.contains(&ticket));
        }
    }

    /// A frame has arrived at a card, with a good check sequence. Nothing is given up here, so that a
    /// frame which was fetched together with this one, late, still counts.
    #[inline(never)]
    pub fn handle_frame(&mut self, now: Instant, path: Path, frame: &[u8]) {
        self.executor.advance(now);
        if self.receive_cyclic(now, frame) {
            self.statistics.frames_received += 1;
        } else {
            self.receive_unusual(now, path, frame);
        }
        self.work();
    }

    /// Takes a frame if it is a cyclic one as it comes back nearly always.
    #[inline]
    fn receive_cyclic(&mut self, now: Instant, frame: &[u8]) -> bool {
        let Some(RunningPlan { cyclic, .. }) = &mut self.running else { return false };
        let (executor, statistics) = (&self.executor, &mut self.statistics);
        let emit = &mut |event| executor.emit(event);
        cyclic.receive(now, frame, &mut self.exchange, statistics, emit)
    }

    /// Time has come to `now`. Hand over frames that have arrived first: whatever is overdue then is
    /// given up.
    #[inline]
    pub fn handle_timeout(&mut self, now: Instant) {
        self.executor.advance(now);
        if self.exchange.earliest() <= now {
            self.expire(now);
        }
        if self.cards.is_forgiven(now) {
            self.forgive_send_failures();
        }
        self.work();
    }

    #[cold]
    fn expire(&mut self, now: Instant) {
        while let Some(slot) = self.exchange.expire(now) {
            if self.exchange.slot(slot).state == SlotState::Answered {
                self.complete(now, slot, &[]);
            } else {
                self.give_up(slot);
            }
        }
    }

    /// Runs whoever is ready.
    #[inline]
    fn work(&mut self) {
        if self.executor.has_wake_flag() {
            self.work_on();
        }
    }

    #[inline(never)]
    fn work_on(&mut self) {
        self.executor.run();
        self.submit();
        if let Some(running) = &mut self.running {
            running.cyclic.refresh();
        }
    }

    /// All that comes back of a frame is back; `last` is what came back last.
    fn complete(&mut self, now: Instant, slot: u8, last: &[u8]) {
        match self.exchange.slot(slot).purpose {
            Purpose::Cyclic { frame } => {
                let Some(running) = &mut self.running else { return };
                let reply = self.exchange.answer(slot, last);
                let withheld = self.exchange.slot(slot).withheld;
                let (shared, statistics) = (&self.executor, &mut self.statistics);
                let emit = &mut |event| shared.emit(event);
                running.cyclic.received(now, frame, withheld, reply, statistics, emit);
            }
            Purpose::Acyclic => self.complete_acyclic(slot, last),
        }
    }

    #[inline(never)]
    fn complete_acyclic(&mut self, slot: u8, last: &[u8]) {
        let mut requests = self.exchange.take_requests(slot);
        if let Ok(view) = FrameView::parse(self.exchange.answer(slot, last)) {
            let datagrams = view.datagrams().map_while(Result::ok);
            for (queued, datagram) in requests.drain(..).zip(datagrams) {
                let data = DatagramData::from_slice(datagram.data());
                self.executor.answer(queued.ticket, Ok(Reply { wkc: datagram.wkc(), data }));
            }
        }
        self.exchange.give_back(slot, requests);
    }

    fn give_up(&mut self, slot: u8) {
        // One that came back without its end has been counted as that.
        self.statistics.frames_lost += u64::from(!self.exchange.slot(slot).truncated);
        match self.exchange.slot(slot).purpose {
            Purpose::Cyclic { frame } => {
                self.statistics.cyclic_lost += 1;
                let Some(running) = &mut self.running else { return };
                let shared = &self.executor;
                running.cyclic.lost(frame, &mut |event| shared.emit(event));
            }
            Purpose::Acyclic => {
                self.statistics.queued_lost += u64::from(!self.exchange.slot(slot).truncated);
                let mut requests = self.exchange.take_requests(slot);
                for queued in requests.drain(..) {
                    match self.exchange.again(queued) {
                        None => self.statistics.repeats += 1,
                        Some(queued) => self.fail(queued),
                    }
                }
                self.exchange.give_back(slot, requests);
            }
        }
    }

    fn fail(&mut self, queued: Queued) {
        let access = queued.request.access();
        let (frames, patience) = (queued.frames, self.exchange.patience());
        let error = ExchangeError::NoReply { access, frames, patience };
        let ticket: Ticket = queued.ticket;
        self.executor.answer(ticket, Err(error));
    }

    /// When [`MainDevice::handle_timeout`] is to be called, if nothing comes before.
    #[inline]
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let cycle = self.running.as_ref().map_or(Instant::MAX, |running| running.cyclic.due());
        let first = cycle.min(self.exchange.earliest()).min(self.executor.first_timer());
        (first != Instant::MAX).then_some(first)
    }

    /// When the next cyclic frames are due.
    #[inline]
    #[must_use]
    pub fn poll_cycle_timeout(&self) -> Option<Instant> {
        let next = self.running.as_ref()?.cyclic.due();
        (next != Instant::MAX).then_some(next)
    }

    /// What has happened, oldest first.
    #[inline]
    pub fn poll_event(&mut self) -> Option<Event> {
        let event = self.executor.poll_event()?;
        if let Some(running) = &mut self.running {
            running.network_status.handle_event(self.executor.now(), &event);
        }
        Some(event)
    }

    // ---- what is there ----

    /// Whether a plan is running.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// The outputs of the process image; empty unless a plan is running. Asking for them counts as
    /// giving all of them anew (see [`Options::allowed_misses`]).
    #[inline]
    pub fn outputs_mut(&mut self) -> &mut [u8] {
        self.running.as_mut().map_or(&mut [], |running| {
            running.cyclic.give_outputs(None);
            &mut running.cyclic.outputs
        })
    }

    /// The same, without giving them anew: for a look, or for changes that are given later.
    #[inline]
    pub fn image_mut(&mut self) -> &mut [u8] {
        self.running.as_mut().map_or(&mut [], |running| &mut running.cyclic.outputs)
    }

    /// The same, but only those of one task count as given anew.
    #[inline]
    pub fn outputs_of_task_mut(&mut self, task: usize) -> &mut [u8] {
        self.running.as_mut().map_or(&mut [], |running| {
            running.cyclic.give_outputs(Some(task));
            &mut running.cyclic.outputs
        })
    }

    /// The inputs of the process image as they last came back whole; empty unless a plan is running.
    #[inline]
    #[must_use]
    pub fn inputs(&self) -> &[u8] {
        self.running.as_ref().map_or(&[], |running| &running.cyclic.inputs)
    }

    /// Whether all frames of a task's cycle have come back, or were given up, since this was asked
    /// last: the moment for an application that works on fresh inputs.
    #[inline]
    pub fn take_exchanged(&mut self, task: usize) -> bool {
        self.running.as_mut().is_some_and(|running| running.cyclic.take_exchanged(task))
    }

    /// When the next cycle of a task begins; `None` unless the running plan has it.
    #[must_use]
    pub fn next_cycle(&self, task: usize) -> Option<Instant> {
        self.running.as_ref()?.cyclic.next_cycle(task)
    }

    /// How good the process data of a SubDevice are, and how old.
    #[must_use]
    pub fn quality(&self, id: DeviceId) -> Quality {
        self.running.as_ref().map_or_else(Quality::default, |running| running.cyclic.quality(id))
    }

    /// How a cyclic frame went the last time; `None` unless the running plan has it.
    #[must_use]
    pub fn frame_status(&self, task: usize, frame: usize) -> Option<FrameStatus> {
        self.running.as_ref()?.cyclic.frame_status(task, frame)
    }

    /// How the network of the running plan stands: the state words of SubDevices and network, error
    /// totals, change counters. It follows the events that were fetched. `None` unless a plan runs.
    #[must_use]
    pub fn network_status(&self) -> Option<&NetworkStatus> {
        self.running.as_ref().map(|running| &running.network_status)
    }

    /// How many SubDevices answered the last cyclic broadcast read.
    #[must_use]
    pub fn responding(&self) -> Option<WorkingCounter> {
        self.running.as_ref()?.cyclic.responding()
    }

    /// How many SubDevices had processed what each card received of the last cyclic broadcast read of a ring, card A
    /// first (RED-15). While the ring is whole, card B receives what card A has sent: `[0, all]`. While it is open,
    /// each card counts its half. `None` without a ring, and before the first cycle.
    #[must_use]
    pub fn responding_by_card(&self) -> Option<[WorkingCounter; 2]> {
        self.running.as_ref()?;
        self.exchange.responding_by_card()
    }

    /// True if what one card of a ring sends arrives at the other; `None` before the first frame, and without a ring.
    #[must_use]
    pub fn ring_intact(&self) -> Option<bool> {
        self.exchange.ring_intact()
    }

    /// The running plan.
    #[must_use]
    pub fn plan(&self) -> Option<&Plan> {
        self.running.as_ref().map(|running| &*running.plan)
    }

    /// What has been sent and received.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}
