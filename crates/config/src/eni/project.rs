//! A network configuration as a project: names, identities, station addresses and wiring.

use linesman_proto::address::Path;
use linesman_proto::topology::End;

use super::Eni;
use crate::attachment::Attachment;
use crate::project::{Project, ProjectDevice};

impl Eni {
    /// The project that says the same of the SubDevices; it chooses nothing. Where the file does not say how they are
    /// wired ([`Eni::is_wired`]), each hangs on port B of the one before it.
    #[must_use]
    pub fn project(&self) -> Project {
        let attachment = |end: Option<End>| match end {
            Some(End::Controller(node, port)) => {
                let name = self.plan.devices.get(node).map(|one| one.name.clone());
                Attachment::Device { name: name.unwrap_or_default(), port }
            }
            Some(End::MainDevice(path)) => Attachment::MainDevice(path),
            None => Attachment::MainDevice(Path::A),
        };
        let devices = self.plan.devices.iter().enumerate().map(|(node, device)| ProjectDevice {
            type_name: device.type_name.clone(),
            vendor_id: Some(device.identity.vendor_id),
            product_code: Some(device.identity.product_code),
            revision: Some(device.identity.revision),
            revision_rule: Some(device.revision_rule),
            entry: self.plan.tree.entry(node).to_string(),
            station: Some(device.station.0),
            ..ProjectDevice::at(&device.name, attachment(self.plan.tree.upstream(node)))
        });
        let name = self.name.clone();
        Project::of(&name, devices.collect())
    }

    /// What a project can say and this file does not, for people.
    #[must_use]
    pub fn lacks(&self) -> Vec<String> {
        let mut lacks = Vec::new();
        if !self.is_wired {
            lacks.push(
                "the wiring (no PreviousPort): each SubDevice is written behind port B of the one before it; \
                 correct `on` where that is not so"
                    .to_owned(),
            );
        }
        let untyped = self.plan.devices.iter().filter(|device| device.type_name.is_empty());
        let untyped = untyped.count();
        if untyped > 0 {
            lacks.push(format!("the order designation (`type`) of {untyped} of its SubDevices"));
        }
        lacks.push(
            "station aliases, the second card of a ring, E-bus currents and kinds of ports: add `alias`, `[ring]` and \
             `esi` where they matter"
                .to_owned(),
        );
        lacks
    }
}
