//! Role of the frame that was taken last: request, return, or neither, with the working counters of copies before it.

use super::{Exchange, PairingOutcome};

/// Role of the latest frame of a network.
#[derive(Clone, Default, Debug)]
pub struct LatestFrame {
    outcome: Option<PairingOutcome>,
    is_whole: bool,
    earlier: Vec<u16>,
}

impl LatestFrame {
    /// Forgets the frame before.
    pub(crate) fn begin(&mut self) {
        self.outcome = None;
        self.is_whole = false;
        self.earlier.clear();
    }

    /// Notes the exchange that the frame completes.
    pub(crate) fn note_exchange(&mut self, exchange: &Exchange<'_>) {
        if exchange.reply.is_some() {
            self.is_whole = exchange.is_last && !exchange.is_part;
            self.earlier.extend_from_slice(exchange.earlier);
        }
    }

    /// Notes what it turned out to be.
    pub(crate) const fn note_outcome(&mut self, outcome: PairingOutcome) {
        self.outcome = Some(outcome);
    }

    /// What it is; `None` for a frame without datagrams, a damaged one, and a question asked beside the MainDevice.
    #[must_use]
    pub const fn outcome(&self) -> Option<PairingOutcome> {
        self.outcome
    }

    /// True if it goes out.
    #[must_use]
    pub const fn is_request(&self) -> bool {
        matches!(self.outcome, Some(PairingOutcome::Request | PairingOutcome::RequestCopy))
    }

    /// True if it comes back.
    #[must_use]
    pub const fn is_return(&self) -> bool {
        matches!(self.outcome, Some(PairingOutcome::Return | PairingOutcome::ReturnAlone))
    }

    /// True if all copies of its request are back: in a ring there are two, and only their sum can be compared with an
    /// expected working counter.
    #[must_use]
    pub const fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// The working counter of datagram `index`, counted from 0, with that of the copy that came back before.
    #[must_use]
    pub fn working_counter(&self, index: usize, own: u16) -> u16 {
        own.saturating_add(self.earlier.get(index).copied().unwrap_or(0))
    }
}
