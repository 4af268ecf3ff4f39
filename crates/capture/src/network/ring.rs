//! Halves of an open ring: by which card SubDevices were reached, as the copies of requests tell that both cards send.
//!
//! In a closed ring all SubDevices process what card A sends, and what card B sends goes round untouched. Where the ring
//! is open each card reaches its half alone.

use std::collections::BTreeMap;

use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::report::Number;
use linesman_proto::address::{Path, StationAddress};
use linesman_proto::time::Instant;
use serde::{Deserialize, Serialize};

use crate::access::{DatagramAccess, DatagramTarget};

/// Most spells that are kept.
const MOST: usize = 1000;

/// A ring, of which both cards were recorded.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RingReport {
    /// Spells in which it was open, in order of time; another spell begins where a SubDevice changes its half.
    pub open: Vec<OpenRingReport>,
    /// Spells beyond those that are listed.
    pub left_out: Number,
}

/// A spell in which a ring was open.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OpenRingReport {
    /// The last frame before that showed the ring closed, or another half; `null` where none did.
    pub after_ns: Option<Number>,
    /// The first frame of card B that SubDevices have processed.
    pub from_ns: Number,
    /// The last frame that showed the halves so.
    pub to_ns: Number,
    /// The first frame that showed the ring closed again, or another half; `null` to the end of the capture.
    pub ended_ns: Option<Number>,
    /// SubDevices that answered card A.
    pub card_a: HalfReport,
    /// SubDevices that answered card B.
    pub card_b: HalfReport,
    /// Numbers of SubDevices that nobody asked by their addresses meanwhile, or that did not answer.
    pub not_known: Vec<u32>,
}

/// A half of an open ring.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct HalfReport {
    /// Number of SubDevices that answered the latest broadcast of this card; `null` where none came back.
    pub count: Option<u16>,
    /// Numbers of those that answered to their addresses.
    pub devices: Vec<u32>,
}

/// A spell, as frames tell it.
#[derive(Clone, PartialEq, Eq, Debug)]
struct OpenRing {
    after: Option<Instant>,
    from: Instant,
    to: Instant,
    ended: Option<Instant>,
    counts: [Option<u16>; 2],
    stations: BTreeMap<StationAddress, Path>,
}

/// Spells of an open ring, gathered from each datagram.
#[derive(Clone, Default, Debug)]
pub(crate) struct RingLog {
    /// True if card B has sent anything that came back.
    has_card_b: bool,
    /// The latest frame that showed the ring closed.
    closed: Option<Instant>,
    spells: Vec<OpenRing>,
    left_out: u64,
}

impl RingLog {
    /// Takes a datagram.
    pub(crate) fn access(&mut self, access: &DatagramAccess<'_>) {
        let Some(card) = access.sent_by else { return };
        let is_b = card == Path::B;
        self.has_card_b |= is_b;
        // Of ARMW and FRMW the working counter tells of those that are written to, too.
        if !access.effect.reads || access.effect.writes {
            return;
        }
        match (access.target, access.own > 0) {
            // What card B has sent went all round, and nobody has processed it.
            (DatagramTarget::All, false) if is_b => {
                if let Some(open) = self.open() {
                    open.ended = Some(access.at);
                }
                self.closed = Some(access.at);
            }
            (DatagramTarget::All, true) => {
                if let Some(open) = self.open_by(card, access.at) {
                    open.counts[usize::from(is_b)] = Some(access.own);
                    open.to = access.at;
                }
            }
            (DatagramTarget::Station(station), true) => self.station(station, card, access.at),
            (_, _) => {}
        }
    }

    fn station(&mut self, station: StationAddress, card: Path, at: Instant) {
        let is_other = |known: &Path| *known != card;
        let moved = |open: &OpenRing| open.stations.get(&station).is_some_and(is_other);
        if let Some(open) = self.open().filter(|open| moved(open)) {
            open.ended = Some(at);
            let last = open.to;
            self.begin(Some(last), at);
        }
        if let Some(open) = self.open_by(card, at) {
            open.stations.insert(station, card);
            open.to = at;
        }
    }

    /// The spell that goes on.
    fn open(&mut self) -> Option<&mut OpenRing> {
        self.spells.last_mut().filter(|open| open.ended.is_none())
    }

    /// The spell that goes on; one begins where SubDevices process what card B sends.
    fn open_by(&mut self, card: Path, at: Instant) -> Option<&mut OpenRing> {
        if card == Path::B && self.open().is_none() {
            self.begin(self.closed, at);
        }
        self.open()
    }

    fn begin(&mut self, after: Option<Instant>, at: Instant) {
        if self.spells.len() >= MOST {
            self.left_out += 1;
            return;
        }
        let (counts, stations) = ([None; 2], BTreeMap::new());
        self.spells.push(OpenRing { after, from: at, to: at, ended: None, counts, stations });
    }

    /// The ring; `None` where the frames do not show two cards.
    pub(crate) fn report(&self, model: &NetworkModel) -> Option<RingReport> {
        let open = |open: &OpenRing| {
            let half = |card: Path| {
                let mine = open.stations.iter().filter(|(_, by)| **by == card);
                let numbers = mine.filter_map(|(station, _)| model.by_station(*station));
                let mut devices: Vec<u32> = numbers.map(|id| id.no()).collect();
                devices.sort_unstable();
                HalfReport { count: open.counts[usize::from(card == Path::B)], devices }
            };
            let number = |at: Instant| Number(at.as_nanos());
            let (card_a, card_b) = (half(Path::A), half(Path::B));
            let is_known = |no: &u32| card_a.devices.contains(no) || card_b.devices.contains(no);
            let all = model.devices.iter().map(|device| device.id.no());
            OpenRingReport {
                after_ns: open.after.map(number),
                from_ns: number(open.from),
                to_ns: number(open.to),
                ended_ns: open.ended.map(number),
                not_known: all.filter(|no| !is_known(no)).collect(),
                card_a,
                card_b,
            }
        };
        self.has_card_b.then(|| RingReport {
            open: self.spells.iter().map(open).collect(),
            left_out: Number(self.left_out),
        })
    }
}
