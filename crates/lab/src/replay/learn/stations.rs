//! Station addresses of the devices, as the recording goes on.

use std::collections::BTreeMap;

use linesman_proto::command::{Addressing, Command};
use linesman_proto::register as r;

use super::Target;
use crate::replay::recording::{Datagram, Recording};

/// Station addresses and positions.
#[derive(Clone, Debug, Default)]
pub(super) struct Stations {
    now: BTreeMap<u16, usize>,
    /// Addresses that answered before they were given.
    assumed: Vec<(usize, u16)>,
}

impl Stations {
    pub(super) fn of(recording: &Recording, count: u16) -> Self {
        let mut given: Vec<u16> = Vec::new();
        let mut used: Vec<u16> = Vec::new();
        let mut placed: BTreeMap<u16, usize> = BTreeMap::new();
        for turn in &recording.turns {
            for (request, reply) in turn.pairs() {
                let Some(command) = request.command.filter(|_| reply.wkc > 0) else { continue };
                let is_station = request.ado == r::STATION_ADDRESS.address;
                match command.addressing() {
                    Addressing::Station => {
                        let is_new = !given.contains(&request.adp) && !used.contains(&request.adp);
                        if is_new && !command.effect().multiple_write {
                            used.push(request.adp);
                        }
                    }
                    Addressing::Position if is_station && command.effect().writes => {
                        given.extend(word(request.data));
                    }
                    Addressing::Position if is_station => {
                        let position = usize::from(0u16.wrapping_sub(request.adp));
                        if let Some(station) = word(reply.data).filter(|one| !given.contains(one)) {
                            placed.entry(station).or_insert(position);
                        }
                    }
                    Addressing::Position
                    | Addressing::Broadcast
                    | Addressing::Logical
                    | Addressing::None => {}
                }
            }
        }
        used.sort_unstable();
        let mut free = (0..usize::from(count)).filter(|at| !placed.values().any(|one| one == at));
        let assumed: Vec<(usize, u16)> = used
            .iter()
            .filter_map(|station| {
                let position = placed.get(station).copied().or_else(|| free.next())?;
                Some((position, *station))
            })
            .collect();
        let now = assumed.iter().map(|(position, station)| (*station, *position)).collect();
        Self { now, assumed }
    }

    /// Station addresses that devices have when the recording begins.
    pub(super) fn at_start(&self) -> Vec<(usize, u16)> {
        self.assumed.clone()
    }

    pub(super) fn note(&self) -> Option<String> {
        if self.assumed.is_empty() {
            return None;
        }
        let list: Vec<String> = self
            .assumed
            .iter()
            .map(|(position, station)| format!("0x{station:04X} to device {}", position + 1))
            .collect();
        Some(format!(
            "station addresses answer that no request of the recording gave: taken to belong, in \
             their order, {}",
            list.join(", ")
        ))
    }

    pub(super) fn target(&self, command: Command, request: &Datagram<'_>, count: usize) -> Target {
        match command.addressing() {
            Addressing::None => Target::Nobody,
            Addressing::Broadcast => Target::All,
            Addressing::Logical => Target::Logical,
            Addressing::Position => {
                let position = usize::from(0u16.wrapping_sub(request.adp));
                if position < count { Target::One(position) } else { Target::Nobody }
            }
            Addressing::Station => {
                self.now.get(&request.adp).map_or(Target::Nobody, |device| Target::One(*device))
            }
        }
    }

    /// A request may have given an address.
    pub(super) fn follow(
        &mut self,
        command: Command,
        request: &Datagram<'_>,
        reply: &Datagram<'_>,
    ) {
        let writes = command.effect().writes && reply.wkc > 0;
        if !writes || request.ado != r::STATION_ADDRESS.address {
            return;
        }
        let Some(station) = word(request.data) else { return };
        match command.addressing() {
            Addressing::Position => {
                let position = usize::from(0u16.wrapping_sub(request.adp));
                self.now.retain(|_, device| *device != position);
                self.now.insert(station, position);
            }
            Addressing::Broadcast => self.now.clear(),
            Addressing::Station => {
                if let Some(device) = self.now.remove(&request.adp) {
                    self.now.insert(station, device);
                }
            }
            Addressing::Logical | Addressing::None => {}
        }
    }
}

fn word(data: &[u8]) -> Option<u16> {
    data.first_chunk().map(|bytes| u16::from_le_bytes(*bytes))
}
