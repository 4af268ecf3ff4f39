//! `ebus-overload`: terminals draw more current than what feeds their E-bus supplies. Its voltage
//! falls along the contacts: the terminals nearest the feed still live, those from where the sum of
//! the currents exceeds what is supplied fall off. Without their load it recovers, they start anew,
//! and fall off again.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::EbusOverload,
    place: PlaceRule::Feed,
    parameters: &[
        Parameter {
            key: "supply_ma",
            meaning: "What is supplied, in mA; what its type supplies unless said. It must be less \
                      than the terminals draw.",
            shape: Shape::Number { low: 1.0, high: 100_000.0, default: None },
        },
        Parameter {
            key: "extra_ma",
            meaning: "What the last terminal draws beside its own current, in mA: a defect.",
            shape: Shape::Number { low: 0.0, high: 100_000.0, default: Some(0.0) },
        },
        Parameter {
            key: "off_ms",
            meaning: "How long the terminals are off until the voltage has recovered, in ms.",
            shape: Shape::Number { low: 0.1, high: 60_000.0, default: Some(100.0) },
        },
        Parameter {
            key: "on_ms",
            meaning: "How long they are on until the voltage falls again, in ms.",
            shape: Shape::Number { low: 0.1, high: 600_000.0, default: Some(700.0) },
        },
    ],
    start: |start| {
        let (feed, terminals) = match start.target.currents.split_first() {
            Some((feed, terminals)) if feed.ma < 0 => (*feed, terminals),
            _ => return Err(start.error("what is given feeds no E-bus".to_owned())),
        };
        let supplied = start.values.number("supply_ma").unwrap_or(f64::from(-feed.ma));
        let extra = start.number("extra_ma");
        let mut drawn = 0.0;
        let mut nodes = Vec::new();
        for (index, terminal) in terminals.iter().enumerate() {
            drawn += f64::from(terminal.ma);
            if index + 1 == terminals.len() {
                drawn += extra;
            }
            if drawn > supplied {
                nodes.push(terminal.node);
            }
        }
        if nodes.is_empty() {
            return Err(start.error(format!(
                "{supplied} mA are supplied and {drawn} mA drawn, which is no overload: give less \
                 with `supply_ma`, or more with `extra_ma`"
            )));
        }
        let (off, on) = (start.milliseconds("off_ms"), start.milliseconds("on_ms"));
        Ok(Box::new(Hiccups { nodes, off, on, at: start.from, next: 0 }))
    },
};

/// Off together, on together, again and again.
#[derive(Debug)]
struct Hiccups {
    nodes: Vec<usize>,
    off: Span,
    on: Span,
    /// When they fall off this time.
    at: Instant,
    /// Counts changes: all off, then all on.
    next: usize,
}

impl Source for Hiccups {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let count = self.nodes.len();
        if self.next == 2 * count {
            self.at = self.at + self.off + self.on;
            self.next = 0;
        }
        let node = *self.nodes.get(self.next % count.max(1))?;
        let falls = self.next < count;
        self.next += 1;
        Some(if falls {
            (self.at, Change::Off { node })
        } else {
            (self.at + self.off, Change::On { node })
        })
    }
}
