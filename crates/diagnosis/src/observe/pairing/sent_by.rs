//! Card of a ring that has sent a frame, found from how it comes back.
//!
//! Where cards are told apart, their requests were seen to leave by them; else the second card is known as the
//! one that sends what the first one has just sent. Controllers leave the source address as it was, but for
//! one bit (S1 chapter 3), so that it tells the two copies of a request apart.

use linesman_proto::address::Path;
use linesman_proto::ethernet::MacAddress;

use super::{Pairing, PendingRequest};

impl Pairing {
    /// The card that had sent what came back from `source` for a request; `None` where the cards cannot be
    /// told apart.
    pub(super) fn sent_by(&self, pending: &PendingRequest, source: MacAddress) -> Option<Path> {
        let first = pending.path.or_else(|| {
            let is_other = is_same(self.other_card?, pending.source);
            Some(if is_other { Path::B } else { Path::A })
        });
        match pending.copy_by {
            None => first,
            // Both cards have one address: nothing tells the copies apart.
            Some(copy) if is_same(copy, pending.source) => None,
            Some(_) if is_same(source, pending.source) => first,
            Some(_) => first.map(Path::other),
        }
    }
}

/// Whether two addresses are one, whoever has processed the frames.
fn is_same(one: MacAddress, other: MacAddress) -> bool {
    one.marked() == other.marked()
}
