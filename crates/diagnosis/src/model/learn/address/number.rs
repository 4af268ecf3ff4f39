//! Order of controllers by their station addresses alone: MainDevices give these in the order of positions, most of them
//! from a number that is known.

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, Position, StationAddress};

use super::{Addresses, MOST_DEVICES};
use crate::main_device::Mark;
use crate::model::{Device, NetworkModel};

/// First station addresses that MainDevices give: SOEM and ours; KickCAT and TwinCAT; libethercat; IgH; ethercrab.
const FIRST_STATIONS: [u16; 5] = [0x1001, 1001, 1000, 1, 0x1000];
/// A station address that lies farther from the first one tells no place, where the MainDevice is recognised.
pub(super) const MOST_BY_NUMBER: usize = 1000;
/// The same where it is not, as long as nobody has counted.
const MOST_UNCOUNTED: usize = 256;

/// The station address from which the MainDevice counts positions, and whether it is known to be its own: then it holds
/// however many answer; else it must be one of a line of `count`.
fn first_station(
    model: &NetworkModel,
    known: impl Iterator<Item = u16>,
    count: usize,
) -> Option<(u16, bool)> {
    let (least, most) = known.fold(None, |bounds: Option<(u16, u16)>, one| {
        let (least, most) = bounds.unwrap_or((one, one));
        Some((least.min(one), most.max(one)))
    })?;
    let fits = |first: u16, count: usize| first <= least && usize::from(most - first) < count;
    let own = own_first_station(model).filter(|first| fits(*first, MOST_BY_NUMBER));
    let guessed = || FIRST_STATIONS.into_iter().find(|first| fits(*first, count));
    own.map(|first| (first, true)).or_else(|| Some((guessed()?, false)))
}

/// The station address of the first SubDevice, where the MainDevice is recognised by it, too.
fn own_first_station(model: &NetworkModel) -> Option<u16> {
    model
        .habits
        .recognised()?
        .marks
        .iter()
        .find_map(|mark| if let Mark::FirstStation(station) = mark { Some(*station) } else { None })
}

impl Addresses {
    /// The controller whose place in the line a station address tells, where MainDevices count from a known number
    /// on: among those that were counted, or, before anybody has counted, as far as it goes.
    pub(super) fn by_number(
        &mut self,
        model: &mut NetworkModel,
        station: StationAddress,
        most_beyond: usize,
    ) -> Option<DeviceId> {
        if model.devices.iter().any(|one| one.planned.is_some()) {
            return None;
        }
        // While nobody has counted them the number alone tells.
        let is_counted = self.present.is_some() || !self.order.is_empty();
        let count = if is_counted { self.order.len() } else { MOST_UNCOUNTED };
        let known = self.stations.keys().chain([station]).map(|one| one.0);
        let (first, is_its_own) = first_station(model, known, count)?;
        let place = usize::from(station.0 - first);
        if place < model.devices.len() {
            return Some(DeviceId(place as u32));
        }
        let is_too_far = place >= model.devices.len() + most_beyond;
        if is_too_far || (is_counted && !is_its_own) {
            return None;
        }
        // There are more than answer now.
        while model.devices.len() <= place {
            model.add_device();
        }
        Some(DeviceId(place as u32))
    }

    /// Gives planned SubDevices the station addresses by which the MainDevice counts positions, where the project does not
    /// give them and none was met by the address that it was taken to have: from the number of the MainDevice that was
    /// recognised, or else from a known one in whose order a station address has a place that was `met`.
    pub(in crate::model::learn) fn count_planned(
        &mut self,
        model: &mut NetworkModel,
        met: Option<StationAddress>,
    ) {
        let count = self.order.len();
        let place = |first: u16, met: StationAddress| met.0.checked_sub(first).map(usize::from);
        let holds = |first: &u16, met| place(*first, met).is_some_and(|place| place < count);
        let known =
            || FIRST_STATIONS.into_iter().find(|first| met.is_some_and(|met| holds(first, met)));
        let first = own_first_station(model).or_else(known);
        let Some(first) = first.filter(|first| self.planned_from != Some(*first)) else { return };
        let is_counted = |device: &Device| {
            device.planned.as_ref().is_some_and(|planned| !planned.station_is_given)
        };
        if model.devices.iter().any(|one| is_counted(one) && one.answered.is_some()) {
            return;
        }
        self.planned_from = Some(first);
        for (position, id) in self.order.clone().into_iter().enumerate() {
            if model.device(id).is_some_and(is_counted) {
                let station = StationAddress(first.wrapping_add(position as u16));
                self.stations.remove_of(id);
                self.stations.insert(station, id);
            }
        }
    }

    /// Puts controllers that were met by their station addresses in the middle of a run into order: every known
    /// MainDevice gives these addresses in the order of positions. Identities change, so this is only for a line of
    /// which nothing was said yet. Says whether any changed.
    pub(in crate::model::learn) fn settle(&mut self, model: &mut NetworkModel) -> bool {
        let is_planned = model.devices.iter().any(|one| one.planned.is_some());
        let may_be_wrong = self.has_guessed || self.is_by_address;
        if self.is_named || !may_be_wrong || is_planned {
            return false;
        }
        let own_first = own_first_station(model);
        let basis = (self.stations.len(), self.present, own_first);
        if self.settled_by == Some(basis) || (!self.has_guessed && own_first.is_none()) {
            return false;
        }
        self.settled_by = Some(basis);
        let Some(places) = self.places(model) else { return false };
        self.has_guessed = false;
        self.is_by_address = true;
        let is_in_order = model
            .devices
            .iter()
            .all(|one| one.station.is_none_or(|at| places.get(&at) == Some(&one.id.index())));
        if is_in_order {
            return false;
        }
        let count = places.values().max().map_or(0, |last| last + 1).max(model.devices.len());
        let mut sorted: Vec<Option<Device>> = vec![None; count];
        let (addressed, others): (Vec<Device>, Vec<Device>) =
            model.devices.drain(..).partition(|device| device.station.is_some());
        for device in addressed {
            if let Some(place) = device.station.and_then(|station| places.get(&station)) {
                sorted[*place] = Some(device);
            }
        }
        // Of those without an address nothing is known but that they are there.
        let mut others = others.into_iter();
        self.stations.clear();
        self.order.clear();
        let mut position = 0;
        // Those that were once counted all together have their positions, whether they answer now or not.
        let was_whole = self.most_counted(model) >= sorted.len();
        for (index, place) in sorted.into_iter().enumerate() {
            let id = DeviceId(index as u32);
            let mut device = place.or_else(|| others.next()).unwrap_or_else(|| Device::new(id));
            device.id = id;
            let never_answered = !was_whole && device.answered.is_none() && device.silent.is_some();
            device.position = (!never_answered).then_some(Position(position));
            if let Some(station) = device.station {
                self.stations.insert(station, id);
            }
            if !never_answered {
                self.order.push(id);
                position += 1;
            }
            model.devices.push(device);
        }
        model.forget_tree();
        model.touch();
        true
    }

    /// How many controllers a frame has passed at most.
    fn most_counted(&self, model: &NetworkModel) -> usize {
        let counted = model.traffic.broadcasts.counted();
        usize::from(counted.max(self.present.unwrap_or(0))).min(MOST_DEVICES)
    }

    /// The places that station addresses tell: by the number from which the MainDevice counts, else, once all are known,
    /// by their order.
    fn places(&self, model: &NetworkModel) -> Option<BTreeMap<StationAddress, usize>> {
        let mut stations: Vec<StationAddress> =
            model.devices.iter().filter_map(|device| device.station).collect();
        stations.sort_unstable();
        let silent = |one: &&Device| one.answered.is_none() && one.silent.is_some();
        let present = self.present.map(usize::from).filter(|present| *present <= MOST_DEVICES);
        let count = present.map(|present| {
            let with_silent = present + model.devices.iter().filter(silent).count();
            with_silent.max(self.most_counted(model))
        });
        let known = stations.iter().map(|one| one.0);
        let first = first_station(model, known, count.unwrap_or(0));
        if let Some((first, _)) = first.filter(|(_, is_its_own)| *is_its_own || count.is_some()) {
            let place = |station: StationAddress| (station, usize::from(station.0 - first));
            return Some(stations.into_iter().map(place).collect());
        }
        let count = count?;
        (stations.len() == count).then(|| stations.into_iter().zip(0..).collect())
    }
}
