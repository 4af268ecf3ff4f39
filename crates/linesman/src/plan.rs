//! Result of a scan, and the plan made of it.

use std::fmt;
use std::path::Path;

use linesman_config::eni::Eni;
use linesman_config::inventory::Inventory;
use linesman_config::project::Project;
use linesman_proto::time::Span;
use linesman_runtime::run::PlanChoices;
use linesman_session::image::{Value, find_device};

use crate::handle::{DeviceHandle, Input, Output, PlanId};
use crate::record::{InputRecord, InputsOf, OutputRecord, OutputsOf};
use crate::{Error, RunOptions};

/// Result of a scan.
#[derive(Clone, Debug)]
pub struct Scan {
    pub(crate) inventory: Inventory,
}

impl Scan {
    /// The plan for what is there, as it is: everything to OP.
    ///
    /// # Errors
    /// When its process data do not fit.
    pub fn plan(&self) -> Result<Plan, Error> {
        let plan = PlanChoices::default().plan_of(&self.inventory).map_err(Error::Plan)?;
        let found = Some(Box::new(self.inventory.clone()));
        Ok(Plan { found, ..plan.into() })
    }

    /// The SubDevices that are there.
    #[must_use]
    pub const fn inventory(&self) -> &Inventory {
        &self.inventory
    }
}

/// Everything that a line is run by.
#[derive(Clone, Debug)]
pub struct Plan {
    plan: linesman_config::plan::Plan,
    id: PlanId,
    /// The scan that it was made of, if it was.
    found: Option<Box<Inventory>>,
    /// The project that it was made of, if it was.
    project: Option<Box<Project>>,
}

impl Plan {
    /// A configuration of another tool (ENI, XML). A project needs the line as well:
    /// [`Segment::load`](crate::Segment::load).
    ///
    /// # Errors
    /// When the file cannot be read, or contradicts itself.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let refuse = |why: String| Error::File { path: path.to_owned(), why };
        let bytes = std::fs::read(path).map_err(|error| refuse(error.to_string()))?;
        let eni = Eni::parse(&bytes).map_err(|error| refuse(error.to_string()))?;
        Ok(eni.plan.into())
    }

    /// A SubDevice by its own name (`Term 2`), by the name of the product (`EL1008`) if there is only one, or by
    /// its number in the order in which frames pass, from 1.
    ///
    /// # Errors
    /// When there is none, or several; the error lists those that there are.
    pub fn device(&self, name: &str) -> Result<DeviceHandle, Error> {
        let id = find_device(&self.plan, name)?.id;
        Ok(DeviceHandle { id, plan: self.id })
    }

    /// All SubDevices with their names, in the order in which frames pass.
    pub fn devices(&self) -> impl Iterator<Item = (DeviceHandle, &str)> {
        let handle = |id| DeviceHandle { id, plan: self.id };
        self.plan.devices.iter().map(move |device| (handle(device.id), device.name.as_str()))
    }

    /// The name of a SubDevice by its number, as a finding names it; `None` when there is no such one.
    #[must_use]
    pub fn name(&self, no: u32) -> Option<&str> {
        let device = self.plan.devices.iter().find(|device| device.id.no() == no)?;
        Some(&device.name)
    }

    /// An input by its name: `EL1008/1`, `Drive/Status word`, `EL3204/1/Value`.
    ///
    /// # Errors
    /// When there is none, or several, or it is of another type.
    pub fn input<T: Value>(&self, name: &str) -> Result<Input<T>, Error> {
        Ok(Input::find(&self.plan, self.id, name)?)
    }

    /// An output by its name.
    ///
    /// # Errors
    /// As [`Plan::input`].
    pub fn output<T: Value>(&self, name: &str) -> Result<Output<T>, Error> {
        Ok(Output::find(&self.plan, self.id, name)?)
    }

    /// An input of a SubDevice by its name there: `1`, `Status word`, `1/Value`.
    ///
    /// # Errors
    /// As [`Plan::input`], or when the SubDevice is one of another plan.
    pub fn input_of<T: Value>(&self, device: DeviceHandle, name: &str) -> Result<Input<T>, Error> {
        self.input(&self.whole_name(device, name)?)
    }

    /// An output of a SubDevice by its name there.
    ///
    /// # Errors
    /// As [`Plan::input_of`].
    pub fn output_of<T: Value>(
        &self,
        device: DeviceHandle,
        name: &str,
    ) -> Result<Output<T>, Error> {
        self.output(&self.whole_name(device, name)?)
    }

    /// The inputs that a struct of [`inputs!`](crate::inputs) names, of a SubDevice by its name.
    ///
    /// # Errors
    /// When there is no such SubDevice, or a variable is missing or of another type.
    pub fn inputs<R: InputRecord>(&self, device: &str) -> Result<InputsOf<R>, Error> {
        Ok(InputsOf { handles: R::find(self, self.device(device)?)? })
    }

    /// The outputs that a struct of [`outputs!`](crate::outputs) names, of a SubDevice by its name.
    ///
    /// # Errors
    /// As [`Plan::inputs`].
    pub fn outputs<R: OutputRecord>(&self, device: &str) -> Result<OutputsOf<R>, Error> {
        Ok(OutputsOf { handles: R::find(self, self.device(device)?)? })
    }

    fn whole_name(&self, device: DeviceHandle, name: &str) -> Result<String, Error> {
        let found = self.plan.device(device.id).filter(|_| device.plan == self.id);
        let other = Error::OtherPlan { found: device.plan, running: self.id };
        Ok(format!("{}/{name}", found.ok_or(other)?.name))
    }

    /// Its identity, which its handles carry.
    #[must_use]
    pub const fn id(&self) -> PlanId {
        self.id
    }

    /// The plan as it is run with these options.
    ///
    /// # Errors
    /// When clocks are asked for and the plan chooses none.
    pub(crate) fn for_run(
        self,
        options: &RunOptions,
    ) -> Result<linesman_config::plan::Plan, Error> {
        let mut plan = if options.clocks { self.clocked(options.time)? } else { self.plan };
        // The first task is the application's; an imported one keeps the times of its others.
        if let Some(task) = plan.tasks.first_mut() {
            task.cycle = options.time;
            task.io_at = options.io_at.unwrap_or(task.io_at);
        }
        Ok(plan)
    }

    /// The plan with distributed clocks, for a cycle of this time. One that has clocks stays as it is.
    fn clocked(self, cycle: Span) -> Result<linesman_config::plan::Plan, Error> {
        if self.plan.reference_clock().is_some() {
            return Ok(self.plan);
        }
        let Some(found) = self.found else {
            let why = "distributed clocks are asked for, and the file chooses none. Do: write `clock = {}` for \
                       the SubDevices of the project that are to have one";
            return Err(Error::Plan(why.to_owned()));
        };
        // Clocks have datagrams of their own: where process data lie does not change.
        let choices = PlanChoices { cycle: Some(cycle), clocks: true, ..PlanChoices::default() };
        choices.plan_of(&found).map_err(Error::Plan)
    }

    /// The plan of a project.
    pub(crate) fn of_project(plan: linesman_config::plan::Plan, project: Project) -> Self {
        Self { project: Some(Box::new(project)), ..plan.into() }
    }

    /// The project that it was made of.
    pub(crate) fn project(&self) -> Option<&Project> {
        self.project.as_deref()
    }

    /// The plan itself.
    #[must_use]
    pub const fn as_plan(&self) -> &linesman_config::plan::Plan {
        &self.plan
    }
}

impl fmt::Display for Plan {
    /// Its identity, as errors write it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.id.fmt(f)
    }
}

impl From<linesman_config::plan::Plan> for Plan {
    fn from(plan: linesman_config::plan::Plan) -> Self {
        Self { id: PlanId::of(&plan), plan, found: None, project: None }
    }
}
