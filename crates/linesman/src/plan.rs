//! Result of a scan, and the plan made of it.

use std::path::Path;

use linesman_config::eni::Eni;
use linesman_config::inventory::Inventory;
use linesman_proto::time::Span;
use linesman_runtime::run::PlanChoices;
use linesman_session::image::{Input, Output, Value};

use crate::Error;

/// What a scan found.
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
        Ok(Plan { plan, found: Some(Box::new(self.inventory.clone())) })
    }

    /// What is there.
    #[must_use]
    pub const fn inventory(&self) -> &Inventory {
        &self.inventory
    }
}

/// Everything that a line is run by.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) plan: linesman_config::plan::Plan,
    /// What it was made of, if that was a scan.
    found: Option<Box<Inventory>>,
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

    /// An input by its name: `EL1008/1`, `Drive/Status word`, `EL3204/1/Value`.
    ///
    /// # Errors
    /// When there is none, or several, or it is of another type.
    pub fn input<T: Value>(&self, name: &str) -> Result<Input<T>, Error> {
        Ok(Input::find(&self.plan, name)?)
    }

    /// An output by its name.
    ///
    /// # Errors
    /// As [`Plan::input`].
    pub fn output<T: Value>(&self, name: &str) -> Result<Output<T>, Error> {
        Ok(Output::find(&self.plan, name)?)
    }

    /// The plan with distributed clocks, for a cycle of this time. One that has clocks stays as it is.
    ///
    /// # Errors
    /// When it was not made of a scan, and chooses none.
    pub(crate) fn clocked(self, cycle: Span) -> Result<linesman_config::plan::Plan, Error> {
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

    /// The plan itself.
    #[must_use]
    pub const fn as_plan(&self) -> &linesman_config::plan::Plan {
        &self.plan
    }
}

impl From<linesman_config::plan::Plan> for Plan {
    fn from(plan: linesman_config::plan::Plan) -> Self {
        Self { plan, found: None }
    }
}
