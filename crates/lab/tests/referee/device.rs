//! One device that answers from a recording.

use std::collections::{BTreeMap, BTreeSet};

use linesman_lab::replay::learn::MailboxTurn;
use linesman_proto::mailbox::{Header, Message};
use linesman_proto::register::{self as r, FmmuConfig, SiiCommand, SiiControl, SyncManagerConfig};
use linesman_proto::time::{Instant, Span};

use crate::tape::{Dialogue, HEADER, REGISTERS, SetUp, Tape, bits, fmmus};

const ERROR: u16 = 1 << 4;
const INIT: u8 = 1;
const FULL: u8 = 1 << 3;
const SM0: u16 = r::SYNC_MANAGER.address.0;
const SM_STATUS: u16 = 5;
const SM_ACTIVATE: u16 = 6;
const ACCESS: u16 = r::SII_ACCESS_ECAT.address.0;
const CONTROL: u16 = r::SII_CONTROL_STATUS.address.0;
const ADDRESS: u16 = r::SII_ADDRESS.address.0;
const DATA: u16 = r::SII_DATA.address.0;
const AL_CONTROL: u16 = r::AL_CONTROL.address.0;
const AL_STATUS: u16 = r::AL_STATUS.address.0;

/// What was asked or written that the real device would have refused, or that was never recorded.
#[derive(Default, Debug)]
pub(crate) struct Remarks {
    /// The rules of controllers, or the recording, contradict it.
    pub(crate) breaches: BTreeSet<String>,
    /// It was never recorded, and follows from nothing that was: not answered.
    pub(crate) unrecorded: BTreeSet<(usize, u16)>,
    /// Something of the last frames was not known.
    pub(crate) guessed: bool,
}

pub(crate) struct Device {
    number: usize,
    tape: Tape,
    memory: BTreeMap<u16, u8>,
    /// AL status mirrors AL control: bit 0 of ESC configuration (0x0141), which is in SII word 0.
    emulated: bool,
    sii: Option<(Instant, SiiCommand, u32)>,
    step: Option<(Instant, u16, u16)>,
    /// A request lies in SyncManager 0 until then.
    request: Option<Instant>,
    answer: Option<(Instant, Vec<u8>)>,
    full: bool,
    asked: BTreeSet<usize>,
    counter: u8,
}

impl Device {
    pub(crate) fn new(number: usize, tape: Tape) -> Self {
        let mut memory = tape.initial.clone();
        // Control bits of a command that was under way in the recording are not of this run.
        const KIND: u8 = 0xF8;
        for address in CONTROL..CONTROL + 2 {
            let keep = if address == CONTROL { KIND } else { 0 };
            memory.entry(address).and_modify(|byte| *byte &= keep);
        }
        memory.insert(r::ESC_TYPE.address.0 + 4, tape.count(&r::FMMU));
        memory.insert(r::ESC_TYPE.address.0 + 5, tape.count(&r::SYNC_MANAGER));
        let assumed = [
            0x0000..0x000A,
            0x0010..0x0012,
            AL_STATUS..AL_STATUS + 6,
            ACCESS..ACCESS + 2,
            CONTROL..DATA + 8,
            0x0600..0x0700,
            0x0800..0x0880,
        ];
        for address in assumed.into_iter().flatten() {
            memory.entry(address).or_insert(0);
        }
        let emulated = tape.mirrors();
        Self {
            number,
            tape,
            memory,
            emulated,
            sii: None,
            step: None,
            request: None,
            answer: None,
            full: false,
            asked: BTreeSet::new(),
            counter: 0,
        }
    }

    pub(crate) fn byte(&self, address: u16) -> u8 {
        self.memory.get(&address).copied().unwrap_or(0)
    }

    pub(crate) fn word(&self, address: u16) -> u16 {
        u16::from_le_bytes([self.byte(address), self.byte(address + 1)])
    }

    fn put(&mut self, address: u16, bytes: &[u8]) {
        self.memory.extend((address..).zip(bytes.iter().copied()));
    }

    /// What has become due.
    fn settle(&mut self, now: Instant, remarks: &mut Remarks) {
        if let Some((_, status, code)) = self.step.take_if(|(at, ..)| *at <= now) {
            self.put(AL_STATUS, &status.to_le_bytes());
            self.put(r::AL_STATUS_CODE.address.0, &code.to_le_bytes());
        }
        if let Some((_, command, word)) = self.sii.take_if(|(at, ..)| *at <= now) {
            self.sii_done(command, word, remarks);
        }
        self.request.take_if(|at| *at <= now);
        if !self.full
            && let Some((_, answer)) = self.answer.take_if(|(at, _)| *at <= now)
        {
            self.put(self.manager(1).start.0, &answer);
            self.full = true;
        }
        for (index, full) in [(0, self.request.is_some()), (1, self.full)] {
            let status = SM0 + 8 * index + SM_STATUS;
            let byte = self.byte(status) & !FULL | if full { FULL } else { 0 };
            self.memory.insert(status, byte);
        }
    }

    fn manager(&self, index: u16) -> SyncManagerConfig {
        let start = SM0 + 8 * index;
        SyncManagerConfig::from_bytes(std::array::from_fn(|at| self.byte(start + at as u16)))
    }

    // ---- reads ----

    /// The bytes from `address` on; `None` is not answered.
    pub(crate) fn read(
        &mut self,
        now: Instant,
        address: u16,
        len: usize,
        remarks: &mut Remarks,
    ) -> Option<Vec<u8>> {
        self.settle(now, remarks);
        let mailbox = self.manager(1);
        if address >= 0x1000 {
            let whole = address == mailbox.start.0 && len == usize::from(mailbox.length);
            if !mailbox.activate.enable() || !whole {
                let number = self.number;
                remarks.breaches.insert(format!("{number}: reads 0x{address:04X}, {len} bytes"));
                return None;
            }
            if !std::mem::take(&mut self.full) {
                return None;
            }
        }
        let range = address..address + len as u16;
        let missing = range.clone().find(|byte| !self.memory.contains_key(byte));
        if let Some(missing) = missing {
            if self.tape.has.get(&missing) != Some(&false) {
                remarks.unrecorded.insert((self.number, missing));
                remarks.guessed = true;
            }
            return None;
        }
        remarks.guessed |= range.clone().any(|byte| {
            byte < r::ESC_TYPE.address.0 + 10 && !self.tape.initial.contains_key(&byte)
        });
        Some(range.map(|byte| self.byte(byte)).collect())
    }

    // ---- writes ----

    /// Whether the write is taken.
    pub(crate) fn write(
        &mut self,
        now: Instant,
        address: u16,
        data: &[u8],
        alone: bool,
        remarks: &mut Remarks,
    ) -> bool {
        self.settle(now, remarks);
        if address >= REGISTERS {
            return self.mailbox_written(now, address, data, remarks);
        }
        let range = address..address + data.len() as u16;
        let number = self.number;
        let known: Vec<Option<bool>> =
            range.clone().map(|byte| self.tape.has.get(&byte).copied()).collect();
        if let Some(at) = known.iter().position(Option::is_none) {
            remarks.unrecorded.insert((number, address + at as u16));
            remarks.guessed = true;
            if alone || !known.contains(&Some(true)) {
                return false;
            }
        }
        if let Some(at) = known.iter().position(|has| *has == Some(false)) {
            if alone {
                let missing = address + at as u16;
                remarks.breaches.insert(format!("{number}: writes 0x{missing:04X}, is not there"));
            }
            if !known.contains(&Some(true)) {
                return false;
            }
        }
        let touches = |from: u16, to: u16| range.start < to && from < range.end;
        if touches(CONTROL, DATA + 8) {
            return self.sii_written(now, address, data, remarks);
        }
        if touches(AL_CONTROL, AL_CONTROL + 2) {
            self.put(address, data);
            self.al_requested(now, remarks);
            return true;
        }
        for (at, byte) in range.clone().zip(data) {
            let manager = at.checked_sub(SM0).filter(|at| *at < 0x80);
            let locked = manager.is_some_and(|at| {
                let this = SM0 + at / 8 * 8;
                match at % 8 {
                    // While it is on, start, length and control stay as they are.
                    0..=4 => self.byte(this + SM_ACTIVATE) & 1 != 0,
                    SM_ACTIVATE => false,
                    // Status, and what the processor says.
                    _ => true,
                }
            });
            if locked && at % 8 <= 4 && self.byte(at) != *byte {
                let this = SM0 + (at - SM0) / 8 * 8;
                let off = (this + SM_ACTIVATE).checked_sub(address).map(usize::from);
                if off.and_then(|off| data.get(off)).is_none_or(|byte| byte & 1 != 0) {
                    let words = format!("{number}: changes 0x{at:04X} of a SyncManager that is on");
                    remarks.breaches.insert(words);
                }
            }
            if !locked && manager.is_none_or(|at| at % 8 != SM_ACTIVATE) {
                self.memory.insert(at, *byte);
            }
        }
        for (at, byte) in range.zip(data) {
            // A register takes its value when the frame has ended: locks are those from before.
            if (SM0..SM0 + 0x80).contains(&at) && at % 8 == SM_ACTIVATE {
                self.memory.insert(at, *byte);
                self.full &= at != SM0 + 8 + SM_ACTIVATE || byte & 1 != 0;
            }
        }
        true
    }

    // ---- EEPROM ----

    fn sii_written(
        &mut self,
        now: Instant,
        address: u16,
        data: &[u8],
        remarks: &mut Remarks,
    ) -> bool {
        let number = self.number;
        if self.byte(ACCESS) & 1 != 0 {
            remarks.breaches.insert(format!("{number}: commands an EEPROM that is not its own"));
            return false;
        }
        if self.sii.is_some() {
            remarks.breaches.insert(format!("{number}: commands an EEPROM that is busy"));
            return false;
        }
        let view =
            |at: u16| at.checked_sub(address).and_then(|at| data.get(usize::from(at))).copied();
        for at in ADDRESS..DATA + 8 {
            if let Some(byte) = view(at) {
                self.memory.insert(at, byte);
            }
        }
        let Some(high) = view(CONTROL + 1) else { return true };
        let command = SiiCommand::from_bits(high);
        let word = u32::from(self.word(ADDRESS)) | u32::from(self.word(ADDRESS + 2)) << 16;
        match command {
            SiiCommand::None => {
                self.memory.insert(CONTROL + 1, 0);
            }
            SiiCommand::Read => {
                // The times of the recording, again and again.
                let took = self.tape.sii_times.pop_front().unwrap_or(Span::us(300));
                self.tape.sii_times.push_back(took);
                const BUSY: u8 = 0x80;
                self.memory.insert(CONTROL + 1, BUSY | command.bits());
                self.sii = Some((now + took, command, word));
            }
            SiiCommand::Write | SiiCommand::Reload | SiiCommand::Reserved(_) => {
                remarks.unrecorded.insert((number, CONTROL));
                return false;
            }
        }
        true
    }

    fn sii_done(&mut self, command: SiiCommand, word: u32, remarks: &mut Remarks) {
        self.memory.insert(CONTROL + 1, 0);
        if command != SiiCommand::Read {
            return;
        }
        let len = SiiControl(self.word(CONTROL)).read_len() as u32;
        let words = (word..word + len / 2).map(|at| self.tape.sii.get(&at).copied());
        match words.collect::<Option<Vec<u16>>>() {
            Some(words) => {
                let bytes: Vec<u8> = words.into_iter().flat_map(u16::to_le_bytes).collect();
                self.put(DATA, &bytes);
            }
            None => {
                // As an EEPROM that does not acknowledge.
                const FAILED: u8 = 1 << 5;
                self.memory.insert(CONTROL + 1, FAILED);
                remarks.breaches.insert(format!("{}: SII word {word} not recorded", self.number));
            }
        }
    }

    // ---- states ----

    fn al_requested(&mut self, now: Instant, remarks: &mut Remarks) {
        let control = self.word(AL_CONTROL);
        let (requested, status) = ((control & 0x0F) as u8, self.word(AL_STATUS));
        let number = self.number;
        let set_up = SetUp::of(|address| self.byte(address));
        if requested != INIT && requested != (status & 0x0F) as u8 {
            match self.tape.set_ups.get(&requested) {
                None => {
                    remarks.unrecorded.insert((number, AL_CONTROL));
                    return;
                }
                Some(recorded) if *recorded != set_up => {
                    let words = format!(
                        "{number}: asks for state {requested} with {set_up:?}, recorded {recorded:?}"
                    );
                    remarks.breaches.insert(words);
                }
                Some(_) => {}
            }
        }
        if self.emulated {
            self.step = Some((now, control & 0x1F, 0));
            return;
        }
        if status & ERROR != 0 && control & ERROR == 0 && requested != INIT {
            remarks.breaches.insert(format!("{number}: asks for a state with an error standing"));
            return;
        }
        if requested == (status & 0x0F) as u8 {
            self.step = Some((now, u16::from(requested), 0));
            return;
        }
        let steps = &mut self.tape.steps;
        let place = steps.iter().position(|step| step.requested & 0x0F == requested);
        match place.and_then(|place| steps.remove(place)) {
            Some(step) => {
                steps.push_back(step);
                self.step = Some((now + step.took, step.status, step.code));
            }
            // Heard in every state, ETG.1000.6.
            None if requested == INIT => self.step = Some((now, u16::from(INIT), 0)),
            None => {
                remarks.unrecorded.insert((number, AL_CONTROL));
            }
        }
    }

    // ---- mailbox ----

    fn mailbox_written(
        &mut self,
        now: Instant,
        address: u16,
        data: &[u8],
        remarks: &mut Remarks,
    ) -> bool {
        let (mailbox, number) = (self.manager(0), self.number);
        let whole = address == mailbox.start.0 && data.len() == usize::from(mailbox.length);
        if !mailbox.activate.enable() || !whole {
            let len = data.len();
            remarks.breaches.insert(format!("{number}: writes 0x{address:04X}, {len} bytes"));
            return false;
        }
        if self.request.is_some() {
            return false;
        }
        let asked = |buffer: &[u8]| -> Option<(u8, Vec<u8>)> {
            let message = Message::parse(buffer).ok()?;
            Some((buffer[HEADER - 1] & 0x0F, message.data.to_vec()))
        };
        let same = |(_, one): &(usize, &Dialogue)| asked(&one.request) == asked(data);
        let mut all = self.tape.dialogues.iter().enumerate().filter(same);
        let place = all.clone().find(|(at, _)| !self.asked.contains(at)).or(all.next_back());
        let Some((at, dialogue)) = place else {
            let header = Header::parse(data);
            let body: Vec<String> =
                data[HEADER..HEADER + 10].iter().map(|byte| format!("{byte:02X}")).collect();
            let body = body.join(" ");
            remarks.breaches.insert(format!("{number}: {header:?} {body} was never asked"));
            return true;
        };
        self.asked.insert(at);
        let mut answer = dialogue.answer.clone();
        self.counter = self.counter % 7 + 1;
        answer[HEADER - 1] = answer[HEADER - 1] & 0x8F | self.counter << 4;
        let turn = self.tape.mailbox.pop_front();
        let MailboxTurn { taken, answered } =
            turn.unwrap_or(MailboxTurn { taken: Span::ZERO, answered: None });
        self.request = Some(now + taken);
        self.answer = Some((now + answered.unwrap_or(Span::ms(1)), answer));
        true
    }

    // ---- process data ----

    /// What a logical datagram reads and writes here, S2 2.13: bit by bit.
    pub(crate) fn map(
        &mut self,
        now: Instant,
        start: u32,
        sent: &[u8],
        data: &mut [u8],
        effect: (bool, bool),
        remarks: &mut Remarks,
    ) -> (bool, bool) {
        self.settle(now, remarks);
        let (mut reads, mut writes) = (false, false);
        for fmmu in fmmus(&|address| self.byte(address)) {
            for bit in 0..bits(&fmmu) {
                let logical = u64::from(fmmu.logical_start.0) * 8
                    + u64::from(fmmu.logical_start_bit)
                    + u64::from(bit);
                let Some(at) = logical.checked_sub(u64::from(start) * 8) else { continue };
                let (byte, mask) = ((at / 8) as usize, 1_u8 << (at % 8));
                let Some(there) = data.get_mut(byte) else { continue };
                let (place, its) = physical(&fmmu, bit);
                let served = place < REGISTERS || self.is_served(place, &fmmu);
                if fmmu.reads && effect.0 && served {
                    let set = self.byte(place) & its != 0;
                    *there = *there & !mask | if set { mask } else { 0 };
                    reads = true;
                }
                if fmmu.writes && effect.1 && served {
                    let set = sent[byte] & mask != 0;
                    let value = self.byte(place) & !its | if set { its } else { 0 };
                    self.memory.insert(place, value);
                    writes = true;
                }
            }
        }
        (reads, writes)
    }

    /// A SyncManager that is on has this byte, in that direction.
    fn is_served(&self, place: u16, fmmu: &FmmuConfig) -> bool {
        const WRITES: u8 = 0x04;
        (0..16).map(|index| self.manager(index)).any(|manager| {
            let from = manager.start.0;
            let inside = place >= from && place - from < manager.length;
            let outwards = manager.control.0 & 0x0C == WRITES;
            inside && manager.activate.enable() && outwards == fmmu.writes
        })
    }
}

/// Where bit `bit` of an FMMU is in the memory.
fn physical(fmmu: &FmmuConfig, bit: u32) -> (u16, u8) {
    let at = u32::from(fmmu.physical_start.0) * 8 + u32::from(fmmu.physical_start_bit) + bit;
    ((at / 8) as u16, 1 << (at % 8))
}
