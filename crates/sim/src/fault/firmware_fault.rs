//! `firmware-fault`: the firmware of a device fails while its controller goes on passing frames.
//!
//! What a hanging processor does follows from S2 2.10 and S1 chapter 8: nobody serves the process
//! data interface, so the PDI watchdog runs out (0x0110 bit 1, 0x0443); the process data watchdog
//! works on, outputs are still taken by the controller, inputs stay as they were last written;
//! requests for a state and mailbox messages stay unanswered.

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::SoftwareFault;
use crate::wire::{Change, SoftwareChange, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::FirmwareFault,
    place: PlaceRule::Processor,
    parameters: &[
        Parameter {
            key: "how",
            meaning: "`hangs`: its processor stops. `restarts`: it crashes and starts anew by itself, \
                      in INIT with code 0x0060. `inputs-frozen`: its application stops, the rest \
                      works; a device that starts like that has no values to exchange and does not \
                      get to OP (0x0018, 0x0019 or 0x002B). `state-machine-dead`: requests for a state stay unanswered, the rest \
                      works. `memory-blocked`: its processor stops with the buffers of its process data \
                      locked (0x0807 + 8n bit 0): its share of working counters is missing, its AL status \
                      stays.",
            shape: Shape::Word {
                words: &[
                    "hangs",
                    "restarts",
                    "inputs-frozen",
                    "state-machine-dead",
                    "memory-blocked",
                ],
            },
        },
        Parameter {
            key: "boot_ms",
            meaning: "With `restarts`: how long it takes to start, in ms.",
            shape: Shape::Number { low: 0.01, high: 600_000.0, default: Some(300.0) },
        },
        Parameter {
            key: "every_ms",
            meaning: "With `restarts`: from one crash to the next, in ms; 0 for a single one.",
            shape: Shape::Number { low: 0.0, high: 3.6e6, default: Some(0.0) },
        },
    ],
    start: |start| {
        let changes: &[SoftwareChange] = match start.values.text("how") {
            Some("restarts") => {
                let (boot, every) = (start.milliseconds("boot_ms"), start.milliseconds("every_ms"));
                if every != Span::ZERO && every <= boot {
                    return Err(start.error("`every_ms` must be longer than `boot_ms`".to_owned()));
                }
                let nodes = start.target.nodes;
                return Ok(Box::new(Crashes { nodes, boot, every, at: start.from, next: 0 }));
            }
            Some("inputs-frozen") => &[SoftwareChange::Begin(SoftwareFault::FrozenApplication)],
            Some("state-machine-dead") => &[SoftwareChange::Begin(SoftwareFault::DeafToRequests)],
            Some("memory-blocked") => {
                &[SoftwareChange::Begin(SoftwareFault::LockedBuffers), SoftwareChange::Hang]
            }
            Some(_) | None => &[SoftwareChange::Hang],
        };
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.flat_map(move |node| {
            changes.iter().map(move |change| (from, Change::Software { node, change: *change }))
        })))
    },
};

#[derive(Debug)]
struct Crashes {
    nodes: Vec<usize>,
    boot: Span,
    every: Span,
    /// When the present crash comes.
    at: Instant,
    /// Counts changes of the crash: all stop, then all start.
    next: usize,
}

impl Source for Crashes {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let count = self.nodes.len();
        if count == 0 {
            return None;
        }
        if self.next == 2 * count {
            if self.every == Span::ZERO {
                return None;
            }
            self.at += self.every;
            self.next = 0;
        }
        let node = *self.nodes.get(self.next % count)?;
        let (at, change) = if self.next < count {
            (self.at, SoftwareChange::Hang)
        } else {
            (self.at + self.boot, SoftwareChange::Reboot)
        };
        self.next += 1;
        Some((at, Change::Software { node, change }))
    }
}
