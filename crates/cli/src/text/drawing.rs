//! Labels beside each SubDevice in a drawing.

use linesman_lab::drawing::Label;

use crate::files::Plant;

/// Names and types of a plant's SubDevices, by node of its tree.
pub(crate) fn labels(plant: &Plant) -> Vec<Label> {
    let label = |planned: Option<&linesman_config::project::ProjectDevice>| {
        planned.map_or_else(Label::default, |planned| Label {
            name: planned.name.clone(),
            type_name: planned.type_name.clone(),
        })
    };
    let devices = plant.segment.devices();
    devices.map(|device| label(plant.project.devices.get(device.index()))).collect()
}
