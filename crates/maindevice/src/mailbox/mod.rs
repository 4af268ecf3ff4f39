//! Talking to the software of SubDevices.
//!
//! One multiplexer per SubDevice owns its mailbox: it counts messages, looks whether there is
//! one to be fetched, fetches lost ones again, and hands them on by type. [`coe`] is one of its
//! clients; jobs wait in a queue and are done one after another. Emergencies and messages that
//! nobody asked for become events.

pub mod coe;
pub(crate) mod multiplexer;
pub(crate) mod queue;

use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;

use crate::event::Event;
use crate::executor::lock;
use crate::supervisor::Context;

pub use coe::SdoError;
use multiplexer::Multiplexer;
pub(crate) use queue::{Job, Queues};

/// Serves the mailbox of one SubDevice; never ends.
pub(crate) async fn serve_mailbox(context: Context, id: DeviceId) {
    let plan = std::sync::Arc::clone(&context.plan);
    let Some(device) = plan.device(id) else { return };
    let Some(mut multiplexer) = Multiplexer::new(&context, device) else { return };
    let interval = context.options.mailbox_interval;
    let mut openings = 0;
    loop {
        let job = context.mailboxes.next(id, context.wire.sleep(interval)).await;
        let (open, now) = {
            let line = lock(&context.line);
            (line.has_mailbox(id), line.mailbox_openings(id))
        };
        // It may have been closed and opened again between two looks.
        if !open || openings != now {
            multiplexer.reset();
            openings = now;
        }
        match job {
            Some(job) if open => work(&context, &mut multiplexer, id, job).await,
            Some(job) => refuse(&context, id, job),
            None if open => multiplexer.drain().await,
            None => {}
        }
    }
}

async fn work(context: &Context, multiplexer: &mut Multiplexer<'_>, id: DeviceId, job: Job) {
    let patience: Span = context.options.mailbox_patience;
    let event = match job {
        Job::Upload { object, complete } => {
            let result = coe::upload(multiplexer, object, complete, patience).await;
            Event::SdoUploaded { id, object, result }
        }
        Job::Download { object, complete, data } => {
            let result = coe::download(multiplexer, object, complete, &data, patience).await;
            Event::SdoDownloaded { id, object, result }
        }
        Job::StartUp { object, complete, data, done } => {
            done.keep(coe::download(multiplexer, object, complete, &data, patience).await);
            return;
        }
    };
    context.wire.emit(event);
}

fn refuse(context: &Context, id: DeviceId, job: Job) {
    let error = SdoError::NotOpen { id };
    context.wire.emit(match job {
        Job::Upload { object, .. } => Event::SdoUploaded { id, object, result: Err(error) },
        Job::Download { object, .. } => Event::SdoDownloaded { id, object, result: Err(error) },
        Job::StartUp { done, .. } => return done.keep(Err(error)),
    });
}

#[cfg(test)]
mod tests;
