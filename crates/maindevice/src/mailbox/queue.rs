//! Errands that wait for a SubDevice's mailbox, and what came of them.

use std::collections::{BTreeMap, VecDeque};
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use super::errand::MailboxRequest;
use super::failure::{MailboxFailure, Step, Why};
use super::protocol_errors::ProtocolErrors;
use crate::executor::lock;
use crate::executor::wire::Sleep;

/// What came of an errand.
pub(crate) type Outcome = Result<Vec<u8>, MailboxFailure>;

/// Something to be done through a mailbox, and who waits for it.
#[derive(Debug)]
pub(crate) struct Job {
    pub(crate) id: DeviceId,
    pub(crate) request: MailboxRequest,
    slot: Arc<Mutex<Slot>>,
}

#[derive(Default, Debug)]
struct Slot {
    outcome: Option<Outcome>,
    waker: Option<Waker>,
}

impl Job {
    /// Tells what came of it.
    pub(crate) fn done(self, outcome: Outcome) {
        self.leave(outcome);
    }

    fn leave(&self, outcome: Outcome) {
        let mut slot = lock(&self.slot);
        slot.outcome.get_or_insert(outcome);
        let waker = slot.waker.take();
        drop(slot);
        if let Some(waker) = waker {
            waker.wake();
        }
    }
}

impl Drop for Job {
    /// A job that nobody does any more must not be waited for.
    fn drop(&mut self) {
        if lock(&self.slot).outcome.is_none() {
            self.leave(Err(failure(self.id, &self.request, Why::Abandoned)));
        }
    }
}

fn failure(id: DeviceId, request: &MailboxRequest, why: Why) -> MailboxFailure {
    MailboxFailure { id, errand: request.errand(), step: Step::Before, why }
}

/// The outcome of an errand, to be awaited.
pub(crate) struct Pending {
    slot: Arc<Mutex<Slot>>,
}

impl Future for Pending {
    type Output = Outcome;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Outcome> {
        let mut slot = lock(&self.slot);
        match slot.outcome.take() {
            Some(outcome) => Poll::Ready(outcome),
            None => {
                slot.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

#[derive(Default, Debug)]
struct Queue {
    jobs: VecDeque<Job>,
    waker: Option<Waker>,
    errors: ProtocolErrors,
}

/// The queues of all SubDevices with a mailbox. Clones mean the same queues.
#[derive(Clone, Default, Debug)]
pub(crate) struct Queues {
    queues: Arc<Mutex<BTreeMap<DeviceId, Queue>>>,
}

impl Queues {
    pub(crate) fn of(devices: impl Iterator<Item = DeviceId>) -> Self {
        let queues = devices.map(|id| (id, Queue::default())).collect();
        Self { queues: Arc::new(Mutex::new(queues)) }
    }

    /// Asks a SubDevice through its mailbox, behind those who asked before; await what comes of it.
    pub(crate) fn ask(&self, id: DeviceId, request: MailboxRequest) -> Pending {
        let slot = Arc::new(Mutex::new(Slot::default()));
        let job = Job { id, request, slot: Arc::clone(&slot) };
        let mut queues = lock(&self.queues);
        let Some(queue) = queues.get_mut(&id) else {
            drop(queues);
            let none = failure(id, &job.request, Why::NoMailbox);
            job.done(Err(none));
            return Pending { slot };
        };
        queue.jobs.push_back(job);
        let waker = queue.waker.take();
        drop(queues);
        if let Some(waker) = waker {
            waker.wake();
        }
        Pending { slot }
    }

    /// The next job, or `None` when it is time to look into the mailbox.
    pub(crate) fn next(&self, id: DeviceId, sleep: Sleep) -> NextJob {
        NextJob { queues: self.clone(), id, sleep }
    }

    /// Notes how an access went.
    pub(crate) fn note(&self, id: DeviceId, at: Instant, request: &MailboxRequest, how: &Outcome) {
        if let Some(queue) = lock(&self.queues).get_mut(&id) {
            match how {
                Ok(_) => queue.errors.clean(request.errand().protocol()),
                Err(failure) => queue.errors.failed(at, failure.clone()),
            }
        }
    }

    /// What went wrong in a mailbox; `None` for a SubDevice without one.
    pub(crate) fn errors(&self, id: DeviceId) -> Option<ProtocolErrors> {
        lock(&self.queues).get(&id).map(|queue| queue.errors.clone())
    }
}

pub(crate) struct NextJob {
    queues: Queues,
    id: DeviceId,
    sleep: Sleep,
}

impl Future for NextJob {
    type Output = Option<Job>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Job>> {
        if let Some(queue) = lock(&self.queues.queues).get_mut(&self.id) {
            if let Some(job) = queue.jobs.pop_front() {
                return Poll::Ready(Some(job));
            }
            queue.waker = Some(context.waker().clone());
        }
        Pin::new(&mut self.sleep).poll(context).map(|()| None)
    }
}
