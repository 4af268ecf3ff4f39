//! Places between two ports of a capture probe: the hops of the frames' way, and the devices between them.

use linesman_proto::topology::{Hop, Route, Tree};

use super::cause::CausePlace;
use crate::model::probe_record::ProbeRecord;

/// Sign of what happened to frames.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum ProbeSign {
    /// Damaged, and no controller had found it: it arose on the link of the port, or in what sends on it.
    Fresh,
    /// Damaged, and found bad by a controller before: it arose before the last one.
    Marked,
    /// Damaged and marked, but so few that the mark may be a part of the damage.
    FewMarked,
    /// Not there any more.
    Lost,
    /// Not there any more at a tap: lost, or damaged, since its cards drop damaged frames.
    Missing,
}

/// The hop on which a port of the probe sits; `None` where the recording does not tell.
#[must_use]
pub fn hop_of(record: &ProbeRecord, tree: &Tree, route: &Route, port: u8) -> Option<usize> {
    let is_back = record.order.is_back(port);
    let out = if is_back { port ^ 1 } else { port };
    let before = usize::from(record.order.before(out)?);
    let node = *tree.order().get(before)?;
    let hop = route.first_hop_to(node)?;
    if is_back { route.opposite(hop) } else { Some(hop) }
}

/// Places in which what is seen at port `to` and not yet at port `from` can have arisen, in the order of the way.
#[must_use]
pub fn places(
    record: &ProbeRecord,
    tree: &Tree,
    from: Option<u8>,
    to: u8,
    sign: ProbeSign,
) -> Option<Vec<CausePlace>> {
    let route = Route::intact(tree);
    let first = from.map_or(Some(0), |port| hop_of(record, tree, &route, port))?;
    let last = hop_of(record, tree, &route, to)?;
    let hops = route.hops().get(first..=last)?;
    let (own, before) = hops.split_last()?;
    let found = match sign {
        ProbeSign::Fresh => places_of(std::slice::from_ref(own), true),
        ProbeSign::Marked if !before.is_empty() => places_of(before, from.is_none()),
        ProbeSign::Marked | ProbeSign::FewMarked | ProbeSign::Lost | ProbeSign::Missing => {
            places_of(hops, from.is_none())
        }
    };
    Some(found)
}

/// The links of hops, and the devices between them; with the sender of the first one if it belongs to them.
fn places_of(hops: &[Hop], with_sender: bool) -> Vec<CausePlace> {
    let mut found = Vec::new();
    for (index, hop) in hops.iter().enumerate() {
        if index > 0 || with_sender {
            found.push(hop.from.node().map_or(CausePlace::Host, CausePlace::Device));
        }
        found.push(CausePlace::Link(hop.link, Some(hop.direction)));
    }
    let mut kept: Vec<CausePlace> = Vec::with_capacity(found.len());
    for place in found {
        if !kept.contains(&place) {
            kept.push(place);
        }
    }
    kept
}
