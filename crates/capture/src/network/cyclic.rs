//! Frames that carry process data or the system time: their datagrams, working counters and times.

use std::collections::BTreeMap;

use linesman_diagnosis::model::{Deficit, NetworkModel};
use linesman_diagnosis::observe::Exchange;
use linesman_diagnosis::report::Number;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::size::{load_percent, wire_time};
use linesman_proto::time::{Instant, Span};
use serde::{Deserialize, Serialize};

use super::states::named;
use crate::access::{DatagramAccess, DatagramTarget, accesses};
use crate::timing::durations::{BarReport, Durations, DurationsReport};

/// Most kinds of frames that are told apart.
const MOST_KINDS: usize = 512;
/// Most working counters that are told apart of one datagram.
const MOST_COUNTERS: usize = 32;
/// Intervals from which a cycle is taken.
const LEAST_INTERVALS: u64 = 3;
/// Cycles that differ by less, in percent, are one task.
const SAME_TASK_PERCENT: u64 = 5;
/// Register of the system time.
const SYSTEM_TIME: u16 = 0x0910;

/// A kind of frame.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CyclicFrameReport {
    /// Its number, from 1.
    pub frame: u32,
    /// How often it was sent, or came back where it was not seen going out.
    pub count: Number,
    /// Those that did not come back.
    pub lost: Number,
    /// Length in bytes, without check sequence.
    pub bytes: u32,
    /// Bytes of data in its datagrams.
    pub data_bytes: u32,
    /// Time on the wire at 100 Mbit/s.
    pub wire_ns: Number,
    /// The usual interval; `null` where it came too seldom to tell.
    pub cycle_ns: Option<Number>,
    /// Share of its cycle that it takes on the wire, in percent.
    pub load_percent: Option<f64>,
    /// Number of its task, from 1.
    pub task: Option<u32>,
    /// Intervals.
    pub intervals: Option<DurationsReport>,
    /// Deviations from the cycle.
    pub jitter: Vec<BarReport>,
    /// Intervals off by a fifth of the cycle or more.
    pub off: Number,
    /// Cycles without it.
    pub missing: Number,
    /// From going out to coming back.
    pub response: Option<DurationsReport>,
    /// Its datagrams.
    pub datagrams: Vec<CyclicDatagramReport>,
}

/// A datagram of a frame.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CyclicDatagramReport {
    /// Its command.
    pub command: String,
    /// Logical address; `null` for others.
    pub logical: Option<u32>,
    /// Register or memory address; `null` for logical commands.
    pub address: Option<u16>,
    /// Station address; `null` for others.
    pub station: Option<u16>,
    /// Position from 1; `null` for others.
    pub position_no: Option<u32>,
    /// Length in bytes.
    pub len: u16,
    /// The working counter that is expected: the highest it reached, since the process data were set up.
    pub expected: Option<u16>,
    /// Working counters that it came back with, and how often.
    pub working_counters: Vec<WorkingCounterReport>,
    /// When the working counter was too low without an order by which it had to be.
    pub misses: Vec<MissReport>,
    /// SubDevices that answer it, as far as their FMMUs were seen.
    pub owners: Vec<u32>,
}

/// A working counter.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WorkingCounterReport {
    /// The value.
    pub value: u16,
    /// Number of datagrams that came back with it.
    pub count: Number,
}

/// A stretch of time in which a working counter was too low.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MissReport {
    /// When it began.
    pub from_ns: Number,
    /// When it was right again; `null` if it never was.
    pub to_ns: Option<Number>,
    /// The frame in which it began.
    pub frame: Option<Number>,
    /// The expected working counter.
    pub expected: u16,
    /// The lowest one.
    pub lowest: u16,
    /// Datagrams that came back too low.
    pub count: Number,
}

/// A cycle.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CycleTaskReport {
    /// Its number, from 1: the fastest first.
    pub task: u32,
    /// Its cycle.
    pub cycle_ns: Number,
    /// Numbers of its frames.
    pub frames: Vec<u32>,
    /// Share of the cycle that they take on the wire, in percent.
    pub load_percent: f64,
}

/// Marks of a kind of frame: command, address and length of each datagram.
type FrameLayout = Vec<(Command, DatagramTarget, u16, u16)>;

/// Kinds of frames.
#[derive(Clone, Default, Debug)]
pub struct CyclicFrames {
    by_kind: BTreeMap<FrameLayout, usize>,
    frames: Vec<FrameStatistics>,
    scratch: (FrameLayout, Vec<Option<u16>>),
    /// ARMW or FRMW to the system time.
    pub(crate) clock: Option<SystemTimeDatagram>,
    /// The highest working counter of a datagram in which each SubDevice has a bit.
    pub(crate) status_bits: Option<u16>,
}

/// The latest datagram that hands round the system time.
#[derive(Clone, Copy, Debug)]
pub struct SystemTimeDatagram {
    pub(crate) command: Command,
    pub(crate) target: DatagramTarget,
    pub(crate) count: u64,
    pub(crate) wkc: u16,
}

#[derive(Clone, Debug)]
struct FrameStatistics {
    kind: FrameLayout,
    bytes: usize,
    count: u64,
    lost: u64,
    last: Option<Instant>,
    intervals: Durations,
    responses: Durations,
    counters: Vec<BTreeMap<u16, u64>>,
}

impl CyclicFrames {
    /// Takes an exchange; `counted` as of [`accesses`].
    pub(crate) fn exchange(&mut self, exchange: &Exchange<'_>, counted: u16) {
        if !exchange.is_last || exchange.is_part {
            return;
        }
        let (mut kind, mut counters) = std::mem::take(&mut self.scratch);
        let mut is_cyclic = false;
        accesses(exchange, counted, |access| {
            is_cyclic |= matches!(access.target, DatagramTarget::Logical(_)) || is_clock(access);
            counters.push(access.wkc);
            kind.push((access.command, access.target, access.address.0, access.len));
            self.note(access);
        });
        if is_cyclic {
            self.record(&kind, exchange, &counters);
        }
        kind.clear();
        counters.clear();
        self.scratch = (kind, counters);
    }

    /// Notes what a datagram tells of the clock and of mailboxes.
    fn note(&mut self, access: &DatagramAccess<'_>) {
        if is_clock(access) {
            let count = self.clock.map_or(0, |clock| clock.count);
            let wkc = access.wkc.unwrap_or(0);
            let (command, target) = (access.command, access.target);
            self.clock = Some(SystemTimeDatagram { command, target, count: count + 1, wkc });
        }
        // More SubDevices than bytes, and no more than bits: each has a bit.
        let is_bits = |wkc: u16| wkc > access.len && u32::from(wkc) <= 8 * u32::from(access.len);
        if access.command == Command::Lrd
            && let Some(wkc) = access.wkc.filter(|wkc| is_bits(*wkc))
        {
            self.status_bits = self.status_bits.max(Some(wkc));
        }
    }

    fn record(&mut self, kind: &FrameLayout, exchange: &Exchange<'_>, counters: &[Option<u16>]) {
        let index = match self.by_kind.get(kind) {
            Some(index) => *index,
            None if self.frames.len() == MOST_KINDS => return,
            None => {
                let frame = exchange.request.or(exchange.reply);
                self.by_kind.insert(kind.clone(), self.frames.len());
                self.frames.push(FrameStatistics {
                    kind: kind.clone(),
                    bytes: frame.map_or(0, |frame| frame.bytes.len()),
                    count: 0,
                    lost: 0,
                    last: None,
                    intervals: Durations::default(),
                    responses: Durations::default(),
                    counters: vec![BTreeMap::new(); kind.len()],
                });
                self.frames.len() - 1
            }
        };
        self.frames[index].take(exchange, counters);
    }

    /// The frames, and the tasks that they belong to.
    pub(crate) fn report(
        &self,
        model: &NetworkModel,
    ) -> (Vec<CyclicFrameReport>, Vec<CycleTaskReport>) {
        let numbered = (1..).zip(&self.frames);
        let mut frames: Vec<_> = numbered.map(|(no, frame)| frame.report(no, model)).collect();
        let tasks = tasks(&mut frames);
        (frames, tasks)
    }
}

fn is_clock(access: &DatagramAccess<'_>) -> bool {
    access.effect.multiple_write && access.address.0 == SYSTEM_TIME
}

impl FrameStatistics {
    fn take(&mut self, exchange: &Exchange<'_>, counters: &[Option<u16>]) {
        self.count += 1;
        let Some(frame) = exchange.request.or(exchange.reply) else { return };
        // Time stamps of several interfaces may run backwards.
        if let Some(last) = self.last.filter(|last| *last < frame.time) {
            self.intervals.record(frame.time.since(last));
        }
        self.last = self.last.max(Some(frame.time));
        match (&exchange.request, &exchange.reply) {
            (Some(request), Some(reply)) if reply.time >= request.time => {
                self.responses.record(reply.time.since(request.time));
            }
            (Some(_), None) if !exchange.is_cut_off => self.lost += 1,
            (_, _) => {}
        }
        for (counts, wkc) in self.counters.iter_mut().zip(counters) {
            let Some(wkc) = wkc else { continue };
            if counts.len() < MOST_COUNTERS || counts.contains_key(wkc) {
                *counts.entry(*wkc).or_default() += 1;
            }
        }
    }

    fn cycle(&self) -> Option<Span> {
        let median = self.intervals.percentile(50)?;
        (self.intervals.count() >= LEAST_INTERVALS && median > Span::ZERO).then_some(median)
    }

    fn report(&self, no: u32, model: &NetworkModel) -> CyclicFrameReport {
        let cycle = self.cycle();
        let datagrams = self.kind.iter().zip(&self.counters);
        CyclicFrameReport {
            frame: no,
            count: Number(self.count),
            lost: Number(self.lost),
            bytes: self.bytes as u32,
            data_bytes: self.kind.iter().map(|(_, _, _, len)| u32::from(*len)).sum(),
            wire_ns: Number(wire_time(self.bytes).as_nanos()),
            cycle_ns: cycle.map(|cycle| Number(cycle.as_nanos())),
            load_percent: cycle.map(|cycle| rounded(load_percent(self.bytes, cycle))),
            task: None,
            intervals: self.intervals.report(),
            jitter: cycle.map_or_else(Vec::new, |cycle| self.intervals.jitter(cycle)),
            off: Number(cycle.map_or(0, |cycle| self.intervals.off(cycle))),
            missing: Number(cycle.map_or(0, |cycle| self.intervals.missing(cycle))),
            response: self.responses.report(),
            datagrams: datagrams.map(|(kind, counts)| datagram(*kind, counts, model)).collect(),
        }
    }
}

fn datagram(
    (command, target, address, len): (Command, DatagramTarget, u16, u16),
    counts: &BTreeMap<u16, u64>,
    model: &NetworkModel,
) -> CyclicDatagramReport {
    let logical = match target {
        DatagramTarget::Logical(at) => Some(at),
        DatagramTarget::Nobody
        | DatagramTarget::All
        | DatagramTarget::Position(_)
        | DatagramTarget::Station(_) => None,
    };
    let is_it =
        |at| model.cyclic.iter().find(|it| (it.command, it.start, it.len) == (command, at, len));
    let followed = logical.and_then(is_it);
    let owners = followed.map(|cyclic| model.owners(cyclic));
    let concerned = |reads: bool, writes: bool| {
        command.effect().reads && reads || command.effect().writes && writes
    };
    let owners = owners.into_iter().flatten().filter(|owner| concerned(owner.reads, owner.writes));
    let deficits = followed.into_iter().flat_map(|cyclic| cyclic.wkc.deficits());
    let (station, position_no) = named(target);
    let highest = counts.keys().next_back().copied();
    CyclicDatagramReport {
        command: command.name().to_owned(),
        logical: logical.map(|at| at.0),
        address: (command.addressing() != Addressing::Logical).then_some(address),
        station,
        position_no,
        len,
        expected: followed.map_or(highest, |cyclic| Some(cyclic.wkc.highest().value)),
        working_counters: counts
            .iter()
            .map(|(value, count)| WorkingCounterReport { value: *value, count: Number(*count) })
            .collect(),
        misses: deficits.map(miss).collect(),
        owners: owners.map(|owner| owner.device.no()).collect(),
    }
}

fn miss(deficit: &Deficit) -> MissReport {
    MissReport {
        from_ns: Number(deficit.first.at.as_nanos()),
        to_ns: deficit.ended.map(|at| Number(at.as_nanos())),
        frame: deficit.first.frame.map(Number),
        expected: deficit.expected,
        lowest: deficit.lowest,
        count: Number(deficit.count),
    }
}

/// Puts frames with the same cycle together; those that came too seldom belong to none.
fn tasks(frames: &mut [CyclicFrameReport]) -> Vec<CycleTaskReport> {
    let mut order: Vec<usize> = (0..frames.len()).collect();
    let cycle = |frame: &CyclicFrameReport| frame.cycle_ns.map(|cycle| cycle.0);
    // A frame that came a few times beside thousands of others belongs to a start-up.
    let most = frames.iter().map(|frame| frame.count.0).max().unwrap_or(0);
    order.retain(|at| {
        let lasts = cycle(&frames[*at]).map(|ns| ns * frames[*at].count.0);
        lasts.is_some() && frames[*at].count.0 * 100 >= most.min(1_000)
    });
    order.sort_by_key(|at| cycle(&frames[*at]));
    let mut tasks: Vec<CycleTaskReport> = Vec::new();
    for at in order {
        let (Some(ns), no) = (cycle(&frames[at]), frames[at].frame) else { continue };
        let load = frames[at].load_percent.unwrap_or(0.0);
        let is_same = |task: &&mut CycleTaskReport| {
            ns.abs_diff(task.cycle_ns.0) * 100 <= ns * SAME_TASK_PERCENT
        };
        let number = match tasks.last_mut().filter(is_same) {
            Some(task) => {
                task.frames.push(no);
                task.load_percent = rounded(task.load_percent + load);
                task.task
            }
            None => {
                let task = tasks.len() as u32 + 1;
                let cycle_ns = Number(ns);
                tasks.push(CycleTaskReport {
                    task,
                    cycle_ns,
                    frames: vec![no],
                    load_percent: load,
                });
                task
            }
        };
        frames[at].task = Some(number);
    }
    tasks
}

/// To a hundredth, the same on every machine.
pub(crate) fn rounded(percent: f64) -> f64 {
    (percent * 100.0).round() / 100.0
}
