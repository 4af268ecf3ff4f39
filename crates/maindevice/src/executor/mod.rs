//! Procedures as `async fn`s, on a poller of our own: no runtime, no clock, no chance.
//!
//! A procedure awaits the answer to a datagram or a point in time through its [`Wire`]. Tasks are
//! polled in the order in which they were woken, and they are woken in the order in which answers
//! came, so that the same frames at the same times always do the same.

mod task;
mod timers;
pub(crate) mod waitlist;
pub mod wire;

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

use linesman_proto::address::StationAddress;
use linesman_proto::time::Instant;

use crate::event::Event;
use crate::exchange::{ExchangeError, Reply, Request, Target, Ticket};
use task::Spawned;
use timers::Timers;
use waitlist::Waitlist;

pub use task::Handle;
pub use wire::Wire;

/// Tasks that end together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Group(pub(crate) u32);

/// Locks what tasks share. A task that panicked does not make it unusable.
pub(crate) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The answer to a request, or who waits for it.
#[derive(Default)]
pub(crate) struct Answer {
    pub(crate) result: Option<Result<Reply, ExchangeError>>,
    pub(crate) waker: Option<Waker>,
}

/// What tasks and the engine share, and what the engine may look at without its lock.
pub(crate) struct Shared {
    state: Mutex<SharedState>,
    /// Now, in ns.
    now: AtomicU64,
    /// When the first sleeper is to be woken, in ns.
    first_timer: AtomicU64,
    /// What there is to do, as bits of [`wake_flags`](mod@wake_flags).
    wake_flags: AtomicU8,
    /// Tasks that want to be polled.
    ready: Mutex<VecDeque<u64>>,
}

/// What there is to do.
mod wake_flags {
    /// A task has changed something.
    pub(super) const NEWS: u8 = 1;
    /// A task wants to be polled.
    pub(super) const READY: u8 = 2;
    /// There are events.
    pub(super) const EVENTS: u8 = 4;
}

impl Shared {
    /// For tasks: whatever they change is news for the engine.
    pub(crate) fn lock(&self) -> MutexGuard<'_, SharedState> {
        self.raise(wake_flags::NEWS);
        lock(&self.state)
    }

    fn raise(&self, what: u8) {
        self.wake_flags.fetch_or(what, Ordering::Relaxed);
    }

    fn settle(&self, what: u8) {
        self.wake_flags.fetch_and(!what, Ordering::Relaxed);
    }

    #[inline]
    fn has_wake_flag(&self, what: u8) -> bool {
        self.wake_flags.load(Ordering::Relaxed) & what != 0
    }

    /// A task wants to be polled.
    fn push_ready(&self, id: u64) {
        lock(&self.ready).push_back(id);
        self.raise(wake_flags::READY);
    }

    #[inline]
    pub(crate) fn now(&self) -> Instant {
        Instant::from_nanos(self.now.load(Ordering::Relaxed))
    }

    /// Something was put among the events.
    pub(crate) fn note_event(&self) {
        self.raise(wake_flags::EVENTS);
    }

    /// Timers have changed.
    pub(crate) fn note_timers(&self, shared: &SharedState) {
        let first = shared.timers.first().map_or(u64::MAX, Instant::as_nanos);
        self.first_timer.store(first, Ordering::Relaxed);
    }
}

/// What tasks and the engine share.
pub(crate) struct SharedState {
    /// Whether what card A sends arrives at card B.
    pub(crate) ring_intact: Option<bool>,
    /// SubDevices without a station address: what is asked of the one they would have is asked of the
    /// place where they are.
    pub(crate) places: Vec<(StationAddress, Target)>,
    pub(crate) submitted: VecDeque<(Ticket, Request)>,
    pub(crate) cancelled: Vec<Ticket>,
    pub(crate) answers: Waitlist<Answer>,
    pub(crate) timers: Timers,
    pub(crate) spawned: VecDeque<Spawned>,
    pub(crate) events: VecDeque<Event>,
}

/// Wakes one task by putting it into the queue of those that are ready.
struct TaskWaker {
    id: u64,
    shared: Arc<Shared>,
    /// It is in the queue already.
    queued: Arc<AtomicBool>,
}

impl Wake for TaskWaker {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        if !self.queued.swap(true, Ordering::Relaxed) {
            self.shared.push_ready(self.id);
        }
    }
}

struct ProcedureTask {
    group: Group,
    future: task::BoxFuture,
    waker: Waker,
    queued: Arc<AtomicBool>,
}

/// The poller.
pub(crate) struct Executor {
    shared: Arc<Shared>,
    tasks: BTreeMap<u64, ProcedureTask>,
    next_task: u64,
    next_group: u32,
}

impl Executor {
    pub(crate) fn new() -> Self {
        let shared = SharedState {
            ring_intact: None,
            places: Vec::new(),
            submitted: VecDeque::new(),
            cancelled: Vec::new(),
            answers: Waitlist::default(),
            timers: Timers::default(),
            spawned: VecDeque::new(),
            events: VecDeque::new(),
        };
        let shared = Shared {
            state: Mutex::new(shared),
            now: AtomicU64::new(0),
            first_timer: AtomicU64::new(u64::MAX),
            wake_flags: AtomicU8::new(0),
            ready: Mutex::default(),
        };
        Self { shared: Arc::new(shared), tasks: BTreeMap::new(), next_task: 0, next_group: 0 }
    }

    /// The time to which the engine was advanced last.
    pub(crate) fn now(&self) -> Instant {
        self.shared.now()
    }

    pub(crate) fn shared(&self) -> MutexGuard<'_, SharedState> {
        lock(&self.shared.state)
    }

    /// Whether tasks have changed something since this was asked last.
    #[inline]
    pub(crate) fn take_news(&self) -> bool {
        let news = self.shared.has_wake_flag(wake_flags::NEWS);
        if news {
            self.shared.settle(wake_flags::NEWS);
        }
        news
    }

    /// The same, for a look.
    #[inline]
    pub(crate) fn has_news(&self) -> bool {
        self.shared.has_wake_flag(wake_flags::NEWS)
    }

    /// Tells the user of the MainDevice.
    #[cold]
    pub(crate) fn emit(&self, event: Event) {
        self.shared().events.push_back(event);
        self.note_event();
    }

    /// Something was put among the events.
    pub(crate) fn note_event(&self) {
        self.shared.note_event();
    }

    /// The next thing to tell.
    #[inline]
    pub(crate) fn poll_event(&mut self) -> Option<Event> {
        if self.shared.has_wake_flag(wake_flags::EVENTS) { self.take_event() } else { None }
    }

    fn take_event(&mut self) -> Option<Event> {
        let event = self.shared().events.pop_front();
        if event.is_none() {
            self.shared.settle(wake_flags::EVENTS);
        }
        event
    }

    /// A wire for a new group of tasks.
    pub(crate) fn group(&mut self, repeats: u8) -> Wire {
        self.next_group += 1;
        Wire::new(Arc::clone(&self.shared), Group(self.next_group), repeats)
    }

    /// Drops all tasks of a group; their requests are forgotten.
    pub(crate) fn cancel(&mut self, group: Group) {
        let spawned: Vec<Spawned> = {
            let mut shared = self.shared();
            let all = std::mem::take(&mut shared.spawned);
            let (drop, keep) = all.into_iter().partition::<Vec<_>, _>(|task| task.group == group);
            shared.spawned = keep.into();
            drop
        };
        drop(spawned);
        // Dropping a task locks what is shared: not while it is held here.
        self.tasks.retain(|_, task| task.group != group);
    }

    /// Time has come to `now`: wakes whoever slept until then.
    #[inline]
    pub(crate) fn advance(&mut self, now: Instant) {
        if now > self.shared.now() {
            self.shared.now.store(now.as_nanos(), Ordering::Relaxed);
        }
        if now.as_nanos() >= self.shared.first_timer.load(Ordering::Relaxed) {
            self.wake_sleepers(now);
        }
    }

    fn wake_sleepers(&mut self, now: Instant) {
        let mut shared = lock(&self.shared.state);
        while let Some(sleeper) = shared.timers.pop_due(now) {
            // Waking touches only the queue of those that are ready.
            sleeper.wake();
        }
        self.shared.note_timers(&shared);
    }

    /// The answer to a request.
    pub(crate) fn answer(&mut self, ticket: Ticket, result: Result<Reply, ExchangeError>) {
        let mut shared = lock(&self.shared.state);
        let Some(answer) = shared.answers.get_mut(ticket.0) else { return };
        answer.result = Some(result);
        let waker = answer.waker.take();
        drop(shared);
        if let Some(waker) = waker {
            waker.wake();
        }
    }

    /// Whether there is something to run, or tasks have changed something.
    #[inline]
    pub(crate) fn has_wake_flag(&self) -> bool {
        self.shared.has_wake_flag(wake_flags::NEWS | wake_flags::READY)
    }

    /// Polls whoever is ready until nobody is.
    #[inline]
    pub(crate) fn run(&mut self) {
        if self.has_wake_flag() {
            self.run_all();
        }
    }

    fn run_all(&mut self) {
        loop {
            self.adopt();
            let Some(id) = lock(&self.shared.ready).pop_front() else { break };
            let Some(task) = self.tasks.get_mut(&id) else { continue };
            task.queued.store(false, Ordering::Relaxed);
            let waker = task.waker.clone();
            match task.future.as_mut().poll(&mut Context::from_waker(&waker)) {
                Poll::Pending => {}
                Poll::Ready(()) => {
                    self.tasks.remove(&id);
                }
            }
        }
        self.shared.settle(wake_flags::READY);
    }

    fn adopt(&mut self) {
        loop {
            let Some(Spawned { group, future }) = self.shared().spawned.pop_front() else { return };
            let id = self.next_task;
            self.next_task += 1;
            let queued = Arc::new(AtomicBool::new(true));
            let shared = Arc::clone(&self.shared);
            let waker =
                Waker::from(Arc::new(TaskWaker { id, shared, queued: Arc::clone(&queued) }));
            self.tasks.insert(id, ProcedureTask { group, future, waker, queued });
            self.shared.push_ready(id);
        }
    }

    /// When the first sleeper wants to be woken; [`Instant::MAX`] when nobody sleeps.
    #[inline]
    pub(crate) fn first_timer(&self) -> Instant {
        Instant::from_nanos(self.shared.first_timer.load(Ordering::Relaxed))
    }
}

impl std::fmt::Debug for Executor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Executor").field("tasks", &self.tasks.len()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
