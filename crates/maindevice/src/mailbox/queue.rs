//! Queue of jobs that wait for a SubDevice's mailbox, and their outcomes.

use std::collections::{BTreeMap, VecDeque};
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use super::failure::{MailboxFailure, Step, Why};
use super::protocol_errors::{ProtocolError, ProtocolErrors};
use super::request::MailboxRequest;
use crate::executor::lock;
use crate::executor::wire::Sleep;

/// So many jobs may wait for the mailbox of a SubDevice. Whoever asks for more is not served: memory must
/// not grow with somebody's haste.
pub const MOST_WAITING: usize = 4_096;

/// What came of an operation.
pub(crate) type Outcome = Result<Vec<u8>, MailboxFailure>;

/// Something to be done through a mailbox, and who waits for it.
#[derive(Debug)]
pub(crate) struct MailboxJob {
    pub(crate) id: DeviceId,
    pub(crate) request: MailboxRequest,
    slot: Arc<Mutex<QueueSlot>>,
}

#[derive(Default, Debug)]
struct QueueSlot {
    outcome: Option<Outcome>,
    waker: Option<Waker>,
}

impl MailboxJob {
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

impl Drop for MailboxJob {
    /// A job that nobody does any more must not be waited for.
    fn drop(&mut self) {
        if lock(&self.slot).outcome.is_none() {
            self.leave(Err(failure(self.id, &self.request, Why::Abandoned)));
        }
    }
}

fn failure(id: DeviceId, request: &MailboxRequest, why: Why) -> MailboxFailure {
    MailboxFailure { id, operation: request.operation(), step: Step::Before, why }
}

/// The outcome of an operation, to be awaited.
pub(crate) struct Pending {
    slot: Arc<Mutex<QueueSlot>>,
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
struct MailboxQueue {
    jobs: VecDeque<MailboxJob>,
    waker: Option<Waker>,
    errors: ProtocolErrors,
    /// The cycle reads whether the mailbox holds something.
    mapped: bool,
    /// It was seen to hold something, and nobody has looked since.
    full: bool,
}

impl MailboxQueue {
    /// The next job; with a client, its next one or an Ethernet frame.
    fn take(&mut self, kept_for: Option<u64>) -> Option<MailboxJob> {
        let at = match kept_for {
            None => 0,
            Some(_) => {
                let mine =
                    |job: &MailboxJob| job.request.client() == kept_for || job.request.is_frame();
                self.jobs.iter().position(mine)?
            }
        };
        self.jobs.remove(at)
    }
}

/// The queues of all SubDevices with a mailbox. Clones mean the same queues.
#[derive(Clone, Default, Debug)]
pub(crate) struct MailboxQueues {
    queues: Arc<Mutex<BTreeMap<DeviceId, MailboxQueue>>>,
}

impl MailboxQueues {
    pub(crate) fn of(devices: impl Iterator<Item = DeviceId>) -> Self {
        let queues = devices.map(|id| (id, MailboxQueue::default())).collect();
        Self { queues: Arc::new(Mutex::new(queues)) }
    }

    /// Asks a SubDevice through its mailbox, behind those who asked before; await what comes of it.
    pub(crate) fn ask(&self, id: DeviceId, request: MailboxRequest) -> Pending {
        let slot = Arc::new(Mutex::new(QueueSlot::default()));
        let job = MailboxJob { id, request, slot: Arc::clone(&slot) };
        let mut queues = lock(&self.queues);
        let Some(queue) = queues.get_mut(&id) else {
            drop(queues);
            let none = failure(id, &job.request, Why::NoMailbox);
            job.done(Err(none));
            return Pending { slot };
        };
        if queue.jobs.len() >= MOST_WAITING {
            drop(queues);
            let too_many = failure(id, &job.request, Why::Crowded { waiting: MOST_WAITING });
            job.done(Err(too_many));
            return Pending { slot };
        }
        queue.jobs.push_back(job);
        let waker = queue.waker.take();
        drop(queues);
        if let Some(waker) = waker {
            waker.wake();
        }
        Pending { slot }
    }

    /// The next job, or `None` when it is time to look into the mailbox. Where the SubDevice is kept for a client of
    /// the mailbox gateway, only the jobs of that one.
    pub(crate) fn next(&self, id: DeviceId, kept_for: Option<u64>, sleep: Sleep) -> NextJob {
        NextJob { queues: self.clone(), id, kept_for, sleep }
    }

    /// Waits until a mailbox is seen to hold something, at most so long.
    pub(crate) fn mail(&self, id: DeviceId, sleep: Sleep) -> MailboxNotice {
        MailboxNotice { queues: self.clone(), id, sleep }
    }

    /// From now on the cycle reads whether these mailboxes hold something.
    pub(crate) fn listen(&self, devices: impl Iterator<Item = DeviceId>) {
        let mut queues = lock(&self.queues);
        for id in devices {
            if let Some(queue) = queues.get_mut(&id) {
                queue.mapped = true;
            }
        }
    }

    /// The cycle has read whether these mailboxes hold something.
    pub(crate) fn see(&self, mailboxes: impl Iterator<Item = (DeviceId, bool)>) {
        let mut queues = lock(&self.queues);
        for (id, full) in mailboxes {
            let Some(queue) = queues.get_mut(&id) else { continue };
            queue.full = full;
            if full && let Some(waker) = queue.waker.take() {
                waker.wake();
            }
        }
    }

    /// Whether the cycle reads if a mailbox holds something.
    pub(crate) fn is_mapped(&self, id: DeviceId) -> bool {
        lock(&self.queues).get(&id).is_some_and(|queue| queue.mapped)
    }

    /// Whether a mailbox was seen to hold something; it is about to be looked into.
    pub(crate) fn take_full(&self, id: DeviceId) -> bool {
        lock(&self.queues).get_mut(&id).is_some_and(|queue| std::mem::take(&mut queue.full))
    }

    /// Notes how an access went.
    pub(crate) fn note(&self, id: DeviceId, at: Instant, request: &MailboxRequest, how: &Outcome) {
        if let Some(queue) = lock(&self.queues).get_mut(&id) {
            match how {
                Ok(_) => queue.errors.clean(request.operation().protocol()),
                Err(failure) => queue.errors.failed(at, failure.clone()),
            }
        }
    }

    /// The mailboxes in which something went wrong so far: whose, how often, and what stands.
    pub(crate) fn troubles(&self) -> Vec<(DeviceId, u64, Vec<ProtocolError>)> {
        let queues = lock(&self.queues);
        let failed = queues.iter().filter(|(_, queue)| queue.errors.total() > 0);
        failed
            .map(|(id, queue)| {
                (*id, queue.errors.total(), queue.errors.standing().cloned().collect())
            })
            .collect()
    }

    /// What went wrong in a mailbox; `None` for a SubDevice without one.
    pub(crate) fn errors(&self, id: DeviceId) -> Option<ProtocolErrors> {
        lock(&self.queues).get(&id).map(|queue| queue.errors.clone())
    }
}

pub(crate) struct NextJob {
    queues: MailboxQueues,
    id: DeviceId,
    kept_for: Option<u64>,
    sleep: Sleep,
}

impl Future for NextJob {
    type Output = Option<MailboxJob>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<MailboxJob>> {
        if let Some(queue) = lock(&self.queues.queues).get_mut(&self.id) {
            if let Some(job) = queue.take(self.kept_for) {
                return Poll::Ready(Some(job));
            }
            if queue.full {
                return Poll::Ready(None);
            }
            queue.waker = Some(context.waker().clone());
        }
        Pin::new(&mut self.sleep).poll(context).map(|()| None)
    }
}

/// Waits until a mailbox is seen to hold something.
pub(crate) struct MailboxNotice {
    queues: MailboxQueues,
    id: DeviceId,
    sleep: Sleep,
}

impl Future for MailboxNotice {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        if let Some(queue) = lock(&self.queues.queues).get_mut(&self.id) {
            if queue.full {
                return Poll::Ready(());
            }
            queue.waker = Some(context.waker().clone());
        }
        Pin::new(&mut self.sleep).poll(context)
    }
}
