//! Tasks within tasks: a procedure starts others and awaits what they give.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

use super::{Group, lock};

pub(crate) type BoxFuture = Pin<Box<dyn Future<Output = ()> + Send>>;

/// A task that the poller has not taken over yet.
pub(crate) struct Spawned {
    pub(crate) group: Group,
    pub(crate) future: BoxFuture,
}

struct TaskOutcome<T> {
    value: Option<T>,
    waker: Option<Waker>,
}

/// Awaits what a task gives. Dropping it leaves the task running.
pub struct Handle<T> {
    outcome: Arc<Mutex<TaskOutcome<T>>>,
}

/// A task that leaves its value for a handle.
pub(crate) fn with_handle<T: Send + 'static>(
    future: impl Future<Output = T> + Send + 'static,
) -> (BoxFuture, Handle<T>) {
    let outcome = Arc::new(Mutex::new(TaskOutcome { value: None, waker: None }));
    let handle = Handle { outcome: Arc::clone(&outcome) };
    let task = async move {
        let value = future.await;
        let waker = {
            let mut outcome = lock(&outcome);
            outcome.value = Some(value);
            outcome.waker.take()
        };
        if let Some(waker) = waker {
            waker.wake();
        }
    };
    (Box::pin(task), handle)
}

impl<T> Handle<T> {
    /// What the task has given, once it has; to be asked again and again from outside.
    #[must_use]
    pub fn take(&self) -> Option<T> {
        lock(&self.outcome).value.take()
    }
}

impl<T> Future for Handle<T> {
    type Output = T;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<T> {
        let mut outcome = lock(&self.outcome);
        match outcome.value.take() {
            Some(value) => Poll::Ready(value),
            None => {
                outcome.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}
