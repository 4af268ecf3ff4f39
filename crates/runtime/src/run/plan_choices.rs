//! Choices beside a project, and the plan made of project and scan.

use linesman_config::identity::{mismatch, text};
use linesman_config::inventory::Inventory;
use linesman_config::plan::time_source::{PTP_TERMINAL, is_type};
use linesman_config::plan::{Plan, PlanOptions, PlannedDevice, TimeSource};
use linesman_config::profile::ClockMode;
use linesman_config::project::{ClockChoice, Project};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use linesman_session::{MakePlan, PlanSource};

/// Choices beside the project.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlanChoices {
    /// The state that SubDevices are driven to.
    pub target: AlState,
    /// Cycle time; `None`: that of the plan.
    pub cycle: Option<Span>,
    /// Distributed clocks for every SubDevice that has one and says how it is to be used.
    pub clocks: bool,
}

impl Default for PlanChoices {
    fn default() -> Self {
        Self { target: AlState::Op, cycle: None, clocks: false }
    }
}

impl PlanChoices {
    fn plan(self, inventory: &Inventory, project: Option<&Project>) -> Result<Plan, String> {
        let mut planned = inventory.planned(self.target);
        if let Some(project) = project {
            // A plan numbers SubDevices in the order in which frames pass them.
            let tree = project.tree().map_err(|error| error.to_string())?;
            for (at, node) in tree.order().iter().enumerate() {
                let wanted = &project.devices[*node];
                let Some(device) = planned.get_mut(at) else {
                    return Err(too_few(project, &wanted.name, inventory));
                };
                if let Some(identity) = wanted.identity() {
                    let found = device.identity;
                    if let Some(what) = mismatch(&identity, &found, wanted.rule()) {
                        return Err(format!(
                            "place {}: expected {} with {}, found {} with {}: another {what}. Do: \
                             check that the right SubDevice is there, or scan again with \
                             `linesman scan WHERE --save FILE`",
                            at + 1,
                            wanted.name,
                            text(&identity),
                            device.name,
                            text(&found),
                        ));
                    }
                    device.identity = identity;
                    device.revision_rule = wanted.rule();
                }
                device.name.clone_from(&wanted.name);
            }
            if planned.len() > project.devices.len() {
                let extra = &planned[project.devices.len()].name;
                return Err(format!(
                    "found {}, the project has {}; the first that it does not have is \
                     {extra}. Do: add it to the project, or take it out",
                    so_many(planned.len()),
                    project.devices.len(),
                ));
            }
        }
        let mut options = PlanOptions::default();
        options.cycle = self.cycle.unwrap_or(options.cycle);
        if self.clocks {
            clock(&mut planned, options.cycle)?;
            options.clock_datagrams = true;
            // It is there for its time (DC-19).
            let tells = |one: &PlannedDevice| is_type(&one.profile.type_name, PTP_TERMINAL);
            let found = planned.iter().position(tells);
            options.time_source = found.map(|at| TimeSource::Device(DeviceId(at as u32)));
        }
        Plan::build(&planned, inventory.tree().clone(), &options)
            .map_err(|error| format!("{error}. Do: see `linesman plan FILE`"))
    }

    /// What is there is run, as it is.
    #[must_use]
    pub fn as_found(self) -> PlanSource {
        let make: MakePlan = Box::new(move |inventory| self.plan(inventory, None));
        PlanSource::Found(make)
    }

    /// What is there is run, if it is what the project says.
    #[must_use]
    pub fn project(self, project: Project) -> PlanSource {
        let make: MakePlan = Box::new(move |inventory| self.plan(inventory, Some(&project)));
        PlanSource::Found(make)
    }

    /// The plan of what was found.
    ///
    /// # Errors
    /// Why none can be made.
    pub fn plan_of(self, inventory: &Inventory) -> Result<Plan, String> {
        self.plan(inventory, None)
    }
}

/// Clocks each SubDevice by the first mode of its own description that has a SYNC0 (ETG.2000, `OpMode`).
fn clock(planned: &mut [PlannedDevice], cycle: Span) -> Result<(), String> {
    for device in planned {
        let modes = &device.profile.clock_modes;
        let with_sync0 = |mode: &&ClockMode| mode.assign_activate & 0x0200 != 0;
        let Some(mode) = modes.iter().find(with_sync0) else { continue };
        let choice = ClockChoice { mode: Some(mode.name.clone()), ..ClockChoice::default() };
        device.settings.clock = Some(choice.settings(modes, cycle)?);
    }
    Ok(())
}

fn too_few(project: &Project, missing: &str, inventory: &Inventory) -> String {
    format!(
        "found {}, the project has {}; the first that is missing is {missing}. Do: check \
         cable and supply there, or look with `linesman diagnose WHERE --project FILE`",
        so_many(inventory.devices.len()),
        project.devices.len(),
    )
}

fn so_many(count: usize) -> String {
    if count == 1 { "1 SubDevice".to_owned() } else { format!("{count} SubDevices") }
}
