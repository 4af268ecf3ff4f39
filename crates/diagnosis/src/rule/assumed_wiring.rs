//! Lowers how sure a place is that hangs on a wiring which nobody told.
//!
//! A pasted list has the order of the SubDevices and not how they are wired. What is placed by counters of ports is
//! then as good as the assumption. It has no finding of its own: it changes those of the rules before it.

use super::{Rule, View};
use crate::finding::{Condition, Evidence, Place};
use crate::model::reported::WiringBasis;

/// The rule.
pub const RULE: Rule = Rule { pages: &[], judge };

/// What is left of a confidence where types and order suggest the wiring, and where the order alone does.
const BY_TYPES: f64 = 0.85;
const BY_ORDER: f64 = 0.6;

#[expect(clippy::ptr_arg, reason = "all rules have this form")]
fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let (factor, how) = match view.model.reported.wiring {
        WiringBasis::Told => return,
        WiringBasis::Types => (BY_TYPES, "by the order of the list and the types"),
        WiringBasis::Order => (BY_ORDER, "as a line in order"),
    };
    let is_placed = |one: &&mut Condition| {
        matches!(one.page.code, "H101" | "H104" | "H110" | "H111" | "H112" | "H115")
            && matches!(one.place, Place::Link { .. } | Place::Device { .. })
    };
    for condition in conditions.iter_mut().filter(is_placed) {
        condition.confidence *= factor;
        condition.alternatives.iter_mut().for_each(|other| other.confidence *= factor);
        let text = format!("the wiring is assumed {how}: compare the place with the drawing");
        condition.evidence.push(Evidence::host(None, text));
    }
}
