//! Handles of a plan: inputs, outputs and SubDevices, found once by name.
//!
//! A handle belongs to the layout that it was found in. Used in a run of another one it reads zeros, writes
//! nothing, and ends the run with [`Error::OtherPlan`](crate::Error::OtherPlan).

use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

use linesman_config::plan::{DevicePlan, Plan};
use linesman_proto::address::DeviceId;
use linesman_session::image::{self, Value};

/// Identity of a plan: which SubDevices it has, and where their process data lie. Plans that agree in both are
/// the same, wherever they come from: a handle found in one serves in the other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlanId {
    layout: u32,
    devices: usize,
    inputs: usize,
    outputs: usize,
}

impl PlanId {
    pub(crate) fn of(plan: &Plan) -> Self {
        let mut hasher = DefaultHasher::new();
        for device in &plan.devices {
            let DevicePlan { id, name, station, identity, inputs, outputs, .. } = device;
            (id, name, station.0, inputs, outputs).hash(&mut hasher);
            (identity.vendor_id, identity.product_code).hash(&mut hasher);
        }
        for variable in &plan.variables {
            (&variable.name, variable.device, variable.bit_at, variable.bits).hash(&mut hasher);
        }
        let hash = hasher.finish();
        Self {
            layout: (hash ^ (hash >> 32)) as u32,
            devices: plan.devices.len(),
            inputs: plan.inputs_len,
            outputs: plan.outputs_len,
        }
    }
}

impl fmt::Display for PlanId {
    /// `plan 7c1a09e2 (4 SubDevices, 2 bytes of inputs, 1 of outputs)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { layout, devices, inputs, outputs } = self;
        let many = if *devices == 1 { "SubDevice" } else { "SubDevices" };
        write!(
            f,
            "plan {layout:08x} ({devices} {many}, {inputs} bytes of inputs, {outputs} of outputs)"
        )
    }
}

/// An input with the type in which the application sees it.
#[derive(Debug)]
pub struct Input<T> {
    pub(crate) variable: image::Input<T>,
    pub(crate) plan: PlanId,
}

/// An output with the type in which the application sees it.
#[derive(Debug)]
pub struct Output<T> {
    pub(crate) variable: image::Output<T>,
    pub(crate) plan: PlanId,
}

impl<T> Clone for Input<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Input<T> {}

impl<T> Clone for Output<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Output<T> {}

impl<T: Value> Input<T> {
    pub(crate) fn find(plan: &Plan, id: PlanId, name: &str) -> Result<Self, image::VariableError> {
        Ok(Self { variable: image::Input::find(plan, name)?, plan: id })
    }
}

impl<T: Value> Output<T> {
    pub(crate) fn find(plan: &Plan, id: PlanId, name: &str) -> Result<Self, image::VariableError> {
        Ok(Self { variable: image::Output::find(plan, name)?, plan: id })
    }
}

/// A SubDevice of a plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DeviceHandle {
    pub(crate) id: DeviceId,
    pub(crate) plan: PlanId,
}

impl DeviceHandle {
    /// Its number in the plan, in the order in which frames pass, from 1: as findings name it.
    #[must_use]
    pub fn no(self) -> u32 {
        self.id.no()
    }

    /// Its key in what the crates below this one give.
    #[must_use]
    pub const fn id(self) -> DeviceId {
        self.id
    }
}
