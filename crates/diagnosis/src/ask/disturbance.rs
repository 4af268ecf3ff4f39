//! Signs that a MainDevice fares worse since it is asked beside it.
//!
//! What is usual is learnt before the first question: which working counters come back, how many frames are lost, how long
//! they take, how long the cycle is, what the MainDevice orders. After that each frame is near a question, or not: near are
//! those that left while it was under way and the next one after it. Losses and delays that are more frequent near questions
//! than elsewhere are their doing; where they are as frequent elsewhere they are the line's, which is what is looked for. A
//! working counter that falls, an order that was not given before, and a longer cycle are signs in any case.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::register::ErrorCounters;
use linesman_proto::time::{Instant, Span};

use super::likelihood::is_more;
use crate::observe::Exchange;

/// Stretches near questions that are kept.
const STRETCHES: usize = 64;
/// After a question is back, the MainDevice's next frame is near it: that of so much of a cycle, in percent …
const NEAR_PERCENT: u64 = 125;
/// … and of so much time at least.
const NEAR: Span = Span::ms(1);
/// A first loss near a question, with none elsewhere, is watched for so long before it counts: a line that loses frames
/// loses further ones.
const DOUBT: Span = Span::ms(500);
/// A frame is late when it takes this many times the longest time that was learnt …
const LATE_TIMES: u64 = 2;
/// … and so much more.
const LATE: Span = Span::us(200);
/// A cycle that is so much longer, in percent, is another one.
const LONGER_PERCENT: u64 = 10;
/// Working counters and orders that are followed.
const KEPT: usize = 256;
/// Registers from here on belong to distributed clocks, process RAM and others that are written in operation.
const FIRST_CLOCK: u16 = 0x0900;
/// EEPROM interface: it is written to read.
const EEPROM: core::ops::Range<u16> = 0x0500..0x0510;
/// SyncManagers: whole ones are set up, single bytes of them are written to have a message repeated.
const SYNC_MANAGERS: core::ops::Range<u16> = 0x0800..0x0880;
/// Bytes of a whole SyncManager.
const SYNC_MANAGER: usize = 8;

/// A sign that the MainDevice is disturbed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Disturbance {
    /// Its frames are lost near questions, and less elsewhere.
    Lost {
        /// Lost ones near questions.
        near: u64,
        /// Frames near questions.
        of: u64,
    },
    /// Its frames take longer near questions.
    Late {
        /// Late ones near questions.
        near: u64,
        /// Frames near questions.
        of: u64,
    },
    /// A working counter is lower than it ever was while it was watched.
    WorkingCounter {
        /// The lowest one before.
        usual: u16,
        /// What came.
        found: u16,
    },
    /// It writes to a register that it did not write to before: it brings something back, or up.
    Order(RegisterAddress),
    /// Its cycle is longer.
    Cycle {
        /// As it was.
        usual: Span,
        /// As it is.
        now: Span,
    },
}

impl fmt::Display for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lost { near, of } => {
                write!(f, "{near} of its {of} frames near questions were lost, more than elsewhere")
            }
            Self::Late { near, of } => {
                write!(
                    f,
                    "{near} of its {of} frames near questions came back late, more than elsewhere"
                )
            }
            Self::WorkingCounter { usual, found } => {
                write!(f, "a working counter of its process data fell from {usual} to {found}")
            }
            Self::Order(register) => {
                write!(f, "it writes to 0x{:04X}, as it did not before", register.0)
            }
            Self::Cycle { usual, now } => write!(f, "its cycle grew from {usual} to {now}"),
        }
    }
}

/// Frames of the MainDevice, and how many of them fared badly.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct FrameOutcomes {
    /// Those that came back, or were lost.
    pub frames: u64,
    /// Those that were lost.
    pub lost: u64,
    /// Those that came back late.
    pub late: u64,
}

/// A stretch of time near a question.
#[derive(Clone, Copy, Debug)]
struct QuestionWindow {
    from: Instant,
    to: Instant,
}

/// Watches whether a MainDevice fares worse.
#[derive(Clone, Default, Debug)]
pub struct DisturbanceWatch {
    is_asking: bool,
    /// By command, logical address and length: the lowest working counter.
    lowest: BTreeMap<(u8, u32, u16), u16>,
    orders: BTreeSet<RegisterAddress>,
    last_order: Option<Instant>,
    cycle: Option<Span>,
    longest: Span,
    /// Frames that no question was near.
    pub others: FrameOutcomes,
    /// Frames that a question was near.
    pub near: FrameOutcomes,
    stretches: VecDeque<QuestionWindow>,
    /// When the first loss near a question was noticed.
    doubt: Option<Instant>,
    found: Option<(Disturbance, bool)>,
}

impl DisturbanceWatch {
    /// What was seen so far is usual; questions begin. `cycle` is that of the MainDevice.
    pub fn begin(&mut self, cycle: Option<Span>) {
        (self.is_asking, self.cycle) = (true, cycle);
    }

    /// A question has left at `sent` and is back, or given up, at `back`.
    pub fn question(&mut self, sent: Instant, back: Instant) {
        let cycle = self.cycle.map_or(Span::ZERO, |cycle| percent(cycle, NEAR_PERCENT));
        if self.stretches.len() == STRETCHES {
            self.stretches.pop_front();
        }
        let from = sent.before(self.longest);
        self.stretches.push_back(QuestionWindow { from, to: back + NEAR.max(cycle) });
    }

    /// The MainDevice has sent a frame.
    pub fn sent(&mut self, at: Instant, view: &FrameView<'_>) {
        for datagram in view.datagrams().map_while(Result::ok) {
            let Some(register) = order(&datagram) else { continue };
            self.last_order = Some(at);
            if self.orders.contains(&register) {
                continue;
            }
            if self.is_asking {
                self.find(Disturbance::Order(register), at);
            } else if self.orders.len() < KEPT {
                self.orders.insert(register);
            }
        }
    }

    /// A frame of the MainDevice came back, or did not.
    pub fn exchanged(&mut self, exchange: &Exchange<'_>) {
        let Some(request) = &exchange.request else { return };
        let is_near = self.is_near(request.time);
        let trip = exchange.reply.map(|reply| reply.time.since(request.time));
        let limit = self.longest * LATE_TIMES + LATE;
        let is_late = self.is_asking && trip.is_some_and(|trip| trip > limit);
        let fared = if is_near { &mut self.near } else { &mut self.others };
        fared.frames += 1;
        fared.lost += u64::from(trip.is_none());
        fared.late += u64::from(is_late);
        if let (false, Some(trip)) = (self.is_asking, trip) {
            self.longest = self.longest.max(trip);
        }
        if let Some(reply) = &exchange.reply
            && let Ok(view) = FrameView::parse(reply.bytes)
        {
            view.datagrams().map_while(Result::ok).for_each(|one| self.count(&one, request.time));
        }
    }

    fn count(&mut self, datagram: &Datagram<'_>, sent: Instant) {
        let addressing = datagram.command().map(Command::addressing);
        if addressing != Some(Addressing::Logical) {
            return;
        }
        let task = (datagram.code(), datagram.logical().0, datagram.data_len() as u16);
        let found = datagram.wkc().0;
        let usual = self.lowest.get(&task).copied();
        match usual {
            Some(usual) if self.is_asking && found < usual => {
                self.find(Disturbance::WorkingCounter { usual, found }, sent);
            }
            Some(usual) => {
                self.lowest.insert(task, usual.min(found));
            }
            None if self.lowest.len() < KEPT => {
                self.lowest.insert(task, found);
            }
            None => {}
        }
    }

    /// Looks at `now`, with the cycle as it is, whether the MainDevice is disturbed.
    pub fn look(&mut self, now: Instant, cycle: Option<Span>) {
        if !self.is_asking {
            return;
        }
        if let (Some(usual), Some(is)) = (self.cycle, cycle)
            && is > percent(usual, 100 + LONGER_PERCENT)
        {
            self.find(Disturbance::Cycle { usual, now: is }, now);
        }
        let (near, others) = (self.near, self.others);
        if is_more(near.late, near.frames, others.late, others.frames) {
            self.find(Disturbance::Late { near: near.late, of: near.frames }, now);
        }
        let lost = Disturbance::Lost { near: near.lost, of: near.frames };
        if near.lost > 0 && others.lost == 0 {
            let since = *self.doubt.get_or_insert(now);
            if now.since(since) >= DOUBT {
                self.find(lost, now);
            }
        } else {
            self.doubt = None;
            if is_more(near.lost, near.frames, others.lost, others.frames) {
                self.find(lost, now);
            }
        }
    }

    /// When the MainDevice last wrote to a register that sets a SubDevice up, or changes its state.
    #[must_use]
    pub const fn last_order(&self) -> Option<Instant> {
        self.last_order
    }

    /// Whether a loss near a question is watched for a while: no further question meanwhile.
    #[must_use]
    pub const fn is_in_doubt(&self) -> bool {
        self.doubt.is_some()
    }

    /// When it is settled whether a loss near a question was its doing.
    #[must_use]
    pub fn timeout(&self) -> Option<Instant> {
        self.doubt.map(|since| since + DOUBT)
    }

    /// The first sign, and whether a question was near.
    pub const fn take_found(&mut self) -> Option<(Disturbance, bool)> {
        self.found.take()
    }

    fn find(&mut self, disturbance: Disturbance, at: Instant) {
        // What is more frequent near questions has been near some.
        let is_near = match disturbance {
            Disturbance::Lost { .. } | Disturbance::Late { .. } | Disturbance::Cycle { .. } => true,
            Disturbance::WorkingCounter { .. } | Disturbance::Order(_) => self.is_near(at),
        };
        self.found.get_or_insert((disturbance, is_near));
    }

    fn is_near(&self, at: Instant) -> bool {
        self.stretches.iter().any(|stretch| stretch.from <= at && at <= stretch.to)
    }
}

/// The register that a datagram writes to set a SubDevice up, or to change its state.
fn order(datagram: &Datagram<'_>) -> Option<RegisterAddress> {
    let effect = datagram.command()?.effect();
    let register = datagram.ado();
    let is_register = match effect.addressing {
        Addressing::Position | Addressing::Station | Addressing::Broadcast => {
            effect.writes && !effect.multiple_write
        }
        Addressing::Logical | Addressing::None => false,
    };
    let len = datagram.data_len();
    let is_order = is_register
        && register.0 < FIRST_CLOCK
        && !(SYNC_MANAGERS.contains(&register.0) && len < SYNC_MANAGER)
        && !EEPROM.contains(&register.0)
        && !ErrorCounters::cover(register, len);
    is_order.then_some(register)
}

fn percent(span: Span, percent: u64) -> Span {
    Span::ns(span.as_nanos().saturating_mul(percent) / 100)
}
