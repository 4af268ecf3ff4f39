//! Messages of a vendor's own protocol (VoE), at start-up.
//!
//! Reference: ETG.1000.6, VoE: what a message means, and whether it is answered, only the vendor knows.

use linesman_proto::mailbox::MailboxType;
use linesman_proto::time::Span;

use super::failure::Why;
use super::pass::copy;
use super::transaction::MailboxTransaction;

/// Sends a message, and gives what came within this time; nothing where nothing came. Only an error reply of the mailbox
/// is a refusal.
pub(crate) async fn send(
    transaction: &mut MailboxTransaction<'_>,
    data: &[u8],
    answer_within: Span,
) -> Result<Vec<u8>, Why> {
    transaction.say(MailboxType::Voe, |body| copy(data, body)).await?;
    transaction.wait_no_longer_than(answer_within);
    match transaction.hear(MailboxType::Voe).await {
        Err(Why::NoAnswer { .. }) => Ok(Vec::new()),
        outcome => outcome,
    }
}
