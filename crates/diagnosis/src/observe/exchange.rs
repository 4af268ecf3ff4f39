//! A request and what came back for it.

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

/// One copy of a frame on its way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameCopy<'a> {
    /// The frame.
    pub bytes: &'a [u8],
    /// When it was seen.
    pub time: Instant,
    /// Its number.
    pub number: u64,
    /// The card, where known.
    pub path: Option<Path>,
}

/// What is known of one request after a copy of it came back, or after none did.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Exchange<'a> {
    /// On its way out; `None` when only the return was seen.
    pub request: Option<FrameCopy<'a>>,
    /// On its way back; `None` when it never came.
    pub reply: Option<FrameCopy<'a>>,
    /// Working counters, datagram by datagram, of copies that came back before this one: in a ring
    /// each request goes out by both cards.
    pub earlier: &'a [u16],
    /// Whether nothing more will come: now it can be judged.
    pub is_last: bool,
    /// How many frames had come back when the request went out: requests with the same number went
    /// out one after the other without any return between them.
    pub returns_before: u64,
    /// Whether the input ended while the return may still have been on its way.
    pub is_cut_off: bool,
    /// Whether it is the copy of a request for the other card of a ring in which some commands are
    /// replaced by NOP, or the one alone that was sent by it. The copy with all of them tells of whoever does not
    /// answer to this one.
    pub is_part: bool,
    /// The card to which its copy did not come, though those of others before and after it did.
    pub copy_lost: Option<Path>,
    /// The card to which its copy did not come since the ring, of which both copies had come back before, is no
    /// longer whole.
    pub copy_gone: Option<Path>,
    /// The card by which the copy that came back had gone out; `None` where that is not known.
    pub sent_by: Option<Path>,
}

impl Exchange<'_> {
    /// What controllers have added to the working counter of datagram `index`, all copies together, when it went out
    /// with `sent` and the one that just came back has `wkc`.
    #[must_use]
    pub fn added(&self, index: usize, sent: u16, wkc: u16) -> u16 {
        let own = wkc.saturating_sub(sent);
        let earlier = self.earlier.get(index).map(|earlier| earlier.saturating_sub(sent));
        earlier.map_or(own, |earlier| earlier.saturating_add(own))
    }
}
