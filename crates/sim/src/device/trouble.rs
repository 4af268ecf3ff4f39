//! What can be wrong with the software of a device, while its controller works: faults.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::time::Span;

use crate::seed::{Seed, Stream};

/// How a device misbehaves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Trouble {
    /// It refuses SDO requests that it could serve.
    RefusesSdo(SdoRefusals),
    /// It answers mailbox messages later than usual.
    SlowMailbox {
        /// By how much.
        by: Span,
    },
    /// It does not take messages out of its mailbox: it stays full.
    MailboxNotRead,
    /// It does not put answers into its mailbox.
    MailboxNotFilled,
    /// Its application has stopped: inputs stay as they are, outputs are not driven anew.
    FrozenApplication,
    /// It does not answer requests for a state.
    DeafToRequests,
    /// It keeps the buffers of its process data locked: who reads or writes there adds nothing to a working
    /// counter.
    LockedBuffers,
    /// A setting of it does not fit what its data say.
    Mismatch(Mismatch),
}

/// Which setting does not fit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mismatch {
    /// Its stored PDO assignment is shorter than its data say.
    ProcessData,
    /// The mailboxes that it takes are shorter than its data say.
    Mailbox,
    /// It finds a module less than were configured.
    Modules,
}

/// Which SDO requests are refused, and how.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SdoRefusals {
    /// What it answers.
    pub answer: RefusedWith,
    /// The first object that is refused.
    pub first: ObjectIndex,
    /// The last one.
    pub last: ObjectIndex,
    /// How many of 1,000,000 requests.
    pub share_ppm: u32,
    /// What decides which ones.
    pub seed: Seed,
}

/// The answer to a request that is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RefusedWith {
    /// An abort of the transfer.
    Abort(SdoAbortCode),
    /// An error reply of the mailbox itself.
    ErrorReply(ErrorReplyCode),
}

/// All that is wrong with a device at present.
#[derive(Clone, Default, Debug)]
pub struct Troubles(Vec<(Trouble, Stream)>);

impl Troubles {
    /// Something goes wrong from now on.
    pub fn begin(&mut self, trouble: Trouble) {
        let seed = match trouble {
            Trouble::RefusesSdo(refusals) => refusals.seed,
            Trouble::SlowMailbox { .. }
            | Trouble::MailboxNotRead
            | Trouble::MailboxNotFilled
            | Trouble::FrozenApplication
            | Trouble::DeafToRequests
            | Trouble::LockedBuffers
            | Trouble::Mismatch(_) => Seed::default(),
        };
        self.0.push((trouble, seed.stream("trouble")));
    }

    /// It does so no longer. Of two that are alike one stays.
    pub fn end(&mut self, trouble: Trouble) {
        if let Some(at) = self.0.iter().position(|(known, _)| *known == trouble) {
            self.0.remove(at);
        }
    }

    /// Whether this is wrong.
    #[must_use]
    pub fn has(&self, trouble: Trouble) -> bool {
        self.0.iter().any(|(known, _)| *known == trouble)
    }

    /// How much later than usual answers come.
    #[must_use]
    pub fn mailbox_delay(&self) -> Span {
        self.0.iter().fold(Span::ZERO, |sum, (trouble, _)| match trouble {
            Trouble::SlowMailbox { by } => sum + *by,
            Trouble::RefusesSdo(_)
            | Trouble::MailboxNotRead
            | Trouble::MailboxNotFilled
            | Trouble::FrozenApplication
            | Trouble::DeafToRequests
            | Trouble::LockedBuffers
            | Trouble::Mismatch(_) => sum,
        })
    }

    /// Whether a request for an object is refused, and with what. Each call is one request: chance
    /// is drawn anew.
    pub fn refuses_sdo(&mut self, index: ObjectIndex) -> Option<RefusedWith> {
        self.0.iter_mut().find_map(|(trouble, stream)| match trouble {
            Trouble::RefusesSdo(refusals) => {
                let hit = (refusals.first..=refusals.last).contains(&index)
                    && stream.below(1_000_000) < u64::from(refusals.share_ppm);
                hit.then_some(refusals.answer)
            }
            Trouble::SlowMailbox { .. }
            | Trouble::MailboxNotRead
            | Trouble::MailboxNotFilled
            | Trouble::FrozenApplication
            | Trouble::DeafToRequests
            | Trouble::LockedBuffers
            | Trouble::Mismatch(_) => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusals(share_ppm: u32) -> Trouble {
        Trouble::RefusesSdo(SdoRefusals {
            answer: RefusedWith::Abort(SdoAbortCode::GENERAL_ERROR),
            first: ObjectIndex(0x8000),
            last: ObjectIndex(0x8FFF),
            share_ppm,
            seed: Seed(7),
        })
    }

    #[test]
    fn a_share_of_some_objects_is_refused() {
        let refused = |share| {
            let mut troubles = Troubles::default();
            troubles.begin(refusals(share));
            assert_eq!(troubles.refuses_sdo(ObjectIndex(0x7FFF)), None);
            assert_eq!(troubles.refuses_sdo(ObjectIndex(0x9000)), None);
            (0..1_000).filter(|_| troubles.refuses_sdo(ObjectIndex(0x8010)).is_some()).count()
        };
        assert_eq!((refused(0), refused(1_000_000)), (0, 1_000));
        let half = refused(500_000);
        assert!((400..600).contains(&half), "{half}");
        assert_eq!(half, refused(500_000), "the same seed, the same choice");
    }

    #[test]
    fn delays_add_up_and_end_one_by_one() {
        let mut troubles = Troubles::default();
        let slow = Trouble::SlowMailbox { by: Span::ms(5) };
        troubles.begin(slow);
        troubles.begin(slow);
        troubles.begin(Trouble::MailboxNotRead);
        assert_eq!(troubles.mailbox_delay(), Span::ms(10));
        troubles.end(slow);
        assert_eq!(troubles.mailbox_delay(), Span::ms(5));
        troubles.end(Trouble::DeafToRequests);
        assert!(troubles.has(Trouble::MailboxNotRead));
    }
}
