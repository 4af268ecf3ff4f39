//! Times that a SubDevice needs for its work in a cycle: objects 0x1C32 (outputs) and 0x1C33 (inputs).
//!
//! Reference: ETG.1020, synchronisation; S0 L496-534.

use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

use crate::esi::dictionary::EsiObject;

/// Subindices of 0x1C32 and 0x1C33.
const SHIFT: u8 = 3;
const MIN_CYCLE: u8 = 5;
const CALC_AND_COPY: u8 = 6;

/// Times of a SubDevice, as far as its description or the project says them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SyncTimes {
    /// Times of its outputs: object 0x1C32.
    #[serde(skip_serializing_if = "DirectionTimes::is_unknown")]
    pub outputs: DirectionTimes,
    /// Times of its inputs: object 0x1C33.
    #[serde(skip_serializing_if = "DirectionTimes::is_unknown")]
    pub inputs: DirectionTimes,
}

/// Times of one direction of process data, in ns; what is not said is not known.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DirectionTimes {
    /// Subindex 05: the shortest cycle in which it gets its work done, in ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub min_cycle_ns: Option<u32>,
    /// Subindex 06: the time for calculating and copying, in ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub calc_and_copy_ns: Option<u32>,
    /// Subindex 03: from SYNC to output valid or input latch, in ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_ns: Option<u32>,
}

impl DirectionTimes {
    /// True if nothing is known.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// The shortest cycle; 0 says nothing, as where a SubDevice measures its own times.
    #[must_use]
    pub fn min_cycle(&self) -> Option<Span> {
        known(self.min_cycle_ns)
    }

    /// The time for calculating and copying; 0 says nothing.
    #[must_use]
    pub fn calc_and_copy(&self) -> Option<Span> {
        known(self.calc_and_copy_ns)
    }

    /// The time in which the work of this direction is done at the latest: that for calculating and copying, else
    /// the shortest cycle, which holds all its work.
    #[must_use]
    pub fn work(&self) -> Option<Span> {
        self.calc_and_copy().or(self.min_cycle())
    }

    /// From SYNC to output valid or input latch; 0 unless said.
    #[must_use]
    pub fn shift(&self) -> Span {
        Span::ns(u64::from(self.shift_ns.unwrap_or(0)))
    }

    /// These times, and those of `other` where nothing is said here.
    #[must_use]
    fn or(self, other: Self) -> Self {
        Self {
            min_cycle_ns: self.min_cycle_ns.or(other.min_cycle_ns),
            calc_and_copy_ns: self.calc_and_copy_ns.or(other.calc_and_copy_ns),
            shift_ns: self.shift_ns.or(other.shift_ns),
        }
    }
}

fn known(ns: Option<u32>) -> Option<Span> {
    ns.filter(|ns| *ns > 0).map(|ns| Span::ns(u64::from(ns)))
}

impl SyncTimes {
    /// The times that stand in the dictionary of a description (ESI) as values after power-on.
    #[must_use]
    pub fn from_dictionary(objects: &[EsiObject]) -> Self {
        let of = |index: ObjectIndex| {
            let object = objects.iter().find(|object| object.index == index.0);
            let value = |subindex| {
                let mut entries = object?.entries.iter();
                let entry = entries.find(|entry| entry.subindex == subindex)?;
                let bytes = entry.default.iter().take(4).rev();
                let value = bytes.fold(0, |value: u32, byte| value << 8 | u32::from(*byte));
                (value > 0).then_some(value)
            };
            DirectionTimes {
                min_cycle_ns: value(MIN_CYCLE),
                calc_and_copy_ns: value(CALC_AND_COPY),
                shift_ns: value(SHIFT),
            }
        };
        Self { outputs: of(ObjectIndex::OUTPUT_SYNC), inputs: of(ObjectIndex::INPUT_SYNC) }
    }

    /// These times, and those of `other` where nothing is said here.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self { outputs: self.outputs.or(other.outputs), inputs: self.inputs.or(other.inputs) }
    }

    /// True if nothing is known.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// The shortest cycle that the SubDevice bears in both directions, as far as that is known.
    #[must_use]
    pub fn min_cycle(&self) -> Option<Span> {
        self.outputs.min_cycle().max(self.inputs.min_cycle())
    }
}
