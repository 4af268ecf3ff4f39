//! The block of error counters, 0x0300 to 0x0313, as one value.
//!
//! Reference: S2 2.9.1 to 2.9.6. Reads come in all sizes (8 bytes from 0x0300, 2 from 0x0302, the
//! whole block), so every counter is optional here and a reading fills in what it covers.

use std::fmt;

use super::counter::Difference;
use super::entry::Register;
use super::table;
use crate::address::RegisterAddress;
use crate::port::{Port, PortMap};

/// One counter of the block.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum ErrorCounter {
    /// Frames that arrived damaged at a port, not marked by an earlier controller.
    InvalidFrame(Port),
    /// Symbols that the physical layer of a port could not decode, inside frames or between them.
    PhysicalLayer(Port),
    /// Frames that arrived damaged at a port, marked by an earlier controller.
    Forwarded(Port),
    /// Bad frames that entered the processing unit.
    ProcessingUnit,
    /// Errors between the controller and the SubDevice's own processor.
    Pdi,
    /// Links lost at a port.
    LostLink(Port),
}

impl ErrorCounter {
    /// All eighteen, in order of addresses.
    pub const ALL: [Self; 18] = {
        use ErrorCounter::{Forwarded, InvalidFrame, LostLink, Pdi, PhysicalLayer, ProcessingUnit};
        use Port::{A, B, C, D};
        [
            InvalidFrame(A),
            PhysicalLayer(A),
            InvalidFrame(B),
            PhysicalLayer(B),
            InvalidFrame(C),
            PhysicalLayer(C),
            InvalidFrame(D),
            PhysicalLayer(D),
            Forwarded(A),
            Forwarded(B),
            Forwarded(C),
            Forwarded(D),
            ProcessingUnit,
            Pdi,
            LostLink(A),
            LostLink(B),
            LostLink(C),
            LostLink(D),
        ]
    };

    /// The register, or family of registers, it is part of.
    #[must_use]
    pub const fn register(self) -> &'static Register {
        match self {
            Self::InvalidFrame(_) | Self::PhysicalLayer(_) => &table::RX_ERROR_COUNTER,
            Self::Forwarded(_) => &table::FORWARDED_RX_ERROR_COUNTER,
            Self::ProcessingUnit => &table::PROCESSING_UNIT_ERROR_COUNTER,
            Self::Pdi => &table::PDI_ERROR_COUNTER,
            Self::LostLink(_) => &table::LOST_LINK_COUNTER,
        }
    }

    /// The port it belongs to, if it is kept per port.
    #[must_use]
    pub const fn port(self) -> Option<Port> {
        match self {
            Self::InvalidFrame(port)
            | Self::PhysicalLayer(port)
            | Self::Forwarded(port)
            | Self::LostLink(port) => Some(port),
            Self::ProcessingUnit | Self::Pdi => None,
        }
    }

    /// Whether it counts what happened at this controller or on the way into it, rather than frames that an earlier one
    /// has found damaged and marked.
    #[must_use]
    pub const fn counts_own(self) -> bool {
        match self {
            Self::InvalidFrame(_) | Self::PhysicalLayer(_) | Self::LostLink(_) | Self::Pdi => true,
            Self::Forwarded(_) | Self::ProcessingUnit => false,
        }
    }

    /// Where its byte is.
    #[must_use]
    pub const fn address(self) -> RegisterAddress {
        let register = self.register();
        match self {
            Self::InvalidFrame(port) | Self::Forwarded(port) | Self::LostLink(port) => {
                register.of_port(port)
            }
            // The high byte of the port's RX error counter.
            Self::PhysicalLayer(port) => RegisterAddress(register.of_port(port).0 + 1),
            Self::ProcessingUnit | Self::Pdi => register.address,
        }
    }

    /// The counters that a write clears together with this one.
    #[must_use]
    #[inline]
    pub const fn clear_group(self) -> ClearGroup {
        match self {
            Self::InvalidFrame(_) | Self::PhysicalLayer(_) | Self::Forwarded(_) => ClearGroup::Rx,
            Self::ProcessingUnit => ClearGroup::ProcessingUnit,
            Self::Pdi => ClearGroup::Pdi,
            Self::LostLink(_) => ClearGroup::LostLink,
        }
    }

    /// What it counts, without the port.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::InvalidFrame(_) => "invalid frames",
            Self::PhysicalLayer(_) => "physical-layer errors",
            Self::Forwarded(_) => "forwarded errors",
            Self::ProcessingUnit => "processing unit errors",
            Self::Pdi => "PDI errors",
            Self::LostLink(_) => "lost links",
        }
    }
}

/// The counter at each byte of the block; none at the PDI error code.
const AT_OFFSET: [Option<ErrorCounter>; ErrorCounters::LEN] = {
    let mut counters = [None; ErrorCounters::LEN];
    let mut index = 0;
    while index < ErrorCounter::ALL.len() {
        let counter = ErrorCounter::ALL[index];
        counters[(counter.address().0 - ErrorCounters::START.0) as usize] = Some(counter);
        index += 1;
    }
    counters
};

impl fmt::Display for ErrorCounter {
    /// `invalid frames, port B`, `PDI errors`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        match self.port() {
            Some(port) => write!(f, ", port {port}"),
            None => Ok(()),
        }
    }
}

/// Counters that one write clears together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum ClearGroup {
    /// 0x0300 to 0x030B: invalid frames, physical layer and forwarded, of all ports.
    Rx,
    /// 0x030C alone.
    ProcessingUnit,
    /// 0x030D, with the PDI error code.
    Pdi,
    /// 0x0310 to 0x0313: lost links of all ports.
    LostLink,
}

impl ClearGroup {
    /// All four.
    pub const ALL: [Self; 4] = [Self::Rx, Self::ProcessingUnit, Self::Pdi, Self::LostLink];

    /// The group that a write to the byte at this address clears, if there is one.
    #[must_use]
    pub fn written_by(address: RegisterAddress) -> Option<Self> {
        let counter = ErrorCounter::ALL.into_iter().find(|counter| counter.address() == address);
        counter.map(ErrorCounter::clear_group)
    }

    /// Where to write to clear it, whatever the value. It clears what others want to read: ask
    /// first.
    #[must_use]
    pub const fn address(self) -> RegisterAddress {
        match self {
            Self::Rx => table::RX_ERROR_COUNTER.address,
            Self::ProcessingUnit => table::PROCESSING_UNIT_ERROR_COUNTER.address,
            Self::Pdi => table::PDI_ERROR_COUNTER.address,
            Self::LostLink => table::LOST_LINK_COUNTER.address,
        }
    }
}

/// The counters of one controller, as far as they were read.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct ErrorCounters {
    /// Frames that arrived damaged, not marked by an earlier controller.
    pub invalid_frame: PortMap<Option<u8>>,
    /// Symbols that could not be decoded.
    pub physical_layer: PortMap<Option<u8>>,
    /// Frames that arrived damaged, marked by an earlier controller.
    pub forwarded: PortMap<Option<u8>>,
    /// Bad frames that entered the processing unit.
    pub processing_unit: Option<u8>,
    /// Errors between the controller and the SubDevice's own processor.
    pub pdi: Option<u8>,
    /// What the last of those was.
    pub pdi_error_code: Option<u16>,
    /// Links lost.
    pub lost_link: PortMap<Option<u8>>,
}

impl ErrorCounters {
    /// Where the block begins.
    pub const START: RegisterAddress = table::RX_ERROR_COUNTER.address;
    /// Length of the block in bytes.
    pub const LEN: usize = (table::LOST_LINK_COUNTER.end().0 - Self::START.0) as usize;

    /// Whether an access to `length` bytes at an address touches nothing but these counters.
    #[must_use]
    pub fn cover(start: RegisterAddress, length: usize) -> bool {
        let (from, start) = (usize::from(Self::START.0), usize::from(start.0));
        start >= from && start + length <= from + Self::LEN
    }

    /// What `data`, read from `start` on, say. Counters that they do not cover stay `None`; `start`
    /// may lie before the block, and `data` may end anywhere.
    #[must_use]
    pub fn from_bytes(data: &[u8], start: RegisterAddress) -> Self {
        let mut counters = Self::default();
        counters.update(data, start);
        counters
    }

    /// The counters that `data`, read from `start` on, cover, in order of addresses: those of
    /// [`from_bytes`](Self::from_bytes).
    #[inline]
    pub fn covered(
        data: &[u8],
        start: RegisterAddress,
    ) -> impl Iterator<Item = (ErrorCounter, u8)> + Clone + '_ {
        // What lies before the block is passed over, and so is what lies behind it.
        let before = usize::from(Self::START.0.saturating_sub(start.0));
        let first = usize::from(start.0.saturating_sub(Self::START.0));
        let data = data.get(before..).unwrap_or_default();
        let counters = AT_OFFSET.get(first..).unwrap_or_default();
        counters.iter().zip(data).filter_map(|(counter, value)| Some(((*counter)?, *value)))
    }

    /// Takes over the counters that `data`, read from `start` on, cover, and keeps the others.
    pub fn update(&mut self, data: &[u8], start: RegisterAddress) {
        let byte = |address: u16| data.get(usize::from(address.checked_sub(start.0)?)).copied();
        for (counter, value) in Self::covered(data, start) {
            *self.slot(counter) = Some(value);
        }
        let code = table::PDI_ERROR_CODE.address.0;
        if let (Some(low), Some(high)) = (byte(code), byte(code + 1)) {
            self.pdi_error_code = Some(u16::from_le_bytes([low, high]));
        }
    }

    /// The bytes of the whole block; counters that are `None` read 0.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        let at = |address: RegisterAddress| usize::from(address.0 - Self::START.0);
        for (counter, value) in self.iter() {
            bytes[at(counter.address())] = value;
        }
        let code = at(table::PDI_ERROR_CODE.address);
        bytes[code..code + 2].copy_from_slice(&self.pdi_error_code.unwrap_or(0).to_le_bytes());
        bytes
    }

    /// The value of a counter, if it was read.
    #[must_use]
    #[inline]
    pub fn value(&self, counter: ErrorCounter) -> Option<u8> {
        match counter {
            ErrorCounter::InvalidFrame(port) => self.invalid_frame[port],
            ErrorCounter::PhysicalLayer(port) => self.physical_layer[port],
            ErrorCounter::Forwarded(port) => self.forwarded[port],
            ErrorCounter::ProcessingUnit => self.processing_unit,
            ErrorCounter::Pdi => self.pdi,
            ErrorCounter::LostLink(port) => self.lost_link[port],
        }
    }

    /// The place of a counter's value.
    #[inline]
    pub fn slot(&mut self, counter: ErrorCounter) -> &mut Option<u8> {
        match counter {
            ErrorCounter::InvalidFrame(port) => &mut self.invalid_frame[port],
            ErrorCounter::PhysicalLayer(port) => &mut self.physical_layer[port],
            ErrorCounter::Forwarded(port) => &mut self.forwarded[port],
            ErrorCounter::ProcessingUnit => &mut self.processing_unit,
            ErrorCounter::Pdi => &mut self.pdi,
            ErrorCounter::LostLink(port) => &mut self.lost_link[port],
        }
    }

    /// Without the counters of forwarded errors: a controller that does not count them apart (feature
    /// bit 7 of 0x0008) reads 0 there, which says nothing.
    #[must_use]
    pub fn without_forwarded(mut self) -> Self {
        for port in Port::ALL {
            *self.slot(ErrorCounter::Forwarded(port)) = None;
        }
        self
    }

    /// The counters that were read, in order of addresses.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (ErrorCounter, u8)> + Clone {
        ErrorCounter::ALL
            .into_iter()
            .filter_map(|counter| self.value(counter).map(|value| (counter, value)))
    }

    /// The two counters of a port's RX error register, if both were read.
    #[must_use]
    pub fn rx(&self, port: Port) -> Option<RxErrors> {
        Some(RxErrors { frames: self.invalid_frame[port]?, physical: self.physical_layer[port]? })
    }

    /// What happened since an earlier reading, for the counters that are in both.
    ///
    /// Counters of a group are cleared together: where one of them fell, the others count as
    /// cleared too, even if they read more than before.
    pub fn since(&self, before: &Self) -> impl Iterator<Item = (ErrorCounter, Difference)> {
        let both = |counter| self.value(counter).zip(before.value(counter));
        let cleared = ClearGroup::ALL.map(|group| {
            ErrorCounter::ALL.into_iter().any(|counter| {
                counter.clear_group() == group
                    && both(counter).is_some_and(|(now, then)| now < then)
            })
        });
        ErrorCounter::ALL.into_iter().filter_map(move |counter| {
            let (now, then) = both(counter)?;
            let difference = if cleared[counter.clear_group() as usize] {
                Difference::since_clear(now)
            } else {
                Difference::between(then, now)
            };
            Some((counter, difference))
        })
    }
}

/// The RX error register of one port: two counters in one word.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct RxErrors {
    /// Frames that arrived damaged: the low byte.
    pub frames: u8,
    /// Symbols that could not be decoded: the high byte.
    pub physical: u8,
}

impl RxErrors {
    /// From the word that people read from 0x0300, 0x0302, 0x0304 or 0x0306.
    #[must_use]
    pub const fn from_word(word: u16) -> Self {
        let [frames, physical] = word.to_le_bytes();
        Self { frames, physical }
    }

    /// The word.
    #[must_use]
    pub const fn to_word(self) -> u16 {
        u16::from_le_bytes([self.frames, self.physical])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BLOCK: [u8; 20] = [
        1, 2, 3, 4, 5, 6, 7, 8, // frames and symbols, ports A to D
        9, 10, 11, 12, // forwarded
        13, 14, 0x34, 0x12, // processing unit, PDI, PDI error code
        15, 16, 17, 18, // lost links
    ];

    // proves: HW-08 partial, HW-13 partial, HW-21 partial
    #[test]
    fn every_counter_has_its_address() {
        let addresses: Vec<u16> =
            ErrorCounter::ALL.iter().map(|counter| counter.address().0).collect();
        let expected: Vec<u16> = (0x0300..0x030E).chain(0x0310..0x0314).collect();
        assert_eq!(addresses, expected);
        assert_eq!((ErrorCounters::START.0, ErrorCounters::LEN), (0x0300, 20));
    }

    // proves: HW-13 partial
    #[test]
    fn the_low_byte_counts_frames_and_the_high_byte_symbols() {
        let counters = ErrorCounters::from_bytes(&[0x12, 0x04], table::RX_ERROR_COUNTER.address);
        assert_eq!(counters.rx(Port::A), Some(RxErrors { frames: 18, physical: 4 }));
        assert_eq!(RxErrors::from_word(0x0412), RxErrors { frames: 18, physical: 4 });
        assert_eq!(RxErrors { frames: 18, physical: 4 }.to_word(), 0x0412);
    }

    // proves: HW-08
    #[test]
    fn each_port_has_a_byte_of_lost_links_and_two_share_a_word() {
        let start = table::LOST_LINK_COUNTER.address;
        let counters = ErrorCounters::from_bytes(&[1, 2, 3, 4], start);
        let lost = |counters: &ErrorCounters| Port::ALL.map(|port| counters.lost_link[port]);
        assert_eq!((start.0, lost(&counters)), (0x0310, [1, 2, 3, 4].map(Some)));
        let word = |address, value: u16| {
            lost(&ErrorCounters::from_bytes(&value.to_le_bytes(), RegisterAddress(address)))
        };
        assert_eq!(word(0x0310, 0x0201), [Some(1), Some(2), None, None]);
        assert_eq!(word(0x0312, 0x0403), [None, None, Some(3), Some(4)]);
    }

    #[test]
    fn the_whole_block_goes_both_ways() {
        let counters = ErrorCounters::from_bytes(&BLOCK, ErrorCounters::START);
        assert_eq!(counters.forwarded[Port::C], Some(11));
        assert_eq!(counters.lost_link[Port::D], Some(18));
        assert_eq!(counters.processing_unit, Some(13));
        assert_eq!(counters.pdi_error_code, Some(0x1234));
        assert_eq!(counters.iter().count(), 18);
        assert_eq!(counters.to_bytes(), BLOCK);
    }

    #[test]
    fn a_short_read_fills_what_it_covers() {
        let eight = ErrorCounters::from_bytes(&BLOCK[..8], ErrorCounters::START);
        assert_eq!(eight.iter().count(), 8);
        assert_eq!(eight.forwarded[Port::A], None);
        let two = ErrorCounters::from_bytes(&BLOCK[2..4], RegisterAddress(0x0302));
        assert_eq!(two.rx(Port::B), Some(RxErrors { frames: 3, physical: 4 }));
        assert_eq!(two.iter().count(), 2);
        // One byte of the two-byte PDI error code is no code.
        let cut = ErrorCounters::from_bytes(&BLOCK[12..15], RegisterAddress(0x030C));
        assert_eq!((cut.pdi, cut.pdi_error_code), (Some(14), None));
    }

    #[test]
    fn a_later_read_keeps_what_it_does_not_cover() {
        let mut counters = ErrorCounters::from_bytes(&BLOCK, ErrorCounters::START);
        counters.update(&[99], RegisterAddress(0x0302));
        assert_eq!(counters.invalid_frame[Port::B], Some(99));
        assert_eq!(counters.physical_layer[Port::B], Some(4));
    }

    #[test]
    fn one_fallen_counter_betrays_the_clear_of_its_group() {
        let before = ErrorCounters::from_bytes(&BLOCK, ErrorCounters::START);
        let mut after = before;
        after.invalid_frame[Port::A] = Some(0);
        after.forwarded[Port::D] = Some(20);
        after.lost_link[Port::A] = Some(17);
        let changes: Vec<_> = after.since(&before).collect();
        let of = |wanted| changes.iter().find(|(counter, _)| *counter == wanted).unwrap().1;
        assert_eq!(of(ErrorCounter::InvalidFrame(Port::A)), Difference::since_clear(0));
        // It rose by 20, not by 8: it was cleared with the others.
        assert_eq!(of(ErrorCounter::Forwarded(Port::D)), Difference::since_clear(20));
        // The lost-link counters are a group of their own.
        assert_eq!(of(ErrorCounter::LostLink(Port::A)), Difference::between(15, 17));
        assert_eq!(of(ErrorCounter::LostLink(Port::B)), Difference::between(16, 16));
    }

    #[test]
    fn an_access_to_counters_alone() {
        let cover = |start, length| ErrorCounters::cover(RegisterAddress(start), length);
        assert!(cover(0x0300, 20) && cover(0x0300, 1) && cover(0x0313, 1) && cover(0x030C, 2));
        assert!(!cover(0x02FF, 2) && !cover(0x0300, 21) && !cover(0x0313, 2) && !cover(0x0120, 2));
    }

    #[test]
    fn what_a_write_clears() {
        let group = |address| ClearGroup::written_by(RegisterAddress(address));
        assert_eq!(group(0x0300), Some(ClearGroup::Rx));
        assert_eq!(group(0x030B), Some(ClearGroup::Rx));
        assert_eq!(group(0x030C), Some(ClearGroup::ProcessingUnit));
        assert_eq!(group(0x030D), Some(ClearGroup::Pdi));
        assert_eq!(group(0x030E), None);
        assert_eq!(group(0x0313), Some(ClearGroup::LostLink));
        assert_eq!(group(0x0314), None);
        for group in ClearGroup::ALL {
            assert_eq!(ClearGroup::written_by(group.address()), Some(group));
            assert_eq!(ClearGroup::ALL[group as usize], group);
        }
    }

    proptest! {
        /// Whatever is read from wherever: nothing panics, and each counter that is filled holds
        /// the byte at its address.
        #[test]
        fn any_read_fills_the_right_counters(
            start in 0x02F0u16..0x0320,
            data in proptest::collection::vec(any::<u8>(), 0..40),
        ) {
            let counters = ErrorCounters::from_bytes(&data, RegisterAddress(start));
            let covered = ErrorCounters::covered(&data, RegisterAddress(start));
            prop_assert!(covered.eq(counters.iter()));
            for counter in ErrorCounter::ALL {
                let expected = counter
                    .address()
                    .0
                    .checked_sub(start)
                    .and_then(|offset| data.get(usize::from(offset)).copied());
                prop_assert_eq!(counters.value(counter), expected);
            }
        }
    }
}
