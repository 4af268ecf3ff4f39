//! # A link that takes longer than a cable can
//!
//! The propagation delay between two neighbours is longer than a cable of 100 m makes it.
//!
//! **How it is found.** An observation file or a pasted list gives the propagation delay of each SubDevice from the
//! reference clock (0x0928). Between a SubDevice and the first one behind it lie a cable and two ports: some 100 ns
//! side by side, 500 ns over a short cable, and 550 ns more for 100 m of copper. Only the first branch of each
//! SubDevice is compared: the delays of the others hold what hangs on those before them.
//!
//! **What it means.** Something that is no EtherCAT stands between the two: a media converter, a switch, a radio link;
//! or a fibre that is longer than copper may be. It works as long as it forwards every frame at once; clocks
//! that are to be in step suffer from one that does not. Delays that fall along the way were measured wrong.
//!
//! **What to do.** Compare with the drawing what lies between the two ports.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity};
use crate::model::NetworkModel;

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "T413",
    name: "delay-long",
    severity: Severity::Info,
    class: Class::Timing,
    source: include_str!("long_delay.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Two ports with 100 m of copper between them, and as much again for doubt.
const LONGEST: Span = Span::ns(2_000);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let Some(tree) = model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len()) else {
        return;
    };
    for node in 0..tree.len() {
        conditions
            .extend(first_branch(tree, node).and_then(|child| condition(model, tree, node, child)));
    }
}

/// Who is reached first behind a SubDevice, in the order of the frames.
fn first_branch(tree: &Tree, node: usize) -> Option<usize> {
    // Entered at port A frames leave by D, then B, then C.
    const ORDER: [Port; 3] = [Port::D, Port::B, Port::C];
    if tree.entry(node) != Port::A {
        return None;
    }
    ORDER
        .iter()
        .find_map(|port| tree.children(node).find(|(one, _)| one == port))
        .map(|(_, child)| child)
}

fn condition(model: &NetworkModel, tree: &Tree, node: usize, child: usize) -> Option<Condition> {
    let (near, far) = (model.devices[node].delay?, model.devices[child].delay?);
    // Of whoever has no clock nobody measured it; the first one has none by itself.
    let is_first = tree.order().first() == Some(&node);
    if far == Span::ZERO || (near == Span::ZERO && !is_first) {
        return None;
    }
    let link = tree.links().get(tree.link_above(child)?)?;
    let place = Place::link(model.network, link.map(|node| DeviceId(node as u32)), None);
    let (here, there) = (model.label(DeviceId(node as u32)), model.label(DeviceId(child as u32)));
    let (cause, text) = if far < near {
        let text =
            format!("the delay falls from SubDevice {here} ({near}) to {there} behind it ({far})");
        (FaultName::ConfigMismatch, text)
    } else if far.saturating_sub(near) > LONGEST {
        let by = far.saturating_sub(near);
        (FaultName::LateFrames, format!("frames take {by} from SubDevice {here} to {there}"))
    } else {
        return None;
    };
    let condition = Condition::new(&PAGE, place, cause, model.now)
        .confidence(0.5)
        .or(FaultName::FalseLink, 0.1)
        .confirmed(model.now)
        .shown_by(Evidence::host(None, text))
        .advise(format!(
            "Look what lies between {here} and {there}: a converter, a switch, a long fibre?"
        ));
    Some(condition)
}
