//! Which controller an address means.
//!
//! Positions mean the controllers of the first full scan, in order, while all of them are there.
//! When fewer answer, positions have moved: on a line without branches the first ones are still
//! where they were, elsewhere a position is known only where its station address was read since.
//!
//! In a ring that is open each card has positions of its own. Those of card B begin at the gap, so they follow
//! upon those of card A (S1 chapter 3: who is entered from behind is processed on the way back).

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, Path, Position, StationAddress};
use linesman_proto::command::Addressing;

use super::{Answer, word_at};
use crate::line::{Line, Seen, SharedBy};

/// Most controllers that are learnt from frames.
const MOST_DEVICES: usize = 4096;
/// Configured station address.
const STATION: u16 = 0x0010;

/// What positions and station addresses mean at the moment.
#[derive(Clone, Default, Debug)]
pub struct Addresses {
    stations: BTreeMap<StationAddress, DeviceId>,
    /// Controllers by position while all are there.
    order: Vec<DeviceId>,
    /// How many controllers a frame passes now, both cards of a ring together.
    present: Option<u16>,
    /// How many of them by each card, as far as that was seen.
    halves: [Option<u16>; 2],
    /// Whether a station was taken for a controller's without any sign of its position.
    has_guessed: bool,
}

impl Addresses {
    /// The addresses of a plan; nothing without one.
    #[must_use]
    pub fn new(line: &Line) -> Self {
        let planned = line
            .devices
            .iter()
            .filter_map(|device| device.planned.map(|planned| (planned.station, device.id)));
        let order = match &line.tree {
            Some(tree) => tree.order().iter().map(|node| DeviceId(*node as u32)).collect(),
            None => line.devices.iter().map(|device| device.id).collect(),
        };
        Self { stations: planned.collect(), order, ..Self::default() }
    }

    /// How many controllers a frame passes now.
    pub(super) const fn present(&self) -> Option<u16> {
        self.present
    }

    /// A frame that `card` has sent, where that is known, passed `passed` controllers.
    pub(super) fn passed(&mut self, line: &mut Line, card: Option<Path>, passed: u16) {
        let Some(card) = card else { return self.count(line, passed) };
        self.halves[card.index()] = Some(passed);
        let other = &mut self.halves[card.other().index()];
        // More than there are: a card that is out of use left its number behind.
        if other.is_some_and(|other| usize::from(other) + usize::from(passed) > self.order.len()) {
            *other = None;
        }
        let all = passed.saturating_add(other.unwrap_or(0));
        self.count(line, all);
    }

    /// Of two copies of a broadcast, so many controllers have answered the first one to come back and the
    /// second one, which `card` has sent.
    pub(super) fn split(&mut self, card: Option<Path>, (first, second): (u16, u16)) {
        if let Some(card) = card {
            self.halves[card.index()] = Some(second);
            self.halves[card.other().index()] = Some(first);
        }
    }

    /// A position in the order of all, of one that `card` counts.
    fn of_all(&self, card: Option<Path>, position: Position) -> Position {
        let before = match card {
            Some(Path::B) => self.halves[Path::A.index()].unwrap_or(0),
            Some(Path::A) | None => 0,
        };
        Position(position.0.wrapping_add(before))
    }

    /// A frame passed `passed` controllers.
    pub(super) fn count(&mut self, line: &mut Line, passed: u16) {
        if self.present == Some(passed) {
            return;
        }
        self.present = Some(passed);
        line.traffic.positions_seen = line.traffic.positions_seen.max(passed);
        let passed = usize::from(passed).min(MOST_DEVICES);
        while self.order.len() < passed {
            // Those that answered to a station before any position was known come first.
            let free = line.devices.get(self.order.len()).map(|device| device.id);
            let id = free.unwrap_or_else(|| line.add_device());
            self.order.push(id);
        }
        let is_line = line
            .tree
            .as_ref()
            .is_none_or(|tree| (0..tree.len()).all(|node| tree.children(node).count() <= 1));
        let is_certain =
            |position: usize| position < passed && (passed == self.order.len() || is_line);
        for (position, id) in self.order.iter().enumerate() {
            let known = is_certain(position).then_some(Position(position as u16));
            if let Some(device) = line.device_mut(*id) {
                device.position = known;
            }
        }
        line.touch();
    }

    /// The controller at a position, as the card counts that has sent the frame.
    pub(super) fn at_position(
        &mut self,
        line: &mut Line,
        position: Position,
        answer: &Answer<'_>,
    ) -> Option<DeviceId> {
        let position = self.of_all(answer.sent_by, position);
        let index = usize::from(position.0);
        if self.present.is_none() && answer.sum > 0 {
            // Nothing says how many there are; this one is.
            self.count(line, position.0.checked_add(1)?);
            self.present = None;
        }
        let known = match self.present {
            Some(present) if usize::from(present) < self.order.len() => line.by_position(position),
            Some(_) | None => self.order.get(index).copied(),
        };
        if known.is_some() {
            return known;
        }
        // Its station address, read or written right here, tells who it is.
        let data = if answer.effect.reads { answer.reply.data() } else { answer.written() };
        let station = word_at(data, answer.ado, STATION).filter(|_| answer.sum > 0)?;
        let id = *self.stations.get(&StationAddress(station))?;
        line.device_mut(id)?.position = Some(position);
        Some(id)
    }

    /// The controller with a station address. One that answers and is not known yet is taken to be
    /// the first one without a station address.
    pub(super) fn at_station(
        &mut self,
        line: &mut Line,
        station: StationAddress,
        answers: bool,
    ) -> Option<DeviceId> {
        if let Some(id) = self.stations.get(&station) {
            return Some(*id);
        }
        if !answers {
            return None;
        }
        let free = line.devices.iter().find(|device| {
            device.station.is_none() && !self.stations.values().any(|id| *id == device.id)
        });
        let id = match free.map(|device| device.id) {
            Some(id) => id,
            None if line.devices.len() < MOST_DEVICES => line.add_device(),
            None => return None,
        };
        self.has_guessed = true;
        self.give(line, id, station);
        Some(id)
    }

    /// Whether the order of controllers is known: from their positions, or by [`Self::settle`].
    pub(super) const fn is_settled(&self) -> bool {
        !self.has_guessed
    }

    /// Puts controllers that were met by their station addresses in the middle of a run into order:
    /// every known MainDevice gives these addresses in the order of positions. Identities change, so
    /// this is only for a line of which nothing was said yet. Says whether it was done.
    pub(super) fn settle(&mut self, line: &mut Line) -> bool {
        let count = line.devices.len();
        let is_whole = self.present.map(usize::from) == Some(count)
            && line.devices.iter().all(|device| device.station.is_some());
        if !self.has_guessed || !is_whole || line.devices.iter().any(|one| one.planned.is_some()) {
            return false;
        }
        line.devices.sort_by_key(|device| device.station);
        self.stations.clear();
        self.order.clear();
        for (index, device) in line.devices.iter_mut().enumerate() {
            device.id = DeviceId(index as u32);
            device.position = Some(Position(index as u16));
            self.order.push(device.id);
            if let Some(station) = device.station {
                self.stations.insert(station, device.id);
            }
        }
        self.has_guessed = false;
        line.touch();
        true
    }

    /// A controller's registers were read.
    pub(super) fn read(&mut self, line: &mut Line, id: DeviceId, answer: &Answer<'_>) {
        let Some(station) = word_at(answer.reply.data(), answer.ado, STATION) else { return };
        let station = StationAddress(station);
        if let Some(owner) = self.is_shared(line, id, station, answer) {
            if let Some(owner) = line.device_mut(owner) {
                let seen = Seen::new(SharedBy::Reading(id), answer.at, Some(answer.frame));
                owner.shares_address(station, seen);
            }
            line.touch();
            return;
        }
        self.give(line, id, station);
    }

    /// Who has the station address that another controller, asked by its position, says is its own: only
    /// while positions are certain, and where that one had another address before.
    fn is_shared(
        &self,
        line: &Line,
        id: DeviceId,
        station: StationAddress,
        answer: &Answer<'_>,
    ) -> Option<DeviceId> {
        let is_position = answer.effect.addressing == Addressing::Position;
        let is_whole = self.present.map(usize::from) == Some(self.order.len());
        let had_another = line.device(id)?.station.is_some_and(|own| own != station);
        let owner = *self.stations.get(&station)?;
        let has_it = line.device(owner)?.station == Some(station);
        (is_position && is_whole && had_another && has_it && owner != id).then_some(owner)
    }

    /// A controller's registers were written.
    pub(super) fn written(&mut self, line: &mut Line, id: DeviceId, answer: &Answer<'_>) {
        if let Some(station) = word_at(answer.written(), answer.ado, STATION) {
            self.give(line, id, StationAddress(station));
        }
    }

    /// All controllers' registers were written: one station address for all is none.
    pub(super) fn broadcast_written(&mut self, line: &mut Line, answer: &Answer<'_>) {
        if word_at(answer.written(), answer.ado, STATION).is_none() {
            return;
        }
        self.stations.clear();
        for device in &mut line.devices {
            device.station = None;
        }
        line.touch();
    }

    fn give(&mut self, line: &mut Line, id: DeviceId, station: StationAddress) {
        let Some(device) = line.device_mut(id) else { return };
        let before = device.station;
        let is_same = before == Some(station) && self.stations.get(&station) == Some(&id);
        if is_same || station.0 == 0 {
            // A device that has none any more keeps the last one, by which it will be sought.
            return;
        }
        device.station = Some(station);
        self.stations.retain(|_, owner| *owner != id);
        if let Some(other) = self.stations.insert(station, id)
            && let Some(other) = line.device_mut(other)
        {
            other.station = None;
        }
        line.touch();
    }
}
