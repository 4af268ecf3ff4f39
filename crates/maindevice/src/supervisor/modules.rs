//! Modules in the slots of a SubDevice: what is there against what is planned.
//!
//! Reference: ETG.5001, objects 0xF030 (configured) and 0xF050 (detected module identities), one entry for
//! each slot.

use linesman_config::plan::DevicePlan;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use super::{Context, StartUpError};
use crate::mailbox::{MailboxRequest, Why};
use crate::procedure::state::StepError;

/// Compares what the SubDevice has detected with the plan, slot by slot. A SubDevice that does not have the
/// object cannot tell, and is believed.
///
/// # Errors
/// [`StepError::Module`] with the first slot that holds another module, or when it does not answer.
pub(super) async fn compare(context: &Context, device: &DevicePlan) -> Result<(), StepError> {
    for (slot, expected) in (1..=u8::MAX).zip(&device.settings.modules) {
        let object = ObjectAddress::new(ObjectIndex::DETECTED_MODULES.0, slot);
        let request = MailboxRequest::Upload { object, complete: false };
        let found = match context.mailboxes.ask(device.id, request).await {
            Ok(data) => {
                let mut bytes = [0; 4];
                bytes.iter_mut().zip(&data).for_each(|(byte, came)| *byte = *came);
                u32::from_le_bytes(bytes)
            }
            Err(failure) => {
                let code = if let Why::Aborted { code } = failure.why { Some(code) } else { None };
                if code == Some(SdoAbortCode::NO_OBJECT) {
                    return Ok(());
                }
                // Slots behind the last one that is used need not be listed.
                if code != Some(SdoAbortCode::NO_SUBINDEX) {
                    return Err(StepError::Unread(Box::new(StartUpError::Object(failure))));
                }
                0
            }
        };
        if found != *expected {
            return Err(StepError::Module { slot, expected: *expected, found });
        }
    }
    Ok(())
}
