//! Facts that the frames do not show, with the reason and the step that would show them.

use linesman_diagnosis::model::{Device, NetworkModel};
use serde::{Deserialize, Serialize};

use super::image::ProcessImageReport;
use super::report::RecordingReport;
use crate::dialogue::FIRST_RAM;

/// Something that is not known.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct UnknownReport {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
    /// Numbers of the SubDevices that it is about; empty for the network as a whole.
    pub devices: Vec<u32>,
}

/// What, why, and whether it lacks of a SubDevice.
type LackRow = (&'static str, &'static str, fn(&Device) -> bool);

/// A fact that is not known of a network.
pub(crate) fn reports(
    model: &NetworkModel,
    recording: &RecordingReport,
    image: &[ProcessImageReport],
) -> Vec<UnknownReport> {
    let mut all = Vec::new();
    let mut note = |what: &str, why: &str, devices: Vec<u32>| {
        all.push(UnknownReport { what: what.to_owned(), why: why.to_owned(), devices });
    };
    match recording.ways.as_deref() {
        Some("requests") => note(
            "answers, working counters, losses",
            "the recording has no returns: record on a card that receives them",
            Vec::new(),
        ),
        Some("returns") => note(
            "response times, lost frames, positions that were asked for",
            "the recording has no requests: record both ways",
            Vec::new(),
        ),
        Some(_) | None => {}
    }
    let count = model.device_count();
    if count > model.devices.len() {
        note(
            "SubDevices one by one",
            "they were only counted by broadcasts: none was asked by its address",
            Vec::new(),
        );
    }
    let lacking = |lacks: fn(&Device) -> bool| -> Vec<u32> {
        let devices = model.devices.iter().filter(|device| lacks(device));
        devices.map(|device| device.id.no()).collect()
    };
    let began = "the capture began after the start-up";
    let start_up = |why: &'static str| if recording.began_in_run { began } else { why };
    let rows: [LackRow; 6] = [
        ("vendor and product", start_up("neither the SII nor object 0x1018 was read"), |device| {
            device.identity.product_code.is_none()
        }),
        (
            "type",
            start_up(
                "neither the names of the SII nor object 0x1008 were read: name a device \
                      description with --esi",
            ),
            |device| device.type_name.is_none(),
        ),
        ("station address", "none was written or answered to", |device| device.station.is_none()),
        ("ports", start_up("DL status (0x0110) was not read"), |device| device.dl.last.is_none()),
        ("state", "AL status (0x0130) was not read", |device| device.al.status.is_none()),
        ("error counters", "nobody read 0x0300 to 0x0313", |device| !device.counters.is_known()),
    ];
    for (what, why, lacks) in rows {
        let devices = lacking(lacks);
        if !devices.is_empty() {
            note(what, why, devices);
        }
    }
    if model.tree.is_none() && count > 1 {
        note("wiring", "it needs DL status of all SubDevices", Vec::new());
    }
    let is_mapped = model.devices.iter().any(|device| !device.fmmus.is_empty());
    if !model.cyclic.is_empty() && !is_mapped {
        note(
            "who owns which bytes of the process image",
            start_up("no FMMU was written"),
            Vec::new(),
        );
    }
    let nameless = nameless(image);
    if !nameless.is_empty() {
        note(
            "names of process data",
            "neither a PDO assignment with its mappings (CoE 0x1C10 and up) nor PDOs of the SII that fit to the \
             SyncManager were seen: name a device description with --esi",
            nameless,
        );
    }
    all
}

/// SubDevices with process data in memory of which no PDO is known. Registers have none.
fn nameless(image: &[ProcessImageReport]) -> Vec<u32> {
    let parts = image.iter().flat_map(|datagram| &datagram.parts);
    let nameless = parts.filter(|part| part.entries_by.is_none() && FIRST_RAM.0 <= part.physical);
    let mut all: Vec<u32> = nameless.map(|part| part.no).collect();
    all.sort_unstable();
    all.dedup();
    all
}
