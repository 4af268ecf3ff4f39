//! Resolution of a project for the planner: each device with what its description says and what the
//! user chose, in processing order.

use linesman_proto::address::{RegisterAddress, StationAlias};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::mailbox::soe::{Idn, VALUE};
use linesman_proto::sii::Direction;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use super::{Project, ProjectDevice, ProjectError, Ring};
use crate::esi::value;
use crate::identity::RevisionRule;
use crate::plan::layout::PlanOptions;
use crate::plan::{
    AutomaticActions, DeviceSettings, IdentificationSource, Plan, PlanError, PlannedDevice,
};
use crate::profile::{DeviceProfile, MappedEntry, MappedPdo};
use crate::start_up::{StartUpAction, StartUpCommand, Transition};

/// A type of device as a description of its maker, or its SII, has it.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Described {
    /// What it needs.
    pub profile: DeviceProfile,
    /// What its maker wants it to be told.
    pub start_up: Vec<StartUpCommand>,
    /// Idents of the modules in its slots.
    pub modules: Vec<u32>,
    /// Vendor, product and revision.
    pub identity: Option<[u32; 3]>,
    /// How its maker wants revisions compared; `None` where nothing is said.
    pub revision_rule: Option<RevisionRule>,
    /// Its maker allows frames that are sent twice in a cycle.
    pub frame_repeat: bool,
    /// What of its description is not carried out, in words.
    pub notes: Vec<String>,
}

/// All that the planner needs.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// In processing order.
    pub devices: Vec<PlannedDevice>,
    /// Wiring, in the same order.
    pub tree: Tree,
    /// Choices.
    pub options: PlanOptions,
    /// For each device of the project, its place in processing order.
    pub places: Vec<usize>,
}

/// A project that cannot be planned.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ResolveError {
    /// The project contradicts itself.
    #[error(transparent)]
    Project(#[from] ProjectError),
    /// It names no SubDevice.
    #[error(
        "there is no [[device]] in it, and a plan needs one at least. Do: write down what is there with `linesman \
         scan WHERE --save FILE`, or add a [[device]]; `linesman schema project` lists all keys"
    )]
    Empty,
    /// Nothing is known of a device.
    #[error(
        "device `{device}`: nothing says what it needs. Do: name a folder of device descriptions (`esi = \
         [\"FOLDER\"]`) and its type or identity, or write [device.description], or save a scan of the line \
         (`linesman scan WHERE --save FILE`)"
    )]
    Unknown {
        /// Whose.
        device: String,
    },
    /// Its description cannot be found or used.
    #[error("device `{device}`: {reason}")]
    Description {
        /// Whose.
        device: String,
        /// Why.
        reason: String,
    },
    /// It cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

/// Finds what is known of a device; nothing, or why it cannot be used.
pub type Lookup<'a> = dyn FnMut(&ProjectDevice) -> Result<Option<Described>, String> + 'a;

impl Project {
    /// The plan. `lookup` finds descriptions of makers; what the project says itself comes first.
    ///
    /// # Errors
    /// [`ResolveError`] names the device.
    pub fn plan(&self, lookup: &mut Lookup<'_>) -> Result<Plan, ResolveError> {
        let resolved = self.resolve(lookup)?;
        Ok(Plan::build(&resolved.devices, resolved.tree, &resolved.options)?)
    }

    /// What the planner needs.
    ///
    /// # Errors
    /// [`ResolveError`] names the device.
    pub fn resolve(&self, lookup: &mut Lookup<'_>) -> Result<Resolved, ResolveError> {
        if self.devices.is_empty() {
            return Err(ResolveError::Empty);
        }
        let tree = self.tree()?;
        let mut devices = Vec::with_capacity(self.devices.len());
        let mut places = vec![0; self.devices.len()];
        for (place, &node) in tree.order().iter().enumerate() {
            let Some(device) = self.devices.get(node) else { continue };
            places[node] = place;
            let wrong = |reason| {
                let device = device.name.clone();
                ResolveError::Description { device, reason }
            };
            let known = match &device.description {
                Some(description) => {
                    let profile = description.profile(&device.type_name).map_err(wrong)?;
                    Some(Described { profile, ..Described::default() })
                }
                None => lookup(device).map_err(wrong)?,
            };
            let Some(known) = known else {
                return Err(ResolveError::Unknown { device: device.name.clone() });
            };
            let planned = self.planned(device, place, known);
            devices.push(planned.map_err(wrong)?);
        }
        let mut options = self.network.options(&self.tasks);
        options.groups = self.planned_groups(&tree, &places);
        options.time_source = self.planned_time(&places);
        options.ring_clocks = self.ring.as_ref().map(Ring::clocks).unwrap_or_default();
        Ok(Resolved { devices, tree: tree.in_processing_order(), options, places })
    }

    /// The cycle of the task that has a device.
    #[must_use]
    pub fn cycle_of(&self, device: &ProjectDevice) -> Span {
        let task = match &device.task {
            None => self.tasks.first(),
            Some(name) => self.tasks.iter().find(|task| task.name == *name),
        };
        task.map_or(PlanOptions::default().cycle, |task| Span::us(u64::from(task.cycle_us)))
    }

    fn planned(
        &self,
        device: &ProjectDevice,
        position: usize,
        known: Described,
    ) -> Result<PlannedDevice, String> {
        let Described {
            mut profile,
            mut start_up,
            modules,
            identity,
            revision_rule,
            frame_repeat,
            notes: _,
        } = known;
        if !device.type_name.is_empty() {
            profile.type_name.clone_from(&device.type_name);
        }
        map(device, &mut profile, &mut start_up)?;
        let for_time = self.pdos_for_time(device, &profile)?;
        let pdos = for_time.or_else(|| device.pdos.clone());
        assign(pdos.as_deref(), &mut profile, &mut start_up)?;
        self.check_time_stamps(device, &profile)?;
        if let Some(leader) = device.sync_leader {
            let comment = "side of the bridge that leads".to_owned();
            start_up.push(download(0x10F5, 1, vec![leader.code()], comment));
        }
        profile.measure();
        profile.sync_times = device.sync_times.or(profile.sync_times);
        start_up.extend(device.start_up.iter().filter_map(command));
        let clock = device.clock.as_ref();
        let clock = clock.map(|one| one.settings(&profile.clock_modes, self.cycle_of(device)));
        let identification = self.identification_of(device);
        let identification = identification
            .map(|choice| choice.planned(device, profile.identification))
            .transpose()?;
        // The number that a source of the EEPROM must tell, once more where that source is looked for.
        let of =
            |source| identification.filter(|check| check.source == source).map(|check| check.value);
        let alias = device.alias.or(of(IdentificationSource::Alias).map(|value| value as u16));
        let serial = device.serial.or(of(IdentificationSource::Serial));
        let settings = DeviceSettings {
            task: device.task.clone(),
            sync_unit: device.sync_unit.clone(),
            access: device.access.unwrap_or(self.network.access),
            frame_repeat: device.frame_repeat.unwrap_or(frame_repeat),
            addressing: device.addressing,
            alias: alias.map(StationAlias),
            identification,
            watchdog: device.watchdog.settings(),
            clock: clock.transpose()?,
            on_wrong_counter: device.on_wrong_counter.unwrap_or(self.network.on_wrong_counter),
            keeping: AutomaticActions {
                restore_state: device.restore_state.unwrap_or(self.network.restore_state),
                reinitialise: device.reinitialise.unwrap_or(self.network.reinitialise),
                clear_counters: device.clear_counters.unwrap_or(self.network.clear_counters),
                forward_ethernet: device.eoe.unwrap_or(self.network.eoe),
            },
            modules,
            net_id: None,
        };
        let [vendor, product, revision] = identity.unwrap_or_default();
        Ok(PlannedDevice {
            name: device.name.clone(),
            station: device.station_at(position),
            identity: linesman_proto::sii::Identity {
                vendor_id: device.vendor_id.unwrap_or(vendor),
                product_code: device.product_code.unwrap_or(product),
                revision: device.revision.unwrap_or(revision),
                serial_number: serial.unwrap_or(0),
            },
            revision_rule: match device.revision {
                Some(_) => device.revision_rule.or(revision_rule).unwrap_or_default(),
                None => RevisionRule::Any,
            },
            profile,
            target: device.target().unwrap_or(AlState::Op),
            start_up,
            settings,
        })
    }
}

/// A command of the project; those that make no sense were refused when it was read.
fn command(entry: &super::StartUpEntry) -> Option<StartUpCommand> {
    let data = value::bytes(&entry.data).ok()?;
    let action = match (entry.index, entry.register) {
        (None, None) => match (&entry.eoe, &entry.idn) {
            (None, None) => StartUpAction::set_net_id(entry.net_id.as_ref()?.parse().ok()?),
            (Some(choice), _) => StartUpAction::SetAddresses {
                port: choice.port,
                parameters: choice.parameters().ok()?,
            },
            (None, Some(idn)) => {
                let idn = Idn::from_text(idn)?;
                StartUpAction::WriteIdn { drive: entry.drive, idn, elements: VALUE, data }
            }
        },
        (Some(index), _) => StartUpAction::CoeDownload {
            object: ObjectAddress::new(index, entry.subindex),
            complete_access: entry.complete_access,
            data,
        },
        (None, Some(register)) => {
            StartUpAction::RegisterWrite { address: RegisterAddress(register), data }
        }
    };
    let transition = Transition::from_letters(&entry.transition)?;
    Some(StartUpCommand { transition, action, comment: entry.comment.clone() })
}

fn download(index: u16, subindex: u8, data: Vec<u8>, comment: String) -> StartUpCommand {
    StartUpCommand {
        transition: Transition::PRE_OP_TO_SAFE_OP,
        action: StartUpAction::CoeDownload {
            object: ObjectAddress::new(index, subindex),
            complete_access: false,
            data,
        },
        comment,
    }
}

/// A list in an object is written with its count at 0, and the count last (ETG.1000.6, 5.6).
fn list(index: u16, what: &str, entries: Vec<Vec<u8>>) -> Vec<StartUpCommand> {
    let mut commands = vec![download(index, 0, vec![0], format!("clear {what}"))];
    let count = entries.len() as u8;
    for (entry, subindex) in entries.into_iter().zip(1..) {
        commands.push(download(index, subindex, entry, format!("{what}, entry {subindex}")));
    }
    commands.push(download(index, 0, vec![count], format!("count of {what}")));
    commands
}

/// Other entries for PDOs.
fn map(
    device: &ProjectDevice,
    profile: &mut DeviceProfile,
    start_up: &mut Vec<StartUpCommand>,
) -> Result<(), String> {
    for mapping in &device.mappings {
        let all = profile.pdos.iter_mut().chain(&mut profile.spare_pdos);
        let Some(pdo) = all.into_iter().find(|pdo| pdo.index == mapping.pdo) else {
            return Err(format!("mapping: its description has no PDO 0x{:04X}", mapping.pdo));
        };
        pdo.entries = mapping.entries.iter().map(MappedEntry::from).collect();
        let entries = mapping.entries.iter().map(|entry| {
            let bits = u8::try_from(entry.bits).map_err(|_| {
                format!(
                    "mapping: PDO 0x{:04X} has an entry of {} bits, at most 255",
                    mapping.pdo, entry.bits
                )
            })?;
            let [low, high] = entry.index.to_le_bytes();
            Ok(vec![bits, entry.subindex, low, high])
        });
        let entries = entries.collect::<Result<Vec<_>, String>>()?;
        let what = format!("entries of PDO 0x{:04X}", mapping.pdo);
        start_up.extend(list(mapping.pdo, &what, entries));
    }
    Ok(())
}

/// The assignment of a SyncManager's PDOs.
const ASSIGNMENT: u16 = 0x1C10;

/// Other PDOs than those of the description.
fn assign(
    wanted: Option<&[u16]>,
    profile: &mut DeviceProfile,
    start_up: &mut Vec<StartUpCommand>,
) -> Result<(), String> {
    let Some(wanted) = wanted else { return Ok(()) };
    let all: Vec<MappedPdo> = profile.pdos.drain(..).chain(profile.spare_pdos.drain(..)).collect();
    let by_default = |direction| {
        let managers = profile.process.iter().find(|manager| manager.direction == direction);
        managers.map(|manager| manager.index)
    };
    let managers = [by_default(Direction::Outputs), by_default(Direction::Inputs)];
    for index in wanted {
        let Some(pdo) = all.iter().find(|pdo| pdo.index == *index) else {
            let has: Vec<_> = all.iter().map(|pdo| format!("0x{:04X}", pdo.index)).collect();
            let has = if has.is_empty() { "none".to_owned() } else { has.join(", ") };
            return Err(format!("pdos: its description has no PDO 0x{index:04X}; it has {has}"));
        };
        let mut pdo = pdo.clone();
        let serves = |manager: &crate::profile::ProcessSyncManager| {
            manager.index == pdo.sync_manager && manager.direction == pdo.direction
        };
        if !profile.process.iter().any(serves) {
            let manager = match pdo.direction {
                Direction::Outputs => managers[0],
                Direction::Inputs => managers[1],
            };
            pdo.sync_manager = manager
                .ok_or_else(|| format!("pdos: there is no SyncManager for PDO 0x{index:04X}"))?;
        }
        profile.pdos.push(pdo);
    }
    profile.spare_pdos = all.into_iter().filter(|pdo| !wanted.contains(&pdo.index)).collect();
    if profile.mailbox.is_some() {
        for manager in &profile.process {
            let mine = profile.pdos.iter().filter(|pdo| pdo.sync_manager == manager.index);
            let entries = mine.map(|pdo| pdo.index.to_le_bytes().to_vec()).collect();
            let what = format!("PDOs of SyncManager {}", manager.index);
            start_up.extend(list(ASSIGNMENT + u16::from(manager.index), &what, entries));
        }
    }
    Ok(())
}
