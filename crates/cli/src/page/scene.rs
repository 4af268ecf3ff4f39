//! Scene of a diagnosis, and of a scan.

use linesman_config::fault::FaultName;
use linesman_config::inventory::Inventory;
use linesman_diagnosis::model::{Device, NetworkModel};
use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, PlaceReport};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;

use super::prose::plain;
use crate::command::scan::report::state_name;
use crate::drawing::{Label, Mark, Scene, State};
use crate::text::finding::percent;
use crate::text::names::Names;

/// The line as a diagnosis knows it, causes marked; `None` when its wiring is not known.
pub(crate) fn of_diagnosis<'a>(
    line: &'a NetworkModel,
    diagnosis: &Diagnosis,
    names: &Names,
) -> Option<Scene<'a>> {
    let tree = line.tree.as_ref()?;
    let boxes = line.devices.iter().map(|device| Label {
        name: device.name.clone().unwrap_or_default(),
        type_name: device.type_name.clone().unwrap_or_default(),
        state: state(device),
        is_missing: is_missing(&diagnosis.findings, device),
        rises: Port::ALL
            .into_iter()
            .map(|port| (port, errors_at(device, port)))
            .filter(|(_, errors)| *errors > 0)
            .collect(),
    });
    let marks = diagnosis.findings.iter().map(|finding| mark(finding, names));
    Some(Scene { tree, boxes: boxes.take(tree.len()).collect(), marks: marks.collect() })
}

/// What a scan found.
pub(crate) fn of_scan(inventory: &Inventory) -> Scene<'_> {
    let boxes = inventory.devices.iter().map(|found| {
        let value = found.al_status.state();
        let error = found.al_status.error();
        let name = state_name(found);
        let text = if error { format!("{name} 0x{:04X}", found.al_code.value()) } else { name };
        Label {
            name: String::new(),
            type_name: found.profile.type_name.clone(),
            state: Some(State { state: value.state(), text, error }),
            is_missing: false,
            rises: Vec::new(),
        }
    });
    Scene { tree: inventory.tree(), boxes: boxes.collect(), marks: Vec::new() }
}

/// The last state that was seen, or that it does not answer.
fn state(device: &Device) -> Option<State> {
    if device.silent.is_some() {
        return Some(State { state: None, text: "no answer".to_owned(), error: true });
    }
    let state = device.al.state()?;
    let error = device.al.has_error();
    let code =
        device.al.code.filter(|_| error).map(|code| format!(" 0x{:04X}", code.value.value()));
    let text = format!("{}{}", state.name(), code.unwrap_or_default());
    Some(State { state: Some(state), text, error })
}

/// Whether a finding that is not over says that the device is not there.
fn is_missing(findings: &[FindingReport], device: &Device) -> bool {
    findings.iter().any(|finding| {
        finding.cause == FaultName::DeviceMissing
            && finding.state != FindingState::Closed
            && matches!(finding.place, PlaceReport::Device { no, .. } if no == device.id.no())
    })
}

/// Damaged frames and symbols that were counted at a port meanwhile.
fn errors_at(device: &Device, port: Port) -> u64 {
    device.counters.rise(ErrorCounter::InvalidFrame(port))
        + device.counters.rise(ErrorCounter::PhysicalLayer(port))
}

fn mark(finding: &FindingReport, names: &Names) -> Mark {
    Mark {
        id: finding.id.clone(),
        severity: finding.severity,
        place: finding.place.clone(),
        title: plain(&format!(
            "{} {} {}: {}, {} ({})",
            finding.id,
            finding.code,
            finding.name,
            names.place(&finding.place),
            finding.cause,
            percent(finding.confidence)
        )),
    }
}
