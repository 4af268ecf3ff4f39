//! Evidence that no verdict hangs on: identities, wiring, mailboxes, clocks, the computer.

use super::signal::host_step;
use super::{Assessment, Basis, Extent, Gap, InputKind, Reason, Subject};
use crate::finding::Place;
use crate::model::Device;

/// The next step that gets a plan to hold the line against.
const NAME_PROJECT: &str = "name what was planned: `--project machine.toml`, or an ENI";

/// Identities against the project.
pub(super) fn identity(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Identity);
    let model = basis.model;
    let is_planned = |one: &&Device| one.planned.is_some_and(|planned| planned.identity.is_some());
    if model.devices.iter().find(is_planned).is_none() {
        let text = "nothing says which SubDevices were planned";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoProject, text).step(NAME_PROJECT));
        return all;
    }
    let planned = model.devices.iter().filter(is_planned);
    let unread: Vec<Place> = planned
        .filter(|one| one.identity.identity().is_none())
        .map(|one| Place::device(model.network, one.id))
        .collect();
    if !unread.is_empty() {
        let text = format!("the identities of {} SubDevices were not read", unread.len());
        let gap = Gap::new(Reason::NoBringUp, text).at(unread).step(match basis.input {
            InputKind::Driven => "let the SIIs be read: `linesman scan WHERE`",
            InputKind::Listened | InputKind::Recorded => "record from the start of the MainDevice",
            InputKind::ReadOut | InputKind::Typed => {
                "compare with `linesman scan WHERE --against machine.toml`"
            }
        });
        all.lacks(Extent::InPart, gap);
    }
    all
}

/// Wiring against the project.
pub(super) fn wiring(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Wiring);
    let model = basis.model;
    if model.devices.is_empty() {
        let text = "no SubDevice was seen, so there is no wiring to compare";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NumberUnknown, text));
    } else if !model.tree_is_planned {
        let text = "nothing says which wiring was planned";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoProject, text).step(NAME_PROJECT));
    } else if model.devices.iter().any(|one| one.dl.first.is_none() || one.dl.is_assumed) {
        let text = "the open ports of some SubDevices were not read";
        all.lacks(Extent::InPart, Gap::new(Reason::LinkStatusNotRead, text));
    }
    all
}

/// Mailboxes.
pub(super) fn mailboxes(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Mailboxes);
    if basis.model.devices.iter().all(|one| one.mailbox.polled.is_none()) {
        let text = "nobody read a mailbox";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoMailboxRequests, text));
    }
    all
}

/// Distributed clocks.
pub(super) fn clocks(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Clocks);
    let model = basis.model;
    let is_in_step = |one: &&Device| one.sync_on.is_some_and(|on| on.value);
    let unread: Vec<Place> = model
        .devices
        .iter()
        .filter(is_in_step)
        .filter(|one| !one.clock.is_known())
        .map(|one| Place::device(model.network, one.id))
        .collect();
    let was_bring_up_seen = model.devices.iter().any(|one| one.al.requested.is_some());
    if !unread.is_empty() {
        let text = format!(
            "the clocks of {} SubDevices were never compared with the reference clock",
            unread.len()
        );
        let gap = Gap::new(Reason::ClocksNotRead, text)
            .at(unread)
            .step("read the difference to the system time, 0x092C, of each SubDevice");
        all.lacks(Extent::InPart, gap);
    } else if !was_bring_up_seen && !model.devices.iter().any(|one| one.clock.is_known()) {
        let text = "whether SubDevices keep step with a clock was not seen";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoBringUp, text));
    }
    all
}

/// The computer of the MainDevice.
pub(super) fn host(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Host);
    if !basis.model.host.is_watched {
        let text = "the counters of the MainDevice's card are not known";
        let gap = Gap::new(Reason::HostCountersMissing, text).step(host_step(basis));
        all.lacks(Extent::NotJudged, gap);
    }
    all
}
