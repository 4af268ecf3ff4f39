//! VoE server: it says what it was told, where that bears the vendor id of the device.
//!
//! Reference: ETG.1000.6, VoE: vendor id (u32), a number of the vendor (u16), data. What they mean is the vendor's
//! affair, and so is whether there is an answer.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::coe::ObjectAddress;

use super::{Answers, Served};

/// Vendor id and the vendor's number.
const VOE_HEADER_LEN: usize = 6;

/// Answers a message with the same one.
pub(super) fn answer(message: &[u8], served: &Served<'_>) -> Result<Answers, ErrorReplyCode> {
    let vendor = message.get(..4).filter(|_| message.len() >= VOE_HEADER_LEN);
    let vendor = vendor.ok_or(ErrorReplyCode::SizeTooShort)?;
    let own = served.dictionary.upload(ObjectAddress::new(0x1018, 1), served.state);
    if own.as_deref() == Ok(vendor) {
        Ok(vec![message.to_vec()])
    } else {
        Err(ErrorReplyCode::InvalidHeader)
    }
}
