//! Station addresses that are asked and never answer: somebody expects a SubDevice there.

use linesman_proto::address::StationAddress;
use linesman_proto::time::{Instant, Span};

use super::{Addresses, MOST_DEVICES};
use crate::model::{NetworkModel, Seen};

/// Asked so often in vain, and over so long, a station address is that of a SubDevice which should be there.
const ASKED_IN_VAIN: u64 = 3;
const ASKED_FOR: Span = Span::ms(20);
/// Who is asked in vain so many numbers beyond all that are known is expected by nobody: somebody looks who is there.
const MOST_BEYOND: usize = 64;
/// Most station addresses without an answer that are followed.
const MOST_UNANSWERED: usize = 512;

/// A station address that never answered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unanswered {
    pub(super) first: Seen<()>,
    last: Instant,
    times: u64,
    /// Whether others had answered at theirs before.
    pub(super) others_answer: bool,
}

impl Unanswered {
    /// Whether it was asked often enough, and for long enough, that somebody expects a SubDevice there.
    fn is_expected(&self) -> bool {
        self.times >= ASKED_IN_VAIN && self.last.since(self.first.at) >= ASKED_FOR
    }
}

impl Addresses {
    /// A station address of no controller was asked, and nobody answered.
    pub(in crate::model::learn) fn asked_in_vain(
        &mut self,
        model: &mut NetworkModel,
        station: StationAddress,
        seen: Seen<()>,
    ) {
        // Address 0 is that of those that were given none.
        if station.0 == 0 {
            return;
        }
        let count = self.unanswered.len();
        match self.unanswered.get_mut(&station) {
            Some(known) => (known.last, known.times) = (seen.at, known.times + 1),
            None if count < MOST_UNANSWERED => {
                // Planned ones have their addresses before anybody was met, and get them before process data.
                let is_planned = model.devices.iter().any(|one| one.planned.is_some());
                let is_met = !is_planned || model.devices.iter().any(|one| one.answered.is_some());
                let others_answer = is_met
                    && !self.stations.is_empty()
                    && (!is_planned || !model.cyclic.is_empty());
                let unanswered = Unanswered { first: seen, last: seen.at, times: 1, others_answer };
                self.unanswered.insert(station, unanswered);
                model.asked_in_vain.push(station);
            }
            None => {}
        }
    }

    /// Makes controllers of station addresses that were asked often enough in vain, where others answer: somebody
    /// expects a SubDevice there. Says whether there are new ones.
    pub(in crate::model::learn) fn expect_unanswered(&mut self, model: &mut NetworkModel) -> bool {
        if model.devices.iter().any(|one| one.planned.is_some()) {
            self.planned_unanswered(model);
            return false;
        }
        if self.stations.is_empty() {
            return false;
        }
        // Who looks for SubDevices asks at other numbers, too.
        let (least, most) = (self.stations.keys().next(), self.stations.keys().next_back());
        let is_near = |station: StationAddress| {
            let beyond = MOST_BEYOND as u16;
            let (least, most) = (least.map_or(0, |one| one.0), most.map_or(u16::MAX, |one| one.0));
            station.0.saturating_add(beyond) >= least && station.0 <= most.saturating_add(beyond)
        };
        let wanted: Vec<(StationAddress, Seen<()>)> = self
            .unanswered
            .iter()
            .filter(|(station, one)| one.is_expected() && is_near(**station))
            .map(|(station, one)| (*station, one.first))
            .collect();
        let mut has_new = false;
        for (station, first) in &wanted {
            if model.devices.len() >= MOST_DEVICES {
                break;
            }
            // It may have been counted while it was there, though nobody asked for it by its address then.
            let counted = self.by_number(model, *station, MOST_BEYOND);
            let counted = counted.filter(|id| model.device(*id).is_some_and(Self::is_free));
            // Once SubDevices are named nobody gets another number: only who has one of its own is added.
            if self.is_named && counted.is_none() {
                continue;
            }
            let id = counted.unwrap_or_else(|| model.add_device());
            has_new = true;
            self.give(model, id, *station);
            self.has_guessed |= counted.is_none();
            if let Some(device) = model.device_mut(id) {
                device.is_silent(first.at, first.frame);
            }
        }
        has_new
    }

    /// A SubDevice that was planned answers for the first time: if it was asked in vain before, it was away.
    pub(in crate::model::learn) fn answers_at_last(
        &mut self,
        model: &mut NetworkModel,
        station: StationAddress,
    ) {
        let Some(asked) = self.unanswered.remove(&station) else { return };
        model.asked_in_vain.retain(|one| *one != station);
        let device = self.stations.get(station).and_then(|id| model.device_mut(id));
        if let Some(device) = device.filter(|one| asked.others_answer && one.silent.is_none()) {
            device.is_silent(asked.first.at, asked.first.frame);
        }
    }

    /// Notes of SubDevices that were planned, and have never answered though they were asked often enough, that they are
    /// silent: where others answer.
    fn planned_unanswered(&self, model: &mut NetworkModel) {
        if model.devices.iter().all(|one| one.answered.is_none()) {
            return;
        }
        for (station, asked) in self.unanswered.iter().filter(|(_, one)| one.is_expected()) {
            let device = self.stations.get(*station).and_then(|id| model.device_mut(id));
            let device = device.filter(|one| one.answered.is_none() && one.silent.is_none());
            if let Some(device) = device {
                device.is_silent(asked.first.at, asked.first.frame);
                model.touch();
            }
        }
    }
}
