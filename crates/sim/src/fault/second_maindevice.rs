//! `second-maindevice`: another MainDevice sends on the same line.
//!
//! It is plugged into a switch at the begin of a line: `maindevice>K1.A` unless said, or in the middle.
//! Its frames are real: every controller behind that place executes them, marks their source address,
//! and they come back to the card, which gets frames that nobody here has sent. Frames of the two
//! wait for each other. What else follows depends on what it does: a scan only reads, `init` and
//! `preop` order all SubDevices into another state, `clear-counters` wipes their error counters.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, DirectedLink, ForeignSender, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::SecondMainDevice,
    place: PlaceRule::Entrance,
    parameters: &[
        Parameter {
            key: "does",
            meaning: "What it does all the time: it looks who is there, orders all SubDevices into INIT or PREOP, or clears their error counters.",
            shape: Shape::Word { words: &["scan", "init", "preop", "clear-counters"] },
        },
        Parameter {
            key: "frames_per_s",
            meaning: "Frames a second, evenly.",
            shape: Shape::Number { low: 0.01, high: 20_000.0, default: Some(100.0) },
        },
    ],
    start: |start| {
        let does = match start.values.text("does") {
            Some("init") => |nth| ForeignSender::State { control: 0x01, nth },
            Some("preop") => |nth| ForeignSender::State { control: 0x02, nth },
            Some("clear-counters") => |nth| ForeignSender::ClearCounters { nth },
            Some(_) | None => |nth| ForeignSender::Scan { nth },
        };
        let every = Span::ns((1e9 / start.number("frames_per_s").max(0.01)) as u64);
        let direction = start.target.directions.first().copied();
        Ok(Box::new(SecondMainDevice { direction, does, every, from: start.from, nth: 0 }))
    },
};

#[derive(Debug)]
struct SecondMainDevice {
    direction: Option<DirectedLink>,
    does: fn(u32) -> ForeignSender,
    every: Span,
    from: Instant,
    nth: u32,
}

impl Source for SecondMainDevice {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let (direction, nth) = (self.direction?, self.nth);
        self.nth = self.nth.wrapping_add(1);
        let at = self.from + self.every * u64::from(nth);
        Some((at, Change::ForeignSender { direction, what: (self.does)(nth) }))
    }
}
