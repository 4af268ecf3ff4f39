//! Cycle time of a plan or a project, given beside its file.

use linesman_proto::time::Span;

use super::layout::DEFAULT_TASK;
use super::{Plan, Task};
use crate::project::{Project, ProjectTask};

/// Why a plan does not take another cycle time. Each says what to do instead.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum CycleError {
    /// Each of its tasks has a time of its own.
    #[error(
        "it has {}: one cycle time cannot be that of all. Do: change them in the file, and leave out \
         the cycle time",
        .0.join(", ")
    )]
    SeveralTasks(
        /// Each task with its cycle time.
        Vec<String>,
    ),
    /// Nothing is exchanged.
    #[error(
        "it exchanges nothing cyclically, so that there is no cycle. Do: leave out the cycle time"
    )]
    NoTask,
    /// A SubDevice has been set up for the one it has.
    #[error(
        "its SubDevices are set up for a cycle of {cycle}: `{device}` has SYNC0 every {sync0}. Do: change \
         the cycle time in the tool or file that says so, and leave it out here"
    )]
    Clocked {
        /// Who.
        device: String,
        /// The cycle of its task.
        cycle: Span,
        /// Its SYNC0.
        sync0: Span,
    },
    /// Something else comes so much earlier.
    #[error(
        "inputs are fetched {ahead} before the other frames, a cycle of {cycle} is too short for it. Do: choose a longer one"
    )]
    TooShort {
        /// The cycle that was wanted.
        cycle: Span,
        /// How much earlier.
        ahead: Span,
    },
}

impl Plan {
    /// Takes another cycle time than that of its file.
    ///
    /// # Errors
    /// When it has several tasks or none, or its SubDevices have been set up for the time it has.
    pub fn set_cycle(&mut self, cycle: Span) -> Result<(), CycleError> {
        let [task] = self.tasks.as_mut_slice() else {
            let shown = |task: &Task| format!("task `{}` every {}", task.name, task.cycle);
            let tasks: Vec<String> = self.tasks.iter().map(shown).collect();
            return Err(match tasks.is_empty() {
                true => CycleError::NoTask,
                false => CycleError::SeveralTasks(tasks),
            });
        };
        if task.cycle == cycle {
            return Ok(());
        }
        let clocked = self.devices.iter().find_map(|device| {
            let clock = device.settings.clock.filter(|clock| clock.sync0())?;
            Some((device.name.clone(), clock.sync0_cycle))
        });
        if let Some((device, sync0)) = clocked {
            return Err(CycleError::Clocked { device, cycle: task.cycle, sync0 });
        }
        let ahead = task.frames.iter().map(|frame| frame.ahead).max().unwrap_or(Span::ZERO);
        if ahead >= cycle {
            return Err(CycleError::TooShort { cycle, ahead });
        }
        task.cycle = cycle;
        Ok(())
    }
}

impl Project {
    /// Takes another cycle time than it says, or one where it says none. Clocks that follow the cycle of
    /// their task follow it.
    ///
    /// # Errors
    /// When it has several tasks, or a clock with a time of its own.
    pub fn set_cycle(&mut self, cycle: Span) -> Result<(), CycleError> {
        let us = |us: u32| Span::us(u64::from(us));
        let wanted = ProjectTask::new(DEFAULT_TASK, cycle);
        match self.tasks.as_mut_slice() {
            [] => self.tasks.push(wanted),
            [task] if task.cycle_us == wanted.cycle_us => return Ok(()),
            [task] => {
                let own = self.devices.iter().find_map(|device| {
                    Some((device.name.clone(), us(device.clock.as_ref()?.sync0_cycle_us?)))
                });
                if let Some((device, sync0)) = own {
                    let cycle = us(task.cycle_us);
                    return Err(CycleError::Clocked { device, cycle, sync0 });
                }
                let ahead = us(task.pre_ticks * self.network.base_time_us);
                if ahead >= cycle {
                    return Err(CycleError::TooShort { cycle, ahead });
                }
                task.cycle_us = wanted.cycle_us;
            }
            tasks => {
                let shown = |task: &ProjectTask| {
                    format!("task `{}` every {}", task.name, us(task.cycle_us))
                };
                return Err(CycleError::SeveralTasks(tasks.iter().map(shown).collect()));
            }
        }
        Ok(())
    }
}
