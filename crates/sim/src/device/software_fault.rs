//! Faults of the software of a device whose controller works.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::time::Span;

use crate::seed::{Seed, Stream};

/// How a device misbehaves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SoftwareFault {
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
    /// Fragments of Ethernet frames do not leave as they should, or do not reach its software (EoE).
    SpoilsFragments(SpoiledFragments),
    /// It has no buffer for Ethernet frames of the MainDevice, and refuses their fragments (EoE).
    EoeBufferFull,
}

/// Fate of a fragment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FragmentTrouble {
    /// It is left out.
    Lost,
    /// It leaves twice, as two messages.
    Doubled,
    /// It leaves after the next one of its frame.
    OutOfOrder,
}

/// Direction of fragments, as the device sees them.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum FragmentWay {
    /// Those that it sends.
    FromDevice,
    /// Those that the MainDevice sends to it.
    ToDevice,
}

/// Which fragments do not leave as they should.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SpoiledFragments {
    /// The only direction that is hit; `None`: both.
    pub way: Option<FragmentWay>,
    /// Fate of those that are hit.
    pub trouble: FragmentTrouble,
    /// Number of fragments that are hit, of 1,000,000.
    pub share_ppm: u32,
    /// Seed of the chance that chooses them.
    pub seed: Seed,
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
pub struct SoftwareFaults(Vec<(SoftwareFault, Stream)>);

impl SoftwareFaults {
    /// Something goes wrong from now on.
    pub fn begin(&mut self, software_fault: SoftwareFault) {
        let seed = match software_fault {
            SoftwareFault::RefusesSdo(refusals) => refusals.seed,
            SoftwareFault::SpoilsFragments(spoiled) => spoiled.seed,
            SoftwareFault::EoeBufferFull
            | SoftwareFault::SlowMailbox { .. }
            | SoftwareFault::MailboxNotRead
            | SoftwareFault::MailboxNotFilled
            | SoftwareFault::FrozenApplication
            | SoftwareFault::DeafToRequests
            | SoftwareFault::LockedBuffers
            | SoftwareFault::Mismatch(_) => Seed::default(),
        };
        self.0.push((software_fault, seed.stream("trouble")));
    }

    /// It does so no longer. Of two that are alike one stays.
    pub fn end(&mut self, software_fault: SoftwareFault) {
        if let Some(at) = self.0.iter().position(|(known, _)| *known == software_fault) {
            self.0.remove(at);
        }
    }

    /// Whether this is wrong.
    #[must_use]
    pub fn has(&self, software_fault: SoftwareFault) -> bool {
        self.0.iter().any(|(known, _)| *known == software_fault)
    }

    /// How much later than usual answers come.
    #[must_use]
    pub fn mailbox_delay(&self) -> Span {
        self.0.iter().fold(Span::ZERO, |sum, (software_fault, _)| match software_fault {
            SoftwareFault::SlowMailbox { by } => sum + *by,
            SoftwareFault::RefusesSdo(_)
            | SoftwareFault::MailboxNotRead
            | SoftwareFault::MailboxNotFilled
            | SoftwareFault::FrozenApplication
            | SoftwareFault::DeafToRequests
            | SoftwareFault::LockedBuffers
            | SoftwareFault::Mismatch(_)
            | SoftwareFault::SpoilsFragments(_)
            | SoftwareFault::EoeBufferFull => sum,
        })
    }

    /// Whether a request for an object is refused, and with what. Each call is one request: chance
    /// is drawn anew.
    pub fn refuses_sdo(&mut self, index: ObjectIndex) -> Option<RefusedWith> {
        self.0.iter_mut().find_map(|(software_fault, stream)| match software_fault {
            SoftwareFault::RefusesSdo(refusals) => {
                let hit = (refusals.first..=refusals.last).contains(&index)
                    && stream.below(1_000_000) < u64::from(refusals.share_ppm);
                hit.then_some(refusals.answer)
            }
            SoftwareFault::SlowMailbox { .. }
            | SoftwareFault::MailboxNotRead
            | SoftwareFault::MailboxNotFilled
            | SoftwareFault::FrozenApplication
            | SoftwareFault::DeafToRequests
            | SoftwareFault::LockedBuffers
            | SoftwareFault::Mismatch(_)
            | SoftwareFault::SpoilsFragments(_)
            | SoftwareFault::EoeBufferFull => None,
        })
    }

    /// Fate of a fragment of an Ethernet frame that goes this way; `None`: nothing is wrong with it. Each call is
    /// one fragment: chance is drawn anew.
    pub fn spoils_fragment(&mut self, goes: FragmentWay) -> Option<FragmentTrouble> {
        self.0.iter_mut().find_map(|(software_fault, stream)| match software_fault {
            SoftwareFault::SpoilsFragments(spoiled) => {
                let hit = spoiled.way.is_none_or(|way| way == goes)
                    && stream.below(1_000_000) < u64::from(spoiled.share_ppm);
                hit.then_some(spoiled.trouble)
            }
            SoftwareFault::RefusesSdo(_)
            | SoftwareFault::SlowMailbox { .. }
            | SoftwareFault::MailboxNotRead
            | SoftwareFault::MailboxNotFilled
            | SoftwareFault::FrozenApplication
            | SoftwareFault::DeafToRequests
            | SoftwareFault::LockedBuffers
            | SoftwareFault::Mismatch(_)
            | SoftwareFault::EoeBufferFull => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusals(share_ppm: u32) -> SoftwareFault {
        SoftwareFault::RefusesSdo(SdoRefusals {
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
            let mut software_faults = SoftwareFaults::default();
            software_faults.begin(refusals(share));
            assert_eq!(software_faults.refuses_sdo(ObjectIndex(0x7FFF)), None);
            assert_eq!(software_faults.refuses_sdo(ObjectIndex(0x9000)), None);
            (0..1_000)
                .filter(|_| software_faults.refuses_sdo(ObjectIndex(0x8010)).is_some())
                .count()
        };
        assert_eq!((refused(0), refused(1_000_000)), (0, 1_000));
        let half = refused(500_000);
        assert!((400..600).contains(&half), "{half}");
        assert_eq!(half, refused(500_000), "the same seed, the same choice");
    }

    #[test]
    fn delays_add_up_and_end_one_by_one() {
        let mut software_faults = SoftwareFaults::default();
        let slow = SoftwareFault::SlowMailbox { by: Span::ms(5) };
        software_faults.begin(slow);
        software_faults.begin(slow);
        software_faults.begin(SoftwareFault::MailboxNotRead);
        assert_eq!(software_faults.mailbox_delay(), Span::ms(10));
        software_faults.end(slow);
        assert_eq!(software_faults.mailbox_delay(), Span::ms(5));
        software_faults.end(SoftwareFault::DeafToRequests);
        assert!(software_faults.has(SoftwareFault::MailboxNotRead));
    }
}
