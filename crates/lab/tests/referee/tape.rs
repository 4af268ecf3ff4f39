//! Knowledge that a recording gives of each device, for the responder to answer from.

use std::collections::{BTreeMap, VecDeque};

use linesman_lab::replay::learn::{AlStep, DeviceSeen, MailboxTurn};
use linesman_lab::replay::recording::Datagram;
use linesman_lab::replay::{Learned, Recording};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::register::{self as r, FmmuConfig, SyncManagerConfig};

/// Length of a mailbox header, whose counter is no part of what is asked.
pub(crate) const HEADER: usize = 6;
/// Registers; memory begins here.
pub(crate) const REGISTERS: u16 = 0x0F00;

/// A mailbox request and its answer, as they were recorded.
#[derive(Clone, Debug)]
pub(crate) struct Dialogue {
    pub(crate) request: Vec<u8>,
    pub(crate) answer: Vec<u8>,
}

/// SyncManagers and FMMUs under which a device took a step.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(crate) struct SetUp {
    /// Those that are on: start, length, mode and direction.
    managers: BTreeMap<u16, (u16, u16, u8)>,
    /// Mapped bits of the memory, in any order; where they are in the logical image is free. Status
    /// bits of SyncManagers may be mapped by whoever wants to see them.
    mapped: Vec<(u32, bool, bool)>,
}

impl SetUp {
    pub(crate) fn of(byte: impl Fn(u16) -> u8) -> Self {
        let mut managers = BTreeMap::new();
        for index in 0..16 {
            let Some(start) = r::SYNC_MANAGER.at(index) else { continue };
            let config =
                SyncManagerConfig::from_bytes(std::array::from_fn(|at| byte(start.0 + at as u16)));
            if config.activate.enable() {
                // Mode and direction; who is told by an interrupt, and what watches, is free.
                const WHAT: u8 = 0x0F;
                managers.insert(index, (config.start.0, config.length, config.control.0 & WHAT));
            }
        }
        let mut mapped = Vec::new();
        for fmmu in fmmus(&byte) {
            let first = u32::from(fmmu.physical_start.0) * 8 + u32::from(fmmu.physical_start_bit);
            let bits = bits(&fmmu);
            mapped.extend((first..first + bits).map(|bit| (bit, fmmu.reads, fmmu.writes)));
        }
        mapped.retain(|(bit, ..)| bit / 8 >= u32::from(REGISTERS));
        mapped.sort_unstable();
        Self { managers, mapped }
    }
}

/// FMMUs that are on.
pub(crate) fn fmmus(byte: &impl Fn(u16) -> u8) -> Vec<FmmuConfig> {
    (0..16)
        .filter_map(|index| r::FMMU.at(index))
        .map(|start| FmmuConfig::from_bytes(std::array::from_fn(|at| byte(start.0 + at as u16))))
        .filter(|fmmu| fmmu.active && fmmu.length > 0)
        .collect()
}

/// How many bits an FMMU maps.
pub(crate) fn bits(fmmu: &FmmuConfig) -> u32 {
    let last = (u32::from(fmmu.length) - 1) * 8 + u32::from(fmmu.logical_stop_bit);
    (last + 1).saturating_sub(u32::from(fmmu.logical_start_bit))
}

/// One device of the recording.
#[derive(Clone, Default, Debug)]
pub(crate) struct Tape {
    /// Register bytes as they were before anything wrote them.
    pub(crate) initial: BTreeMap<u16, u8>,
    pub(crate) sii: BTreeMap<u32, u16>,
    pub(crate) sii_times: VecDeque<linesman_proto::time::Span>,
    pub(crate) steps: VecDeque<AlStep>,
    pub(crate) mailbox: VecDeque<MailboxTurn>,
    pub(crate) dialogues: Vec<Dialogue>,
    /// By the state that was asked for.
    pub(crate) set_ups: BTreeMap<u8, SetUp>,
    /// Which register bytes are there, and which are not; of others the recording says nothing.
    pub(crate) has: BTreeMap<u16, bool>,
    station: u16,
    written: BTreeMap<u16, u8>,
    asked: Option<Vec<u8>>,
}

impl Tape {
    /// A wide access proves only that its beginning is there: one byte is enough to be counted.
    fn note(&mut self, range: std::ops::Range<u16>, has: bool) {
        const ENTRY: u16 = FmmuConfig::LEN as u16;
        let end = if has { range.end.min(range.start.saturating_add(ENTRY)) } else { range.end };
        for byte in (range.start..end).filter(|byte| *byte < REGISTERS) {
            let known = self.has.entry(byte).or_insert(has);
            *known |= has;
        }
    }

    fn byte(&self, address: u16) -> u8 {
        self.written.get(&address).copied().unwrap_or(0)
    }

    fn wrote(&mut self, ado: u16, data: &[u8]) {
        for (address, byte) in (ado..).zip(data).filter(|(address, _)| *address < REGISTERS) {
            self.written.insert(address, *byte);
        }
        if ado == r::AL_CONTROL.address.0 {
            let set_up = SetUp::of(|address| self.byte(address));
            self.set_ups.entry(data[0] & 0x0F).or_insert(set_up);
        }
        if ado >= 0x1000 && ado == self.mailbox_start(0) {
            self.asked = Some(data.to_vec());
        }
    }

    fn fetched(&mut self, ado: u16, data: &[u8]) {
        if ado >= 0x1000
            && ado == self.mailbox_start(1)
            && let Some(request) = self.asked.take()
        {
            self.dialogues.push(Dialogue { request, answer: data.to_vec() });
        }
    }

    fn mailbox_start(&self, index: u16) -> u16 {
        let start = r::SYNC_MANAGER.address.0 + 8 * index;
        u16::from_le_bytes([self.byte(start), self.byte(start + 1)])
    }

    /// Whether AL status mirrors AL control, error bit included: by SII word 0, else by what was seen. A
    /// request for INIT cannot be refused, so an error bit behind it is the one that was written.
    pub(crate) fn mirrors(&self) -> bool {
        const ERROR: u16 = 1 << 4;
        const INIT: u16 = 1;
        self.sii.get(&0).map_or_else(
            || self.steps.iter().any(|step| step.status & 0x1F == ERROR | INIT),
            |word| word >> 8 & 1 != 0,
        )
    }

    /// As many of a kind as are there for sure, one behind the other.
    pub(crate) fn count(&self, register: &r::Register) -> u8 {
        let there = |index: &u16| {
            register.at(*index).is_some_and(|start| self.has.get(&start.0) == Some(&true))
        };
        (0..16).take_while(there).count() as u8
    }
}

/// The devices of a recording, in the order in which frames pass them.
pub(crate) fn tapes(recording: &Recording, learned: &Learned) -> Vec<Tape> {
    let of = |seen: &DeviceSeen| Tape {
        initial: seen.initial.clone(),
        sii: seen.sii.clone(),
        sii_times: seen.sii_times.iter().copied().collect(),
        steps: seen.steps.clone(),
        mailbox: seen.mailbox.clone(),
        ..Tape::default()
    };
    let mut tapes: Vec<Tape> = learned.devices.iter().map(of).collect();
    for turn in &recording.turns {
        for (request, reply) in turn.pairs() {
            if let Some(command) = request.command {
                take(&mut tapes, command, &request, &reply);
            }
        }
    }
    tapes
}

fn take(tapes: &mut [Tape], command: Command, request: &Datagram<'_>, reply: &Datagram<'_>) {
    let effect = command.effect();
    let end = request.ado.0.saturating_add(request.data.len() as u16);
    let range = request.ado.0..end;
    let meant = match command.addressing() {
        _ if effect.multiple_write => return,
        Addressing::Position => usize::from(request.adp.wrapping_neg()),
        Addressing::Station => {
            let mine = |tape: &Tape| tape.station == request.adp && tape.station != 0;
            let Some(found) = tapes.iter().position(mine) else { return };
            found
        }
        Addressing::Broadcast => {
            let all = usize::from(reply.wkc) == tapes.len();
            for tape in tapes.iter_mut() {
                // Some have it: who, is not told.
                if all || reply.wkc == 0 {
                    tape.note(range.clone(), all);
                }
                if effect.writes && all {
                    tape.wrote(request.ado.0, request.data);
                }
            }
            return;
        }
        Addressing::Logical | Addressing::None => return,
    };
    let Some(tape) = tapes.get_mut(meant) else { return };
    // Whether a mailbox or AL control takes something depends on the moment.
    if reply.wkc > 0 || effect.reads {
        tape.note(range, reply.wkc > 0);
    }
    if reply.wkc == 0 {
        return;
    }
    if effect.writes {
        if request.ado == r::STATION_ADDRESS.address {
            tape.station = u16::from_le_bytes([request.data[0], request.data[1]]);
        }
        tape.wrote(request.ado.0, request.data);
    } else {
        tape.fetched(request.ado.0, reply.data);
    }
}
