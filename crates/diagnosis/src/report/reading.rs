//! How to have read what would tell the place of a finding, for the MainDevice that drives the line.

use linesman_config::fault::Class;

use super::{FindingReport, PlaceReport};
use crate::ask::Refusal;
use crate::coverage::InputKind;
use crate::line::Line;
use crate::main_device::{MainDeviceKind, next_step};

/// Adds to findings whose place is left open, where nobody has read error counters, how this kind of MainDevice reads them.
pub(crate) fn advise(findings: &mut [FindingReport], line: &Line, input: InputKind) {
    let is_others = matches!(input, InputKind::Listened | InputKind::Recorded | InputKind::Typed);
    let kind = line.main_device_kind();
    let is_read = line.devices.iter().any(|device| device.counters.is_known());
    if !is_others || is_read || kind == MainDeviceKind::Unknown {
        return;
    }
    let may_ask =
        input == InputKind::Listened && Refusal::of(line.habits.recognised().as_ref()).is_none();
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
