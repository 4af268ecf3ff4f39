//! Messages that wait to be fetched.
//!
//! Reference: ETG.1000.4, mailbox: the counter of the sender goes from 1 to 7 and on with 1; of
//! messages that wait, those of higher priority leave first.

use std::collections::VecDeque;

use linesman_proto::address::StationAddress;
use linesman_proto::mailbox::{BufferTooSmall, Counter, Header, MailboxType};

use super::ANSWERS;
use crate::controller::Pdi;

/// Whom a message is for, and how urgent it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Envelope {
    /// The address that came with the request; 0 for the MainDevice itself.
    pub(super) address: StationAddress,
    /// 0 to 3, 3 first.
    pub(super) priority: u8,
}

impl Envelope {
    /// To the MainDevice, unasked.
    pub(super) const UNASKED: Self = Self { address: StationAddress(0), priority: 0 };

    /// Back to who sent a message.
    pub(super) const fn answering(header: &Header) -> Self {
        Self { address: header.address, priority: header.priority }
    }
}

#[derive(Clone, PartialEq, Eq, Debug)]
struct QueuedMessage {
    envelope: Envelope,
    kind: MailboxType,
    body: Vec<u8>,
}

/// The queue of messages to the MainDevice.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(super) struct Outbox {
    waiting: VecDeque<QueuedMessage>,
    sent: Counter,
    /// The last message that was put into SyncManager 1.
    last: Vec<u8>,
    /// The one before it, which the MainDevice has fetched. Empty if there is none, or it was repeated.
    fetched: Vec<u8>,
    /// A message that was taken out of SyncManager 1 for one that is repeated, and goes in after it.
    taken_out: Option<Vec<u8>>,
}

impl Outbox {
    /// Messages that are not in SyncManager 1 yet.
    pub(super) fn len(&self) -> usize {
        self.waiting.len() + usize::from(self.taken_out.is_some())
    }

    /// The next message has this counter, 1 to 7.
    pub(super) fn count_from(&mut self, next: Counter) {
        let before = (0..=7).filter_map(Counter::new).find(|counter| counter.next() == next);
        self.sent = before.unwrap_or(Counter::NONE);
    }

    /// Queues a message behind all of its own and of higher priority.
    pub(super) fn push(&mut self, kind: MailboxType, envelope: Envelope, body: Vec<u8>) {
        let before = |waiting: &QueuedMessage| waiting.envelope.priority >= envelope.priority;
        let at = self.waiting.iter().rposition(before).map_or(0, |at| at + 1);
        self.waiting.insert(at, QueuedMessage { envelope, kind, body });
    }

    /// Puts the next message into SyncManager 1, if that is empty. One that does not fit into it is
    /// not sent.
    pub(super) fn deliver(&mut self, pdi: &mut Pdi<'_>) {
        if let Some(message) = self.taken_out.take() {
            if pdi.write_sync_manager(ANSWERS, &message) {
                self.fetched = std::mem::replace(&mut self.last, message);
            } else {
                self.taken_out = Some(message);
            }
            return;
        }
        while let Some(waiting) = self.waiting.front() {
            let counter = self.sent.next();
            let header = Header {
                address: waiting.envelope.address,
                priority: waiting.envelope.priority,
                ..Header::new(waiting.kind, counter, 0)
            };
            let mut message = vec![0; super::answer_room(pdi)];
            match header.write_message(&mut message, |slot| copy(&waiting.body, slot)) {
                Ok(len) => message.truncate(len),
                Err(BufferTooSmall { .. }) => {
                    self.waiting.pop_front();
                    continue;
                }
            }
            if pdi.write_sync_manager(ANSWERS, &message) {
                self.waiting.pop_front();
                self.sent = counter;
                self.fetched = std::mem::replace(&mut self.last, message);
            }
            return;
        }
    }

    /// Puts the message in again that was fetched last: the MainDevice did not get it. Where the next
    /// one is in the mailbox already, it is taken out, and follows.
    pub(super) fn repeat(&mut self, pdi: &mut Pdi<'_>) {
        if !pdi.mailbox_full(ANSWERS) {
            if !self.last.is_empty() {
                pdi.write_sync_manager(ANSWERS, &self.last);
                self.fetched.clear();
            }
        } else if !self.fetched.is_empty() {
            pdi.deactivate_sync_manager(ANSWERS, true);
            pdi.deactivate_sync_manager(ANSWERS, false);
            let repeated = std::mem::take(&mut self.fetched);
            pdi.write_sync_manager(ANSWERS, &repeated);
            self.taken_out = Some(std::mem::replace(&mut self.last, repeated));
        }
    }
}

/// Writes a body that is ready.
fn copy(body: &[u8], buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
    let (needed, available) = (body.len(), buffer.len());
    let slot = buffer.get_mut(..needed).ok_or(BufferTooSmall { needed, available })?;
    slot.copy_from_slice(body);
    Ok(needed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn higher_priority_leaves_first_and_the_same_in_order() {
        let mut outbox = Outbox::default();
        for (priority, body) in [(0, 1), (2, 2), (0, 3), (3, 4), (2, 5), (0, 6)] {
            let envelope = Envelope { priority, ..Envelope::UNASKED };
            outbox.push(MailboxType::Coe, envelope, vec![body]);
        }
        let order: Vec<u8> = outbox.waiting.iter().map(|waiting| waiting.body[0]).collect();
        assert_eq!(order, [4, 2, 5, 1, 3, 6]);
    }
}
