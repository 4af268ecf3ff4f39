//! Background polling while nothing is wrong: registers that show trouble early and that nobody
//! else reads, by turns; and objects that tell why a SubDevice left its state.

use std::collections::BTreeMap;

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::state::AlState;
use linesman_proto::state::status_code::Class as CodeClass;
use linesman_proto::time::{Instant, Span};

use crate::model::{Device, NetworkModel, UpTime};

/// From one turn to the next.
const EVERY: Span = Span::ms(200);
/// Clocks that are read in one turn.
const CLOCKS: usize = 32;
/// Watchdogs that are read in one turn.
const WATCHDOGS: usize = 12;
/// How far the clock is off the reference clock.
const DIFFERENCE: (u16, u16) = (0x092C, 4);
/// Watchdogs: divider, times, states and counters.
const WATCHDOG: (u16, u16) = (0x0400, 0x44);
/// Event missed and cycle exceeded.
const COUNTS: [u8; 2] = [0x0B, 0x0C];

/// A register: where it begins, and its length.
pub(super) type PolledRegister = (u16, u16);

/// Whose turn it is.
#[derive(Clone, Default, Debug)]
pub(super) struct BackgroundPoll {
    next: Option<Instant>,
    /// Devices that had their turn since the first one had.
    clocks: usize,
    watchdogs: usize,
    /// For which of its errors a device was last asked.
    asked: BTreeMap<DeviceId, Instant>,
    /// For which of its falls it was last asked how long it is up.
    asked_up: BTreeMap<DeviceId, Instant>,
}

impl BackgroundPoll {
    /// When the next turn is; `None` as long as there is nobody to be asked.
    pub(super) const fn next(&self) -> Option<Instant> {
        self.next
    }

    /// What is to be read now.
    pub(super) fn turn(
        &mut self,
        model: &NetworkModel,
        now: Instant,
    ) -> Vec<(DeviceId, PolledRegister)> {
        if self.next.is_some_and(|next| now < next) {
            return Vec::new();
        }
        // Who is on its way up is asked enough.
        let is_up = |device: &&Device| {
            device.silent.is_none() && device.al.state() >= Some(AlState::SafeOp)
        };
        let up: Vec<&Device> = model.devices.iter().filter(is_up).collect();
        let in_step = |device: &&&Device| device.sync_on.is_some_and(|on| on.value);
        let clocked: Vec<DeviceId> = up.iter().filter(in_step).map(|device| device.id).collect();
        let all: Vec<DeviceId> = up.iter().map(|device| device.id).collect();
        self.next = (!all.is_empty()).then_some(now + EVERY);
        let restarted = self.restarted(model);
        let clocks = take(&mut self.clocks, &clocked, CLOCKS).map(|id| (id, DIFFERENCE));
        let watchdogs = take(&mut self.watchdogs, &all, WATCHDOGS).map(|id| (id, WATCHDOG));
        clocks.chain(watchdogs).chain(restarted).collect()
    }

    /// Who has fallen since the last turn, and answers: how long it is up tells how long its supply was away.
    fn restarted(&mut self, model: &NetworkModel) -> Vec<(DeviceId, PolledRegister)> {
        let mut wanted = Vec::new();
        for device in &model.devices {
            let mut falls = device.al.changes.iter().rev().filter(|change| change.is_own_fall());
            let Some(fall) = falls.next() else { continue };
            let is_there = device.silent.is_none() && device.station.is_some();
            if is_there && self.asked_up.insert(device.id, fall.at) != Some(fall.at) {
                wanted.push((device.id, UpTime::REGISTERS));
            }
        }
        wanted
    }

    /// Objects that tell why devices lost their step, once for each time.
    pub(super) fn objects(&mut self, model: &NetworkModel) -> Vec<(DeviceId, ObjectAddress)> {
        let mut wanted = Vec::new();
        for device in &model.devices {
            let Some(error) = device.al.errors.back() else { continue };
            let code = error.code.map(|code| code.value.explain().class);
            let is_new = self.asked.get(&device.id) != Some(&error.status.at);
            if !(error.had_arrived && code == Some(CodeClass::Timing) && is_new) {
                continue;
            }
            self.asked.insert(device.id, error.status.at);
            // Who has no outputs counts with its inputs.
            for index in [ObjectIndex::OUTPUT_SYNC, ObjectIndex::INPUT_SYNC] {
                for subindex in COUNTS {
                    wanted.push((device.id, ObjectAddress::new(index.0, subindex)));
                }
            }
        }
        wanted
    }
}

/// The next ones of `all`, from where the last turn ended.
fn take<'a>(
    turn: &mut usize,
    all: &'a [DeviceId],
    most: usize,
) -> impl Iterator<Item = DeviceId> + use<'a> {
    let begin = if *turn >= all.len() { 0 } else { *turn };
    let end = (begin + most).min(all.len());
    *turn = end;
    all[begin..end].iter().copied()
}
