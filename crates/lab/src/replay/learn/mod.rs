//! Knowledge that a recording gives of the devices that answered.
//!
//! The first value of each register that no request had written before is the value at the start.
//! Where the recording begins in the middle of a run, station addresses that are used without having
//! been given are taken to be given in the order of their numbers, and mappings that are only set up
//! later to have been the same before; [`Learned::notes`] says where that was done.

mod device;
mod latency;
mod objects;
mod stations;
mod target;

use std::collections::BTreeSet;

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::register::{self as r, EcatEvents};

pub use device::{AlStep, DeviceSeen, MailboxTurn};
use stations::Stations;
pub use target::Target;

use super::recording::{Datagram, Recording, Turn};
use linesman_proto::time::Instant;

/// Registers that say what a controller is end here.
const IDENTITY: usize = 0x000A;
/// Most devices that a recording is believed to have.
const MOST_DEVICES: u16 = 4_096;

/// How many controllers answered an access to registers: what tells which registers they have.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Presence {
    /// Who was asked: `None` for all.
    pub device: Option<usize>,
    /// The first register byte.
    pub address: RegisterAddress,
    /// How many bytes.
    pub len: usize,
    /// Whether it was a write.
    pub writes: bool,
    /// How many answered.
    pub answered: u16,
}

/// What was learned.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Learned {
    /// In the order in which frames pass them.
    pub devices: Vec<DeviceSeen>,
    /// Which accesses were answered by how many.
    pub presence: Vec<Presence>,
    /// Broadcast reads of what controllers are: from which register on, all ORed, and how many
    /// answered.
    pub identities: Vec<(RegisterAddress, Vec<u8>, u16)>,
    /// ECAT events that stood when the recording began, and those that were masked in.
    pub events: EventsAtStart,
    /// What had to be assumed, for people.
    pub notes: Vec<String>,
    /// A logical access was answered before any mapping was seen.
    mapped_before: bool,
}

/// ECAT events when the recording begins.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct EventsAtStart {
    /// Events that stood.
    pub request: u16,
    /// Events that datagrams carried away.
    pub mask: u16,
    /// Devices whose DL or AL status was read while an event stood; with none, all had it.
    pub owners: BTreeSet<usize>,
    /// The last event went with the read of a device's status.
    pub ended: bool,
    begun: bool,
    /// DL status, AL status were read: their events are gone.
    served: u16,
}

impl EventsAtStart {
    fn take(&mut self, request: &Datagram<'_>, reply: &Datagram<'_>, target: Target) {
        self.ended |= self.request != 0 && reply.irq == 0;
        if !std::mem::replace(&mut self.begun, true) {
            self.mask = reply.irq;
        }
        self.request |= reply.irq & !self.served;
        let end = u32::from(request.ado.0) + request.data.len() as u32;
        let covers = |register: &r::Register| {
            u32::from(request.ado.0) < u32::from(register.end().0)
                && u32::from(register.address.0) < end
        };
        let reads = request.command.is_some_and(|command| {
            command.effect().reads && command.addressing() != Addressing::Logical
        });
        if reads && reply.wkc > 0 {
            let events =
                [(&r::DL_STATUS, EcatEvents::DL_STATUS), (&r::AL_STATUS, EcatEvents::AL_STATUS)];
            for (register, event) in events {
                if covers(register) {
                    self.served |= event.0;
                    if let Target::One(device) = target
                        && !self.ended
                    {
                        self.owners.insert(device);
                    }
                }
            }
        }
    }
}

/// Learns from a recording.
#[must_use]
pub fn learn(recording: &Recording) -> Learned {
    let count = device_count(recording);
    let mut stations = Stations::of(recording, count);
    let mut learned =
        Learned { devices: vec![DeviceSeen::default(); usize::from(count)], ..Learned::default() };
    if let Some(note) = stations.note() {
        learned.notes.push(note);
    }
    for (position, station) in stations.at_start() {
        learned.devices[position].preset_station(station);
    }
    for turn in &recording.turns {
        if turn.reply.is_none() {
            learned.take_lost(turn, &mut stations);
        }
        for (request, reply) in turn.pairs() {
            let count = learned.devices.len();
            let target = request
                .command
                .map_or(Target::Nobody, |command| stations.target(command, &request, count));
            learned.events.take(&request, &reply, target);
            learned.take(&request, &reply, turn.request.at, &mut stations);
        }
    }
    for device in &mut learned.devices {
        device.finish();
    }
    if learned.mapped_before && learned.devices.iter_mut().any(DeviceSeen::map_from_later) {
        learned.notes.push(
            "process data were exchanged before any mapping was written: FMMUs and SyncManagers are \
             taken to be as they are written later"
                .to_owned(),
        );
    }
    learned.presence.sort_unstable();
    learned.presence.dedup();
    learned.identities.sort_unstable();
    learned.identities.dedup();
    learned
}

impl Learned {
    /// What came back was not recorded. A write to a device that answers otherwise was done.
    fn take_lost(&mut self, turn: &Turn, stations: &mut Stations) {
        for request in turn.request.datagrams() {
            let Some(command) = request.command else { continue };
            let target = stations.target(command, &request, self.devices.len());
            let only_writes = command.effect().writes && !command.effect().reads;
            if let (Target::One(device), true) = (target, only_writes) {
                self.devices[device].write(request.ado, request.data, true, turn.request.at);
            }
        }
    }

    fn take(
        &mut self,
        request: &Datagram<'_>,
        reply: &Datagram<'_>,
        at: Instant,
        stations: &mut Stations,
    ) {
        let Some(command) = request.command else { return };
        let target = stations.target(command, request, self.devices.len());
        let effect = command.effect();
        self.note_presence(command, request, reply, target);
        // All are one.
        let target = match target {
            Target::All if self.devices.len() == 1 => Target::One(0),
            Target::One(_) | Target::All | Target::Logical | Target::Nobody => target,
        };
        match target {
            Target::One(device) => {
                let seen = &mut self.devices[device];
                if effect.reads {
                    seen.read(request.ado, reply.data, reply.wkc > 0, at);
                }
                if effect.writes && !effect.multiple_write {
                    seen.write(request.ado, request.data, reply.wkc > 0, at);
                }
            }
            Target::All if reply.wkc > 0 => {
                if effect.reads {
                    for seen in &mut self.devices {
                        seen.read_by_all(request.ado, reply.data, at);
                    }
                }
                if effect.writes {
                    for seen in &mut self.devices {
                        seen.write(request.ado, request.data, true, at);
                    }
                }
            }
            Target::Logical if reply.wkc > 0 => {
                let mapped = self.devices.iter().any(|seen| seen.has_mapping());
                self.mapped_before |= !mapped;
            }
            Target::All | Target::Logical | Target::Nobody => {}
        }
        stations.follow(command, request, reply);
    }

    fn note_presence(
        &mut self,
        command: Command,
        request: &Datagram<'_>,
        reply: &Datagram<'_>,
        target: Target,
    ) {
        let effect = command.effect();
        let is_identity = usize::from(request.ado.0) + request.data.len() <= IDENTITY;
        if target == Target::All && effect.reads && !effect.writes && is_identity {
            self.identities.push((request.ado, reply.data.to_vec(), reply.wkc));
        }
        if effect.multiple_write && target != Target::Nobody {
            // One reads, the others write: all that have the register add one.
            self.presence.push(Presence {
                device: None,
                address: request.ado,
                len: request.data.len(),
                writes: true,
                answered: reply.wkc,
            });
            return;
        }
        if effect.reads == effect.writes || usize::from(request.ado.0) + request.data.len() > 0x0F00
        {
            return;
        }
        let device = match target {
            Target::One(device) => Some(device),
            Target::All => None,
            Target::Logical | Target::Nobody => return,
        };
        // Whether these take a write depends on the moment.
        let moody = [0x0120..0x0122, 0x0500..0x0600, 0x0800..0x0880];
        let range = request.ado.0..request.ado.0 + request.data.len() as u16;
        let touches =
            |other: &std::ops::Range<u16>| range.start < other.end && other.start < range.end;
        if effect.writes && device.is_some() && moody.iter().any(touches) {
            return;
        }
        if effect.writes && moody[..2].iter().any(touches) {
            return;
        }
        self.presence.push(Presence {
            device,
            address: request.ado,
            len: request.data.len(),
            writes: effect.writes,
            answered: reply.wkc,
        });
    }
}

/// How many controllers frames pass: each adds one to positions; else how many stations answered.
fn device_count(recording: &Recording) -> u16 {
    let mut most = 0;
    let mut answering = Vec::new();
    for turn in &recording.turns {
        for (request, reply) in turn.pairs() {
            let Some(command) = request.command else { continue };
            match command.addressing() {
                Addressing::Position | Addressing::Broadcast => {
                    let passed = reply.adp.wrapping_sub(request.adp);
                    most = most.max(if passed > MOST_DEVICES { 0 } else { passed });
                }
                Addressing::Station if reply.wkc > 0 && !command.effect().multiple_write => {
                    if !answering.contains(&request.adp) {
                        answering.push(request.adp);
                    }
                }
                Addressing::Station | Addressing::Logical | Addressing::None => {}
            }
        }
    }
    if most == 0 { answering.len() as u16 } else { most }
}
