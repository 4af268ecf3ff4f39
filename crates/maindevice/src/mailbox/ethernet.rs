//! Ethernet frames to a SubDevice, in fragments (EoE).
//!
//! Reference: ETG.1000.6, EoE (initiate EoE, EoE fragment). Nothing answers a fragment: whether the frame arrived,
//! its sender finds out by the protocols above. What the SubDevice sends comes unasked, as
//! [`Event::Mailbox`](crate::Event::Mailbox).

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::eoe::{self, fragments};

use linesman_proto::time::Span;

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
    transaction.multiplexer.drain().await;
    let again = transaction.multiplexer.repetitions().wrapping_sub(before);
    Ok([sent.to_le_bytes(), again.to_le_bytes()].concat())
}
