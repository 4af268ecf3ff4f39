//! Numbers that a plan does not hold: what was given, what is assumed instead, and sentences that tell it.

use linesman_proto::time::Span;

use super::super::shift::JITTER_PERCENT;
use super::super::{IoAt, Plan};
use super::line_delay::cable_links;

/// The longest copper cable between two SubDevices, in m; assumed of each where no length is given.
const LONGEST_CABLE_M: u32 = 100;

/// Numbers beside the plan, for [`Plan::timing`].
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct TimingOptions {
    /// How early and how late the MainDevice may send. `None`: a tenth of the shortest cycle is assumed.
    pub jitter: Option<Span>,
    /// By how much the first task ends earlier or later, where its frames wait for that. `None`: taken as 0.
    pub task_jitter: Option<Span>,
    /// How long tasks take at the most, by name. Those that are not named are taken as 0.
    pub execution: Vec<(String, Span)>,
    /// Metres of copper cable behind the reference clock. `None`: 100 m are assumed of each link.
    pub cable_m: Option<u32>,
    /// What has to be left over on both sides of SYNC0.
    pub margin: Span,
}

/// The numbers that are reckoned with.
pub(super) struct Assumed {
    pub(super) jitter: Span,
    /// 0 where no frame waits for the end of the first task.
    pub(super) task_jitter: Span,
    pub(super) margin: Span,
    cable_m: Option<u32>,
    /// By number of the task.
    execution: Vec<Option<Span>>,
    /// What of it nobody has said.
    pub(super) told: Vec<String>,
}

impl Assumed {
    pub(super) fn of(plan: &Plan, options: &TimingOptions) -> Self {
        let mut told = Vec::new();
        let shortest = plan.tasks.iter().map(|task| task.cycle).min().unwrap_or_default();
        let jitter = options.jitter.unwrap_or_else(|| {
            let jitter = Span::ns(shortest.as_nanos() * JITTER_PERCENT / 100);
            told.push(format!(
                "the jitter of the MainDevice is not given: {jitter} early and late are assumed, a tenth of \
                 the shortest cycle (`--jitter`)"
            ));
            jitter
        });
        let ends = plan.tasks.first().is_some_and(|task| task.io_at == IoAt::TaskEnd);
        let task_jitter = match options.task_jitter {
            Some(jitter) if ends => jitter,
            None if ends => {
                told.push(
                    "how much the time of the first task varies is not given, and its frames wait for its end: \
                     taken as 0 (`--task-jitter`)"
                        .to_owned(),
                );
                Span::ZERO
            }
            Some(_) | None => Span::ZERO,
        };
        let given = |name: &str| {
            let found = options.execution.iter().find(|(task, _)| task == name);
            found.map(|(_, takes)| *takes)
        };
        let execution: Vec<_> = plan.tasks.iter().map(|task| given(&task.name)).collect();
        if plan.tasks.len() > 1 {
            let unknown = plan.tasks.iter().zip(&execution).filter(|(_, takes)| takes.is_none());
            let names: Vec<_> = unknown.map(|(task, _)| format!("\"{}\"", task.name)).collect();
            if !names.is_empty() {
                told.push(format!(
                    "how long tasks take is not given for {}: taken as 0, their frames follow each other at \
                     once (`--execution TASK=TIME`)",
                    names.join(", ")
                ));
            }
        }
        let reference = plan.reference_clock().map_or(0, |id| id.index());
        let links = (reference + 1..plan.devices.len()).filter(|node| cable_links(plan, *node));
        let links = links.count();
        if options.cable_m.is_none() && links > 0 {
            told.push(format!(
                "lengths of cables are not given: {LONGEST_CABLE_M} m are assumed of each of {links} behind the \
                 reference clock (`--cable-m`)"
            ));
        }
        let (margin, cable_m) = (options.margin, options.cable_m);
        Self { jitter, task_jitter, margin, cable_m, execution, told }
    }

    /// How long a task takes at the most, 0 where nobody says.
    pub(super) fn execution(&self, task: usize) -> Span {
        self.execution.get(task).copied().flatten().unwrap_or_default()
    }

    /// Metres of copper in so many links; those that were given are of all links together.
    pub(super) fn cable_m(&self, links: usize) -> u64 {
        match self.cable_m {
            _ if links == 0 => 0,
            Some(metres) => u64::from(metres),
            None => links as u64 * u64::from(LONGEST_CABLE_M),
        }
    }
}
