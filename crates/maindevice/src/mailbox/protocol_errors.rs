//! Protocol errors in the mailbox of a SubDevice: the last error, and those before it.
//!
//! Reference: PLC libraries of the vendor tool give the *last* protocol error of a SubDevice, which
//! its next clean access erases. So does [`ProtocolErrors::last`]; the history stays.

use std::collections::VecDeque;

use linesman_proto::mailbox::MailboxType;
use linesman_proto::time::Instant;

use super::failure::MailboxFailure;

/// How many errors of a SubDevice are kept.
const KEPT: usize = 64;

/// An error, and when it was.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ProtocolError {
    /// When the operation ended.
    pub at: Instant,
    /// What went wrong.
    pub failure: MailboxFailure,
}

/// The errors in the mailbox of one SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ProtocolErrors {
    history: VecDeque<ProtocolError>,
    /// Protocols whose newest access failed.
    standing: Vec<MailboxType>,
    /// How many there were in all.
    total: u64,
}

impl ProtocolErrors {
    /// The error of the newest access by this protocol; `None` when that was clean.
    #[must_use]
    pub fn last(&self, protocol: MailboxType) -> Option<&ProtocolError> {
        let of = |error: &&ProtocolError| error.failure.operation.protocol() == protocol;
        self.standing.contains(&protocol).then(|| self.history.iter().rev().find(of)).flatten()
    }

    /// The last error of each protocol whose newest access failed.
    pub fn standing(&self) -> impl Iterator<Item = &ProtocolError> {
        self.standing.iter().filter_map(|protocol| self.last(*protocol))
    }

    /// The errors, oldest first; at most 64.
    pub fn history(&self) -> impl DoubleEndedIterator<Item = &ProtocolError> {
        self.history.iter()
    }

    /// How many errors there were, also those that are kept no longer.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.total
    }

    /// An access was clean.
    pub(crate) fn clean(&mut self, protocol: MailboxType) {
        self.standing.retain(|standing| *standing != protocol);
    }

    /// An access failed.
    pub(crate) fn failed(&mut self, at: Instant, failure: MailboxFailure) {
        let protocol = failure.operation.protocol();
        if !self.standing.contains(&protocol) {
            self.standing.push(protocol);
        }
        if self.history.len() == KEPT {
            // The newest error of a protocol that stands is never among the oldest 64 unless the
            // other one fails on and on; it is then told by its number only.
            self.history.pop_front();
        }
        self.history.push_back(ProtocolError { at, failure });
        self.total += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mailbox::failure::{Step, Why};
    use crate::mailbox::request::MailboxOperation;
    use linesman_proto::address::DeviceId;
    use linesman_proto::mailbox::abort_code::SdoAbortCode;
    use linesman_proto::mailbox::coe::ObjectAddress;
    use linesman_proto::mailbox::foe::FoeErrorCode;

    fn failure(operation: MailboxOperation, why: Why) -> MailboxFailure {
        MailboxFailure { id: DeviceId(2), operation, step: Step::Request, why }
    }

    #[test]
    fn a_clean_access_erases_the_last_error_of_its_protocol_and_no_history() {
        let mut errors = ProtocolErrors::default();
        let object = ObjectAddress::new(0x10F0, 1);
        let abort = failure(
            MailboxOperation::Write { object, complete: false },
            Why::Aborted { code: SdoAbortCode::READ_ONLY },
        );
        let file = failure(
            MailboxOperation::ReadFile { name: "a".to_owned() },
            Why::File { code: FoeErrorCode::DISK_FULL, text: String::new() },
        );
        errors.failed(Instant::ZERO, abort.clone());
        errors.failed(Instant::ZERO, file.clone());
        assert_eq!(errors.last(MailboxType::Coe).map(|last| &last.failure), Some(&abort));
        errors.clean(MailboxType::Coe);
        assert_eq!(errors.last(MailboxType::Coe), None);
        assert_eq!(errors.last(MailboxType::Foe).map(|last| &last.failure), Some(&file));
        assert_eq!(errors.history().count(), 2);
        for _ in 0..100 {
            errors.failed(Instant::ZERO, abort.clone());
        }
        assert_eq!((errors.history().count(), errors.total()), (KEPT, 102));
    }
}
