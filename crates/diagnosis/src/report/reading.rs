//! Advice on reading what would tell the place of a finding, for the MainDevice that drives the line.

use linesman_config::fault::Class;

use super::{FindingReport, PlaceReport};
use crate::ask::AskRefusal;
use crate::coverage::InputKind;
use crate::main_device::{MainDeviceKind, next_step};
use crate::model::NetworkModel;

/// Adds to findings whose place is left open, where nobody has read error counters, how this kind of MainDevice reads them.
pub(crate) fn advise(findings: &mut [FindingReport], model: &NetworkModel, input: InputKind) {
    let is_others = matches!(input, InputKind::Listened | InputKind::Recorded | InputKind::Typed);
    let kind = model.main_device_kind();
    let is_read = model.devices.iter().any(|device| device.counters.is_known());
    if !is_others || is_read || kind == MainDeviceKind::Unknown {
        return;
    }
    let may_ask = input == InputKind::Listened
        && AskRefusal::of(model.habits.recognised().as_ref()).is_none();
    for finding in findings.iter_mut().filter(|finding| is_open(finding)) {
        if may_ask {
            finding.actions.push(
                "Have the counters read beside the MainDevice, on its own computer: `linesman diagnose WHERE --ask`."
                    .to_owned(),
            );
        }
        let step = next_step::error_counters(kind);
        finding.actions.push(format!("Beside {}: {step}.", kind.name()));
    }
}

/// Whether counters may tell a place that is not known, or known as one of several.
fn is_open(finding: &FindingReport) -> bool {
    let is_unplaced = match &finding.place {
        PlaceReport::Network { .. } => true,
        PlaceReport::Link { b, .. } => b.is_none(),
        PlaceReport::Device { .. } | PlaceReport::Host => false,
    };
    let has_other = finding.alternatives.iter().any(|other| other.place.is_some());
    finding.class == Class::Hardware && (is_unplaced || has_other)
}
