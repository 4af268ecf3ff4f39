//! Damage of each hop from error counters: frames that were bad on arrival are told from those that became bad.
//!
//! The checks are walked in order, with the number of bad frames that earlier checks counted. A port
//! with forwarded counting counts those apart; one without counts them again as invalid, so what is
//! beyond their number is new. Readings are made one after the other, and frames are damaged in
//! between: so only what a port had counted when all earlier ports were last read is compared
//! (the *horizon*); what was counted later waits for the next reading.

mod lost_beside;

use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Hop, Route};

use super::input::LocateInput;
use super::intervals::Intervals;
use crate::model::{CounterTrack, Counting, Rise};
use lost_beside::LostAtCard;

/// Damage on one hop: a link in one direction, with the sender and the receiver at its ends.
#[derive(Clone, PartialEq, Debug)]
pub struct Damage {
    /// The card whose frames are damaged there.
    pub path: Path,
    /// The hop. Its `to` is the port that counted.
    pub hop: Hop,
    /// Frames that were found bad first there.
    pub frames: u64,
    /// Symbols that could not be decoded there, in frames or between them; `None` when nobody read
    /// that counter.
    pub symbols: Option<u64>,
    /// Whether there may have been more: a counter stood at 255, or was cleared by somebody else.
    pub is_lower_bound: bool,
    /// Hops before it whose receiving ports nobody read: the damage may be there as well.
    pub or_earlier: Vec<Hop>,
    /// The controller (index in the tree) and port that counted the frames as bad already when they came,
    /// where the receiver itself could not count them.
    pub shown_at: Option<(usize, Port)>,
    /// When the first was read.
    pub first: Instant,
    /// When the latest was read.
    pub last: Instant,
}

/// What the card can say of the last hop.
#[derive(Clone, PartialEq, Debug)]
pub enum LastHop {
    /// The card dropped this many bad frames that no controller had found bad.
    Damaged {
        /// Where frames of which card arrive.
        hop: Hop,
        /// The card that counted.
        card: Path,
        /// Number of them, without those that controllers counted.
        frames: u64,
        /// Number of damaged frames that controllers had counted.
        carried: u64,
        /// When the card first reported some.
        first: Instant,
        /// When it last did.
        last: Instant,
    },
    /// Frames did not come back though no controller found one bad, and the card's counters are not
    /// known: nobody can tell whether they were damaged on the last hop or lost in the card.
    Unknown {
        /// The hop to the card.
        hop: Hop,
        /// The card.
        card: Path,
        /// How many frames were lost.
        lost: u64,
        /// True if frames were damaged elsewhere, or links changed, at other times.
        is_beside: bool,
        /// When the first was missed.
        first: Instant,
        /// When the latest was missed.
        last: Instant,
    },
}

/// All damage on a line.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Located {
    /// Hop by hop, in the order of the checks, card A's frames first.
    pub hops: Vec<Damage>,
    /// What the cards add.
    pub last_hops: Vec<LastHop>,
}

impl Located {
    /// Searches a line.
    #[must_use]
    pub fn on(input: &LocateInput<'_>) -> Self {
        let mut located = Self::default();
        let mut nothing_counted = true;
        let (mut ends, mut beside) = (Vec::new(), Vec::new());
        for route in input.routes() {
            let mut walk = ErrorWalk {
                input,
                carried: CountedBefore::default(),
                horizon: Instant::MAX,
                is_read: false,
            };
            located.hops.extend(walk.along(route));
            nothing_counted &= walk.carried.frames == 0;
            ends.push(walk.card(route));
            if let Some(hop) = walk.unknown(route) {
                located.last_hops.push(hop);
            }
            beside.extend(walk.unknown_beside(route));
        }
        // Where nothing was counted and no link changed, all frames that were lost are of one kind.
        if !nothing_counted || located.last_hops.is_empty() {
            located.last_hops = beside;
        }
        located.last_hops.extend(ends.into_iter().flatten());
        located
    }
}

/// Links that come up together with the computer spoil the first frames; those are not missed.
const COMING_UP: Span = Span::ms(100);

/// Frames in a row that are too many to have been hit one by one.
const IN_A_ROW: u64 = 8;

/// Cards tell what they counted so long after it at most.
const CARD_READ_WITHIN: Span = Span::ms(300);

/// Whether a counter stood at its end already when the present errors began.
fn is_stuck(track: &CounterTrack) -> bool {
    track.is_at_end() && track.spell_rise() == 0
}

/// Bad frames that earlier checks counted.
#[derive(Clone, Copy, Default, Debug)]
struct CountedBefore {
    frames: u64,
    is_lower_bound: bool,
}

struct ErrorWalk<'s, 'a> {
    input: &'s LocateInput<'a>,
    carried: CountedBefore,
    /// What was counted up to then is in all readings walked by so far.
    horizon: Instant,
    /// Whether any check was read.
    is_read: bool,
}

/// A counter as far as it can be compared with those before it.
#[derive(Clone, Copy, Default, Debug)]
struct CounterReading {
    /// Rises up to the horizon.
    settled: u64,
    /// All rises.
    total: u64,
    /// Rises that fall together with a change of the link.
    excused: u64,
    is_lower_bound: bool,
}

impl ErrorWalk<'_, '_> {
    fn along(&mut self, route: &Route) -> Vec<Damage> {
        let mut found = Vec::new();
        let mut unread = Vec::new();
        for hop in route.hops() {
            let End::Controller(node, port) = hop.to else { continue };
            let invalid = self.input.track(node, ErrorCounter::InvalidFrame(port));
            // A counter that stood at 255 when the errors began is as good as none.
            let Some(invalid) = invalid.filter(|track| !is_stuck(track)) else {
                found.extend(self.symbols_alone(route, *hop, node, port));
                unread.push(*hop);
                continue;
            };
            if let Some(marked) = self.marked_before(route, &unread, *hop, node, port) {
                match found.iter_mut().find(|known: &&mut Damage| known.hop == marked.hop) {
                    Some(known) => {
                        (known.frames, known.shown_at) = (marked.frames, marked.shown_at);
                        known.first = known.first.min(marked.first);
                        known.last = known.last.max(marked.last);
                    }
                    None => found.push(marked),
                }
            }
            let damage = self.check(*hop, node, port, invalid);
            if let Some((frames, symbols, is_lower_bound)) = damage {
                let (first, last) = self.period(node, port);
                found.push(Damage {
                    path: route.path(),
                    hop: *hop,
                    frames,
                    symbols,
                    is_lower_bound,
                    // A frame that was bad before was counted by the first port that was read.
                    or_earlier: if frames > 0 { unread.clone() } else { Vec::new() },
                    shown_at: None,
                    first,
                    last,
                });
            }
            // What is damaged before here would have been counted here.
            unread.clear();
            self.is_read = true;
            if let Some(at) = self.input.last_read(node, port) {
                self.horizon = self.horizon.min(at);
            }
        }
        found
    }

    /// Symbols that a port counted whose frame counter stands at its end, or was not read.
    fn symbols_alone(&self, route: &Route, hop: Hop, node: usize, port: Port) -> Option<Damage> {
        let track = self.input.track(node, ErrorCounter::PhysicalLayer(port))?;
        let physical = self.read(hop, track);
        let symbols = physical.settled.saturating_sub(physical.excused);
        // A frame that came in bad may show as a symbol; without the frame counter only more than
        // those are damage of the hop itself.
        let is_own = symbols > self.carried.frames && !is_stuck(track);
        let first = self.input.rises(track).next().map(|rise| rise.at);
        let last = track.last_rise().map(|rise| rise.at);
        is_own.then_some(Damage {
            path: route.path(),
            hop,
            frames: 0,
            symbols: Some(symbols),
            is_lower_bound: true,
            or_earlier: Vec::new(),
            shown_at: None,
            first: first?,
            last: last?,
        })
    }

    /// Frames that come in marked as bad although no port counted them: they were found bad at a port
    /// that nobody read.
    fn marked_before(
        &mut self,
        route: &Route,
        unread: &[Hop],
        hop: Hop,
        node: usize,
        port: Port,
    ) -> Option<Damage> {
        let (nearest, earlier) = unread.split_last()?;
        let track = self.input.track(node, ErrorCounter::Forwarded(port))?;
        let forwarded = self.read(hop, track);
        let frames = forwarded.settled.saturating_sub(self.carried.frames);
        let first = self.input.rises(track).next().map(|rise| rise.at);
        let last = track.last_rise().map(|rise| rise.at);
        self.carried.frames = self.carried.frames.max(forwarded.total);
        (frames > 0).then_some(Damage {
            path: route.path(),
            hop: *nearest,
            frames,
            symbols: None,
            is_lower_bound: true,
            or_earlier: earlier.to_vec(),
            shown_at: Some((node, port)),
            first: first?,
            last: last?,
        })
    }

    /// What is new at a port: frames, symbols, and whether that is a lower bound.
    fn check(
        &mut self,
        hop: Hop,
        node: usize,
        port: Port,
        invalid: &CounterTrack,
    ) -> Option<(u64, Option<u64>, bool)> {
        let read = |counter| self.input.track(node, counter).map(|track| self.read(hop, track));
        let invalid = self.read(hop, invalid);
        let forwarded = read(ErrorCounter::Forwarded(port)).unwrap_or_default();
        let physical = self.input.track(node, ErrorCounter::PhysicalLayer(port));
        let physical = physical.filter(|track| !is_stuck(track));
        let physical = physical.map(|track| self.read(hop, track));
        let is_physical_read = physical.is_some();
        let physical = physical.unwrap_or_default();
        let before = self.carried;

        let bad = invalid.settled + forwarded.settled;
        let apart = self.counting(Some(node)).is_some_and(|counting| counting.forwarded_apart);
        let frames = if before.frames == 0 || forwarded.total > 0 || apart {
            invalid.settled
        } else if before.is_lower_bound {
            // Two counters that both stand at their end, or were cleared at different times, differ
            // by chance: only symbols of its own show that a port has damage of its own. What one at
            // its end counted beyond an exact one is damage of its own, at least.
            let own = invalid.settled.saturating_sub(before.frames);
            if physical.settled > 0 { own } else { 0 }
        } else {
            invalid.settled.saturating_sub(before.frames)
        };
        // Noise of a link that comes and goes shows as symbols; without them a change cuts off a frame, no more.
        let excused = match is_physical_read {
            true => invalid.excused.min(physical.total + self.input.cut_off_at_most(hop.link)),
            false => invalid.excused,
        };
        let frames = frames.saturating_sub(excused);

        // Some controllers make a symbol error anew when they send a bad frame on: then the symbols
        // go with the bad frames that came, one each.
        let remakes = self.counting(hop.from.node()).is_none_or(|one| one.remakes_symbol_errors);
        let goes_with_frames = remakes && physical.settled <= bad && physical.settled * 2 >= bad;
        let remade = match frames == 0 && before.frames > 0 && goes_with_frames {
            true => self.counted_with_frames(node, port),
            false => 0,
        };
        let symbols = physical.settled.saturating_sub(remade);
        let symbols = symbols.saturating_sub(physical.excused);

        self.carried.frames = before.frames.max(invalid.total + forwarded.total);
        self.carried.is_lower_bound |= invalid.is_lower_bound || forwarded.is_lower_bound;
        let is_lower_bound = invalid.is_lower_bound || physical.is_lower_bound;
        (frames > 0 || symbols > 0).then_some((
            frames,
            is_physical_read.then_some(symbols),
            is_lower_bound,
        ))
    }

    /// How a controller counts, where that is known.
    fn counting(&self, node: Option<usize>) -> Option<Counting> {
        self.input.model().devices.get(node?)?.counting
    }

    /// How many symbol errors of a port came with bad frames. A reading may come between the symbol and the end of
    /// its frame: then the one shows in this reading, the other in the next.
    fn counted_with_frames(&self, node: usize, port: Port) -> u64 {
        let rises = |counter| {
            let track = self.input.track(node, counter);
            track.into_iter().flat_map(|track| self.input.rises(track))
        };
        let bad = [ErrorCounter::InvalidFrame(port), ErrorCounter::Forwarded(port)];
        let frames: Intervals =
            bad.into_iter().flat_map(rises).map(|rise| (rise.after_time, rise.at)).collect();
        let with_frames = rises(ErrorCounter::PhysicalLayer(port)).filter(|rise| {
            frames.meet((rise.after_time.before(Span::ns(1)), rise.at + Span::ns(1)))
        });
        with_frames.map(|rise| rise.difference.rise).sum()
    }

    fn read(&self, hop: Hop, track: &CounterTrack) -> CounterReading {
        let total = track.spell_rise();
        let horizon = if self.input.has_ended() { Instant::MAX } else { self.horizon };
        let mut reading = CounterReading {
            settled: total,
            total,
            excused: 0,
            // One that stood at its end before the present errors has missed none of these.
            is_lower_bound: total > 0 && track.total.is_lower_bound(),
        };
        for rise in self.input.rises(track) {
            let by = rise.difference.rise;
            if rise.at > horizon {
                reading.settled = reading.settled.saturating_sub(by);
            } else if self.input.falls_with_link_change(hop.link, rise)
                || (by == 1 && self.was_cut_before(hop, rise))
            {
                reading.excused += by;
            }
        }
        reading
    }

    /// Whether another link of the controller that sends on this hop changed then: the frame that it was
    /// sending on is cut off, and who comes next is the first that can count it.
    fn was_cut_before(&self, hop: Hop, rise: &Rise) -> bool {
        let End::Controller(node, _) = hop.from else { return false };
        let others = Port::ALL.into_iter().map(|port| End::Controller(node, port));
        let mut links = others.filter_map(|end| self.input.tree().link_at(end));
        links.any(|link| self.input.falls_with_link_change(link, rise))
    }

    /// When the port counted: the first and the latest reading that showed a rise.
    fn period(&self, node: usize, port: Port) -> (Instant, Instant) {
        let counters = [ErrorCounter::InvalidFrame(port), ErrorCounter::PhysicalLayer(port)];
        let tracks = || counters.into_iter().filter_map(|c| self.input.track(node, c));
        let rises = || tracks().flat_map(|track| self.input.rises(track)).map(|rise| rise.at);
        let (first, last) = (rises().min(), rises().max());
        let now = self.input.model().now;
        (first.unwrap_or(now), last.unwrap_or(now))
    }

    /// What the card counted beyond what the controllers did.
    fn card(&self, route: &Route) -> Option<LastHop> {
        let card = route.arrives_at()?;
        let hop = *route.hops().last()?;
        let errors = self.input.model().host.card(card).crc;
        let (first, last) = (errors.first_of_spell?, errors.last?);
        // At the end of the input no reading comes any more. If nothing came back at last, the
        // counters could not even be asked, and their silence says nothing.
        let silences = &self.input.model().traffic.losses.silences();
        let is_silent = silences.back().is_some_and(|silence| silence.ended.is_none());
        let may_judge = self.input.has_ended() && !is_silent;
        let read_since = |at: Instant| may_judge || self.horizon > at;
        // What controllers had counted when they were cleared nobody has read.
        let devices = self.input.model().devices.iter();
        let cleared = devices.filter_map(|device| device.counters.cleared_by_order()).max();
        if cleared.is_some_and(|cleared| last <= cleared + CARD_READ_WITHIN) {
            return None;
        }
        let frames = errors.of_spell().saturating_sub(self.carried.frames);
        let is_new = if self.carried.frames == 0 {
            read_since(first)
        } else {
            !self.carried.is_lower_bound && read_since(last)
        };
        (frames > 0 && is_new && self.is_read).then_some(LastHop::Damaged {
            hop,
            card,
            frames,
            carried: self.carried.frames,
            first,
            last,
        })
    }

    /// Frames that were lost while no counter moved and none of the card is known.
    fn unknown(&self, route: &Route) -> Option<LastHop> {
        let card = route.arrives_at()?;
        let hop = *route.hops().last()?;
        let model = self.input.model();
        let (LostAtCard::Copies(lost) | LostAtCard::Frames(lost)) = self.losses_at(card)?;
        let (first, last) = (lost.first_of_spell?, lost.last?);
        let is_silent = self.carried.frames == 0 && !model.host.is_watched;
        // Counters that were read before the frame was missed say nothing of it.
        let is_read = self.is_read && self.horizon >= first;
        let is_first =
            model.traffic.recording.first().is_some_and(|begin| last < begin + COMING_UP);
        // Somebody who looks for the place where all of them vanish does so in a silence, not in noise.
        let was_searched =
            model.hole.is_some_and(|hole| first <= hole.since.at && hole.since.at <= last);
        // What vanishes all the while is no single loss, and has a finding of its own.
        let vanished = model.traffic.losses.swallowed().iter().any(|silence| {
            silence.frames >= IN_A_ROW
                && silence.since.at <= first
                && silence.ended.is_none_or(|ended| last <= ended)
        });
        let is_cut = model.traffic.recording.cut() > 0;
        let is_unrecorded = model.traffic.recording.was_bad(first, last);
        let is_explained = is_unrecorded
            || is_cut
            || is_first
            || was_searched
            || vanished
            || self.input.any_link_changed(first, last);
        (is_silent && is_read && !is_explained).then_some(LastHop::Unknown {
            hop,
            card,
            lost: lost.of_spell(),
            is_beside: false,
            first,
            last,
        })
    }
}
