//! Handle of a procedure: access to the line and to the time.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use linesman_proto::address::{RegisterAddress, StationAddress, WorkingCounter};
use linesman_proto::time::{Instant, Span};

use super::task::{Handle, Spawned, with_handle};
use super::{Answer, Group, Shared};
use crate::event::Event;
use crate::exchange::{ExchangeError, Reply, Request, Target, Ticket};

/// The line as procedures see it. Clones mean the same line.
#[derive(Clone)]
pub struct Wire {
    shared: Arc<Shared>,
    group: Group,
    repeats: u8,
}

impl Wire {
    pub(crate) fn new(shared: Arc<Shared>, group: Group, repeats: u8) -> Self {
        Self { shared, group, repeats }
    }

    pub(crate) fn group(&self) -> Group {
        self.group
    }

    /// The present time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.shared.now()
    }

    /// Whether what card A sends arrives at card B; `None` with one card.
    #[must_use]
    pub fn ring_intact(&self) -> Option<bool> {
        self.shared.lock().ring_intact
    }

    /// Queues a datagram at once; await the result for its answer. Dropping it gives the answer up.
    pub fn submit(&self, request: Request) -> Exchanging {
        let mut shared = self.shared.lock();
        let request = match shared.places.as_slice() {
            [] => request,
            places => request.placed(places),
        };
        let ticket = Ticket(shared.answers.insert(Answer::default()));
        shared.submitted.push_back((ticket, request));
        Exchanging { shared: Arc::clone(&self.shared), ticket }
    }

    /// Queues a datagram that is repeated when its frame is lost.
    pub fn ask(&self, request: Request) -> Exchanging {
        self.submit(request.repeated(self.repeats))
    }

    /// Reads registers; lost frames are repeated. The working counter is the caller's to judge.
    pub fn read(&self, target: Target, address: RegisterAddress, len: u16) -> Exchanging {
        self.ask(Request::read(target, address, len))
    }

    /// Writes registers; lost frames are repeated. The working counter is the caller's to judge.
    pub fn write(&self, target: Target, address: RegisterAddress, data: &[u8]) -> Exchanging {
        self.ask(Request::write(target, address, data))
    }

    /// Reads registers of one SubDevice; asks again when it did not answer.
    ///
    /// # Errors
    /// [`ExchangeError`] when no frame came back, or never with working counter 1.
    pub async fn read_one(
        &self,
        target: Target,
        address: RegisterAddress,
        len: u16,
    ) -> Result<Reply, ExchangeError> {
        self.delivered(Request::read(target, address, len)).await
    }

    /// Writes registers of one SubDevice; writes again when it did not take them.
    ///
    /// # Errors
    /// [`ExchangeError`] when no frame came back, or never with working counter 1.
    pub async fn write_one(
        &self,
        target: Target,
        address: RegisterAddress,
        data: &[u8],
    ) -> Result<Reply, ExchangeError> {
        self.delivered(Request::write(target, address, data)).await
    }

    /// Sends a datagram to one SubDevice until it is executed, or often enough.
    async fn delivered(&self, request: Request) -> Result<Reply, ExchangeError> {
        let request = request.repeated(self.repeats);
        let mut received = WorkingCounter(0);
        let attempts = u32::from(self.repeats) + 1;
        for _ in 0..attempts {
            let reply = self.submit(request.clone()).await?;
            if reply.wkc == WorkingCounter(1) {
                return Ok(reply);
            }
            received = reply.wkc;
        }
        Err(ExchangeError::WorkingCounter {
            access: request.access(),
            expected: WorkingCounter(1),
            received,
            frames: attempts,
        })
    }

    /// From now on, what is asked of this station address is asked of this place: who is there has none.
    pub(crate) fn set_place(&self, station: StationAddress, place: Target) {
        let mut shared = self.shared.lock();
        shared.places.retain(|(known, _)| *known != station);
        shared.places.push((station, place));
    }

    /// Every SubDevice is asked by its own station address again.
    pub(crate) fn forget_places(&self) {
        self.shared.lock().places.clear();
    }

    /// Sleeps.
    pub fn sleep(&self, span: Span) -> Sleep {
        self.sleep_until(self.now() + span)
    }

    /// Sleeps until then.
    pub fn sleep_until(&self, until: Instant) -> Sleep {
        Sleep { shared: Arc::clone(&self.shared), until, timer: None }
    }

    /// Starts another procedure beside this one; it ends with the same group.
    pub fn spawn<T: Send + 'static>(
        &self,
        future: impl Future<Output = T> + Send + 'static,
    ) -> Handle<T> {
        let (future, handle) = with_handle(future);
        self.shared.lock().spawned.push_back(Spawned { group: self.group, future });
        handle
    }

    /// Tells the user of the MainDevice.
    pub fn emit(&self, event: Event) {
        self.shared.lock().events.push_back(event);
        self.shared.note_event();
    }
}

impl std::fmt::Debug for Wire {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wire").field("group", &self.group).finish_non_exhaustive()
    }
}

/// The answer to a datagram, to be awaited.
pub struct Exchanging {
    shared: Arc<Shared>,
    ticket: Ticket,
}

impl Future for Exchanging {
    type Output = Result<Reply, ExchangeError>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let mut shared = self.shared.lock();
        let Some(answer) = shared.answers.get_mut(self.ticket.0) else { return Poll::Pending };
        match answer.result.take() {
            Some(result) => {
                shared.answers.remove(self.ticket.0);
                Poll::Ready(result)
            }
            None => {
                answer.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

impl Drop for Exchanging {
    fn drop(&mut self) {
        let mut shared = self.shared.lock();
        if shared.answers.remove(self.ticket.0).is_some() {
            shared.cancelled.push(self.ticket);
        }
    }
}

/// A point in time, to be awaited.
pub struct Sleep {
    shared: Arc<Shared>,
    until: Instant,
    timer: Option<u64>,
}

impl Future for Sleep {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        let until = self.until;
        let board = Arc::clone(&self.shared);
        if board.now() >= until {
            return Poll::Ready(());
        }
        let mut shared = board.lock();
        let sleeps = self.timer.is_some_and(|timer| shared.timers.renew(timer, context.waker()));
        if !sleeps {
            self.timer = Some(shared.timers.insert(until, context.waker().clone()));
            board.note_timers(&shared);
        }
        Poll::Pending
    }
}

impl Drop for Sleep {
    fn drop(&mut self) {
        if let Some(timer) = self.timer {
            let mut shared = self.shared.lock();
            if shared.timers.remove(timer) {
                self.shared.note_timers(&shared);
            }
        }
    }
}
