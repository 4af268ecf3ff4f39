//! Sleep that the next alert ends.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll};

use super::device_table::DeviceTable;
use crate::executor::lock;
use crate::executor::wire::Sleep;

/// Sleeps, but no longer than until the next alert.
pub(crate) struct AlertSleep {
    pub(crate) device_table: Arc<Mutex<DeviceTable>>,
    /// The last alert that was acted upon.
    pub(crate) seen: u64,
    pub(crate) sleep: Sleep,
    /// Its place among those that wait.
    pub(crate) place: Option<u64>,
}

impl Future for AlertSleep {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        let mut device_table = lock(&self.device_table);
        if device_table.alerts != self.seen {
            return Poll::Ready(());
        }
        if self.place.is_none() {
            let place = device_table.waiting.insert(context.waker().clone());
            drop(device_table);
            self.place = Some(place);
        } else {
            drop(device_table);
        }
        Pin::new(&mut self.sleep).poll(context)
    }
}

impl Drop for AlertSleep {
    fn drop(&mut self) {
        if let Some(place) = self.place {
            lock(&self.device_table).waiting.remove(place);
        }
    }
}
