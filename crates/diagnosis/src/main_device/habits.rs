//! Facts about the requests of a MainDevice by which it is recognised.

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::register::ErrorCounters;
use linesman_proto::time::Instant;

use super::kind::{self, Recognised};
use super::poll::{Poll, Polls};

/// Senders whose habits are kept: the MainDevice, and one more that may have been seen first.
const SENDERS: usize = 2;
/// After fewer requests nothing is said of what is not read.
const ENOUGH: u64 = 100;
/// The station address of a SubDevice that a MainDevice takes out of the way.
const NO_STATION: [u16; 2] = [0x0000, 0xFFFF];

/// Registers that tell of trouble, each with its length.
const TELLING: [(RegisterAddress, u16); 4] = [
    (RegisterAddress(0x0110), 2),
    (RegisterAddress(0x0130), 2),
    (RegisterAddress(0x0300), 8),
    (RegisterAddress(0x0310), 4),
];

/// End of the last of them.
const TELLING_END: u16 = {
    let (register, len) = TELLING[TELLING.len() - 1];
    register.0 + len
};

/// Habits of those who send requests on one line.
#[derive(Clone, Default, Debug)]
pub struct Habits {
    senders: Vec<SenderHabits>,
}

/// Use of the index bytes of datagrams.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct IndexUse {
    /// The highest index.
    pub(super) highest: u8,
    /// Frames with more than one datagram.
    pub(super) several: u64,
    /// Those in which all datagrams have the same index.
    pub(super) same: u64,
    /// Those in which all but the first have the index that they had in the frame before, while that of the first
    /// is another.
    pub(super) steady: u64,
    first: u8,
    others: Option<u8>,
}

/// Indexes of the datagrams of a frame.
#[derive(Clone, Copy, Default, Debug)]
struct FrameIndexes {
    first: Option<u8>,
    second: Option<u8>,
    /// True if one behind the second differs from it.
    differ: bool,
}

/// Habits of one sender.
#[derive(Clone, Debug)]
pub(super) struct SenderHabits {
    /// Its source address, with the mark that returning frames carry.
    pub(super) mac: MacAddress,
    /// Requests.
    pub(super) requests: u64,
    /// Those to the EtherCAT address 01:01:05:01:00:00.
    pub(super) to_ethercat_address: u64,
    pub(super) index: IndexUse,
    /// Station address less position, as the first one was written.
    pub(super) base: Option<u16>,
    /// The lowest station address that was addressed.
    pub(super) lowest_station: Option<u16>,
    /// Whether DL control's alias bit was cleared by itself: BWR 0x0103 of 1 byte.
    pub(super) clears_alias_bit: bool,
    /// Whether all FMMUs were cleared by one BWR 0x0600 of 256 bytes.
    pub(super) clears_all_fmmus: bool,
    /// Whether a single FMMU behind the first was cleared by BWR of 16 bytes.
    pub(super) clears_single_fmmus: bool,
    /// Whether control, address and data of the EEPROM were read at once: 0x0502, 10 bytes.
    pub(super) reads_eeprom_by_ten: bool,
    /// Whether the system time was distributed by FRMW of 4 bytes.
    pub(super) distributes_half_time: bool,
    /// Whether time differences of all were read at once: BRD 0x092C.
    pub(super) reads_differences: bool,
    /// Frames with process data and AL status of all, at the logical addresses that configurators give.
    pub(super) configured_frames: u64,
    /// Reads of error counters.
    pub(super) counter_reads: u64,
    /// Broadcast writes that clear them after [`Self::counter_reads`] had begun.
    pub(super) counter_clears: u64,
    /// Which of [`TELLING`] were read.
    telling_read: [bool; TELLING.len()],
    polls: Polls,
}

impl Habits {
    /// Takes a frame of a MainDevice: a request, or a return whose request was not seen.
    pub fn take(&mut self, view: &FrameView<'_>, at: Instant, is_request: bool) {
        let mac = view.source().marked();
        let known = self.senders.iter().position(|sender| sender.mac == mac);
        let index = match known {
            Some(index) => index,
            None if self.senders.len() < SENDERS => {
                self.senders.push(SenderHabits::new(mac));
                self.senders.len() - 1
            }
            None => return,
        };
        if let Some(sender) = self.senders.get_mut(index) {
            sender.take(view, at, is_request);
        }
    }

    /// The MainDevice as far as it is recognised; `None` before its first request.
    #[must_use]
    pub fn recognised(&self) -> Option<Recognised> {
        self.main().map(kind::recognise)
    }

    /// Its source address, with the mark of returning frames.
    #[must_use]
    pub fn source(&self) -> Option<MacAddress> {
        self.main().map(|main| main.mac)
    }

    /// The registers that it polls at `now`.
    #[must_use]
    pub fn polls(&self, now: Instant) -> Vec<Poll> {
        self.main().map_or_else(Vec::new, |main| main.polls.polled(now))
    }

    /// Registers that tell of trouble and that nobody has read so far: DL status, AL status, error counters, lost-link
    /// counters. None while too few requests were seen.
    pub fn never_reads(&self) -> impl Iterator<Item = (RegisterAddress, u16)> + '_ {
        let is_read = |index: usize| self.senders.iter().any(|one| one.telling_read[index]);
        let is_enough = self.main().is_some_and(|main| main.requests >= ENOUGH);
        let telling = TELLING.iter().copied().enumerate();
        telling.filter(move |(index, _)| is_enough && !is_read(*index)).map(|(_, one)| one)
    }

    fn main(&self) -> Option<&SenderHabits> {
        self.senders.iter().max_by_key(|sender| sender.requests)
    }
}

impl SenderHabits {
    fn new(mac: MacAddress) -> Self {
        Self {
            mac,
            requests: 0,
            to_ethercat_address: 0,
            index: IndexUse::default(),
            base: None,
            lowest_station: None,
            clears_alias_bit: false,
            clears_all_fmmus: false,
            clears_single_fmmus: false,
            reads_eeprom_by_ten: false,
            distributes_half_time: false,
            reads_differences: false,
            configured_frames: 0,
            counter_reads: 0,
            counter_clears: 0,
            telling_read: [false; TELLING.len()],
            polls: Polls::default(),
        }
    }

    fn take(&mut self, view: &FrameView<'_>, at: Instant, is_request: bool) {
        self.requests += 1;
        self.to_ethercat_address += u64::from(view.destination() == kind::ETHERCAT_ADDRESS);
        let (mut has_configured, mut has_states) = (false, false);
        let mut indexes = FrameIndexes::default();
        for datagram in view.datagrams().map_while(Result::ok) {
            indexes.add(datagram.index());
            let Some(command) = datagram.command() else { continue };
            let effect = command.effect();
            match effect.addressing {
                Addressing::Logical => {
                    has_configured |= kind::CONFIGURED_ADDRESSES.contains(&datagram.logical().0);
                    continue;
                }
                Addressing::None => continue,
                Addressing::Station => self.note_station(datagram.adp()),
                Addressing::Position | Addressing::Broadcast => {}
            }
            has_states |= command == Command::Brd && datagram.ado().0 == 0x0130;
            if effect.reads && !effect.writes {
                self.note_reading(&datagram);
            }
            self.note_trait(command, &datagram, is_request);
            self.polls.take(effect, &datagram, at);
        }
        self.index.take(indexes);
        self.configured_frames += u64::from(has_configured && has_states);
    }

    fn note_station(&mut self, station: u16) {
        if !NO_STATION.contains(&station) {
            self.lowest_station = Some(self.lowest_station.map_or(station, |low| low.min(station)));
        }
    }

    #[inline]
    fn note_reading(&mut self, datagram: &Datagram<'_>) {
        let ado = datagram.ado().0;
        if ado >= TELLING_END || self.telling_read == [true; TELLING.len()] {
            return;
        }
        let end = ado.saturating_add(datagram.data_len() as u16);
        for ((register, len), read) in TELLING.iter().zip(&mut self.telling_read) {
            *read |= ado < register.0 + len && register.0 < end;
        }
    }

    #[inline]
    fn note_trait(&mut self, command: Command, datagram: &Datagram<'_>, is_request: bool) {
        let (ado, len) = (datagram.ado().0, datagram.data_len());
        match (command, ado, len) {
            (Command::Apwr, 0x0010, 2) if is_request && self.base.is_none() => {
                let station =
                    datagram.data().try_into().map(u16::from_le_bytes).unwrap_or_default();
                // Positions count down from 0.
                let base = station.wrapping_add(datagram.adp());
                self.base = (!NO_STATION.contains(&station)).then_some(base);
            }
            (Command::Bwr, 0x0103, 1) => self.clears_alias_bit = true,
            (Command::Bwr, 0x0600, 256) => self.clears_all_fmmus = true,
            (Command::Bwr, 0x0610, 16) => self.clears_single_fmmus = true,
            (Command::Fprd | Command::Aprd, 0x0502, 10) => self.reads_eeprom_by_ten = true,
            (Command::Frmw, 0x0910, 4) => self.distributes_half_time = true,
            (Command::Brd, 0x092C, 4) => self.reads_differences = true,
            (Command::Fprd, 0x0300, _) => self.counter_reads += 1,
            (Command::Bwr, _, len) if ErrorCounters::cover(datagram.ado(), len) => {
                self.counter_clears += u64::from(self.counter_reads > 0);
            }
            _ => {}
        }
    }
}

impl FrameIndexes {
    #[inline]
    fn add(&mut self, index: u8) {
        match (self.first, self.second) {
            (None, _) => self.first = Some(index),
            (Some(_), None) => self.second = Some(index),
            (Some(_), Some(second)) => self.differ |= index != second,
        }
    }
}

impl IndexUse {
    fn take(&mut self, indexes: FrameIndexes) {
        let Some(first) = indexes.first else { return };
        let (second, are_equal) = (indexes.second, !indexes.differ);
        self.highest = self.highest.max(first).max(second.unwrap_or(first));
        let Some(second) = second else { return };
        self.several += 1;
        self.same += u64::from(are_equal && second == first);
        let is_steady = are_equal && self.others == Some(second) && self.first != first;
        self.steady += u64::from(is_steady && second != first);
        (self.first, self.others) = (first, are_equal.then_some(second));
    }
}
