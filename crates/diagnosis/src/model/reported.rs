//! Statements of another program about a line: what the MainDevice counts of its frames, how many
//! SubDevices it hears, what has trouble, what was exchanged to find a fault.
//!
//! Frames and registers tell the rest of the line; this is what is known without them. `None` means
//! that nobody told, and 0 that somebody told 0.

use std::collections::BTreeMap;

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::AlStatus;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::{Seen, Tally};
use crate::main_device::MainDeviceKind;

/// What was told of a line.
#[derive(Clone, Default, Debug)]
pub struct Reported {
    /// The MainDevice whose tools say so.
    pub kind: MainDeviceKind,
    /// Frames that the MainDevice has sent.
    pub sent: Option<u64>,
    /// The cycle of its process data.
    pub cycle: Option<Span>,
    /// Frames that did not come back, or came back damaged.
    pub lost: Option<Tally>,
    /// How many frames a second are being lost now.
    pub loss_rate: Option<f64>,
    /// Frames that came back after they were given up.
    pub late: Option<Tally>,
    /// Datagrams that did not come back in time: late, or lost.
    pub timed_out: Option<Tally>,
    /// Datagrams that came back and that nobody waited for any more.
    pub unmatched: Option<Tally>,
    /// Datagrams that were not sent, because the one before was still out.
    pub skipped: Option<Tally>,
    /// Frames that came back with a content that cannot be.
    pub corrupted: Option<Tally>,
    /// Cycles of the application that began late.
    pub late_cycles: Option<Tally>,
    /// How many SubDevices answer a broadcast, and since when so many.
    pub answering: Option<Seen<u16>>,
    /// The most that ever answered.
    pub answering_most: u16,
    /// AL status of all SubDevices, put together with OR, as last told.
    pub states: Option<Seen<AlStatus>>,
    /// The working counters that are expected, by the label of their datagram.
    pub expected: BTreeMap<String, u16>,
    /// Whether frames of the second card of a ring are needed, as the MainDevice says: then the ring is open.
    pub ring_open: Option<Seen<bool>>,
    /// Parts that were exchanged to find a fault.
    pub exchanges: Vec<PartExchange>,
    /// How the wiring is known.
    pub wiring: WiringBasis,
}

/// How the wiring of a line is known that nobody saw.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum WiringBasis {
    /// It was told.
    #[default]
    Told,
    /// It was assumed, by the order of a list and the types in it.
    Types,
    /// It was assumed to be a line in order.
    Order,
}

/// A part that was exchanged with another one between two readings.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PartExchange {
    /// What was exchanged.
    pub part: Part,
    /// Where it was, or what.
    pub at: ExchangePlace,
    /// Where it came to; `None` when it was replaced by a new one, or nobody says.
    pub to: Option<ExchangePlace>,
    /// What the errors did.
    pub outcome: ExchangeOutcome,
}

/// A kind of part.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Part {
    /// A cable with its plugs.
    Cable,
    /// A SubDevice.
    Device,
    /// The MainDevice's network card.
    Card,
}

/// Where a part is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ExchangePlace {
    /// A link, by its index in the tree.
    Link(usize),
    /// A link, by its ends.
    Ends(End<DeviceId>, End<DeviceId>),
    /// A SubDevice.
    Device(DeviceId),
    /// The computer.
    Host,
}

/// What the errors did when a part was exchanged.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ExchangeOutcome {
    /// They went with the part, or went away with it.
    Moved,
    /// They stayed where they were.
    Stayed,
}

/// Trouble of a SubDevice that another tool reports in words or counts of its own.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ReportedTrouble {
    /// A start-up command failed, or its configuration did.
    Configuration,
    /// It left its state so many times without being asked.
    StateChanges(u64),
    /// It was gone so many times.
    Absences(u64),
    /// Its clock did not get in step with the reference clock in time.
    Clock,
    /// A port has a link and no communication.
    LinkError(Port),
    /// A port has a link where none is planned.
    AdditionalLink(Port),
    /// A port should have a link and has none, and nobody said what belongs there.
    MissingLink(Port),
}

/// Errors of a SubDevice that a tool counts for all its ports together.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ErrorSum {
    /// The latest value.
    pub last: Seen<u64>,
    /// By how much it rose, as far as was seen.
    pub rise: u64,
    /// When it was first seen to be higher than before.
    pub first_rise: Option<Instant>,
    /// When it last rose.
    pub last_rise: Option<Instant>,
    /// Whether the value before is not known and was taken for 0: it may be old.
    pub may_be_old: bool,
}

impl ErrorSum {
    /// The first value that was told.
    #[must_use]
    pub const fn first(value: Seen<u64>) -> Self {
        Self { last: value, rise: 0, first_rise: None, last_rise: None, may_be_old: false }
    }

    /// Takes a further value. A lower one was cleared in between.
    pub fn record(&mut self, value: Seen<u64>) {
        let rise = value.value.checked_sub(self.last.value).unwrap_or(value.value);
        if rise > 0 {
            self.rise = self.rise.saturating_add(rise);
            self.first_rise.get_or_insert(value.at);
            self.last_rise = Some(value.at);
        }
        self.last = value;
    }
}

/// How a type of controller counts errors, where it is known.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Counting {
    /// It counts frames that were bad already apart (0x0308 to 0x030B); else it counts them as bad again.
    pub forwarded_apart: bool,
    /// It makes a symbol error anew when it sends a bad frame on: programmable logic.
    pub remakes_symbol_errors: bool,
}

impl Reported {
    /// Whether anything of the MainDevice's frames was told.
    #[must_use]
    pub const fn tells_of_frames(&self) -> bool {
        self.sent.is_some()
            || self.lost.is_some()
            || self.late.is_some()
            || self.timed_out.is_some()
            || self.unmatched.is_some()
            || self.skipped.is_some()
            || self.corrupted.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_sum_counts_rises_through_a_clear() {
        let at = |s| Instant::ZERO + Span::s(s);
        let mut sum = ErrorSum::first(Seen::new(154_656, at(1), None));
        sum.record(Seen::new(154_660, at(2), None));
        sum.record(Seen::new(3, at(3), None));
        sum.record(Seen::new(3, at(4), None));
        assert_eq!((sum.rise, sum.first_rise, sum.last_rise), (7, Some(at(2)), Some(at(3))));
    }
}
