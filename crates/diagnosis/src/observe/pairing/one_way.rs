//! Recordings of one direction: nothing but what comes back.

use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::Instant;

use super::{Exchange, Fingerprint, Pairing};

/// So many returns without a request in between come from a recording that has none.
const ONE_WAY_FOR_SURE: u32 = 64;

/// A recording that shows only what comes back, as far as that is known.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) enum OneWay {
    /// Nothing speaks for it yet.
    #[default]
    Open,
    /// Answers came from this marked address, and no request was seen: whatever has it comes back.
    From(MacAddress),
    /// Requests and returns are both there.
    No,
}

impl Pairing {
    /// Whether so many returns came without a single request that there are none in the recording: then every frame
    /// comes back, also the copies of a ring's second card, which nobody processes.
    pub(super) const fn is_one_way_for_sure(&self) -> bool {
        matches!(self.one_way, OneWay::From(_)) && self.alone >= ONE_WAY_FOR_SURE
    }

    /// A return came whose request was not seen. An answer from a marked address, with no request
    /// ever paired, means that requests are not recorded; what nobody answered and was taken for one
    /// came back too. Where the MainDevice's own address has the mark, the next answer to such a
    /// frame shows the mistake.
    pub(super) fn weigh_one_way(
        &mut self,
        source: MacAddress,
        print: Fingerprint,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) {
        match self.one_way {
            OneWay::Open if print.is_answered && source.is_marked() => {
                self.one_way = OneWay::From(source);
                self.turn_round(|one| one == source, settle);
            }
            OneWay::From(_) => {
                self.alone += 1;
                if self.alone == ONE_WAY_FOR_SURE {
                    self.turn_round(|_| true, settle);
                }
                let was_its_request = |(returned, _): &(Fingerprint, Instant)| {
                    returned.lasting == print.lasting && !returned.is_answered
                };
                let is_sure = self.alone >= ONE_WAY_FOR_SURE;
                if !is_sure
                    && print.is_answered
                    && self.returned.iter().flatten().any(was_its_request)
                {
                    self.one_way = OneWay::No;
                }
            }
            OneWay::Open | OneWay::No => {}
        }
    }

    /// Requests of these senders were returns: whoever sent them is no sender.
    fn turn_round(
        &mut self,
        is_theirs: impl Fn(MacAddress) -> bool,
        settle: &mut impl FnMut(&Exchange<'_>),
    ) {
        self.senders.forget(&is_theirs);
        while let Some(at) = self.pending.iter().position(|one| is_theirs(one.source)) {
            self.mistaken += 1;
            if !self.pending[at].source.is_marked() {
                // No controller has touched it: the copy of a ring's second card.
                self.remove(at);
                continue;
            }
            let reply = Some(self.pending[at].copy());
            let returns_before = self.returns;
            settle(&Exchange {
                request: None,
                reply,
                earlier: &[],
                is_last: true,
                returns_before,
                is_cut_off: false,
                is_part: false,
                copy_lost: None,
                copy_gone: None,
                sent_by: None,
            });
            self.returns += 1;
            self.remove(at);
        }
    }
}
