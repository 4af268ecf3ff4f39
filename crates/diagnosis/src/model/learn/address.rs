//! Addresses, and the controllers they mean.
//!
//! Positions mean the controllers of the first full scan, in order, while all of them are there.
//! When fewer answer, positions have moved: on a line without branches the first ones are still
//! where they were, elsewhere a position is known only where its station address was read since.
//!
//! A recording that begins in the middle of a run meets controllers by their station addresses alone. MainDevices give
//! these in the order of positions, most of them from a number that is known; so the address tells the position once
//! it is known how many there are. Until all of them were met the numbers are a guess: nothing is learnt of
//! positions then but which station address is there.
//!
//! A station address that is asked again and again and never answers belongs to a SubDevice that is not there, or is
//! cut off: it becomes a controller of its own, in the order of station addresses, so that the silence has a place.
//!
//! In a ring that is open each card has positions of its own. Those of card B begin at the gap, so they follow
//! upon those of card A (S1 chapter 3: who is entered from behind is processed on the way back).

mod number;
mod station_table;
mod unanswered;

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, Path, Position, StationAddress};
use linesman_proto::command::Addressing;
use linesman_proto::time::Span;

use super::count::CountDoubt;
use super::{Answer, word_at};
use crate::model::{Device, NetworkModel, Seen, SharedBy};
use number::MOST_BY_NUMBER;
use station_table::StationTable;
use unanswered::Unanswered;

/// Who did not answer at its station address so long ago at most, and is given one, had lost it.
const AWAY_WITHIN: Span = Span::s(5);
/// The station address by which SOEM takes a SubDevice aside that it sets up anew.
const SET_ASIDE: StationAddress = StationAddress(0xFFFF);
/// Most controllers that are learnt from frames.
const MOST_DEVICES: usize = 4096;
/// Configured station address.
const STATION: u16 = 0x0010;
/// What positions and station addresses mean at the moment.
#[derive(Clone, Default, Debug)]
pub struct Addresses {
    stations: StationTable,
    /// Controllers by position while all are there.
    order: Vec<DeviceId>,
    /// How many controllers a frame passes now, both cards of a ring together.
    present: Option<u16>,
    /// A count that is too large to be believed at once.
    doubt: CountDoubt,
    /// How many of them by each card, as far as that was seen.
    halves: [Option<u16>; 2],
    /// Whether a station was taken for a controller's without any sign of its position.
    has_guessed: bool,
    /// Whether controllers were put into order by their station addresses, without any sign of their positions.
    is_by_address: bool,
    /// By how many station addresses, by which count and from which first address they were last put into order.
    settled_by: Option<(usize, Option<u16>, Option<u16>)>,
    /// Whether something was said of single controllers, so that they keep their numbers.
    is_named: bool,
    /// The first station address by which planned SubDevices were counted.
    planned_from: Option<u16>,
    /// Station addresses that were asked and never answered.
    unanswered: BTreeMap<StationAddress, Unanswered>,
}

impl Addresses {
    /// The addresses of a plan; nothing without one.
    #[must_use]
    pub fn new(model: &NetworkModel) -> Self {
        let planned = model
            .devices
            .iter()
            .filter_map(|device| device.planned.map(|planned| (planned.station, device.id)));
        let order = match &model.tree {
            Some(tree) => tree.order().iter().map(|node| DeviceId(*node as u32)).collect(),
            None => model.devices.iter().map(|device| device.id).collect(),
        };
        Self { stations: planned.collect(), order, ..Self::default() }
    }

    /// How many controllers a frame passes now.
    pub(super) const fn present(&self) -> Option<u16> {
        self.present
    }

    /// A frame that `card` has sent, where that is known, passed `passed` controllers; confirmed, if as many have
    /// answered.
    pub(super) fn passed(
        &mut self,
        model: &mut NetworkModel,
        card: Option<Path>,
        passed: u16,
        is_confirmed: bool,
    ) {
        if !self.doubt.is_believed(passed, model.traffic.broadcasts.positions(), is_confirmed) {
            return;
        }
        let Some(card) = card else { return self.count(model, passed) };
        self.halves[card.index()] = Some(passed);
        let other = &mut self.halves[card.other().index()];
        // More than there are: a card that is out of use left its number behind.
        if other.is_some_and(|other| usize::from(other) + usize::from(passed) > self.order.len()) {
            *other = None;
        }
        let all = passed.saturating_add(other.unwrap_or(0));
        self.count(model, all);
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
    pub(super) fn count(&mut self, model: &mut NetworkModel, passed: u16) {
        if self.present == Some(passed) {
            return;
        }
        self.present = Some(passed);
        model.traffic.broadcasts.record_positions(passed);
        let passed = usize::from(passed).min(MOST_DEVICES);
        while self.order.len() < passed {
            // Those that answered to a station before any position was known come first, and those that come back have
            // their places.
            let mut known = model.devices.iter().map(|device| device.id);
            let free = known.find(|id| !self.order.contains(id));
            let id = free.unwrap_or_else(|| model.add_device());
            let place = self.order.partition_point(|one| *one < id);
            self.order.insert(place, id);
        }
        let is_line = model
            .tree
            .as_ref()
            .is_some_and(|tree| (0..tree.len()).all(|node| tree.children(node).count() <= 1));
        let is_whole = passed == self.order.len();
        // Where the wiring is not known, those before whom nobody is missing.
        let is_away = |id: &DeviceId| {
            model.device(*id).is_none_or(|one| {
                one.silent.is_some() || (one.answered.is_none() && self.is_by_address)
            })
        };
        let before_any_away = match model.tree {
            Some(_) => 0,
            None => self.order.iter().position(is_away).unwrap_or(self.order.len()),
        };
        let is_certain = |position: usize| {
            position < passed && (is_whole || is_line || position < before_any_away)
        };
        let fixed = self.order.iter().filter(|id| !model.optional.contains_key(id)).count();
        let mut positions = 0..;
        for (place, id) in self.order.iter().enumerate() {
            // Where groups come and go, places are certain while no group is there.
            let known = match model.optional.is_empty() {
                true => is_certain(place).then_some(Position(place as u16)),
                false if passed == fixed && !model.optional.contains_key(id) => {
                    positions.next().map(Position)
                }
                false => None,
            };
            if let Some(device) = model.device_mut(*id) {
                device.position = known;
            }
        }
        model.touch();
    }

    /// The controller at a position, as the card counts that has sent the frame.
    pub(super) fn at_position(
        &mut self,
        model: &mut NetworkModel,
        position: Position,
        answer: &Answer<'_>,
    ) -> Option<DeviceId> {
        let position = self.of_all(answer.sent_by, position);
        let index = usize::from(position.0);
        if self.present.is_none() && answer.sum > 0 {
            // Nothing says how many there are; this one is.
            self.count(model, position.0.checked_add(1)?);
            self.present = None;
        }
        // Whoever is known beyond those that were counted may be anywhere among them.
        let is_partial = self.present.is_some_and(|one| {
            let present = usize::from(one);
            present < self.order.len() || (model.tree.is_none() && present < model.devices.len())
        });
        // Groups that come and go may be anywhere.
        let is_partial = is_partial || !model.optional.is_empty();
        let known = match (is_partial, &model.tree) {
            (true, None) => {
                self.named_here(model, answer).or_else(|| self.among_present(model, index))
            }
            (true, Some(_)) => model.by_position(position),
            (false, _) => self.order.get(index).copied(),
        };
        if known.is_some() {
            return known;
        }
        let id = self.named_here(model, answer)?;
        model.device_mut(id)?.position = Some(position);
        Some(id)
    }

    /// The controller whose station address is read or written by a datagram.
    fn named_here(&self, model: &NetworkModel, answer: &Answer<'_>) -> Option<DeviceId> {
        let data = if answer.effect.reads { answer.reply.data() } else { answer.written() };
        let station = word_at(data, answer.ado, STATION).filter(|_| answer.sum > 0)?;
        let station = StationAddress(station);
        self.stations.get(station).or_else(|| planned_in_groups(model, station))
    }

    /// The controller at a place among those that are there, where some are not: those that are left keep their order.
    /// As long as it is not known who is missing, only those before whom nobody is.
    fn among_present(&self, model: &NetworkModel, index: usize) -> Option<DeviceId> {
        // While a line is scanned nobody has answered yet; who was met by its number alone must have.
        let is_there =
            |one: &&Device| one.silent.is_none() && (one.answered.is_some() || !self.is_by_address);
        let mut there = model.devices.iter().filter(is_there);
        let count = there.clone().count();
        let found = match self.present.map(usize::from) == Some(count) {
            true => there.nth(index),
            false => model.devices.iter().take_while(is_there).nth(index),
        };
        found.map(|device| device.id)
    }

    /// The controller with a station address. One that answers and is not known yet is taken to be
    /// the first one without a station address.
    pub(super) fn at_station(
        &mut self,
        model: &mut NetworkModel,
        station: StationAddress,
        answers: bool,
    ) -> Option<DeviceId> {
        if let Some(id) = self.stations.get(station) {
            return Some(id);
        }
        if !answers {
            return None;
        }
        self.count_planned(model, Some(station));
        if let Some(id) = self.stations.get(station) {
            return Some(id);
        }
        if let Some(id) = planned_in_groups(model, station) {
            self.give(model, id, station);
            return Some(id);
        }
        let by_number = self.by_number(model, station, MOST_BY_NUMBER);
        let by_number = by_number.filter(|id| model.device(*id).is_some_and(Self::is_free));
        let free = || model.devices.iter().find(|one| Self::is_free(one)).map(|device| device.id);
        // Where all were counted and have their addresses, one of them has got another one, unseen.
        let is_whole = self.present.is_some_and(|one| usize::from(one) == model.devices.len());
        let id = match by_number.or_else(free) {
            Some(id) => id,
            None if is_whole => return None,
            None if model.devices.len() < MOST_DEVICES => model.add_device(),
            None => return None,
        };
        // Counted from a known number it is no mere guess, and what positions tell still corrects it.
        self.is_by_address |= by_number.is_some();
        self.has_guessed |= by_number.is_none();
        self.give(model, id, station);
        Some(id)
    }

    /// Whether a controller was counted, and no station address is known to be its own.
    const fn is_free(device: &Device) -> bool {
        device.station.is_none()
    }

    /// Whether single controllers were named, so that their numbers stay.
    pub(super) const fn name(&mut self) {
        self.is_named = true;
    }

    /// Whether the order of controllers is known: from their positions, or by [`Self::settle`].
    pub(super) const fn is_settled(&self) -> bool {
        !self.has_guessed
    }

    /// A controller's registers were read.
    pub(super) fn read(&mut self, model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
        let Some(station) = word_at(answer.reply.data(), answer.ado, STATION) else { return };
        let station = StationAddress(station);
        if station.0 == 0
            && let Some(device) = model.device_mut(id)
            && device.station.is_some_and(|had| had.0 != 0)
        {
            device.lost_address = Some(Seen::new((), answer.at, Some(answer.frame)));
        }
        let may_be_wrong = self.has_guessed || self.is_by_address;
        if may_be_wrong && answer.effect.addressing == Addressing::Position {
            self.correct(model, id, station);
            return;
        }
        if let Some(owner) = self.is_shared(model, id, station, answer) {
            if let Some(owner) = model.device_mut(owner) {
                let seen = Seen::new(SharedBy::Reading(id), answer.at, Some(answer.frame));
                owner.shares_address(station, seen);
            }
            model.touch();
            return;
        }
        self.give(model, id, station);
    }

    /// A guess is put right: the controller at a position says its station address. What was learnt by that address
    /// goes with it.
    fn correct(&mut self, model: &mut NetworkModel, id: DeviceId, station: StationAddress) {
        let guessed = self.stations.get(station).filter(|guessed| *guessed != id);
        let Some(guessed) = guessed else { return self.give(model, id, station) };
        let (one, other) = (id.index(), guessed.index());
        if self.is_named || one.max(other) >= model.devices.len() {
            return;
        }
        model.devices.swap(one, other);
        for index in [one, other] {
            let device = &mut model.devices[index];
            device.id = DeviceId(index as u32);
            if let Some(station) = device.station {
                self.stations.insert(station, device.id);
            }
        }
        let position = model.devices[one].position;
        model.devices[one].position = model.devices[other].position;
        model.devices[other].position = position;
        model.forget_tree();
        model.touch();
    }

    /// Who has the station address that another controller, asked by its position, says is its own: only
    /// while positions are certain, and where that one had another address before.
    fn is_shared(
        &self,
        model: &NetworkModel,
        id: DeviceId,
        station: StationAddress,
        answer: &Answer<'_>,
    ) -> Option<DeviceId> {
        let is_position = answer.effect.addressing == Addressing::Position;
        let is_whole = self.present.map(usize::from) == Some(self.order.len());
        let had_another = model.device(id)?.station.is_some_and(|own| own != station);
        let owner = self.stations.get(station)?;
        let has_it = model.device(owner)?.station == Some(station);
        (is_position && is_whole && had_another && has_it && owner != id).then_some(owner)
    }

    /// A controller's registers were written.
    pub(super) fn written(&mut self, model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
        let Some(station) = word_at(answer.written(), answer.ado, STATION) else { return };
        let station = StationAddress(station);
        let since = answer.at.before(AWAY_WITHIN);
        let asked_in_vain = self.unanswered.contains_key(&station);
        self.give(model, id, station);
        let is_running = !model.cyclic.is_empty() || model.traffic.datagrams.lost_logical() > 0;
        if let Some(device) = model.device_mut(id).filter(|_| is_running && station != SET_ASIDE) {
            // While a line runs addresses are given to those that have lost theirs.
            let was_away = device.last_unanswered.is_some_and(|last| last >= since);
            if asked_in_vain || was_away {
                device.lost_address = Some(Seen::new((), answer.at, Some(answer.frame)));
            }
        }
    }

    /// All controllers' registers were written: one station address for all is none.
    pub(super) fn broadcast_written(&mut self, model: &mut NetworkModel, answer: &Answer<'_>) {
        if word_at(answer.written(), answer.ado, STATION).is_none() {
            return;
        }
        self.stations.clear();
        let was_guess = std::mem::take(&mut self.has_guessed) && !self.is_named;
        for device in &mut model.devices {
            if was_guess && device.planned.is_none() {
                // Whose it was that was learnt by addresses is never told any more.
                *device = Device { position: device.position, ..Device::new(device.id) };
            }
            device.station = None;
        }
        model.touch();
    }

    fn give(&mut self, model: &mut NetworkModel, id: DeviceId, station: StationAddress) {
        let Some(device) = model.device_mut(id) else { return };
        let before = device.station;
        let is_same = before == Some(station) && self.stations.get(station) == Some(id);
        if is_same || station.0 == 0 {
            // A device that has none any more keeps the last one, by which it will be sought.
            return;
        }
        device.station = Some(station);
        if let Some(asked) = self.unanswered.remove(&station) {
            model.asked_in_vain.retain(|one| *one != station);
            if asked.others_answer
                && let Some(device) = model.device_mut(id)
            {
                // It was away, and has its address again.
                device.is_silent(asked.first.at, asked.first.frame);
            }
        }
        self.stations.remove_of(id);
        if let Some(other) = self.stations.insert(station, id)
            && let Some(other) = model.device_mut(other)
        {
            other.station = None;
        }
        model.touch();
    }
}

/// The controller that is planned with a station address and has none yet, on a line with groups that come and go: there
/// positions tell nothing, and each MainDevice gives everybody the address that was planned.
fn planned_in_groups(model: &NetworkModel, station: StationAddress) -> Option<DeviceId> {
    if model.optional.is_empty() {
        return None;
    }
    let is_it = |device: &&Device| {
        device.station.is_none() && device.planned.is_some_and(|planned| planned.station == station)
    };
    model.devices.iter().find(is_it).map(|device| device.id)
}
