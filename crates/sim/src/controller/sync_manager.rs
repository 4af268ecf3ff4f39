//! SyncManagers: who may touch the guarded memory, and when what was touched takes effect.
//!
//! Read first: S1 chapter 8. An access begins at the start address and ends with the end address;
//! only then, and for frames only with a good check sequence, does the state change. The end
//! address cannot be touched twice in one frame. In buffered mode the three buffers lie side by
//! side in RAM, and accesses to the first are led to the one whose turn it is.

use linesman_proto::register::{
    EcatEvents, SYNC_MANAGER, SmControl, SmDirection, SmMode, SmStatus, SyncManagerConfig,
};

use super::memory::Memory;

/// Most SyncManagers a controller can have.
pub(super) const MAX: usize = 16;
/// Offset of the status byte in a SyncManager's registers.
const STATUS: usize = 5;

/// All SyncManagers of a controller.
#[derive(Clone, Debug)]
pub(super) struct SyncManagers {
    all: [SyncManager; MAX],
    /// Those that guard something, lowest first.
    guards: [u8; MAX],
    guard_count: usize,
    /// The controller knows sequential mode.
    sequential: bool,
}

/// What a SyncManager says to an access.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Grant {
    /// Nobody guards these bytes, or only to notice: they are where they are.
    Plain,
    /// The bytes are here.
    At(usize),
    /// No.
    Denied,
}

/// What a SyncManager does with accesses.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
enum SyncManagerMode {
    /// Off, or of length 0: nothing.
    #[default]
    Off,
    /// Locked by the SubDevice, or set up to something that does not exist: refuses all.
    Locked,
    /// Length 1: lets all pass, and notices (S1 8.5).
    Transparent,
    /// Three buffers.
    Buffered,
    /// One buffer, written and read in turn.
    Mailbox,
}

#[derive(Clone, Copy, Default, Debug)]
struct SyncManager {
    start: usize,
    length: usize,
    control: SmControl,
    enabled: bool,
    kind: SyncManagerMode,
    /// Completely written and not yet begun to be read.
    written: bool,
    /// Completely read and not yet begun to be written.
    read: bool,
    full: bool,
    last: Option<u8>,
    writing: u8,
    reading: u8,
    /// An access from the EtherCAT side has begun and not ended.
    open: bool,
    /// The SubDevice has begun to write, and the controller shows it.
    opened_by_pdi: bool,
    /// Only in order, in sequential mode: where the next access of a session must begin.
    in_order: bool,
    next: usize,
    /// The last session was not written in order.
    violated: bool,
    passing: FrameAccess,
}

/// What the frame that is passing has done so far.
#[derive(Clone, Copy, Default, Debug)]
struct FrameAccess {
    touched: bool,
    open_before: bool,
    next_before: usize,
    started: bool,
    done: bool,
    violated: bool,
}

/// What the end of a frame brought about.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Settled {
    /// The MainDevice wrote it completely.
    pub(super) written: bool,
    /// Such a write triggers the watchdog.
    pub(super) watchdog: bool,
}

impl SyncManagers {
    pub(super) fn new(sequential: bool) -> Self {
        Self { all: [SyncManager::default(); MAX], guards: [0; MAX], guard_count: 0, sequential }
    }

    /// Takes over what the registers of SyncManager `index` say. One that was switched on or off,
    /// or locked or unlocked by the SubDevice, begins from scratch.
    pub(super) fn configure(&mut self, index: usize, memory: &mut Memory) {
        let config = config(index, memory);
        let manager = &mut self.all[index];
        let kind = SyncManagerMode::of(&config, memory.len());
        let restarts = manager.kind != kind || manager.enabled != config.activate.enable();
        manager.start = usize::from(config.start.0);
        manager.length = usize::from(config.length);
        manager.control = config.control;
        manager.enabled = config.activate.enable();
        manager.kind = kind;
        manager.in_order = self.sequential && config.control.sequential();
        if restarts {
            manager.restart();
        }
        self.put_status(index, memory);
        self.list_guards();
    }

    fn list_guards(&mut self) {
        self.guard_count = 0;
        for (index, manager) in self.all.iter().enumerate() {
            if manager.kind != SyncManagerMode::Off {
                self.guards[self.guard_count] = index as u8;
                self.guard_count += 1;
            }
        }
    }

    /// Whether an access of the EtherCAT side to `at..end` is allowed, up to which address this
    /// answer holds, and which SyncManager gave it. The lowest one that guards a byte decides.
    pub(super) fn ask(&mut self, at: usize, end: usize, write: bool) -> (usize, Grant, u16) {
        let mut until = end;
        for position in 0..self.guard_count {
            let index = self.guards[position];
            let manager = &mut self.all[usize::from(index)];
            if manager.start <= at && at < manager.end() {
                let (until, grant) = manager.ask(at, until, write);
                return (until, grant, 1 << index);
            }
            if at < manager.start {
                until = until.min(manager.start);
            }
        }
        (until, Grant::Plain, 0)
    }

    /// The frame has ended: what it did to SyncManager `index` counts, or not.
    pub(super) fn settle(&mut self, index: usize, good: bool, memory: &mut Memory) -> Settled {
        let manager = &mut self.all[index];
        let passing = std::mem::take(&mut manager.passing);
        if !good {
            manager.open = passing.open_before;
            manager.next = passing.next_before;
            return Settled::default();
        }
        let settled = manager.settle(passing);
        self.put_status(index, memory);
        settled
    }

    fn put_status(&self, index: usize, memory: &mut Memory) {
        let status = self.all[index].status();
        memory.put(address(index) + STATUS, &[status.0]);
    }

    /// The AL event of SyncManager `index` stands.
    pub(super) fn raises_al_event(&self, index: usize) -> bool {
        let manager = &self.all[index];
        manager.control.al_event()
            && match manager.control.direction() {
                SmDirection::MainDeviceWrites => manager.written,
                SmDirection::MainDeviceReads => manager.read,
                SmDirection::Reserved(_) => false,
            }
    }

    /// The ECAT event of SyncManager `index` stands.
    pub(super) fn raises_ecat_event(&self, index: usize) -> bool {
        let manager = &self.all[index];
        !EcatEvents::sync_manager(index as u16).is_empty()
            && manager.control.ecat_event()
            && match manager.control.direction() {
                SmDirection::MainDeviceWrites => manager.read,
                SmDirection::MainDeviceReads => manager.written,
                SmDirection::Reserved(_) => false,
            }
    }

    /// The SubDevice reads: the length, and the data as far as `buffer` reaches. `None` when there
    /// is nothing to read.
    pub(super) fn read_by_pdi(
        &mut self,
        index: usize,
        buffer: &mut [u8],
        memory: &mut Memory,
    ) -> Option<usize> {
        let manager = self.all.get_mut(index)?;
        if manager.control.direction() != SmDirection::MainDeviceWrites {
            return None;
        }
        let from = match manager.kind {
            SyncManagerMode::Off | SyncManagerMode::Locked => return None,
            SyncManagerMode::Transparent => manager.start,
            SyncManagerMode::Buffered => manager.buffer(manager.last?),
            SyncManagerMode::Mailbox if manager.full => manager.start,
            SyncManagerMode::Mailbox => return None,
        };
        let len = manager.length.min(buffer.len());
        memory.copy_out(from, &mut buffer[..len]);
        manager.written = false;
        manager.full = false;
        manager.read = true;
        let length = manager.length;
        self.put_status(index, memory);
        Some(length)
    }

    /// The SubDevice writes a whole buffer; what `data` lacks is filled with 0, in a mailbox left. False when it
    /// cannot: switched off, the wrong direction, a full mailbox, too much data.
    pub(super) fn write_by_pdi(&mut self, index: usize, data: &[u8], memory: &mut Memory) -> bool {
        let Some(manager) = self.all.get_mut(index) else { return false };
        if manager.control.direction() != SmDirection::MainDeviceReads
            || data.len() > manager.length
        {
            return false;
        }
        let at = match manager.kind {
            SyncManagerMode::Off | SyncManagerMode::Locked => return false,
            SyncManagerMode::Transparent => manager.start,
            SyncManagerMode::Buffered => {
                manager.writing = manager.free_buffer();
                manager.last = Some(manager.writing);
                manager.buffer(manager.writing)
            }
            SyncManagerMode::Mailbox if manager.full => return false,
            SyncManagerMode::Mailbox => {
                manager.full = true;
                manager.start
            }
        };
        memory.copy_in(at, data);
        // Behind a message stays what was there before, as recordings of real mailboxes show.
        if manager.kind != SyncManagerMode::Mailbox {
            memory.clear_range(at + data.len(), at + manager.length);
        }
        manager.read = false;
        manager.opened_by_pdi = false;
        manager.written = true;
        self.put_status(index, memory);
        true
    }

    /// The SubDevice touches the first byte of a buffer that it is going to write: whoever waits for
    /// it to be read has been heard. `shown` says whether the controller shows the buffer as open.
    pub(super) fn open_by_pdi(&mut self, index: usize, shown: bool, memory: &mut Memory) {
        let Some(manager) = self.all.get_mut(index) else { return };
        let is_session =
            matches!(manager.kind, SyncManagerMode::Buffered | SyncManagerMode::Mailbox);
        if is_session && manager.is_read() && !manager.full {
            manager.read = false;
            manager.opened_by_pdi = shown;
            self.put_status(index, memory);
        }
    }

    /// Whether the mailbox `index` holds a message.
    pub(super) fn is_full(&self, index: usize) -> bool {
        self.all.get(index).is_some_and(|manager| manager.full)
    }
}

/// Where the registers of SyncManager `index` are.
pub(super) const fn address(index: usize) -> usize {
    SYNC_MANAGER.address.0 as usize + index * SyncManagerConfig::LEN
}

/// What the registers of SyncManager `index` say.
pub(super) fn config(index: usize, memory: &Memory) -> SyncManagerConfig {
    SyncManagerConfig::from_bytes(memory.array(address(index)))
}

impl SyncManagerMode {
    fn of(config: &SyncManagerConfig, memory_len: usize) -> Self {
        if !config.activate.enable() || config.length == 0 {
            return Self::Off;
        }
        if config.pdi_control.deactivated() {
            return Self::Locked;
        }
        let fits = u32::from(config.start.0) + config.memory_len() <= memory_len as u32;
        if !fits {
            return Self::Locked;
        }
        match (config.control.mode(), config.control.direction()) {
            (SmMode::Reserved(_), _) | (_, SmDirection::Reserved(_)) => Self::Locked,
            (SmMode::Buffered | SmMode::Mailbox, _) if config.length == 1 => Self::Transparent,
            (SmMode::Buffered, _) => Self::Buffered,
            (SmMode::Mailbox, _) => Self::Mailbox,
        }
    }
}

impl SyncManager {
    fn end(&self) -> usize {
        self.start + self.length
    }

    fn restart(&mut self) {
        (self.written, self.read, self.full, self.open) = (false, false, false, false);
        (self.next, self.violated, self.opened_by_pdi) = (self.start, false, false);
        (self.last, self.writing, self.reading) = (None, 0, 0);
    }

    fn buffer(&self, number: u8) -> usize {
        self.start + usize::from(number) * self.length
    }

    /// A buffer that is neither the newest nor being read.
    fn free_buffer(&self) -> u8 {
        let taken = |buffer: u8| {
            self.last == Some(buffer) || (self.open && self.reading == buffer && self.is_read())
        };
        (0..3).find(|buffer| !taken(*buffer)).unwrap_or(0)
    }

    /// Whether the EtherCAT side reads it.
    fn is_read(&self) -> bool {
        self.control.direction() == SmDirection::MainDeviceReads
    }

    fn ask(&mut self, at: usize, end: usize, write: bool) -> (usize, Grant) {
        let until = end.min(self.end());
        if !self.passing.touched {
            self.passing = FrameAccess {
                touched: true,
                open_before: self.open,
                next_before: self.next,
                ..FrameAccess::default()
            };
        }
        match self.kind {
            SyncManagerMode::Off => (until, Grant::Plain),
            SyncManagerMode::Locked => (until, Grant::Denied),
            SyncManagerMode::Transparent => {
                let noticed = write != self.is_read();
                self.passing.started |= noticed;
                self.passing.done |= noticed;
                (until, Grant::Plain)
            }
            SyncManagerMode::Buffered | SyncManagerMode::Mailbox => {
                self.ask_session(at, until, write)
            }
        }
    }

    /// An access to a buffer: it must be in the right direction and have begun at the start.
    fn ask_session(&mut self, at: usize, until: usize, write: bool) -> (usize, Grant) {
        if write == self.is_read() {
            return (until, Grant::Denied);
        }
        if at == self.start && !self.open && !self.begin(write) {
            return (until, Grant::Denied);
        }
        if !self.open {
            return (until, Grant::Denied);
        }
        if self.in_order && write {
            if at != self.start && at != self.next {
                self.passing.violated = true;
                return (until, Grant::Denied);
            }
            self.next = until;
        }
        self.passing.started |= at == self.start;
        let mut until = until;
        if until == self.end() {
            if self.passing.done {
                // The end address again in the same frame: all but it.
                until -= 1;
                if at == until {
                    return (self.end(), Grant::Denied);
                }
            } else {
                self.passing.done = true;
                self.open = false;
            }
        }
        let buffer = match self.kind {
            SyncManagerMode::Buffered if write => self.writing,
            SyncManagerMode::Buffered => self.reading,
            SyncManagerMode::Off
            | SyncManagerMode::Locked
            | SyncManagerMode::Transparent
            | SyncManagerMode::Mailbox => 0,
        };
        (until, Grant::At(self.buffer(buffer) + at - self.start))
    }

    /// The start address is touched: whether an access may begin.
    fn begin(&mut self, write: bool) -> bool {
        self.open = match (self.kind, self.last) {
            (SyncManagerMode::Mailbox, _) => self.full != write && !self.passing.done,
            (_, _) if write => true,
            // Never written: there is nothing to read yet.
            (_, None) => false,
            (_, Some(last)) => {
                self.reading = last;
                true
            }
        };
        self.open
    }

    fn settle(&mut self, passing: FrameAccess) -> Settled {
        self.violated = passing.violated || (self.violated && !passing.started);
        let written = passing.done && !self.is_read();
        if passing.started {
            if self.is_read() {
                self.written = false;
            } else {
                self.read = false;
            }
        }
        if passing.done {
            self.open = false;
            if written {
                self.written = true;
            } else {
                self.read = true;
            }
            match self.kind {
                SyncManagerMode::Mailbox => self.full = written,
                SyncManagerMode::Buffered if written => {
                    self.last = Some(self.writing);
                    self.writing = self.free_buffer();
                }
                SyncManagerMode::Buffered
                | SyncManagerMode::Off
                | SyncManagerMode::Locked
                | SyncManagerMode::Transparent => {}
            }
        }
        Settled { written, watchdog: written && self.control.watchdog() }
    }

    /// A mailbox has one buffer, the first, as real controllers show.
    fn last_shown(&self) -> Option<u8> {
        match self.kind {
            SyncManagerMode::Mailbox => Some(0),
            SyncManagerMode::Off
            | SyncManagerMode::Locked
            | SyncManagerMode::Transparent
            | SyncManagerMode::Buffered => self.last,
        }
    }

    fn status(&self) -> SmStatus {
        SmStatus(0)
            .with_written(self.written)
            .with_read(self.read)
            .with_sequence_violation(self.violated)
            .with_mailbox_full(self.full)
            .with_last_buffer(self.last_shown())
            .with_read_open(self.open && self.is_read())
            .with_write_open(self.opened_by_pdi || (self.open && !self.is_read()))
    }
}
