//! Another way to the SubDevice behind a lost link, as a ring has it.

use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use crate::locate::{LinkLoss, LinkLosses};
use crate::model::NetworkModel;
use crate::model::is_on_terminal_bus;

/// Both ends of a link are read in turns as quick as this where what was read of them can be compared.
const SOON: Span = Span::ms(200);

/// True if the SubDevice behind the link was read while it was lost: then frames have another way to it, as in a ring
/// whose second card is not known.
///
/// The link of a cable needs 0.3 s to come back, so that a reading soon after the loss was made while it was away, where
/// both ends are read in quick turns.
pub(super) fn is_there(model: &NetworkModel, tree: &Tree, drops: &LinkLosses) -> bool {
    let link = tree.links()[drops.link];
    let End::Controller(node, port) = link.downstream else { return false };
    let lost = model.devices[node].counters.track(ErrorCounter::LostLink(port));
    let is_meanwhile = |drop: &LinkLoss, at: Instant| {
        drop.end == link.upstream
            && drop.at < at
            && match drop.back {
                Some(back) => at < drop.at + SOON && drop.at + SOON * 2 < back,
                None => true,
            }
    };
    let rises = || lost.into_iter().flat_map(|track| &track.rises);
    !is_on_terminal_bus(model, node)
        && rises()
            .filter(|rise| rise.at.since(rise.after_time) <= SOON)
            .any(|rise| drops.seen.iter().any(|drop| is_meanwhile(drop, rise.at)))
}
