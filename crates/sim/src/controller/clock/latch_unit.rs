//! The unit that takes the times of two inputs, LATCH0 and LATCH1.
//!
//! Reference: S2 2.15.5; S1 9.2.2. In single event mode an edge is kept until its time is read by
//! the side that owns the unit; otherwise each edge takes the place of the one before.

use std::ops::Range;

use linesman_proto::register::{self as r, AlEvents, EcatEvents};
use linesman_proto::time::Instant;

use crate::controller::access::touches;
use crate::controller::core::Core;
use crate::controller::memory::{Rights, at};

/// An input of the unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LatchInput {
    /// LATCH0.
    Latch0,
    /// LATCH1.
    Latch1,
}

/// Which way a signal goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    /// It rises.
    Positive,
    /// It falls.
    Negative,
}

/// Bit 2 of the status: the input is high.
const HIGH: u8 = 1 << 2;
/// Bits 0 and 1: an edge was seen.
const EVENTS: u8 = 0b11;

impl LatchInput {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Latch0, Self::Latch1];

    const fn control(self) -> &'static r::Register {
        match self {
            Self::Latch0 => &r::LATCH0_CONTROL,
            Self::Latch1 => &r::LATCH1_CONTROL,
        }
    }

    const fn status(self) -> &'static r::Register {
        match self {
            Self::Latch0 => &r::LATCH0_STATUS,
            Self::Latch1 => &r::LATCH1_STATUS,
        }
    }

    const fn time(self, edge: Edge) -> &'static r::Register {
        match (self, edge) {
            (Self::Latch0, Edge::Positive) => &r::LATCH0_POSITIVE,
            (Self::Latch0, Edge::Negative) => &r::LATCH0_NEGATIVE,
            (Self::Latch1, Edge::Positive) => &r::LATCH1_POSITIVE,
            (Self::Latch1, Edge::Negative) => &r::LATCH1_NEGATIVE,
        }
    }

    /// Bit of 0x0980 that gives it to the processor.
    const fn owner_bit(self) -> u8 {
        match self {
            Self::Latch0 => 1 << 4,
            Self::Latch1 => 1 << 5,
        }
    }
}

impl Edge {
    const ALL: [Self; 2] = [Self::Positive, Self::Negative];

    const fn bit(self) -> u8 {
        match self {
            Self::Positive => 1 << 0,
            Self::Negative => 1 << 1,
        }
    }
}

impl Core {
    /// Whether the EtherCAT side owns an input of the unit.
    pub(in crate::controller) fn latch_is_for_ecat(&self, input: LatchInput) -> bool {
        self.memory.u8(&r::CYCLIC_UNIT_CONTROL) & input.owner_bit() == 0
    }

    /// An input has this level since `when`.
    pub(in crate::controller) fn set_latch_input(
        &mut self,
        input: LatchInput,
        high: bool,
        when: Instant,
    ) {
        if self.rights.byte(at(input.status())) & Rights::READ == 0 {
            return;
        }
        let status = self.memory.u8(input.status());
        if (status & HIGH != 0) == high {
            return;
        }
        let level = if high { HIGH } else { 0 };
        self.memory.set_u8(input.status(), status & !HIGH | level);
        let edge = if high { Edge::Positive } else { Edge::Negative };
        let single = self.memory.u8(input.control()) & edge.bit() != 0;
        if single && status & edge.bit() != 0 {
            return;
        }
        let time = self.clock.taken(when).wrapping_add(self.system_time_offset());
        self.put_time(input.time(edge), time);
        if single {
            let status = self.memory.u8(input.status());
            self.memory.set_u8(input.status(), status | edge.bit());
        }
        if self.latch_is_for_ecat(input) {
            self.raise_ecat_events(EcatEvents::DC_LATCH);
        } else {
            self.raise_al_events(AlEvents::DC_LATCH, when);
        }
    }

    /// Which times of inputs a range of addresses touches, as bits for
    /// [`Core::end_latch_reads`].
    pub(super) fn latch_reads(range: &Range<usize>) -> u8 {
        let times =
            LatchInput::ALL.into_iter().flat_map(|input| Edge::ALL.map(|edge| (input, edge)));
        let touched =
            times.enumerate().filter(|(_, (input, edge))| touches(range, input.time(*edge)));
        touched.fold(0, |bits, (index, _)| bits | 1 << index)
    }

    /// A good frame has read these times.
    pub(in crate::controller) fn end_latch_reads(&mut self, reads: u8) {
        let times =
            LatchInput::ALL.into_iter().flat_map(|input| Edge::ALL.map(|edge| (input, edge)));
        for (_, (input, edge)) in times.enumerate().filter(|(index, _)| reads >> index & 1 != 0) {
            if self.latch_is_for_ecat(input) {
                self.clear_latch_event(input, edge);
            }
        }
        if !self.latch_event_left(true) {
            self.clear_ecat_events(EcatEvents::DC_LATCH);
        }
    }

    /// The processor reads the time of an edge, with an event if there was one.
    pub(in crate::controller) fn read_latch_time(&mut self, input: LatchInput, edge: Edge) -> u64 {
        if !self.latch_is_for_ecat(input) {
            self.clear_latch_event(input, edge);
            if !self.latch_event_left(false) {
                self.clear_al_events(AlEvents::DC_LATCH);
            }
        }
        self.memory.u64(input.time(edge))
    }

    fn clear_latch_event(&mut self, input: LatchInput, edge: Edge) {
        let status = self.memory.u8(input.status());
        self.memory.set_u8(input.status(), status & !edge.bit());
    }

    fn latch_event_left(&self, ecat: bool) -> bool {
        LatchInput::ALL.into_iter().any(|input| {
            self.latch_is_for_ecat(input) == ecat && self.memory.u8(input.status()) & EVENTS != 0
        })
    }
}
