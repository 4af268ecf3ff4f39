//! Who sends requests: one MainDevice, its second card, or somebody else.

use linesman_proto::ethernet::MacAddress;

use crate::line::Seen;

/// So many requests of its own make a sender one for sure.
pub const OWN: u64 = 16;

/// Somebody who sends requests.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sender {
    /// Its address.
    pub mac: MacAddress,
    /// Its first request.
    pub first: Seen<()>,
    /// Requests of its own: the second card of a ring only repeats those of the first.
    pub own: u64,
    /// Whether it is a card of this host, so that several of them are one MainDevice.
    pub is_host: bool,
}
