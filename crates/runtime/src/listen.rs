//! Listening on cards without ever sending: beside another MainDevice, and before becoming one.

use std::hash::BuildHasher;

use linesman_diagnosis::{Direction, FrameSeen, HostEvent, HostObservation};
use linesman_link::clock::HostClock;
use linesman_link::direction::FrameDirection;
use linesman_link::error::LinkError;
use linesman_link::interface::CardLock;
use linesman_link::socket::{
    Batch, ListenFilter, Listener, Ready, SocketCounters, Waitable, wait_any,
};
use linesman_proto::address::{Network, Path};
use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::{Instant, Span};

use crate::host_watch::HostWatch;

/// Frames fetched in one call.
const BATCH: usize = 256;
/// How long a line is listened to before it is driven: a MainDevice at work sends more often.
const BEFORE_DRIVING: Span = Span::ms(300);
/// And so much longer at most, by chance: of two that begin at the same instant one is still listening when
/// the other sends.
const LONGER: Span = Span::ms(200);

/// One card, or the two at the ends of a ring, that are listened on.
pub struct CardListener {
    clock: HostClock,
    cards: Vec<ListenedCard>,
    batch: Batch,
    frames: u64,
}

struct ListenedCard {
    listener: Listener,
    path: Path,
    watch: HostWatch,
    /// Frames that this socket had no room for, as last told.
    drops: u64,
    /// Whether frames were seen that this host sent: then the MainDevice runs here, and what comes
    /// in has come back. Else the card may be fed by a tap, with requests and answers alike.
    sees_own: bool,
}

/// Something that was heard.
#[derive(Clone, Copy, Debug)]
pub enum ListenEvent<'a> {
    /// A frame.
    Frame(FrameSeen<'a>),
    /// Something about the host, which is that of the MainDevice: at a tap the card's counters are about the tap.
    Host(HostObservation),
    /// So many frames passed up to this time for which the listening socket had no room. They were not lost on the line.
    Missed(u64, Instant),
}

/// What the card of a tap has dropped: that tells nothing of the MainDevice's card.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct TapCounts {
    /// Frames whose check sequence was wrong, and other damaged ones.
    pub damaged: u64,
    /// Frames for which the card had no room.
    pub dropped: u64,
}

impl CardListener {
    /// Begins to listen; the first interface is card A, the second card B.
    ///
    /// # Errors
    /// When an interface cannot be used.
    pub fn open(names: &[String], clock: HostClock) -> Result<Self, LinkError> {
        let open = |(path, name): (Path, &String)| {
            Ok(ListenedCard {
                listener: Listener::open(name, ListenFilter::EtherCat)?,
                watch: HostWatch::open(name, path, &clock)?,
                path,
                drops: 0,
                sees_own: false,
            })
        };
        let cards: Result<Vec<ListenedCard>, LinkError> =
            Path::ALL.into_iter().zip(names).map(open).collect();
        Ok(Self { clock, cards: cards?, batch: Batch::new(BATCH), frames: 0 })
    }

    /// The clock of the run.
    #[must_use]
    pub const fn clock(&self) -> &HostClock {
        &self.clock
    }

    /// Whether this host has sent EtherCAT frames: then its card's counters are about the line.
    #[must_use]
    pub fn sees_own(&self) -> bool {
        self.cards.iter().any(|card| card.sees_own)
    }

    /// Waits for frames, at most until `deadline`, and gives what was heard to `sink`.
    ///
    /// # Errors
    /// When an interface vanished, was switched off, or the kernel refuses something else.
    pub fn hear(
        &mut self,
        deadline: Instant,
        mut sink: impl FnMut(ListenEvent<'_>),
    ) -> Result<(), LinkError> {
        let Self { clock, cards, batch, frames } = self;
        match cards.as_slice() {
            [a, b, ..] => wait_any([&a.listener as &dyn Waitable, &b.listener], clock, deadline)?,
            [a] => a.listener.wait(clock, deadline)?,
            [] => Ready::Deadline,
        };
        for card in cards {
            card.listener.recv_batch(batch, clock)?;
            for frame in batch.iter() {
                *frames += 1;
                card.sees_own |= frame.direction == FrameDirection::Outgoing;
                let direction = match frame.direction {
                    FrameDirection::Outgoing => Direction::Sent,
                    FrameDirection::Incoming if card.sees_own => Direction::Received,
                    FrameDirection::Incoming | FrameDirection::Unknown => Direction::Unknown,
                };
                sink(ListenEvent::Frame(FrameSeen {
                    network: Network::default(),
                    path: Some(card.path),
                    direction,
                    time: frame.at,
                    number: *frames,
                    fcs: None,
                    truncated: frame.truncated,
                    probe: None,
                    bytes: frame.bytes,
                }));
            }
            let now = clock.now();
            if !card.watch.is_due(now)? {
                continue;
            }
            let drops = card.listener.counters()?.drops;
            let missed = drops - std::mem::replace(&mut card.drops, drops);
            if missed > 0 {
                sink(ListenEvent::Missed(missed, now));
            }
            // Until it is known whether this host drives the line, the watch adds up.
            if !card.sees_own {
                continue;
            }
            // What this socket has no room for is no loss of the MainDevice's socket.
            for observation in card.watch.poll(now, SocketCounters::default())? {
                sink(ListenEvent::Host(observation));
            }
        }
        Ok(())
    }

    /// What the cards have dropped on which nothing was seen to leave this host.
    ///
    /// # Errors
    /// When an interface vanished or the kernel does not answer.
    pub fn tap_counts(&mut self) -> Result<TapCounts, LinkError> {
        let mut counts = TapCounts::default();
        let now = self.clock.now();
        for card in self.cards.iter_mut().filter(|card| !card.sees_own) {
            for observation in card.watch.poll(now, SocketCounters::default())? {
                match observation.what {
                    HostEvent::CardErrors { crc, other } => counts.damaged += crc + other,
                    HostEvent::CardDrops(count) => counts.dropped += count,
                    HostEvent::Carrier(_)
                    | HostEvent::SocketDrops(_)
                    | HostEvent::SendFailures(_)
                    | HostEvent::Late(_)
                    | HostEvent::ClockStep(_) => {}
                }
            }
        }
        Ok(counts)
    }
}

/// What is on a line that somebody else drives.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ObservedTraffic {
    /// EtherCAT frames that were heard.
    pub frames: u64,
    /// For how long.
    pub within: Span,
    /// Who sent the first of them, where a frame tells.
    pub source: Option<MacAddress>,
}

/// How long to listen, by a number that nobody else has drawn.
fn listening(chance: u64) -> Span {
    BEFORE_DRIVING + Span::ns(chance % LONGER.as_nanos())
}

/// Listens on a line that is about to be driven, for 0.3 to 0.5 s; `None` when nobody else drives it. It ends
/// as soon as somebody is heard for 0.3 s or longer.
///
/// # Errors
/// When an interface cannot be used, or is used by another process of this host.
pub fn is_driven(names: &[String]) -> Result<Option<ObservedTraffic>, LinkError> {
    for interface in names {
        if let Some(holder) = CardLock::holder(interface)? {
            return Err(LinkError::InUse { interface: interface.clone(), holder });
        }
    }
    let clock = HostClock::start();
    let mut card_listener = CardListener::open(names, clock)?;
    // No seed: two hosts must not draw the same. The standard library asks the system.
    let chance = std::hash::RandomState::new().hash_one(names);
    let began = clock.now();
    let until = began + listening(chance);
    let mut driven = ObservedTraffic { frames: 0, within: Span::ZERO, source: None };
    while clock.now() < until && (driven.frames == 0 || clock.now() < began + BEFORE_DRIVING) {
        card_listener.hear(until, |heard| {
            let ListenEvent::Frame(frame) = heard else { return };
            driven.frames += 1;
            let source = frame.bytes.get(6..12).and_then(|bytes| bytes.first_chunk::<6>());
            driven.source = driven.source.or(source.map(|bytes| MacAddress(*bytes)));
        })?;
    }
    driven.within = clock.now().since(began);
    Ok((driven.frames > 0).then_some(driven))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_long_is_listened_is_left_to_chance_but_never_short() {
        let drawn: Vec<Span> =
            (0..100_u64).map(|n| listening(n.wrapping_mul(0x9E37_79B9_7F4A_7C15))).collect();
        assert!(
            drawn.iter().all(|span| (Span::ms(300)..Span::ms(500)).contains(span)),
            "{drawn:?}"
        );
        let alike = drawn.iter().filter(|span| **span == drawn[0]).count();
        assert_eq!(alike, 1, "{drawn:?}");
    }
}
