//! Wiring of the SubDevices of a text: as it tells, else as order, types and silence suggest.

use linesman_proto::address::Path;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::topology::{End, Reconstruction, SeenController};

use crate::model::reported::WiringBasis;

/// What is known of a SubDevice that tells of its place.
#[derive(Clone, Default, Debug)]
pub(super) struct Hints {
    pub(super) type_name: Option<String>,
    /// Whether it answers, where that is told.
    pub(super) answers: Option<bool>,
    /// Ports that should have a link and have none.
    pub(super) missing: PortMap<bool>,
    /// Open ports, where all are told.
    pub(super) open: Option<PortMap<bool>>,
    /// Positions of its neighbours by port.
    pub(super) neighbours: Option<PortMap<Option<u16>>>,
}

/// Where a SubDevice hangs: the one before it with its port, `None` for the MainDevice; and by which port it is
/// entered.
pub(super) type AttachPoint = (Option<(usize, Port)>, Port);

/// The places of all, in order.
pub(super) fn places(hints: &[Hints]) -> (Vec<AttachPoint>, WiringBasis) {
    if let Some(places) = by_neighbours(hints).or_else(|| by_open_ports(hints)) {
        return (places, WiringBasis::Told);
    }
    let knows_types = hints.iter().any(|hint| hint.type_name.is_some());
    let basis = if knows_types { WiringBasis::Types } else { WiringBasis::Order };
    // One has no choice.
    let basis = if hints.len() < 2 { WiringBasis::Told } else { basis };
    (assumed(hints), basis)
}

/// As each tells who is behind its ports.
fn by_neighbours(hints: &[Hints]) -> Option<Vec<AttachPoint>> {
    if hints.len() < 2 {
        return None;
    }
    let port_to = |from: usize, to: usize| {
        let neighbours = hints.get(from)?.neighbours.as_ref()?;
        neighbours.iter().find(|(_, next)| next.map(usize::from) == Some(to)).map(|(port, _)| port)
    };
    let place = |at: usize| {
        if at == 0 {
            return Some((None, Port::A));
        }
        let (before, port) =
            (0..at).rev().find_map(|before| Some((before, port_to(before, at)?)))?;
        Some((Some((before, port)), port_to(at, before).unwrap_or(Port::A)))
    };
    (0..hints.len()).map(place).collect()
}

/// As the open ports of all allow.
fn by_open_ports(hints: &[Hints]) -> Option<Vec<AttachPoint>> {
    let seen: Option<Vec<SeenController>> = hints
        .iter()
        .map(|hint| Some(SeenController { open: hint.open?, ..SeenController::default() }))
        .collect();
    let seen = seen.filter(|seen| seen.len() > 1)?;
    let found = Reconstruction::of(Path::A, &seen);
    if !found.errors.is_empty() {
        return None;
    }
    let place = |node: usize| {
        let above = match found.tree.upstream(node)? {
            End::MainDevice(_) => None,
            End::Controller(before, port) => Some((before, port)),
        };
        Some((above, found.tree.entry(node)))
    };
    (0..seen.len()).map(place).collect()
}

/// What a port is wired to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum PortAttachment {
    /// Contacts between terminals.
    Terminal,
    /// A cable.
    Cable,
    /// Either.
    Any,
}

impl PortAttachment {
    fn fits(self, other: Self) -> bool {
        self == other || self == Self::Any || other == Self::Any
    }
}

/// By which kind of port a type is entered, and its further ports in the order of the frames. Reference: device
/// descriptions of the maker.
fn ports_of(type_name: Option<&str>) -> (PortAttachment, &'static [(Port, PortAttachment)]) {
    use Port::{B, C, D};
    use PortAttachment::{Any, Cable, Terminal};
    let Some(name) = type_name else { return (Any, &[(B, Any)]) };
    let is = |families: &[&str]| families.iter().any(|family| name.starts_with(family));
    if is(&["EK1110"]) {
        (Terminal, &[(B, Cable)])
    } else if is(&["EK1122"]) {
        (Terminal, &[(D, Cable), (B, Cable), (C, Terminal)])
    } else if is(&["EK1121", "EK1521", "EK1561"]) {
        (Terminal, &[(D, Cable), (C, Terminal)])
    } else if is(&["EK"]) {
        (Cable, &[(B, Terminal), (C, Cable)])
    } else if is(&["EL", "ES", "EM", "KM"]) {
        (Terminal, &[(B, Terminal)])
    } else if is(&["CU1123"]) {
        (Cable, &[(B, Cable), (C, Cable)])
    } else if is(&["CU112", "EP1122", "EP9128"]) {
        (Cable, &[(D, Cable), (B, Cable), (C, Cable)])
    } else if is(&["EP", "EQ", "ER", "AX", "CU"]) {
        (Cable, &[(B, Cable)])
    } else {
        (Any, &[(B, Any)])
    }
}

/// A SubDevice to which more can still be attached: those that come later hang on it or on one before it.
struct OpenChain {
    node: usize,
    ports: Vec<(Port, PortAttachment)>,
}

fn assumed(hints: &[Hints]) -> Vec<AttachPoint> {
    let mut places: Vec<AttachPoint> = Vec::with_capacity(hints.len());
    let mut spine: Vec<OpenChain> = Vec::new();
    for (node, hint) in hints.iter().enumerate() {
        let (entry, ports) = ports_of(hint.type_name.as_deref());
        let found = attach(hints, &spine, hint, entry);
        let (above, depth) = match found {
            Some((depth, port)) => (Some((spine[depth].node, port)), Some(depth)),
            None => match spine.last() {
                // Nothing fits: behind the one before it, all the same.
                Some(last) => {
                    let port = last.ports.first().map_or(Port::B, |(port, _)| *port);
                    (Some((last.node, port)), Some(spine.len() - 1))
                }
                None => (None, None),
            },
        };
        if let (Some(depth), Some((_, port))) = (depth, above) {
            spine.truncate(depth + 1);
            if let Some(top) = spine.last_mut() {
                let used = top.ports.iter().position(|(one, _)| *one == port);
                top.ports.drain(..used.map_or(0, |used| used + 1));
            }
        }
        places.push((above, Port::A));
        spine.push(OpenChain { node, ports: ports.to_vec() });
    }
    places
}

/// The nearest place that fits: not behind somebody who is silent, for one that answers; for one that is silent
/// behind a link that is missed, where the nearest would answer.
fn attach(
    hints: &[Hints],
    spine: &[OpenChain],
    hint: &Hints,
    entry: PortAttachment,
) -> Option<(usize, Port)> {
    let fits = |depth: &usize, port: Port, kind: PortAttachment| {
        let above = &hints[spine[*depth].node];
        let is_reached =
            hint.answers != Some(true) || (above.answers != Some(false) && !above.missing[port]);
        kind.fits(entry) && is_reached
    };
    let candidates: Vec<(usize, Port)> = (0..spine.len())
        .rev()
        .flat_map(|depth| spine[depth].ports.iter().map(move |(port, kind)| (depth, *port, *kind)))
        .filter(|(depth, port, kind)| fits(depth, *port, *kind))
        .map(|(depth, port, _)| (depth, port))
        .collect();
    let nearest = candidates.first().copied();
    let nearest_answers =
        nearest.is_none_or(|(depth, _)| hints[spine[depth].node].answers != Some(false));
    let missed =
        candidates.iter().copied().find(|(depth, port)| hints[spine[*depth].node].missing[*port]);
    match missed {
        Some(missed) if hint.answers == Some(false) && nearest_answers => Some(missed),
        Some(_) | None => nearest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hint(type_name: &str, answers: bool) -> Hints {
        let type_name = Some(type_name.to_owned()).filter(|name| !name.is_empty());
        Hints { type_name, answers: Some(answers), ..Hints::default() }
    }

    fn above(hints: &[Hints]) -> Vec<Option<(usize, Port)>> {
        places(hints).0.into_iter().map(|(above, _)| above).collect()
    }

    #[test]
    fn couplers_hang_on_sockets_and_terminals_side_by_side() {
        use Port::{B, C};
        let hints: Vec<Hints> =
            ["EK1100", "EL1008", "EK1110", "EK1100", "EL2008", "EK1100", "EP2308", "AX5103"]
                .map(|name| hint(name, true))
                .into();
        let expected = [
            None,
            Some((0, B)),
            Some((1, B)),
            Some((2, B)),
            Some((3, B)),
            Some((3, C)),
            Some((5, C)),
            Some((6, B)),
        ];
        assert_eq!(above(&hints), expected);
        assert_eq!(places(&hints).1, WiringBasis::Types);
    }

    #[test]
    fn who_answers_does_not_hang_behind_who_is_silent() {
        use Port::{B, C, D};
        // A junction with a silent coupler on D, and a terminal behind it that answers.
        let mut hints = vec![
            hint("EK1100", true),
            hint("EK1122", true),
            hint("EK1100", false),
            hint("EL3104", false),
            hint("EL4732", true),
        ];
        hints[1].missing[D] = true;
        assert_eq!(above(&hints), [None, Some((0, B)), Some((1, D)), Some((2, B)), Some((1, C))]);
        // Two couplers, the first one's terminals silent.
        let hints = [
            hint("EK1100", true),
            hint("EK1110", true),
            hint("EK1100", false),
            hint("EL1008", false),
            hint("EK1828", true),
        ];
        assert_eq!(above(&hints)[4], Some((0, C)));
    }

    #[test]
    fn who_is_silent_hangs_behind_the_link_that_is_missed() {
        use Port::C;
        let mut hints = vec![
            hint("EK1100", true),
            hint("EL1008", true),
            hint("EK1110", true),
            hint("EK1100", true),
            hint("EK1828", false),
        ];
        hints[0].missing[C] = true;
        assert_eq!(above(&hints)[4], Some((0, C)));
    }

    #[test]
    fn unknown_types_are_a_line_in_order() {
        let hints: Vec<Hints> = vec![Hints::default(); 3];
        assert_eq!(above(&hints), [None, Some((0, Port::B)), Some((1, Port::B))]);
        assert_eq!(places(&hints).1, WiringBasis::Order);
    }

    #[test]
    fn told_neighbours_and_open_ports_come_first() {
        let neighbours =
            |of: [Option<u16>; 4]| Hints { neighbours: Some(PortMap(of)), ..Hints::default() };
        let told = [
            neighbours([None, Some(1), Some(2), None]),
            neighbours([Some(0), None, None, None]),
            neighbours([None, None, Some(0), None]),
        ];
        let (places, basis) = super::places(&told);
        assert_eq!(basis, WiringBasis::Told);
        assert_eq!(
            places,
            [(None, Port::A), (Some((0, Port::B)), Port::A), (Some((0, Port::C)), Port::C)]
        );
        let open = |of: [bool; 4]| Hints { open: Some(PortMap(of)), ..Hints::default() };
        let told = [
            open([true, true, true, false]),
            open([true, false, false, false]),
            open([true, false, false, false]),
        ];
        assert_eq!(above(&told), [None, Some((0, Port::B)), Some((0, Port::C))]);
        // What cannot be is not believed.
        let wrong = [open([true, false, false, false]), open([true, false, false, false])];
        assert_eq!(super::places(&wrong).1, WiringBasis::Order);
    }
}
