//! Ethernet frames to a SubDevice, in fragments (EoE).
//!
//! Reference: ETG.1000.6, EoE (initiate EoE, EoE fragment). Nothing answers a fragment: whether the frame arrived,
//! its sender finds out by the protocols above. What the SubDevice sends comes unasked, as
//! [`Event::Mailbox`](crate::Event::Mailbox).

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::eoe::{self, fragments};
use linesman_proto::time::{Instant, Span};

use super::failure::{Step, Why};
use super::transaction::MailboxTransaction;

/// How long a mailbox may stay full. A frame that is late is of no use, and others wait behind it.
const FRAME_PATIENCE: Span = Span::ms(500);

/// Sends a frame; gives how many fragments that took, and how often messages were sent or fetched again meanwhile.
pub(crate) async fn send_frame(
    transaction: &mut MailboxTransaction<'_>,
    port: u8,
    number: u8,
    frame: &[u8],
) -> Result<Vec<u8>, Why> {
    transaction.patience = transaction.patience.min(FRAME_PATIENCE);
    let before = transaction.multiplexer.repetitions();
    let room =
        transaction.multiplexer.out_size().saturating_sub(linesman_proto::mailbox::HEADER_LEN);
    let mut sent: u32 = 0;
    for fragment in fragments(frame, port, number, room) {
        let message = eoe::Message::Fragment(fragment);
        transaction.say(MailboxType::Eoe, |body| message.write(body)).await?;
        transaction.multiplexer.fragment_sent();
        sent += 1;
        transaction.step = Step::Fragment(sent);
    }
    // A SubDevice whose own messages are not fetched takes no more of ours.
    transaction.multiplexer.drain_unless_empty().await;
    let again = transaction.multiplexer.repetitions().wrapping_sub(before);
    Ok([sent.to_le_bytes(), again.to_le_bytes()].concat())
}

/// A SubDevice may refuse a fragment of an Ethernet frame so long after it took it.
const FRAGMENT_REFUSED_WITHIN: Span = Span::s(2);

/// Fragments of Ethernet frames that a SubDevice may still refuse.
///
/// Nothing answers a fragment but an error reply, and that does not say which message it is about. Messages are answered
/// in order: so many error replies as there are fragments before a request may be about those, and the next one is not.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct UnansweredFragments {
    count: u32,
    /// Time when the last one was sent.
    last: Instant,
}

impl UnansweredFragments {
    pub(super) fn sent(&mut self, now: Instant) {
        *self = Self { count: self.count.saturating_add(1), last: now };
    }

    /// An error reply came. True if it may be about a fragment.
    pub(super) fn refused(&mut self, now: Instant) -> bool {
        if now >= self.last + FRAGMENT_REFUSED_WITHIN {
            self.count = 0;
        }
        let is_about_fragment = self.count > 0;
        self.count = self.count.saturating_sub(1);
        is_about_fragment
    }
}
