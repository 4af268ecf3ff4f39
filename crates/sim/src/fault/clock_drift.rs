//! `clock-drift`: the quartz of a device runs too fast or too slow, at once or more and more with heat.
//! At its reset values the loop follows up to 762 ppm (0x0932 within its limits) and 24 ppm more by
//! its bandwidth; beyond that 0x092C grows.
//!
//! Reference: S2 2.15.2.4 to 2.15.2.6.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, TimingChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::ClockDrift,
    place: PlaceRule::Device,
    parameters: &[
        Parameter {
            key: "ppm",
            meaning: "How much too fast the quartz runs, in parts per million; negative is too slow.",
            shape: Shape::Number { low: -2_000.0, high: 2_000.0, default: Some(900.0) },
        },
        Parameter {
            key: "ramp_ppm_per_s",
            meaning: "How much faster it becomes in each second: heat.",
            shape: Shape::Number { low: -100.0, high: 100.0, default: Some(0.0) },
        },
        Parameter {
            key: "ramp_s",
            meaning: "For how many seconds it becomes faster.",
            shape: Shape::Number { low: 0.0, high: 10_000.0, default: Some(60.0) },
        },
    ],
    start: |start| {
        let change = TimingChange::Drift {
            ppb: (start.number("ppm") * 1_000.0).round() as i64,
            ramp_ppb_per_s: (start.number("ramp_ppm_per_s") * 1_000.0).round() as i64,
            ramp: Span::ns((start.number("ramp_s") * 1e9) as u64),
        };
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Timing { node, change }))))
    },
};
