//! Places that the steps of a story name: links, directions of them, SubDevices.

use linesman_config::attachment::Attachment;
use linesman_proto::address::DeviceId;
use linesman_proto::topology::End;

use crate::lab::Lab;
use crate::verdict::Site;

/// The place that a text names.
pub(super) fn site(lab: &Lab, text: &str) -> Result<Site, String> {
    let unknown = |name: &str| format!("no SubDevice of this line is called `{name}`");
    match text {
        "host" => return Ok(Site::Host),
        "network" => return Ok(Site::Network),
        _ => {}
    }
    if let Some(name) = text.strip_prefix("device ") {
        return device(lab, name).map(Site::Device).ok_or_else(|| unknown(name));
    }
    let tree = lab.tree();
    // Names may hold `-`, so every way of parting the text is tried.
    for (at, separator) in text.match_indices(['>', '-']) {
        let (one, other) = (&text[..at], &text[at + 1..]);
        if let (Some(one), Some(other)) = (end(lab, one), end(lab, other)) {
            return Ok(match separator {
                ">" => Site::hop(tree, one, other),
                _ => Site::link(tree, one, other),
            });
        }
    }
    Err(format!(
        "`{text}` is no place of this line: expected `K1.C-B3.A`, `K1.C>B3.A`, `device K1`, \
         `host` or `network`"
    ))
}

fn end(lab: &Lab, text: &str) -> Option<End<DeviceId>> {
    match text.parse().ok()? {
        Attachment::MainDevice(path) => Some(End::MainDevice(path)),
        Attachment::Device { name, port } => device(lab, &name).map(|id| End::Controller(id, port)),
    }
}

/// The SubDevice that is called so in the project, or has this number in the diagnosis: one that was not planned has no name
/// there.
pub(super) fn device(lab: &Lab, name: &str) -> Option<DeviceId> {
    let named = lab.project().devices.iter().position(|device| device.name == name);
    match named {
        Some(at) => Some(DeviceId(at as u32)),
        None => DeviceId::from_no(name.parse().ok()?),
    }
}
