//! Jobs that wait for a SubDevice's mailbox.

use std::collections::{BTreeMap, VecDeque};
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;

use super::SdoError;
use crate::executor::wire::Sleep;
use crate::executor::{Promise, lock};

/// Something to be done through a mailbox.
#[derive(Debug)]
pub(crate) enum Job {
    /// Fetch an object.
    Upload { object: ObjectAddress, complete: bool },
    /// Bring an object.
    Download { object: ObjectAddress, complete: bool, data: Vec<u8> },
    /// Bring an object for a procedure that awaits the result.
    StartUp {
        object: ObjectAddress,
        complete: bool,
        data: Vec<u8>,
        done: Promise<Result<(), SdoError>>,
    },
}

#[derive(Default, Debug)]
struct Queue {
    jobs: VecDeque<Job>,
    waker: Option<Waker>,
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

    /// Adds a job; gives it back when the SubDevice has no mailbox.
    pub(crate) fn push(&self, id: DeviceId, job: Job) -> Result<(), Job> {
        let mut queues = lock(&self.queues);
        let Some(queue) = queues.get_mut(&id) else { return Err(job) };
        queue.jobs.push_back(job);
        let waker = queue.waker.take();
        drop(queues);
        if let Some(waker) = waker {
            waker.wake();
        }
        Ok(())
    }

    /// The next job, or `None` when it is time to look into the mailbox.
    pub(crate) fn next(&self, id: DeviceId, sleep: Sleep) -> NextJob {
        NextJob { queues: self.clone(), id, sleep }
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
