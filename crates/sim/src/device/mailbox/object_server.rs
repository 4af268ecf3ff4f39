//! The CoE server alone, for objects that are behind no controller: those of a MainDevice.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::Message;
use linesman_proto::mailbox::coe::information::Body;
use linesman_proto::state::AlState;

use super::coe::CoeServer;
use super::{Served, information};
use crate::device::dictionary::Dictionary;
use crate::device::files::Files;
use crate::device::software_fault::SoftwareFaults;

/// A CoE server for one client: it remembers the client's transfer while that takes several messages.
#[derive(Clone, Default, Debug)]
pub struct ObjectServer {
    coe: CoeServer,
}

impl ObjectServer {
    /// The answers to a CoE message, each as what follows its mailbox header; none to an abort. `mailbox_len` is the
    /// length of the longest message that may come back, mailbox header included, in bytes.
    ///
    /// # Errors
    /// The code of the mailbox error reply to what is no request.
    pub fn answer(
        &mut self,
        request: &[u8],
        dictionary: &mut Dictionary,
        mailbox_len: usize,
    ) -> Result<Vec<Vec<u8>>, ErrorReplyCode> {
        // Subindices that are left out are refused here: no SubDevice, no walk from 0 up.
        if let Ok(Message::Information(question)) = Message::parse(request)
            && let Body::EntryRequest { object, .. } = question.body
            && let Some(known) = dictionary.object(object.index)
            && known.entry(object.subindex).is_none()
        {
            return Ok(information::refuse(SdoAbortCode::NO_SUBINDEX));
        }
        let (mut files, mut software_faults) = (Files::default(), SoftwareFaults::default());
        let mut served = Served {
            dictionary,
            files: &mut files,
            software_faults: &mut software_faults,
            state: AlState::Op,
        };
        self.coe.answer(request, &mut served, mailbox_len)
    }
}
