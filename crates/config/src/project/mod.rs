//! Project: the user's file with what is wanted.
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

mod choice;
mod choose;
mod description;
mod device;
pub mod ethernet;
mod from_esi;
mod gateway;
mod group;
mod resolve;
mod ring;
mod time;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use linesman_proto::address::{Path, StationAddress};
use linesman_proto::topology::{End, Tree, Wired, WiringError};
use serde::{Deserialize, Serialize};

use crate::attachment::Attachment;
use crate::inventory::Inventory;
use crate::plan::AddressingChoice;

pub use choice::{
    ClockChoice, Mapping, Network, ProjectTask, StartUpEntry, TaskPurpose, WatchdogChoice,
};
pub use description::{
    DescribedEntry, DescribedMailbox, DescribedPdo, DescribedSyncManager, Description, FmmuWord,
    Way,
};
pub use device::ProjectDevice;
pub use ethernet::EthernetChoice;
pub use gateway::ProjectGateway;
pub use group::{IdentificationChoice, IdentificationWay, ProjectGroup};
pub use resolve::{Described, Lookup, ResolveError, Resolved};
pub use ring::Ring;
pub use time::{SyncLeader, TimeChoice, TimeStampForm};

/// A project.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// What the machine is called.
    #[serde(default)]
    pub name: String,
    /// Folders and files with device descriptions of makers (ESI), relative to the project.
    #[serde(default)]
    pub esi: Vec<String>,
    /// The network as a whole.
    #[serde(default)]
    pub network: Network,
    /// Tasks, the first of which has all devices that do not say otherwise; one of 1 ms unless said.
    #[serde(default, rename = "task")]
    pub tasks: Vec<ProjectTask>,
    /// Its SubDevices, in the order of their numbers.
    #[serde(default, rename = "device")]
    pub devices: Vec<ProjectDevice>,
    /// Devices that are plugged in and out together while the network runs.
    #[serde(default, rename = "group")]
    pub groups: Vec<ProjectGroup>,
    /// Where a second card closes a ring, if it does.
    #[serde(default)]
    pub ring: Option<Ring>,
    /// The mailbox gateway of its runs, if they have one.
    #[serde(default)]
    pub gateway: Option<ProjectGateway>,
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
    /// Two tasks bear the same name.
    #[error("two tasks are called `{name}`: give each a name of its own")]
    TaskTwice {
        /// The name.
        name: String,
    },
    /// A device is in a task that is not there.
    #[error("device `{device}` is in the task `{task}`, but there is no [[task]] of that name")]
    UnknownTask {
        /// Whose.
        device: String,
        /// The unknown name.
        task: String,
    },
    /// A value that makes no sense.
    #[error("{whose}: {reason}")]
    Value {
        /// Of which task or device.
        whose: String,
        /// What was expected.
        reason: String,
    },
    /// The places contradict each other.
    #[error("the wiring does not fit together: {0}")]
    Wiring(String),
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
        project.check()?;
        project.check_groups(text)?;
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
            let described = Description::of(&found.profile);
            ProjectDevice {
                name: found.label(),
                type_name: found.profile.type_name.clone(),
                vendor_id: identity.map(|identity| identity.vendor_id),
                product_code: identity.map(|identity| identity.product_code),
                revision: identity.map(|identity| identity.revision),
                entry: tree.entry(node).to_string(),
                station: (found.station.0 != 0).then_some(found.station.0),
                alias: (found.alias.0 != 0).then_some(found.alias.0),
                description: (described != Description::default()).then_some(described),
                ..ProjectDevice::at(
                    "",
                    attachment(tree.upstream(node).unwrap_or(End::MainDevice(Path::A))),
                )
            }
        });
        let ring = tree
            .closes_at()
            .map(|(node, port)| Ring::closing_at(Attachment::Device { name: label(node), port }));
        let devices = devices.collect();
        Self { ring, ..Self::of(name, devices) }
    }

    /// A project of these devices with nothing special.
    #[must_use]
    pub fn of(name: &str, devices: Vec<ProjectDevice>) -> Self {
        let (esi, network, tasks, ring) = (Vec::new(), Network::default(), Vec::new(), None);
        let groups = Vec::new();
        Self { name: name.to_owned(), esi, network, tasks, devices, groups, ring, gateway: None }
    }

    /// Whether it says more than who is where, and what that is: tasks, settings, descriptions of makers.
    #[must_use]
    pub fn chooses(&self) -> bool {
        !self.esi.is_empty()
            || !self.tasks.is_empty()
            || !self.groups.is_empty()
            || self.network != Network::default()
            || self.devices.iter().any(ProjectDevice::chooses)
    }

    /// Whether what refers to something refers to something that is there, and numbers make sense.
    fn check(&self) -> Result<(), ProjectError> {
        let value = |whose: String, reason: &str| {
            Err(ProjectError::Value { whose, reason: reason.to_owned() })
        };
        for (at, task) in self.tasks.iter().enumerate() {
            if self.tasks[..at].iter().any(|other| other.name == task.name) {
                return Err(ProjectError::TaskTwice { name: task.name.clone() });
            }
            let whose = format!("task `{}`", task.name);
            if task.cycle_us == 0 {
                return value(whose, "cycle_us is 0, expected a cycle time in µs");
            }
            if task.pre_ticks > 0 && !task.separate_inputs {
                return value(whose, "pre_ticks needs separate_inputs = true");
            }
            let ahead = u64::from(task.pre_ticks) * u64::from(self.network.base_time_us);
            if ahead >= u64::from(task.cycle_us) {
                let reason = "pre_ticks times base_time_us is a whole cycle or more";
                if task.pre_ticks > 0 {
                    return value(whose, reason);
                }
            }
            if task.repeats > MOST_REPEATS {
                return value(whose, "repeats is above 3");
            }
        }
        if self.network.base_time_us == 0 {
            return value("network".to_owned(), "base_time_us is 0, expected a time in µs");
        }
        if let Some(Err(reason)) = self.ring.as_ref().map(Ring::pair) {
            return Err(ProjectError::Value { whose: "[ring]".to_owned(), reason });
        }
        let mut stations = BTreeMap::new();
        for (device, station) in self.devices.iter().zip(self.stations()) {
            if let Some(task) = &device.task
                && !self.tasks.iter().any(|known| known.name == *task)
            {
                let (device, task) = (device.name.clone(), task.clone());
                return Err(ProjectError::UnknownTask { device, task });
            }
            let station = station.0;
            if let Some(other) = stations.insert(station, &device.name) {
                let whose = format!("device `{}`", device.name);
                let reason =
                    format!("station address 0x{station:04X} is that of `{other}` already");
                return Err(ProjectError::Value { whose, reason });
            }
            device.check()?;
        }
        self.check_time()?;
        self.check_aliases(&stations)
    }

    /// Whether the second addresses by which SubDevices are looked for are theirs alone.
    fn check_aliases(&self, stations: &BTreeMap<u16, &String>) -> Result<(), ProjectError> {
        let mut aliases = BTreeMap::new();
        let by_alias = |device: &&ProjectDevice| device.addressing == AddressingChoice::Alias;
        for device in self.devices.iter().filter(by_alias) {
            let Some(alias) = device.alias else { continue };
            let station = stations.get(&alias).filter(|other| **other != &device.name);
            let other = aliases.insert(alias, &device.name).or(station.copied());
            if let Some(other) = other {
                let whose = format!("device `{}`", device.name);
                let reason = format!(
                    "alias {alias} (0x{alias:04X}) is an address of `{other}` too: by it alone neither can \
                     be found"
                );
                return Err(ProjectError::Value { whose, reason });
            }
        }
        Ok(())
    }

    /// The station addresses of the devices, in their order in the project: those that are given, and else by their
    /// positions in the order of frames, as MainDevices count them. Where the wiring contradicts itself, by the order in
    /// the project.
    #[must_use]
    pub fn stations(&self) -> Vec<StationAddress> {
        let mut positions: Vec<usize> = (0..self.devices.len()).collect();
        if let Ok(tree) = self.tree() {
            for (position, node) in tree.order().iter().enumerate() {
                if let Some(known) = positions.get_mut(*node) {
                    *known = position;
                }
            }
        }
        let devices = self.devices.iter().zip(positions);
        devices.map(|(device, position)| device.station_at(position)).collect()
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
        Tree::from_wiring(&wired, closes_at)
            .map_err(|wrong| ProjectError::Wiring(self.wiring_in_words(wrong)))
    }

    /// Names for the numbers of a wiring that does not fit together.
    fn wiring_in_words(&self, wrong: WiringError) -> String {
        let name = |node: usize| self.devices.get(node).map_or("?", |device| device.name.as_str());
        let end_name = |end: End| match end {
            End::MainDevice(path) => Attachment::MainDevice(path).to_string(),
            End::Controller(node, port) => format!("{}.{port}", name(node)),
        };
        match wrong {
            WiringError::NoSuchController { .. } => wrong.to_string(),
            WiringError::WiredTwice { end, first, second } => format!(
                "`{}` is wired twice, to `{}` and `{}`: move one of them",
                end_name(end),
                name(first),
                name(second)
            ),
            WiringError::OnEntry { node, port, child } => format!(
                "device `{}` is wired to `{}.{port}`, the port where frames enter `{}`",
                name(child),
                name(node),
                name(node)
            ),
            WiringError::Detached { node } => format!(
                "device `{}` is not connected to the MainDevice: its wiring runs in a circle",
                name(node)
            ),
            WiringError::RingTaken { node, port, taken } => format!(
                "the ring cannot close at `{}.{port}`: `{}` is wired already",
                name(node),
                end_name(taken)
            ),
        }
    }

    /// The file that reads back as this project.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut text = format!("name = {}\n", quoted(&self.name));
        if !self.esi.is_empty() {
            let _ = writeln!(text, "esi = {}", inline(&self.esi));
        }
        if self.network != Network::default() {
            let _ = writeln!(text, "\n[network]\n{}", lines(&self.network));
        }
        for task in &self.tasks {
            let _ = writeln!(text, "\n[[task]]\n{}", lines(task));
        }
        if let Some(ring) = &self.ring {
            let _ = writeln!(text, "\n[ring]\n{}", lines(ring));
        }
        for device in &self.devices {
            device.write(&mut text);
        }
        for group in &self.groups {
            let _ = writeln!(text, "\n[[group]]\n{}", device::inline_lines(group));
        }
        text
    }
}

/// Most copies of a frame beside the first.
const MOST_REPEATS: u8 = 3;

/// A value on one line.
fn inline<T: Serialize>(value: &T) -> String {
    toml::Value::try_from(value).map_or_else(|_| String::new(), |value| value.to_string())
}

/// The keys of a table, one a line.
fn lines<T: Serialize>(value: &T) -> String {
    toml::to_string(value).unwrap_or_default().trim_end().to_owned()
}

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::RevisionRule;
    use linesman_proto::address::StationAddress;
    use linesman_proto::port::Port;

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
        assert_eq!(project.stations(), [0x1001, 0x1002, 0x2000].map(StationAddress));
        assert_eq!(project.devices[1].identity(), None);
        assert_eq!(project.devices[1].rule(), RevisionRule::Any, "no revision to compare");
    }

    #[test]
    fn stations_follow_the_order_of_frames_and_not_of_the_file() {
        let text = "name = \"p\"\n[[device]]\nname = \"K1\"\non = \"maindevice\"\n[[device]]\nname = \"K3\"\n\
                    on = \"K1.C\"\n[[device]]\nname = \"T2\"\non = \"K1.B\"\n";
        let project = Project::parse(text).unwrap();
        assert_eq!(project.stations(), [0x1001, 0x1003, 0x1002].map(StationAddress));
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

    const CHOICES: &str = r#"
name = "machine"
esi = ["descriptions"]

[network]
layout = "compact"
on_wrong_counter = "clear"

[[task]]
name = "fast"
cycle_us = 500
separate_inputs = true
pre_ticks = 1

[[device]]
name = "Drive"
on = "maindevice"
state = "SAFEOP"
task = "fast"
sync_unit = "axes"
access = "separate"
frame_repeat = true
addressing = "alias"
alias = 4711
watchdog = { process_data = 500 }
clock = { assign_activate = 0x0700, sync0_cycle_us = 500, reference = true }
pdos = [0x1601, 0x1A00]
modules = ["", "M2"]

[[device.mapping]]
pdo = 0x1601
entries = [{ index = 0x6040, bits = 16, name = "Control" }, { index = 0x607A, bits = 32, type = "DINT" }]

[[device.start_up]]
transition = "PS"
index = 0x6060
data = "08"
comment = "mode"

[device.description]
ebus_current_ma = 120
ports = "YY"
mailbox = { receive = [0x1000, 128], send = [0x1080, 128], protocols = ["CoE"] }
sync_managers = [
    { index = 2, direction = "outputs", start = 0x1100, control = 0x64 },
    { index = 3, direction = "inputs", start = 0x1400, control = 0x20 },
]
pdos = [
    { index = 0x1600, direction = "outputs", sync_manager = 2, entries = [{ index = 0x6040, bits = 16 }] },
    { index = 0x1601, direction = "outputs" },
    { index = 0x1A00, direction = "inputs", sync_manager = 3, entries = [{ index = 0x6041, bits = 16, name = "Status" }] },
]
"#;

    #[test]
    fn choices_read_and_write_themselves() {
        let text = CHOICES.replace("pre_ticks = 1", "pre_ticks = 0");
        let project = Project::parse(&text).unwrap();
        assert_eq!(Project::parse(&project.to_toml()), Ok(project.clone()));
        assert!(project.chooses() && !Project::parse(PLANT).unwrap().chooses());
        let broken =
            |from: &str, to: &str| Project::parse(&text.replace(from, to)).unwrap_err().to_string();
        for (from, to, expected) in [
            ("task = \"fast\"", "task = \"slow\"", "no [[task]] of that name"),
            ("state = \"SAFEOP\"", "state = \"RUN\"", "expected INIT, PREOP, SAFEOP, OP or BOOT"),
            ("transition = \"PS\"", "transition = \"X\"", "letters I, P, S, O, B"),
            ("data = \"08\"", "data = \"8\"", "two for each byte"),
            ("cycle_us = 500", "cycle_us = 0", "expected a cycle time"),
            ("index = 0x6060", "", "one of `index`, `register`, `idn`, `eoe` and `net_id`"),
            ("layout = \"compact\"", "layout = \"tight\"", "unknown variant `tight`"),
            (
                "watchdog = { process_data",
                "watchdog = { proces_data",
                "unknown field `proces_data`",
            ),
        ] {
            let error = broken(from, to);
            assert!(error.contains(expected), "{to}: {error}");
        }
    }

    #[test]
    fn chosen_pdos_are_planned_assigned_and_mapped() {
        let text = CHOICES.replace("separate_inputs = true\npre_ticks = 1\n", "");
        let project = Project::parse(&text).unwrap();
        let plan = project.plan(&mut |_| Ok(None)).unwrap();
        assert_eq!((plan.outputs_len, plan.inputs_len), (6, 2));
        let names: Vec<&str> = plan.variables.iter().map(|one| one.name.as_str()).collect();
        assert_eq!(names.last(), Some(&"Status"));
        let told: Vec<String> = plan.devices[0].start_up.iter().map(ToString::to_string).collect();
        let all = told.join("\n");
        // The mapping, the assignment of both SyncManagers, and the user's own command at the end.
        for expected in ["10 00 40 60", "20 00 7A 60", "01 16", "00 1A"] {
            assert!(all.contains(expected), "{expected}: {all}");
        }
        assert!(told.last().unwrap().contains("(mode)"), "{all}");
        let device = &plan.devices[0];
        assert_eq!(device.settings.on_wrong_counter, crate::plan::OnWrongCounter::Clear);
        assert_eq!(device.target, linesman_proto::state::AlState::SafeOp);
        let wrong = text.replace("pdos = [0x1601, 0x1A00]", "pdos = [0x1605]");
        let error = Project::parse(&wrong).unwrap().plan(&mut |_| Ok(None)).unwrap_err();
        assert!(error.to_string().contains("no PDO 0x1605; it has 0x1600"), "{error}");
    }
}
