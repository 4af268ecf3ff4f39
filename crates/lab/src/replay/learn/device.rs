//! Knowledge of one device.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::{Counter, Message};
use linesman_proto::register::{
    self as r, AlStatus, FmmuConfig, SiiCommand, SiiControl, SyncManagerConfig,
};
use linesman_proto::time::{Instant, Span};

use super::latency::Waiting;
use super::objects::ObjectsSeen;

/// Bytes of registers that are followed.
const REGISTERS: usize = 0x1000;
/// Length of a mailbox header.
const HEADER_LEN: usize = 6;
/// A mailbox is full (SyncManager status).
const FULL: u8 = 1 << 3;
const SM0: u16 = r::SYNC_MANAGER.address.0;
const SM_STATUS: u16 = 5;
const ERROR: u16 = 1 << 4;
/// What was not done when the recording ended is not done while it is played.
const UNSEEN: Span = Span::s(86_400);

/// A step of the application layer as it was seen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AlStep {
    /// The state that was asked for.
    pub requested: u8,
    /// How long nobody took the request: until then the next write is refused.
    pub taken: Span,
    /// How long it took.
    pub took: Span,
    /// AL status behind it.
    pub status: u16,
    /// The AL status code, if it was read.
    pub code: u16,
}

/// A mailbox request as it was seen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct MailboxTurn {
    /// How long it stayed in SyncManager 0.
    pub taken: Span,
    /// When the answer was in SyncManager 1; `None` when none was seen.
    pub answered: Option<Span>,
}

/// What is known of one device.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct DeviceSeen {
    /// Register bytes as they were before anything wrote them.
    pub initial: BTreeMap<u16, u8>,
    /// Bytes behind the first messages of its mailbox: what its memory held before.
    pub memory: BTreeMap<u16, u8>,
    /// Words of its SII as they were before anything wrote them.
    pub sii: BTreeMap<u32, u16>,
    /// It took an acknowledgement for what it is: a controller without a processor gives the bit back.
    pub acknowledges: bool,
    /// How long its SII took for each command.
    pub sii_times: Vec<Span>,
    /// How long its EEPROM acknowledges nothing behind a write, if that showed.
    pub programming: Option<Span>,
    /// Steps of its application layer.
    pub steps: VecDeque<AlStep>,
    /// Behind each answer that was fetched: when the device began to write the next, and whether the
    /// controller showed it. `None` where it was not seen.
    pub openings: VecDeque<Option<(Span, bool)>>,
    /// Mailbox requests.
    pub mailbox: VecDeque<MailboxTurn>,
    /// The counter of the first answer that was fetched: what the device had counted to before.
    pub first_answer: Option<Counter>,
    /// Its dictionary.
    pub objects: ObjectsSeen,
    written: BTreeSet<u16>,
    current: BTreeMap<u16, u8>,
    sii_written: BTreeSet<u32>,
    sii_waiting: Option<(Waiting, SiiCommand, u32)>,
    /// When the last command to the SII came, when the last write was done, and when a command
    /// behind it last failed.
    sii_commanded_at: Instant,
    sii_written_at: Option<Instant>,
    sii_failed_at: Option<Instant>,
    /// When AL control last refused a write, behind one that it took.
    al_refused_at: Option<Instant>,
    /// What 0x0508 holds: from which word on, and how many bytes of it.
    last_word: Option<(u32, usize)>,
    al_waiting: Option<(Waiting, u8)>,
    /// The last request for a state acknowledged an error.
    al_acknowledged: bool,
    /// Mailbox bytes of which the first content was seen.
    memory_seen: BTreeSet<u16>,
    fetched: Option<Waiting>,
    mailbox_waiting: Option<(Waiting, Option<Span>, Waiting)>,
    /// The first set-up of mappings and buffers that requests brought.
    later: BTreeMap<u16, u8>,
}

impl DeviceSeen {
    pub(super) fn preset_station(&mut self, station: u16) {
        for (at, byte) in (r::STATION_ADDRESS.address.0..).zip(station.to_le_bytes()) {
            self.initial.insert(at, byte);
            self.current.insert(at, byte);
        }
    }

    /// An identity word pair of the SII, if all of it was read.
    #[must_use]
    pub fn sii_u32(&self, word: u32) -> Option<u32> {
        let (low, high) = (self.sii.get(&word)?, self.sii.get(&(word + 1))?);
        Some(u32::from(*low) | u32::from(*high) << 16)
    }

    /// A register byte as it was at the start.
    #[must_use]
    pub fn byte(&self, address: RegisterAddress) -> Option<u8> {
        self.initial.get(&address.0).copied()
    }

    /// A register of two bytes as it was at the start.
    #[must_use]
    pub fn word(&self, address: RegisterAddress) -> Option<u16> {
        let high = self.initial.get(&(address.0 + 1))?;
        Some(u16::from_le_bytes([self.byte(address)?, *high]))
    }

    fn sync_manager(&self, index: u16) -> SyncManagerConfig {
        let start = SM0 + 8 * index;
        SyncManagerConfig::from_bytes(std::array::from_fn(|offset| {
            self.current.get(&(start + offset as u16)).copied().unwrap_or(0)
        }))
    }

    /// Whether an FMMU is known to be set up.
    pub(super) fn has_mapping(&self) -> bool {
        (0..16u16).any(|index| {
            let Some(start) = r::FMMU.at(index) else { return false };
            let bytes = std::array::from_fn(|offset| {
                self.current.get(&(start.0 + offset as u16)).copied().unwrap_or(0)
            });
            FmmuConfig::from_bytes(bytes).active
        })
    }

    /// Takes mappings and buffers at the start to be as requests bring them later.
    pub(super) fn map_from_later(&mut self) -> bool {
        let mut any = false;
        for (address, byte) in &self.later {
            any |= !self.initial.contains_key(address);
            self.initial.entry(*address).or_insert(*byte);
        }
        any
    }

    /// A read of this device alone.
    pub(super) fn read(&mut self, ado: RegisterAddress, data: &[u8], answered: bool, at: Instant) {
        let mailbox_in = self.sync_manager(1);
        let fetches = mailbox_in.activate.enable() && ado == mailbox_in.start;
        if fetches {
            self.mailbox_fetched(data, answered, at);
        }
        if !answered {
            return;
        }
        for (address, byte) in (ado.0..).zip(data) {
            if usize::from(address) >= REGISTERS {
                break;
            }
            if !self.written.contains(&address) {
                self.initial.entry(address).or_insert(*byte);
            }
            if !is_status(address) {
                self.current.insert(address, *byte);
            }
        }
        let view = |address: u16| {
            address.checked_sub(ado.0).and_then(|offset| data.get(usize::from(offset))).copied()
        };
        if let Some(status) = view(r::SII_CONTROL_STATUS.address.0) {
            // Its upper bits say what the interface is; no write changes them.
            const KIND: u8 = 0xF8;
            let address = r::SII_CONTROL_STATUS.address.0;
            self.initial.entry(address).or_insert(status & KIND);
        }
        self.sii_read(&view, at);
        if let Some(status) = view(r::AL_STATUS.address.0) {
            self.al_read(u16::from(status), at);
        }
        if let (Some(low), Some(high)) =
            (view(r::AL_STATUS_CODE.address.0), view(r::AL_STATUS_CODE.address.0 + 1))
            && let Some(step) = self.steps.back_mut()
            && step.status & ERROR != 0
            && step.code == 0
        {
            step.code = u16::from_le_bytes([low, high]);
        }
        if let Some(status) = view(SM0 + SM_STATUS)
            && let Some((waiting, taken, _)) = &mut self.mailbox_waiting
            && taken.is_none()
        {
            match status & FULL {
                0 => *taken = Some(waiting.done(at)),
                _ => waiting.still(at),
            }
        }
        if let Some(status) = view(SM0 + 8 + SM_STATUS) {
            self.opening_polled(status, at);
            self.answer_polled(status & FULL != 0, at);
        }
    }

    /// A read of all devices: what of it says something of each.
    pub(super) fn read_by_all(&mut self, ado: RegisterAddress, data: &[u8], at: Instant) {
        let Some(offset) = r::AL_STATUS.address.0.checked_sub(ado.0) else { return };
        // All in one state: each is in it.
        let address = r::AL_STATUS.address.0;
        if let Some(status) = data.get(usize::from(offset))
            && AlStatus(u16::from(*status)).state().state().is_some()
            && !self.written.contains(&r::AL_CONTROL.address.0)
        {
            self.initial.entry(address).or_insert(*status);
        }
        let (Some(status), Some((waiting, requested))) =
            (data.get(usize::from(offset)).copied(), &mut self.al_waiting)
        else {
            return;
        };
        // The states of all, ORed: only when nothing else is in it has this one arrived for sure.
        if status & 0x0F == *requested {
            self.al_read(u16::from(status), at);
        } else {
            waiting.still(at);
        }
    }

    /// A write to this device, alone or with others.
    pub(super) fn write(&mut self, ado: RegisterAddress, data: &[u8], answered: bool, at: Instant) {
        if !answered {
            let control = r::AL_CONTROL.address;
            if ado == control && self.al_waiting.is_some() {
                self.al_refused_at = Some(at);
            }
            return;
        }
        let mailbox_out = self.sync_manager(0);
        if mailbox_out.activate.enable() && ado == mailbox_out.start && ado.0 >= 0x1000 {
            self.mailbox_written(data, at);
        }
        let settings = [r::FMMU, r::SYNC_MANAGER];
        for (address, byte) in (ado.0..).zip(data) {
            if usize::from(address) >= REGISTERS {
                break;
            }
            let is_setting = settings
                .iter()
                .any(|register| (register.address.0..register.end().0).contains(&address));
            // A scan writes zeros everywhere: the first set-up is what has something in it.
            if is_setting && data.iter().any(|byte| *byte != 0) {
                self.later.entry(address).or_insert(*byte);
            }
            self.written.insert(address);
            self.current.insert(address, *byte);
        }
        let view = |address: u16| {
            address.checked_sub(ado.0).and_then(|offset| data.get(usize::from(offset))).copied()
        };
        if let Some(high) = view(r::SII_CONTROL_STATUS.address.0 + 1) {
            self.sii_commanded(SiiCommand::from_bits(high), at);
        }
        if let Some(control) = view(r::AL_CONTROL.address.0) {
            self.al_overtaken(at);
            self.al_waiting = Some((Waiting::since(at), control & 0x0F));
            self.al_acknowledged = u16::from(control) & ERROR != 0;
        }
    }

    /// The recording has ended: what was still under way took longer than that.
    pub(super) fn finish(&mut self) {
        if let Some((waiting, requested)) = self.al_waiting.take() {
            let taken = self.al_taken(&waiting, waiting.last_seen());
            let status = u16::from(requested);
            self.steps.push_back(AlStep { requested, taken, took: UNSEEN, status, code: 0 });
        }
        if self.sii_waiting.take().is_some() {
            self.sii_times.push(UNSEEN);
        }
        if let Some((_, taken, _)) = self.mailbox_waiting.take() {
            self.mailbox
                .push_back(MailboxTurn { taken: taken.unwrap_or_default(), answered: None });
        }
    }

    // ---- SII ----

    fn sii_commanded(&mut self, command: SiiCommand, at: Instant) {
        if let Some((waiting, ..)) = self.sii_waiting.take() {
            self.sii_times.push(waiting.done(at));
        }
        if !matches!(command, SiiCommand::Read | SiiCommand::Write | SiiCommand::Reload) {
            return;
        }
        let byte = |address: u16| self.current.get(&address).copied().unwrap_or(0);
        let start = r::SII_ADDRESS.address.0;
        let word = u32::from_le_bytes(std::array::from_fn(|offset| byte(start + offset as u16)));
        if command == SiiCommand::Write {
            self.sii_written.insert(word);
        }
        self.sii_commanded_at = at;
        self.sii_waiting = Some((Waiting::since(at), command, word));
    }

    fn sii_read(&mut self, view: &impl Fn(u16) -> Option<u8>, at: Instant) {
        let start = r::SII_CONTROL_STATUS.address.0;
        if let (Some(low), Some(high)) = (view(start), view(start + 1)) {
            let control = SiiControl::from_bytes([low, high]);
            if let Some((waiting, command, word)) = &mut self.sii_waiting {
                if control.busy() {
                    waiting.still(at);
                } else {
                    self.sii_times.push(waiting.done(at));
                    let (command, word) = (*command, *word);
                    self.sii_waiting = None;
                    self.sii_ended(command, control, at);
                    if command == SiiCommand::Read && !control.command_failed() {
                        self.last_word = Some((word, control.read_len()));
                    }
                }
            }
        }
        let data = r::SII_DATA.address.0;
        if self.sii_waiting.is_none()
            && let Some((word, len)) = self.last_word
        {
            for index in 0..len as u16 / 2 {
                let (Some(low), Some(high)) = (view(data + 2 * index), view(data + 2 * index + 1))
                else {
                    break;
                };
                let at = word + u32::from(index);
                if !self.sii_written.contains(&at) {
                    self.sii.entry(at).or_insert(u16::from_le_bytes([low, high]));
                }
            }
        }
    }

    /// A command ended: what that says of how long the EEPROM is busy with itself behind a write.
    fn sii_ended(&mut self, command: SiiCommand, control: SiiControl, at: Instant) {
        if control.acknowledge_error() {
            self.sii_failed_at = Some(self.sii_commanded_at);
            return;
        }
        if let (Some(failed), Some(written)) = (self.sii_failed_at.take(), self.sii_written_at) {
            let mut programming = Waiting::since(written);
            programming.still(failed);
            self.programming.get_or_insert(programming.done(self.sii_commanded_at));
        }
        self.sii_written_at = (command == SiiCommand::Write).then_some(at);
    }

    // ---- application layer ----

    /// How long the request that waits was not taken: until behind the last refused write.
    fn al_taken(&mut self, waiting: &Waiting, at: Instant) -> Span {
        let Some(refused) = self.al_refused_at.take() else { return Span::ZERO };
        let mut taken = *waiting;
        taken.still(refused);
        taken.done(at)
    }

    /// Another request was taken while one waited.
    fn al_overtaken(&mut self, at: Instant) {
        if let Some((waiting, requested)) = self.al_waiting.take() {
            let taken = self.al_taken(&waiting, at);
            if taken > Span::ZERO {
                let status = u16::from(requested);
                let took = taken;
                self.steps.push_back(AlStep { requested, taken, took, status, code: 0 });
            }
        }
    }

    fn al_read(&mut self, status: u16, at: Instant) {
        let Some((waiting, requested)) = &mut self.al_waiting else { return };
        let arrived = status & 0x0F == u16::from(*requested);
        if !arrived && status & ERROR == 0 {
            waiting.still(at);
            return;
        }
        self.acknowledges |= self.al_acknowledged && status & ERROR == 0;
        let (waiting, requested) = (*waiting, *requested);
        self.al_waiting = None;
        let taken = self.al_taken(&waiting, at);
        let took = waiting.done(at).max(taken);
        self.steps.push_back(AlStep { requested, taken, took, status, code: 0 });
    }

    // ---- mailbox ----

    fn mailbox_written(&mut self, data: &[u8], at: Instant) {
        if let Some((_, taken, _)) = self.mailbox_waiting.take() {
            self.mailbox
                .push_back(MailboxTurn { taken: taken.unwrap_or_default(), answered: None });
        }
        self.mailbox_waiting = Some((Waiting::since(at), None, Waiting::since(at)));
        self.objects.asked(data);
    }

    fn mailbox_fetched(&mut self, data: &[u8], answered: bool, at: Instant) {
        self.answer_polled(answered, at);
        if answered {
            self.leftover(self.sync_manager(1).start, data);
            if let (None, Ok(message)) = (self.first_answer, Message::parse(data)) {
                self.first_answer = Some(message.header.counter);
            }
            self.objects.answered(data);
            if self.fetched.replace(Waiting::since(at)).is_some() {
                self.openings.push_back(None);
            }
        }
    }

    /// What lies behind the end of a message, where no message was before.
    fn leftover(&mut self, start: RegisterAddress, data: &[u8]) {
        let len =
            Message::parse(data).map_or(data.len(), |message| HEADER_LEN + message.data.len());
        for (address, (offset, byte)) in (start.0..).zip(data.iter().enumerate()) {
            // Where a message was, its bytes are no leftover any more.
            let value = if offset < len { None } else { Some(*byte) };
            let known = self.memory_seen.insert(address);
            if let (true, Some(value)) = (known, value) {
                self.memory.insert(address, value);
            }
        }
    }

    fn opening_polled(&mut self, status: u8, at: Instant) {
        /// It was read, and nothing has happened since.
        const READ: u8 = 1 << 1;
        /// The buffer is open for writing.
        const OPEN: u8 = 1 << 7;
        let Some(waiting) = &mut self.fetched else { return };
        if status & READ != 0 {
            waiting.still(at);
        } else if status & FULL == 0 {
            let opening = (waiting.done(at), status & OPEN != 0);
            self.openings.push_back(Some(opening));
            self.fetched = None;
        } else {
            self.openings.push_back(None);
            self.fetched = None;
        }
    }

    fn answer_polled(&mut self, full: bool, at: Instant) {
        let Some((_, taken, waiting)) = &mut self.mailbox_waiting else { return };
        if !full {
            waiting.still(at);
            return;
        }
        let answered = waiting.done(at);
        let taken = taken.unwrap_or(Span::ns(answered.as_nanos() / 4));
        self.mailbox.push_back(MailboxTurn { taken, answered: Some(answered) });
        self.mailbox_waiting = None;
    }
}

/// Whether a register shows a state, so that what was read of it is no setting.
fn is_status(address: u16) -> bool {
    (r::SII_ADDRESS.address.0..r::SII_DATA.end().0).contains(&address)
}
