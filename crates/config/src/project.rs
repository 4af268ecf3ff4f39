//! What was wanted: the user's project file.
//!
//! ```toml
//! name = "machine"
//!
//! [[device]]
//! name = "K1"
//! type = "EK1100"
//! vendor_id = 2
//! product_code = 0x044C2C52
//! revision = 0x00120000
//! on = "maindevice"
//! ```
//!
//! Unknown keys are errors. The order of devices is the order of their numbers.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use linesman_proto::address::{DeviceId, Path, StationAddress};
use linesman_proto::port::Port;
use linesman_proto::sii::Identity;
use linesman_proto::topology::{End, Tree, Wired, WiringError};
use serde::{Deserialize, Serialize};

use crate::attachment::Attachment;
use crate::identity::RevisionRule;
use crate::inventory::Inventory;

/// A project.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// What the machine is called.
    #[serde(default)]
    pub name: String,
    /// Its SubDevices, in the order of their numbers.
    #[serde(default, rename = "device")]
    pub devices: Vec<ProjectDevice>,
    /// Where a second card closes a ring, if it does.
    #[serde(default)]
    pub ring: Option<Ring>,
}

/// The far end of a ring.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// The port that is wired to the second card, such as `B9.B`.
    pub closes_at: Attachment,
}

/// A SubDevice of a project.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProjectDevice {
    /// Unique name.
    pub name: String,
    /// Order designation, such as `EL2004`; for people.
    #[serde(default, rename = "type")]
    pub type_name: String,
    /// Vendor; with `product_code`, what is compared.
    #[serde(default)]
    pub vendor_id: Option<u32>,
    /// Product code.
    #[serde(default)]
    pub product_code: Option<u32>,
    /// Revision number.
    #[serde(default)]
    pub revision: Option<u32>,
    /// How the revision is compared.
    #[serde(default)]
    pub revision_rule: RevisionRule,
    /// Serial number; not compared when absent.
    #[serde(default)]
    pub serial: Option<u32>,
    /// Whose port it hangs on: `maindevice` or a device's name and port.
    pub on: Attachment,
    /// The port by which it is entered, `A` unless said.
    #[serde(default = "port_a")]
    #[schemars(regex(pattern = "^[A-D]$"))]
    pub entry: String,
    /// Station address; 0x1001 and up in order unless said.
    #[serde(default)]
    pub station: Option<u16>,
}

fn port_a() -> String {
    "A".to_owned()
}

/// A project that cannot be used.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ProjectError {
    /// Not TOML, or not of this form.
    #[error("{0}")]
    Form(String),
    /// Two devices bear the same name.
    #[error("two devices are called `{name}`: give each a name of its own")]
    NameTwice {
        /// The name.
        name: String,
    },
    /// A place refers to a device that is not there.
    #[error("device `{device}` hangs on `{on}`, but no device is called `{on}`")]
    UnknownDevice {
        /// Whose place it is.
        device: String,
        /// The unknown name.
        on: String,
    },
    /// Not a port.
    #[error("device `{device}` is entered by port `{entry}`: expected A, B, C or D")]
    NoPort {
        /// Whose.
        device: String,
        /// What was written.
        entry: String,
    },
    /// The places contradict each other.
    #[error("the wiring does not fit together: {0}")]
    Wiring(WiringError),
}

impl Project {
    /// Reads a project file and checks that its wiring fits together.
    ///
    /// # Errors
    /// [`ProjectError`]: line and column for what is not TOML or not expected, else the device.
    pub fn parse(text: &str) -> Result<Self, ProjectError> {
        let project: Self =
            toml::from_str(text).map_err(|error| ProjectError::Form(error.to_string()))?;
        project.tree()?;
        Ok(project)
    }

    /// The project that describes what was found.
    #[must_use]
    pub fn from_inventory(name: &str, inventory: &Inventory) -> Self {
        let tree = inventory.tree();
        let label = |node: usize| inventory.devices[node].label();
        let attachment = |end: End| match end {
            End::MainDevice(path) => Attachment::MainDevice(path),
            End::Controller(node, port) => Attachment::Device { name: label(node), port },
        };
        let devices = inventory.devices.iter().enumerate().map(|(node, found)| {
            let identity = found.identity;
            ProjectDevice {
                name: found.label(),
                type_name: found.profile.type_name.clone(),
                vendor_id: identity.map(|identity| identity.vendor_id),
                product_code: identity.map(|identity| identity.product_code),
                revision: identity.map(|identity| identity.revision),
                revision_rule: RevisionRule::Equal,
                serial: None,
                on: attachment(tree.upstream(node).unwrap_or(End::MainDevice(Path::A))),
                entry: tree.entry(node).to_string(),
                station: (found.station.0 != 0).then_some(found.station.0),
            }
        });
        let ring = tree
            .closes_at()
            .map(|(node, port)| Ring { closes_at: Attachment::Device { name: label(node), port } });
        Self { name: name.to_owned(), devices: devices.collect(), ring }
    }

    /// How the devices are wired; node *n* is device *n*.
    ///
    /// # Errors
    /// [`ProjectError`] when names, ports or places contradict each other.
    pub fn tree(&self) -> Result<Tree, ProjectError> {
        let mut nodes = BTreeMap::new();
        for (node, device) in self.devices.iter().enumerate() {
            if nodes.insert(device.name.as_str(), node).is_some() {
                return Err(ProjectError::NameTwice { name: device.name.clone() });
            }
        }
        let resolve = |device: &str, on: &Attachment| match on {
            Attachment::MainDevice(path) => Ok(End::MainDevice(*path)),
            Attachment::Device { name, port } => match nodes.get(name.as_str()) {
                Some(node) => Ok(End::Controller(*node, *port)),
                None => {
                    Err(ProjectError::UnknownDevice { device: device.to_owned(), on: name.clone() })
                }
            },
        };
        let mut wired = Vec::with_capacity(self.devices.len());
        for device in &self.devices {
            let on = resolve(&device.name, &device.on)?;
            wired.push(Wired { on, entry: device.entry_port()? });
        }
        let closes_at = match &self.ring {
            None => None,
            Some(ring) => match resolve("ring", &ring.closes_at)? {
                End::Controller(node, port) => Some((node, port)),
                End::MainDevice(_) => None,
            },
        };
        Tree::from_wiring(&wired, closes_at).map_err(ProjectError::Wiring)
    }

    /// The file that reads back as this project.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut text = format!("name = {}\n", quoted(&self.name));
        if let Some(ring) = &self.ring {
            let _ = write!(text, "\n[ring]\ncloses_at = {}\n", quoted(&ring.closes_at.to_string()));
        }
        for device in &self.devices {
            device.write(&mut text);
        }
        text
    }
}

impl ProjectDevice {
    /// Who it must be; `None` when the project does not say.
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        Some(Identity {
            vendor_id: self.vendor_id?,
            product_code: self.product_code?,
            revision: self.revision.unwrap_or(0),
            serial_number: self.serial.unwrap_or(0),
        })
    }

    /// How its revision is compared: not at all when none was given.
    #[must_use]
    pub const fn rule(&self) -> RevisionRule {
        match self.revision {
            Some(_) => self.revision_rule,
            None => RevisionRule::Any,
        }
    }

    /// The station address it is to have.
    #[must_use]
    pub fn station(&self, id: DeviceId) -> StationAddress {
        StationAddress(self.station.unwrap_or(0x1000_u16.wrapping_add(id.no() as u16)))
    }

    fn entry_port(&self) -> Result<Port, ProjectError> {
        let mut letters = self.entry.chars();
        match (letters.next().and_then(Port::from_letter), letters.next()) {
            (Some(port), None) => Ok(port),
            (Some(_) | None, _) => {
                Err(ProjectError::NoPort { device: self.name.clone(), entry: self.entry.clone() })
            }
        }
    }

    fn write(&self, text: &mut String) {
        let mut line = |key: &str, value: String| {
            let _ = writeln!(text, "{key} = {value}");
        };
        line("\n[[device]]\nname", quoted(&self.name));
        line("type", quoted(&self.type_name));
        let hex = |value: u32| format!("0x{value:08X}");
        if let Some(vendor_id) = self.vendor_id {
            line("vendor_id", hex(vendor_id));
        }
        if let Some(product_code) = self.product_code {
            line("product_code", hex(product_code));
        }
        if let Some(revision) = self.revision {
            line("revision", hex(revision));
        }
        if self.revision_rule != RevisionRule::Equal {
            line(
                "revision_rule",
                toml::Value::try_from(self.revision_rule)
                    .map_or_else(|_| quoted("equal"), |rule| rule.to_string()),
            );
        }
        if let Some(serial) = self.serial {
            line("serial", serial.to_string());
        }
        line("on", quoted(&self.on.to_string()));
        if self.entry != "A" {
            line("entry", quoted(&self.entry));
        }
        if let Some(station) = self.station {
            line("station", format!("0x{station:04X}"));
        }
    }
}

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANT: &str = r#"
name = "plant \"7\""

[ring]
closes_at = "Box.B"

[[device]]
name = "K1"
type = "EK1100"
vendor_id = 2
product_code = 0x044C2C52
revision = 0x00120000
on = "maindevice"

[[device]]
name = "Term 2 (EL1008)"
on = "K1.B"
revision_rule = "high-word-equal-or-greater"

[[device]]
name = "Box"
on = "K1.C"
entry = "A"
station = 0x2000
serial = 4711
"#;

    #[test]
    fn a_project_reads_and_writes_itself() {
        let project = Project::parse(PLANT).unwrap();
        assert_eq!(Project::parse(&project.to_toml()), Ok(project.clone()));
        let tree = project.tree().unwrap();
        assert_eq!(tree.upstream(1), Some(End::Controller(0, Port::B)));
        assert_eq!(tree.closes_at(), Some((2, Port::B)));
        assert_eq!(project.devices[0].station(DeviceId(0)), StationAddress(0x1001));
        assert_eq!(project.devices[2].station(DeviceId(2)), StationAddress(0x2000));
        assert_eq!(project.devices[1].identity(), None);
        assert_eq!(project.devices[1].rule(), RevisionRule::Any, "no revision to compare");
    }

    #[test]
    fn mistakes_are_named() {
        let broken = |from: &str, to: &str| {
            Project::parse(&PLANT.replace(from, to)).unwrap_err().to_string()
        };
        let table = [
            ("product_code", "productcode", "unknown field `productcode`"),
            ("\"K1.B\"", "\"K9.B\"", "no device is called `K9`"),
            ("\"K1.B\"", "\"K1.E\"", "ports A, B, C, D"),
            ("name = \"Box\"", "name = \"K1\"", "two devices are called `K1`"),
            ("entry = \"A\"", "entry = \"X\"", "expected A, B, C or D"),
            ("\"K1.C\"", "\"K1.B\"", "K1"),
        ];
        for (from, to, expected) in table.into_iter().take(5) {
            let error = broken(from, to);
            assert!(error.contains(expected), "{to}: {error}");
        }
        assert!(broken("\"K1.C\"", "\"K1.B\"").contains("does not fit together"));
        assert!(broken("vendor_id = 2", "vendor_id = \"x\"").contains("line 10"), "line is named");
    }
}
