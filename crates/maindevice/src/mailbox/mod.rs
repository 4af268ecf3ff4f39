//! Mailbox communication with the software of SubDevices.
//!
//! One multiplexer per SubDevice owns its mailbox: it counts messages, looks whether there is
//! one to be fetched, fetches lost ones again, and hands them on by type. `coe`, `information`,
//! `foe`, `settings`, `soe`, `aoe`, `voe` and `pass` are its clients; jobs ([`MailboxRequest`]) wait in a queue and are done one after
//! another; `ethernet` sends frames for the virtual switch. Emergencies and messages that nobody asked for become events; what went wrong is kept
//! ([`ProtocolErrors`]).

mod aoe;
mod coe;
mod ethernet;
mod failure;
mod foe;
mod information;
mod mapped;
pub(crate) mod multiplexer;
mod pass;
mod progress;
mod protocol_errors;
pub(crate) mod queue;
mod request;
mod settings;
mod soe;
pub(crate) mod transaction;
mod voe;

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};

use crate::executor::lock;
use crate::supervisor::Context;

pub use failure::{MailboxFailure, Step, Why};
pub use progress::{FileBusy, FileProgress};
pub use protocol_errors::{ProtocolError, ProtocolErrors};
pub use request::{MailboxOperation, MailboxRequest};

pub(crate) use mapped::MailboxBits;
use multiplexer::Multiplexer;
pub use queue::MOST_WAITING;
pub(crate) use queue::{MailboxJob, MailboxQueues, Outcome};

/// A mailbox whose bit the cycle reads is looked into all the same once in so long.
const UNHEARD: Span = Span::s(1);

/// So long after an Ethernet frame a mailbox is looked into often: frames seldom come alone.
const FRAMES_EXPECTED: Span = Span::ms(200);
/// So often, then.
const FRAME_INTERVAL: Span = Span::ms(1);

/// So long after a message of a transfer a SubDevice is kept for the client of the mailbox gateway whose transfer it
/// is.
const KEPT_FOR_CLIENT: Span = Span::s(1);
/// After so long others have their turn, whatever is under way.
const LONGEST_TRANSFER: Span = Span::s(60);

/// A client of the mailbox gateway that a SubDevice is kept for, as its transfer takes several messages.
#[derive(Clone, Copy, Debug)]
struct KeptFor {
    client: u64,
    since: Instant,
    until: Instant,
}

impl KeptFor {
    /// The client, if a message of it was passed on and more of its transfer is to come.
    fn after(
        before: Option<Self>,
        client: Option<u64>,
        under_way: bool,
        now: Instant,
    ) -> Option<Self> {
        let client = client.filter(|_| under_way)?;
        let since = before.filter(|kept| kept.client == client).map_or(now, |kept| kept.since);
        let until = (now + KEPT_FOR_CLIENT).min(since + LONGEST_TRANSFER);
        Some(Self { client, since, until })
    }
}

/// Serves the mailbox of one SubDevice; never ends.
pub(crate) async fn serve_mailbox(context: Context, id: DeviceId) {
    let plan = std::sync::Arc::clone(&context.plan);
    let Some(device) = plan.device(id) else { return };
    let (wire, mailboxes) = (&context.wire, &context.mailboxes);
    let Some(mut multiplexer) = Multiplexer::new(wire, mailboxes, device) else { return };
    let mut openings = 0;
    let mut kept_for: Option<KeptFor> = None;
    // Messages were left in the mailbox, so that jobs get their turn.
    let mut is_full = false;
    loop {
        let now = context.wire.now();
        kept_for = kept_for.filter(|kept| now < kept.until);
        let interval = match mailboxes.is_mapped(id) {
            true => context.options.mailbox_interval.max(UNHEARD),
            false => context.options.mailbox_interval,
        };
        let interval = kept_for.map_or(interval, |kept| interval.min(kept.until.since(now)));
        let expects_frames = multiplexer.last_frame().is_some_and(|at| now < at + FRAMES_EXPECTED);
        let interval = match expects_frames && !mailboxes.is_mapped(id) {
            true => interval.min(FRAME_INTERVAL),
            false => interval,
        };
        let interval = if std::mem::take(&mut is_full) { Span::ZERO } else { interval };
        let client = kept_for.map(|kept| kept.client);
        let job = mailboxes.next(id, client, context.wire.sleep(interval)).await;
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
            Some(job) => {
                let (client, is_frame) = (job.request.client(), job.request.is_frame());
                work(&context, &mut multiplexer, job, open).await;
                if is_frame {
                    continue;
                }
                let (under_way, now) = (multiplexer.is_passing(), context.wire.now());
                kept_for = KeptFor::after(kept_for, client, under_way, now);
            }
            None if open => is_full = multiplexer.drain().await,
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
    // What others ask for in vain is no trouble of the SubDevice, nor are frames that nobody can take now.
    if job.request.client().is_none() && (open || !job.request.is_frame()) {
        context.mailboxes.note(job.id, context.wire.now(), &job.request, &outcome);
    }
    job.done(outcome);
}

#[cfg(test)]
mod tests;
