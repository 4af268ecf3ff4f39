//! Times at which cyclic frames pass the reference clock, from the earliest to the latest.
//!
//! Zero is when the frame that brings the time of the reference clock is there (SYN-09): the MainDevice keeps it at
//! the begin of the cycle. Frames that are due together follow each other; those of later tasks wait for the
//! tasks before. Reference: S0 L256, L312-388, L656-688.

use linesman_proto::time::Span;

use super::super::shift::signed;
use super::super::{IoAt, Plan, Role};
use super::assumption::Assumed;

/// A cyclic frame at the reference clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameTime {
    /// Index of its task.
    pub task: usize,
    /// Its number over all tasks, from 0.
    pub number: usize,
    /// When it begins without jitter, as soon as it is due, in ns after the frame that brings the time.
    pub due_ns: i64,
    /// When it begins at the earliest.
    pub earliest_ns: i64,
    /// When it has ended at the latest.
    pub latest_ns: i64,
    /// How much earlier than the other frames of its task it leaves (SYN-15).
    pub ahead: Span,
}

/// All frames of a plan; `None` where none of them brings the time of the reference clock: nothing then ties
/// them to SYNC0.
pub(super) fn frame_times(plan: &Plan, assumed: &Assumed) -> Option<Vec<FrameTime>> {
    let mut due = due(plan, assumed);
    let jitter = signed(assumed.jitter + assumed.task_jitter);
    let mut order: Vec<usize> = (0..due.len()).collect();
    order.sort_by_key(|at| due[*at].latest_ns);
    // What is due while another frame is still leaving waits for its end.
    let mut free = i64::MIN;
    for at in order {
        let begins = due[at].latest_ns.max(free);
        due[at].latest_ns = begins;
        free = begins.saturating_add(due[at].wire_ns);
    }
    let frames = plan.tasks.iter().flat_map(|task| &task.frames);
    let brings = frames.into_iter().position(|frame| frame.has(Role::ReferenceClock))?;
    let (first, last) = (due[brings].earliest_ns, due[brings].latest_ns);
    let times = due.iter().map(|one| FrameTime {
        task: one.task,
        number: one.number,
        due_ns: one.earliest_ns.saturating_sub(last),
        earliest_ns: one.earliest_ns.saturating_sub(last).saturating_sub(jitter),
        latest_ns: one
            .latest_ns
            .saturating_add(one.wire_ns)
            .saturating_sub(first)
            .saturating_add(jitter),
        ahead: one.ahead,
    });
    Some(times.collect())
}

/// When a frame is due, and how long it takes.
struct DueFrame {
    task: usize,
    number: usize,
    earliest_ns: i64,
    latest_ns: i64,
    wire_ns: i64,
    ahead: Span,
}

fn due(plan: &Plan, assumed: &Assumed) -> Vec<DueFrame> {
    let mut due = Vec::new();
    for (task, one) in plan.tasks.iter().enumerate() {
        let begins = plan.cycle_begin_ns(one);
        let last = one.frames.iter().map(|frame| frame.ahead).min().unwrap_or_default();
        let mut of_batch: Option<(Span, i64)> = None;
        for frame in &one.frames {
            let wire_ns = signed(frame.wire_time());
            let ahead = frame.ahead.saturating_sub(last);
            let before = match of_batch {
                Some((same, before)) if same == frame.ahead => before,
                Some(_) | None => 0,
            };
            of_batch = Some((frame.ahead, before + wire_ns));
            let at = begins.saturating_sub(signed(ahead));
            // The earliest: no task before it takes any time. Frames before it in its batch there are always.
            due.push(DueFrame {
                task,
                number: due.len(),
                earliest_ns: at.saturating_add(before),
                latest_ns: at.saturating_add(signed(waits(plan, assumed, task, ahead))),
                wire_ns,
                ahead: frame.ahead,
            });
        }
    }
    due
}

/// How long a frame waits for tasks at the most. The first task's own end is where its cycle begins by the
/// reference clock, unless another of its frames has left before.
fn waits(plan: &Plan, assumed: &Assumed, task: usize, ahead: Span) -> Span {
    let ends = |task: usize| plan.tasks.get(task).is_some_and(|task| task.io_at == IoAt::TaskEnd);
    let own = if ends(task) && ahead == Span::ZERO { assumed.execution(task) } else { Span::ZERO };
    if task == 0 {
        let has_early = plan.tasks[0].frames.windows(2).any(|two| two[0].ahead != two[1].ahead);
        return if has_early { own } else { Span::ZERO };
    }
    let first = if ends(0) { Span::ZERO } else { assumed.execution(0) };
    (1..task).fold(first + own, |sum, task| sum + assumed.execution(task))
}
