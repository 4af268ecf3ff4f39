//! `false-link`: a port shows a link although nothing behind it answers.
//!
//! A media converter with a broken fibre, a switch in between, or a neighbour whose PHY lives while
//! its controller is dead: the near port keeps its link, its loop stays open, and every frame that it
//! sends there vanishes without a trace. No controller counts anything and no frame comes back, while
//! everybody before the hole has executed it: writes still reach them. Both directions at once
//! (`K1.C-K2.A`) or one of them (`K1.C>K2.A`).

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::FalseLink,
    place: PlaceRule::Directions,
    parameters: &[Parameter {
        key: "far",
        meaning: "Whether the far end shows a link, too, or has lost it; only the near one is deceived then.",
        shape: Shape::Word { words: &["with-link", "without-link"] },
    }],
    start: |start| {
        let from = start.from;
        let mut changes: Vec<_> = start
            .target
            .directions
            .iter()
            .map(|direction| (from, Change::Swallow { direction: *direction }))
            .collect();
        if start.values.text("far") == Some("without-link") {
            // The line that goes to the far end: away from the MainDevice, or the one that was named.
            let direction = match start.target.directions.as_slice() {
                [direction] => Some(*direction),
                directions => directions.iter().find(|direction| direction.downstream).copied(),
            };
            changes.extend(direction.map(|direction| (from, Change::Break { direction })));
        }
        Ok(ListedChanges::boxed(changes))
    },
};
