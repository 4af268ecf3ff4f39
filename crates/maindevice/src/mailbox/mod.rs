//! Mailbox communication with the software of SubDevices.
//!
//! One multiplexer per SubDevice owns its mailbox: it counts messages, looks whether there is
//! one to be fetched, fetches lost ones again, and hands them on by type. `coe`, `information`,
//! `foe` and `settings` are its clients; jobs ([`MailboxRequest`]) wait in a queue and are done one after
//! another. Emergencies and messages that nobody asked for become events; what went wrong is kept
//! ([`ProtocolErrors`]).

mod coe;
mod failure;
mod foe;
mod information;
mod mapped;
pub(crate) mod multiplexer;
mod protocol_errors;
pub(crate) mod queue;
mod request;
mod settings;
pub(crate) mod transaction;

use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;

use crate::executor::lock;
use crate::supervisor::Context;

pub use failure::{MailboxFailure, Step, Why};
pub use protocol_errors::{ProtocolError, ProtocolErrors};
pub use request::{MailboxOperation, MailboxRequest};

pub(crate) use mapped::MailboxBits;
use multiplexer::Multiplexer;
pub use queue::MOST_WAITING;
pub(crate) use queue::{MailboxJob, MailboxQueues, Outcome};

/// A mailbox whose bit the cycle reads is looked into all the same once in so long.
const UNHEARD: Span = Span::s(1);

/// Serves the mailbox of one SubDevice; never ends.
pub(crate) async fn serve_mailbox(context: Context, id: DeviceId) {
    let plan = std::sync::Arc::clone(&context.plan);
    let Some(device) = plan.device(id) else { return };
    let (wire, mailboxes) = (&context.wire, &context.mailboxes);
    let Some(mut multiplexer) = Multiplexer::new(wire, mailboxes, device) else { return };
    let mut openings = 0;
    loop {
        let interval = match mailboxes.is_mapped(id) {
            true => context.options.mailbox_interval.max(UNHEARD),
            false => context.options.mailbox_interval,
        };
        let job = mailboxes.next(id, context.wire.sleep(interval)).await;
        let (open, boots, now) = {
            let device_table = lock(&context.device_table);
            (
                device_table.has_mailbox(id),
                device_table.boots(id),
                device_table.mailbox_openings(id),
            )
        };
        // It may have been closed and opened again between two looks.
        if !open || openings != now {
            multiplexer.reset();
            openings = now;
        }
        let open = open && multiplexer.set_boots(boots);
        match job {
            Some(job) => work(&context, &mut multiplexer, job, open).await,
            None if open => multiplexer.drain().await,
            // What is left of an earlier run is of no interest, and must not be looked at for ever.
            None => {
                mailboxes.take_full(id);
            }
        }
    }
}

async fn work(context: &Context, multiplexer: &mut Multiplexer, job: MailboxJob, open: bool) {
    let outcome: Outcome = if open {
        transaction::perform(multiplexer, &job.request, context.options.mailbox_patience).await
    } else {
        let (id, operation) = (job.id, job.request.operation());
        Err(MailboxFailure { id, operation, step: Step::Before, why: Why::NotOpen })
    };
    context.mailboxes.note(job.id, context.wire.now(), &job.request, &outcome);
    job.done(outcome);
}

#[cfg(test)]
mod tests;
