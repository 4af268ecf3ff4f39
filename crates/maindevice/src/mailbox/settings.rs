//! Addresses of an Ethernet port, set by EoE.
//!
//! Reference: ETG.1000.6, EoE (set IP parameter).

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::eoe::{self, EoeResult, Setting};

use super::failure::Why;
use super::transaction::MailboxTransaction;

/// Sets the addresses of a port.
pub(crate) async fn set_addresses(
    transaction: &mut MailboxTransaction<'_>,
    port: u8,
    parameters: &[u8],
) -> Result<(), Why> {
    let request = eoe::Message::Request { port, about: Setting::SetIp, parameters };
    transaction.say(MailboxType::Eoe, |body| request.write(body)).await?;
    let answer = transaction.hear(MailboxType::Eoe).await?;
    match eoe::Message::parse(&answer) {
        Ok(eoe::Message::Response { about: Setting::SetIp, result, .. }) => match result {
            EoeResult::SUCCESS => Ok(()),
            result => Err(Why::Ethernet { result }),
        },
        other => {
            let found = format!("{other:?}");
            Err(Why::Protocol { expected: "the answer to new addresses", found })
        }
    }
}
