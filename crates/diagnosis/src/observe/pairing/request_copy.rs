//! Copies of requests: what the second card of a ring sends.

use linesman_proto::ethernet::MacAddress;

use super::{Fingerprint, FrameSeen, OTHER_CARD, Pairing, PendingRequest, gap};

impl Pairing {
    /// Takes a request as the copy that the other card of a ring sends, if it is one.
    pub(super) fn take_copy(
        &mut self,
        frame: &FrameSeen<'_>,
        source: MacAddress,
        is_repeated: bool,
        print: Fingerprint,
    ) -> bool {
        if let Some(path) = frame.path
            && let Some(pending) = self.pending.iter_mut().rev().find(|pending| {
                pending.print == print
                    && !pending.sent[path.index()]
                    && gap(pending.time, frame.time) <= OTHER_CARD
            })
        {
            pending.sent[path.index()] = true;
            pending.copy_by = Some(source);
            pending.out += 1;
            return true;
        }
        let is_other_card = |pending: &&mut PendingRequest| {
            pending.print == print
                && pending.copy_by.is_none()
                && pending.source != source
                && gap(pending.time, frame.time) <= OTHER_CARD
        };
        if frame.path.is_none()
            && is_repeated
            && let Some(pending) = self.pending.iter_mut().rev().find(is_other_card)
        {
            pending.copy_by = Some(source);
            pending.out += 1;
            self.other_card = Some(source);
            self.senders.note(frame, source, is_repeated);
            return true;
        }
        false
    }
}
