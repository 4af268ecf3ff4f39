//! Causes of damage, from places and counts, each with its confidence.
//!
//! | seen | most likely |
//! |---|---|
//! | bad frames, clean symbols | the sender spoils frames before they are coded |
//! | symbols on several links at the same times | interference from outside |
//! | symbols in both directions of one link | the cable or its plugs |
//! | symbols in one direction, again and again | the sender's output or the receiver's input |
//! | symbols in one direction, a few | the cable, or anything else |
//!
//! The numbers for one link by itself are in `cause_weights`.

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Instant;
use linesman_proto::topology::route::Direction;
use linesman_proto::topology::{End, Hop};

use super::cause_weights::{CauseSeat, LinkSymptom, NOISE_ON_TERMINAL_BUS};
use super::damage::{Damage, LastHop, Located};
use super::input::LocateInput;
use super::rhythm::{falls_together, is_steady};
use crate::model::is_on_terminal_bus;

/// From this many hits on, their distribution says something.
const MANY: u64 = 8;

/// Where a cause sits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CausePlace {
    /// A link (index in the tree), in one direction or both.
    Link(usize, Option<Direction>),
    /// A controller (index in the tree).
    Device(usize),
    /// The computer with its card.
    Host,
}

/// A cause at a spot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Suspect {
    /// Why.
    pub cause: FaultName,
    /// Where.
    pub spot: CausePlace,
    /// How sure, 0 to 1.
    pub weight: f64,
}

/// Damage that has one cause, with what may have done it.
#[derive(Clone, PartialEq, Debug)]
pub struct Suspicion {
    /// The hops on which frames are damaged.
    pub damages: Vec<Damage>,
    /// What the card adds.
    pub last_hop: Option<LastHop>,
    /// Causes, most likely first. Never empty.
    pub suspects: Vec<Suspect>,
    /// Damage elsewhere at the same times, that comes from the same source.
    pub beneath: Vec<Suspicion>,
}

impl Suspicion {
    /// When it was first read.
    #[must_use]
    pub fn first(&self) -> Option<Instant> {
        let hops = self.damages.iter().map(|damage| damage.first);
        hops.chain(self.last_hop.as_ref().map(LastHop::first)).min()
    }

    /// When it was last read.
    #[must_use]
    pub fn last(&self) -> Option<Instant> {
        let hops = self.damages.iter().map(|damage| damage.last);
        hops.chain(self.last_hop.as_ref().map(LastHop::last)).max()
    }

    /// How many frames were damaged at least.
    #[must_use]
    pub fn frames(&self) -> u64 {
        let hops: u64 = self.damages.iter().map(|damage| damage.frames).sum();
        hops + self.last_hop.as_ref().map_or(0, LastHop::frames)
    }

    /// How many symbols could not be decoded at least.
    #[must_use]
    pub fn symbols(&self) -> u64 {
        self.damages.iter().filter_map(|damage| damage.symbols).sum()
    }

    /// All causes on a line, in the order in which frames get there.
    #[must_use]
    pub fn all(input: &LocateInput<'_>, located: &Located) -> Vec<Self> {
        let mut links: Vec<DamageGroup> = Vec::new();
        let mut senders: Vec<DamageGroup> = Vec::new();
        for damage in &located.hops {
            let both = located.hops.iter().any(|other| {
                other.hop.link == damage.hop.link && other.hop.direction != damage.hop.direction
            });
            match damage.hop.from {
                // One device that spoils frames inside does so at each of its outputs. Noise hits symbols: many bad
                // frames without any are not its doing, whatever the way back shows.
                End::Controller(node, _)
                    if is_clean(damage) && (!both || damage.frames >= MANY) =>
                {
                    group(&mut senders, node).damages.push(damage.clone());
                }
                End::Controller(..) | End::MainDevice(_) => {
                    group(&mut links, damage.hop.link).damages.push(damage.clone());
                }
            }
        }
        for last in &located.last_hops {
            let link = last.hop().link;
            match last {
                LastHop::Damaged { .. } => {
                    let sender = last.hop().from.node();
                    let spoils = senders.iter_mut().find(|group| Some(group.key) == sender);
                    // The device that spoils frames on the way out does so on the way home, too.
                    let group = match spoils {
                        Some(spoils) => spoils,
                        None => group(&mut links, link),
                    };
                    group.last_hop = Some(last.clone());
                }
                // What else is damaged on that link may have cost these frames, too.
                LastHop::Unknown { is_beside: true, .. }
                    if links.iter().any(|group| group.key == link) => {}
                LastHop::Unknown { .. } => group(&mut links, link).last_hop = Some(last.clone()),
            }
        }
        let mut all: Vec<Self> = Vec::new();
        all.extend(senders.into_iter().map(|group| {
            let suspects = inside(&group);
            group.with(suspects)
        }));
        let noisy = share_source(input, links);
        all.extend(noisy);
        all
    }
}

/// Damage that belongs together: by link, or by the device that sent the frames.
#[derive(Clone, Debug)]
struct DamageGroup {
    key: usize,
    damages: Vec<Damage>,
    last_hop: Option<LastHop>,
}

impl DamageGroup {
    fn with(self, suspects: Vec<Suspect>) -> Suspicion {
        let Self { key: _, damages, last_hop } = self;
        Suspicion { damages, last_hop, suspects, beneath: Vec::new() }
    }

    fn first(&self) -> Option<Instant> {
        self.damages.iter().map(|damage| damage.first).min()
    }

    fn last(&self) -> Option<Instant> {
        self.damages.iter().map(|damage| damage.last).max()
    }

    /// Number of hits.
    fn hits(&self) -> u64 {
        self.damages.iter().map(|damage| damage.frames.max(damage.symbols.unwrap_or(0))).sum()
    }

    fn has_symbols(&self) -> bool {
        self.damages.iter().any(|damage| damage.symbols.is_some_and(|symbols| symbols > 0))
    }
}

fn group(groups: &mut Vec<DamageGroup>, key: usize) -> &mut DamageGroup {
    let index = match groups.iter().position(|group| group.key == key) {
        Some(index) => index,
        None => {
            groups.push(DamageGroup { key, damages: Vec::new(), last_hop: None });
            groups.len() - 1
        }
    };
    &mut groups[index]
}

impl LastHop {
    /// The hop to the card.
    #[must_use]
    pub const fn hop(&self) -> Hop {
        match self {
            Self::Damaged { hop, .. } | Self::Unknown { hop, .. } => *hop,
        }
    }

    /// The card.
    #[must_use]
    pub const fn card(&self) -> Path {
        match self {
            Self::Damaged { card, .. } | Self::Unknown { card, .. } => *card,
        }
    }

    /// How many frames.
    #[must_use]
    pub const fn frames(&self) -> u64 {
        match self {
            Self::Damaged { frames, .. } => *frames,
            Self::Unknown { lost, .. } => *lost,
        }
    }

    /// When the first was noticed.
    #[must_use]
    pub const fn first(&self) -> Instant {
        match self {
            Self::Damaged { first, .. } | Self::Unknown { first, .. } => *first,
        }
    }

    /// When the latest was noticed.
    #[must_use]
    pub const fn last(&self) -> Instant {
        match self {
            Self::Damaged { last, .. } | Self::Unknown { last, .. } => *last,
        }
    }
}

fn is_clean(damage: &Damage) -> bool {
    damage.symbols == Some(0) && damage.frames > 0
}

/// Clean symbols, bad frames: whoever sends spoiled them before they were coded.
fn inside(group: &DamageGroup) -> Vec<Suspect> {
    let Some(damage) = group.damages.first() else { return Vec::new() };
    let frames: u64 = group.damages.iter().map(|damage| damage.frames).sum();
    let hop = damage.hop;
    let weight = if frames >= 3 { 0.8 } else { 0.6 };
    let mut list = vec![Suspect {
        cause: FaultName::DeviceInternal,
        spot: CausePlace::Device(group.key),
        weight,
    }];
    // A wrong symbol may decode as another valid one: seldom, and not again and again.
    let link = CausePlace::Link(hop.link, Some(hop.direction));
    for (cause, weight) in [(FaultName::CableDegraded, 0.1), (FaultName::ReceiverDamaged, 0.05)] {
        list.push(Suspect { cause, spot: link, weight });
    }
    add_earlier(&mut list, damage);
    list
}

/// Links that are hit at the same times have one source; the first of them leads.
fn share_source(input: &LocateInput<'_>, mut links: Vec<DamageGroup>) -> Vec<Suspicion> {
    links.sort_by_key(|group| group.damages.is_empty());
    let mut all: Vec<Suspicion> = Vec::new();
    let mut taken = vec![false; links.len()];
    // The link that was noticed first leads, and goes on leading.
    let mut order: Vec<usize> = (0..links.len()).collect();
    order.sort_by_key(|index| (links[*index].first().unwrap_or(Instant::MAX), *index));
    for (at, &index) in order.iter().enumerate() {
        if taken[index] {
            continue;
        }
        let leader = &links[index];
        let others = order[at + 1..].iter().copied().filter(|other| !taken[*other]);
        let together = with_same_source(input, &links, index, others);
        let mut members: Vec<&DamageGroup> = vec![leader];
        members.extend(together.iter().map(|other| &links[*other]));
        let common = (members.len() > 1).then(|| common_device(&members)).flatten();
        let suspicion = |group: &DamageGroup| {
            let list = if members.len() > 1 { shared(group, common) } else { single(input, group) };
            group.clone().with(list)
        };
        let mut lead = suspicion(leader);
        lead.beneath = together.iter().map(|other| suspicion(&links[*other])).collect();
        for other in together {
            taken[other] = true;
        }
        all.push(lead);
    }
    all
}

/// Those of the `others` that are hit together with the first link, or with one that is.
fn with_same_source(
    input: &LocateInput<'_>,
    links: &[DamageGroup],
    first: usize,
    others: impl Iterator<Item = usize>,
) -> Vec<usize> {
    if !links[first].has_symbols() {
        return Vec::new();
    }
    let mut left: Vec<usize> = others.filter(|other| links[*other].has_symbols()).collect();
    let mut found = Vec::new();
    let mut one = first;
    for next in 0.. {
        let (together, apart) = left.into_iter().partition(|other: &usize| {
            falls_together(input, &links[one].damages, &links[*other].damages)
        });
        left = apart;
        found.extend::<Vec<usize>>(together);
        match found.get(next) {
            Some(following) => one = *following,
            None => break,
        }
    }
    if found.is_empty() {
        found =
            left.into_iter().filter(|other| is_hit_alike(&links[first], &links[*other])).collect();
        if found.len() + 1 < MANY_LINKS {
            found.clear();
        }
    }
    found
}

/// Number of links from which on those that are hit in the same stretch of time are taken to have one source, even where hits
/// are too few to show a rhythm that they share: so many cables seldom fail at a time.
const MANY_LINKS: usize = 3;

/// Links that one source hits are hit about as often: none more than this many times as often as another.
const ALIKE: u64 = 10;

/// True if two links are hit about as often, and one not only after the other.
fn is_hit_alike(one: &DamageGroup, other: &DamageGroup) -> bool {
    let overlap = one.first() <= other.last() && other.first() <= one.last();
    overlap && one.hits() <= other.hits() * ALIKE && other.hits() <= one.hits() * ALIKE
}

/// The device at whose ports all damage is sent, or all is received.
fn common_device(groups: &[&DamageGroup]) -> Option<(usize, FaultName)> {
    let hops = || groups.iter().flat_map(|group| &group.damages).map(|damage| damage.hop);
    let first = hops().next()?;
    let sender = first.from.node().filter(|node| hops().all(|hop| hop.from.node() == Some(*node)));
    let receiver = first.to.node().filter(|node| hops().all(|hop| hop.to.node() == Some(*node)));
    match (sender, receiver) {
        (Some(node), _) => Some((node, FaultName::TransmitterDamaged)),
        (None, Some(node)) => Some((node, FaultName::ReceiverDamaged)),
        (None, None) => None,
    }
}

/// One of several links that are hit together.
fn shared(group: &DamageGroup, common: Option<(usize, FaultName)>) -> Vec<Suspect> {
    let spot = link_spot(group);
    let mut list = vec![Suspect {
        cause: FaultName::EmcNoise,
        spot,
        weight: if common.is_some() { 0.55 } else { 0.75 },
    }];
    if let Some((node, cause)) = common {
        list.push(Suspect { cause, spot: CausePlace::Device(node), weight: 0.25 });
    }
    list.push(Suspect { cause: FaultName::CableDegraded, spot, weight: 0.15 });
    list
}

/// One link, or the last hop, by itself.
fn single(input: &LocateInput<'_>, group: &DamageGroup) -> Vec<Suspect> {
    let spot = link_spot(group);
    let hop = group.damages.first().map(|damage| damage.hop);
    let Some(hop) = hop.or_else(|| group.last_hop.as_ref().map(LastHop::hop)) else {
        return Vec::new();
    };
    let is_both = matches!(spot, CausePlace::Link(_, None));
    let symptom = symptom(input, group, hop, is_both);
    let is_unread =
        !symptom.is_complete() && group.damages.iter().all(|damage| damage.symbols.is_none());
    let share = if is_unread { 0.8 } else { 1.0 };
    let weights = symptom.weights().iter();
    // Whoever is entered by a link tells what kind it is.
    let behind = input.tree().links().get(hop.link).and_then(|link| link.downstream.node());
    let is_of_bus = behind.is_some_and(|node| is_on_terminal_bus(input.model(), node));
    let noise = if is_of_bus { NOISE_ON_TERMINAL_BUS } else { 1.0 };
    let mut list: Vec<Suspect> = weights
        .filter_map(|(cause, seat, weight)| {
            let of_bus = if *cause == FaultName::EmcNoise { noise } else { 1.0 };
            let (cause, spot) = seated(*cause, *seat, spot, hop)?;
            Some(suspect(cause, spot, weight * share * of_bus))
        })
        .collect();
    list.sort_by(|one, other| other.weight.total_cmp(&one.weight));
    if symptom.is_complete() {
        return list;
    }
    if is_unread {
        let sender = hop.from.node().map_or(CausePlace::Host, CausePlace::Device);
        list.push(suspect(FaultName::DeviceInternal, sender, 0.1));
    } else if !is_both && let Some(node) = hop.from.node() {
        // Controllers in programmable logic make a symbol error of a frame that was bad before.
        list.push(suspect(FaultName::DeviceInternal, CausePlace::Device(node), 0.04));
    }
    if let Some(damage) = group.damages.first() {
        add_earlier(&mut list, damage);
    }
    list
}

/// What is seen of one link; `is_both` if in both directions.
fn symptom(input: &LocateInput<'_>, group: &DamageGroup, hop: Hop, is_both: bool) -> LinkSymptom {
    let hits: u64 = group.damages.iter().map(|d| d.frames.max(d.symbols.unwrap_or(0))).sum::<u64>();
    let is_all_clean = !group.damages.is_empty() && group.damages.iter().all(is_clean);
    let at_card = [hop.from, hop.to].into_iter().any(|end| end.node().is_none());
    match (&group.last_hop, is_both) {
        (Some(LastHop::Unknown { .. }), _) => LinkSymptom::LastHopUnread,
        (_, true) => LinkSymptom::BothDirections,
        (Some(LastHop::Damaged { .. }), false) => LinkSymptom::LastHopDamaged,
        (None, false) if is_all_clean && at_card => LinkSymptom::CleanFromCard,
        (None, false) if at_card => LinkSymptom::OneDirectionAtCard,
        (None, false) if hits < MANY => LinkSymptom::OneDirectionFew,
        (None, false) if is_steady(input, &group.damages) && other_way_counts(input, hop) => {
            LinkSymptom::OneDirectionSteady
        }
        (None, false) => LinkSymptom::OneDirectionMany,
    }
}

/// A cause and its place; `None` for one inside a controller where the card is.
fn seated(
    cause: FaultName,
    seat: CauseSeat,
    link: CausePlace,
    hop: Hop,
) -> Option<(FaultName, CausePlace)> {
    let stage = |end: End| match end {
        End::MainDevice(_) => (FaultName::NicDamaged, CausePlace::Host),
        End::Controller(..) => (cause, link),
    };
    match seat {
        CauseSeat::Link => Some((cause, link)),
        CauseSeat::Output => Some(stage(hop.from)),
        CauseSeat::Input => Some(stage(hop.to)),
        CauseSeat::Sender => hop.from.node().map(|node| (cause, CausePlace::Device(node))),
        CauseSeat::Host => Some((cause, CausePlace::Host)),
    }
}

/// Whether the other direction of a link could tell of symbols, so that their absence says something.
fn other_way_counts(input: &LocateInput<'_>, hop: Hop) -> bool {
    let End::Controller(node, port) = hop.from else { return true };
    let track = input.track(node, ErrorCounter::PhysicalLayer(port));
    track.is_some_and(|track| !track.is_at_end() || track.spell_rise() > 0)
}

const fn suspect(cause: FaultName, spot: CausePlace, weight: f64) -> Suspect {
    Suspect { cause, spot, weight }
}

/// Ports that nobody read lie between the last clean check and the first bad one: the hops to them
/// share the suspicion.
fn add_earlier(list: &mut Vec<Suspect>, damage: &Damage) {
    let earlier = damage.or_earlier.len();
    if earlier == 0 {
        return;
    }
    let share = 1.0 / (earlier as f64 + 1.0);
    let total: f64 = list.iter().map(|suspect| suspect.weight).sum();
    for suspect in list.iter_mut() {
        suspect.weight *= share;
    }
    for hop in damage.or_earlier.iter().rev().take(4) {
        let spot = CausePlace::Link(hop.link, Some(hop.direction));
        list.push(suspect(FaultName::CableDegraded, spot, total * share));
    }
}

/// The link with the direction in which it damages frames.
fn link_spot(group: &DamageGroup) -> CausePlace {
    let hops = group.damages.iter().map(|damage| damage.hop);
    let mut all = hops.chain(group.last_hop.as_ref().map(LastHop::hop));
    let Some(first) = all.next() else { return CausePlace::Host };
    let is_one = all.all(|hop| hop.direction == first.direction);
    CausePlace::Link(first.link, is_one.then_some(first.direction))
}
