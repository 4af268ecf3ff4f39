//! Plan of what a lab has found.

use linesman_config::inventory::Inventory;
use linesman_config::plan::{ClockSettings, Plan, PlanOptions, PlannedDevice};
use linesman_config::project::{Described, ProjectDevice};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;

use super::Lab;

/// Frames that compensate the drift of clocks before SubDevices go beyond PREOP: fewer than on a real
/// line, where the bring-up may take its time.
pub(super) const DRIFT_FRAMES: u32 = 2_000;

impl Lab {
    /// The project's identity of a SubDevice of the plan. A plan numbers what was found in the order
    /// of processing, which for a device with several controllers is not that of the project.
    #[must_use]
    pub fn of_plan(&self, id: DeviceId) -> DeviceId {
        let node = self.tree.order().get(id.index());
        node.map_or(id, |node| DeviceId(*node as u32))
    }

    /// The plan's identity of a SubDevice of the project; the other way round than
    /// [`Lab::of_plan`].
    #[must_use]
    pub fn in_plan(&self, id: DeviceId) -> DeviceId {
        let at = self.tree.order().iter().position(|node| *node == id.index());
        at.map_or(id, |at| DeviceId(at as u32))
    }

    /// The plan for what was found, with the names of the project where they fit.
    pub(super) fn make_plan(&self, inventory: &Inventory) -> Result<Plan, String> {
        if self.project.chooses() {
            return self.chosen_plan(inventory);
        }
        let mut planned = inventory.planned(self.options.target);
        if planned.len() == self.project.devices.len() {
            for (device, id) in planned.iter_mut().zip(0..) {
                let wanted = &self.project.devices[self.of_plan(DeviceId(id)).index()];
                device.name.clone_from(&wanted.name);
            }
        }
        let (cycle, clock_datagrams) = (self.options.cycle, self.options.clocks);
        if clock_datagrams {
            for device in &mut planned {
                device.settings.clock = clocked(device, cycle);
            }
        }
        let options = PlanOptions { cycle, clock_datagrams, ..PlanOptions::default() };
        let options = self.options.habit.plan(options);
        Plan::build(&planned, inventory.tree().clone(), &options).map_err(|error| error.to_string())
    }

    /// The plan that the project chooses, for SubDevices that are what was found in their places: there are no
    /// descriptions of their makers, but what they say of themselves.
    fn chosen_plan(&self, inventory: &Inventory) -> Result<Plan, String> {
        let order = self.tree.order();
        let mut lookup = |wanted: &ProjectDevice| {
            let node = self.project.devices.iter().position(|device| device.name == wanted.name);
            let place = order.iter().position(|at| Some(*at) == node);
            let found = place.and_then(|place| inventory.devices.get(place));
            Ok(found
                .map(|found| Described { profile: found.profile.clone(), ..Described::default() }))
        };
        let resolved = self.project.resolve(&mut lookup).map_err(|error| error.to_string())?;
        let mut devices = resolved.devices;
        for (device, node) in devices.iter_mut().zip(order) {
            device.target = self.target_of(DeviceId(*node as u32));
        }
        let options = self.options.habit.plan(resolved.options);
        Plan::build(&devices, resolved.tree, &options).map_err(|error| error.to_string())
    }
}

/// The first operation mode of a SubDevice that has a SYNC0, with one event a cycle.
fn clocked(device: &PlannedDevice, cycle: Span) -> Option<ClockSettings> {
    let modes = device.profile.clock_modes.iter();
    let synced = modes.map(|mode| ClockSettings {
        assign_activate: mode.assign_activate,
        sync0_cycle: cycle,
        ..ClockSettings::default()
    });
    synced.into_iter().find(ClockSettings::sync0)
}
