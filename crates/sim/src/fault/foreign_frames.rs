//! `foreign-frames`: frames that are not EtherCAT travel on the line.
//!
//! A computer or a switch shares the cable. While a controller's forwarding rule (0x0100 bit 0) is 1,
//! as after power-on, its processing unit destroys such a frame and counts it at 0x030C, with clean
//! ports: only the first controller sees any. Where the MainDevice has set the rule to 0 the frame
//! passes on, to the next controller whose rule is 1 or back to the card. The line's own frames are
//! not hurt, but wait while another one is on the cable.

use linesman_config::fault::FaultName;
use linesman_proto::time::Instant;

use super::{Kind, Parameter, PlaceRule, Shape};
use crate::seed::Stream;
use crate::wire::{Change, DirectedLink, ForeignSender, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::ForeignFrames,
    place: PlaceRule::Entrance,
    parameters: &[
        Parameter {
            key: "protocol",
            meaning: "What they are.",
            shape: Shape::Word { words: &["mixed", "arp", "ipv4", "lldp"] },
        },
        Parameter {
            key: "frames_per_s",
            meaning: "Mean number of frames a second, by chance.",
            shape: Shape::Number { low: 0.001, high: 20_000.0, default: Some(20.0) },
        },
    ],
    start: |start| {
        let what = match start.values.text("protocol") {
            Some("arp") => &[ForeignSender::Arp][..],
            Some("ipv4") => &[ForeignSender::Ipv4],
            Some("lldp") => &[ForeignSender::Lldp],
            Some(_) | None => &[ForeignSender::Arp, ForeignSender::Ipv4, ForeignSender::Lldp],
        };
        let (direction, rate_per_s) =
            (start.target.directions.first().copied(), start.number("frames_per_s"));
        Ok(Box::new(ForeignTraffic {
            direction,
            what,
            rate_per_s,
            at: start.from,
            stream: start.stream,
        }))
    },
};

#[derive(Debug)]
struct ForeignTraffic {
    direction: Option<DirectedLink>,
    what: &'static [ForeignSender],
    rate_per_s: f64,
    at: Instant,
    stream: Stream,
}

impl Source for ForeignTraffic {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        let direction = self.direction?;
        self.at += self.stream.wait(self.rate_per_s);
        let what = *self.stream.pick(self.what)?;
        (self.at != Instant::MAX).then_some((self.at, Change::ForeignSender { direction, what }))
    }
}
