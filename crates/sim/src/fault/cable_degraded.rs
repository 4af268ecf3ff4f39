//! `cable-degraded`: a cable, plug or contact is worn. Both directions suffer, and most while it is
//! moved: errors swell and fade with the period of the movement.

use linesman_config::fault::FaultName;

use super::source::{Envelope, HITS, PoissonErrors, frame_hits};
use super::{Kind, Parameter, PlaceRule, Shape};

pub(super) const KIND: Kind = Kind {
    name: FaultName::CableDegraded,
    place: PlaceRule::Directions,
    parameters: &[
        Parameter {
            key: "hits_per_s",
            meaning: "Mean number of destroyed symbols a second, in each direction.",
            shape: Shape::Number { low: 0.0, high: 1e6, default: Some(40.0) },
        },
        Parameter {
            key: "movement_ms",
            meaning: "Period of the movement, in ms; 0 for a cable at rest: errors come evenly.",
            shape: Shape::Number { low: 0.0, high: 3.6e6, default: Some(800.0) },
        },
        HITS,
    ],
    start: |start| {
        let interval = start.interval();
        let period = start.milliseconds("movement_ms");
        let mut stream = start.stream.clone();
        if let Some(count) = start.values.whole("hits") {
            let hits = &mut start.hits.unwrap_or(stream);
            return Ok(frame_hits(count, interval, &start.target.directions, hits));
        }
        let envelope = match period.as_nanos() {
            0 => Envelope::Constant,
            _ => Envelope::Swell { period, phase: stream.fraction() },
        };
        let rate = start.number("hits_per_s");
        Ok(Box::new(PoissonErrors::new(
            start.target.directions,
            rate,
            envelope,
            start.from,
            stream,
        )))
    },
};
