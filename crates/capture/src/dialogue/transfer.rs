//! A transfer: messages that belong together, and the store of all of them.

use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::Instant;

use super::MailboxMessage;
use super::report::{MailboxProtocol, TransferOutcome};
use crate::access::DatagramTarget;

/// Most transfers that are kept.
const MOST: usize = 50_000;
/// Most bytes that are kept of one.
pub(super) const MOST_DATA: usize = 4096;

/// When a message was seen, and in which frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SeenAt {
    /// When.
    pub at: Instant,
    /// The number of the frame.
    pub frame: u64,
}

/// Messages that belong together.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MailboxTransfer {
    /// Whose mailbox.
    pub target: DatagramTarget,
    /// The protocol.
    pub protocol: MailboxProtocol,
    /// What is done: `upload`, `write-file`.
    pub what: &'static str,
    /// The request; `None` where it was not recorded, or there is none.
    pub asked: Option<SeenAt>,
    /// The last message of the answer.
    pub answered: Option<SeenAt>,
    /// Number of messages.
    pub messages: u32,
    /// Of CoE: the object.
    pub object: Option<ObjectAddress>,
    /// Of CoE: all entries at once.
    pub complete: bool,
    /// Of an SDO: `expedited`, `normal`, `segmented`.
    pub form: Option<&'static str>,
    /// Bytes that were announced, where that was done.
    pub announced: Option<u32>,
    /// Bytes that came.
    pub size: u64,
    /// The first of them.
    pub data: Vec<u8>,
    /// Meaning of the data, or name of the file.
    pub text: Option<String>,
    /// The end it came to.
    pub outcome: TransferOutcome,
    /// Abort code, or error code of the protocol.
    pub code: Option<u32>,
}

impl MailboxTransfer {
    /// Adds data.
    pub(super) fn push(&mut self, data: &[u8]) {
        self.size += data.len() as u64;
        let room = MOST_DATA.saturating_sub(self.data.len());
        self.data.extend_from_slice(&data[..data.len().min(room)]);
    }

    /// Ends it.
    pub(super) fn end(&mut self, when: SeenAt, outcome: TransferOutcome, code: Option<u32>) {
        (self.answered, self.outcome, self.code) = (Some(when), outcome, code);
    }
}

/// All transfers.
#[derive(Clone, Default, Debug)]
pub(super) struct Store {
    pub(super) transfers: Vec<MailboxTransfer>,
    pub(super) left_out: u64,
}

impl Store {
    /// Begins a transfer with a message; `None` where there is no room for more.
    pub(super) fn open(
        &mut self,
        message: &MailboxMessage<'_>,
        protocol: MailboxProtocol,
        what: &'static str,
    ) -> Option<usize> {
        if self.transfers.len() >= MOST {
            self.left_out += 1;
            return None;
        }
        self.transfers.push(MailboxTransfer {
            target: message.target,
            protocol,
            what,
            asked: message.is_request.then_some(message.when),
            answered: (!message.is_request).then_some(message.when),
            messages: 1,
            object: None,
            complete: false,
            form: None,
            announced: None,
            size: 0,
            data: Vec::new(),
            text: None,
            outcome: TransferOutcome::Unanswered,
            code: None,
        });
        Some(self.transfers.len() - 1)
    }

    /// A message that stands for itself.
    pub(super) fn single(
        &mut self,
        message: &MailboxMessage<'_>,
        protocol: MailboxProtocol,
        what: &'static str,
    ) {
        let index = self.open(message, protocol, what);
        if let Some(transfer) = self.get(index) {
            transfer.push(message.body);
            transfer.outcome = TransferOutcome::Told;
        }
    }

    pub(super) fn get(&mut self, index: Option<usize>) -> Option<&mut MailboxTransfer> {
        self.transfers.get_mut(index?)
    }
}
