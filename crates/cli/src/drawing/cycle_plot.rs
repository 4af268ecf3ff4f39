//! Plot of a cycle: for each task its frames and its program, for each SubDevice with SYNC0 the frames, SYNC0, and when
//! it reads outputs and writes inputs. As SVG, and as lines of letters.
//!
//! Reference: S0 L447-475, L611-637. A frame that fetches inputs earlier stands where it is (SYN-29).

use linesman_config::plan::timing::{CycleTimes, PlanTiming, TimingOptions, TimingVerdict};
use linesman_config::plan::{IoAt, Plan};
use linesman_proto::time::Span;
use maud::{Markup, PreEscaped, html};

/// Columns of names, and of time, in pixels.
const NAMES: f64 = 180.0;
const TIMES: f64 = 820.0;
/// Height of a lane.
const LANE: usize = 24;
/// The narrowest bar.
const LEAST: f64 = 1.5;
/// Steps of the axis.
const STEPS: i64 = 8;

/// Colours.
const STYLE: &str = "\
.cycle text{font:11px sans-serif;fill:#222}.cycle .faint{fill:#777}.cycle .grid{stroke:#ddd}\
.cycle .frame{fill:#4a6fa5}.cycle .other{fill:#b9c0c8}.cycle .next{fill:#8fa9cc}.cycle .program{fill:#b59be0}\
.cycle .sync0{fill:#d9534f}.cycle .read{fill:#f2d16b}.cycle .written{fill:#7cc98a}.cycle .latch{fill:#1e7a3a}\
.cycle .fail{fill:#b3261e;font-weight:700}";

/// What a bar stands for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum BarKind {
    /// A frame, from its earliest begin to its latest end.
    Frame,
    /// One of another task.
    OtherFrame,
    /// The same frame of the next cycle.
    NextFrame,
    /// The program of a task.
    Program,
    /// SYNC0.
    Sync0,
    /// Outputs are read.
    Read,
    /// Inputs are written.
    Written,
    /// The input latch.
    Latch,
}

/// All kinds with the letter of each, the class of its colour, and the words of the legend. Later ones are drawn over
/// earlier ones.
const KINDS: [(BarKind, char, &str, &str); 8] = [
    (BarKind::Program, 'p', "program", "program of the task"),
    (BarKind::OtherFrame, 'o', "other", "frame of another task"),
    (BarKind::NextFrame, 'n', "next", "frame of the next cycle"),
    (BarKind::Frame, 'f', "frame", "frame, earliest to latest"),
    (BarKind::Read, 'r', "read", "outputs read"),
    (BarKind::Written, 'w', "written", "inputs written"),
    (BarKind::Latch, 'L', "latch", "input latch"),
    (BarKind::Sync0, 'S', "sync0", "SYNC0"),
];

impl BarKind {
    fn described(self) -> &'static (Self, char, &'static str, &'static str) {
        KINDS.iter().find(|(kind, ..)| *kind == self).unwrap_or(&KINDS[0])
    }
}

/// A stretch of time, in ns after the cycle begins.
struct Bar {
    kind: BarKind,
    from_ns: i64,
    to_ns: i64,
    title: String,
}

/// A task or a SubDevice.
struct Lane {
    name: String,
    verdict: Option<TimingVerdict>,
    bars: Vec<Bar>,
}

/// The plot of a plan.
pub(crate) struct CyclePlot {
    lanes: Vec<Lane>,
    from_ns: i64,
    to_ns: i64,
}

impl CyclePlot {
    /// The plot of what was found of a plan.
    pub(crate) fn new(plan: &Plan, timing: &PlanTiming, options: &TimingOptions) -> Self {
        let tasks = (0..plan.tasks.len()).map(|task| task_lane(plan, timing, options, task));
        let devices = timing.devices.iter().map(|device| {
            let planned = plan.device(device.device);
            let has_inputs = planned.is_some_and(|planned| !planned.inputs.is_empty());
            Lane {
                name: planned.map_or_else(String::new, |planned| planned.name.clone()),
                verdict: Some(device.verdict),
                bars: device.times.as_ref().map_or_else(Vec::new, |one| bars(one, has_inputs)),
            }
        });
        let lanes: Vec<Lane> = tasks.chain(devices).collect();
        let all = || lanes.iter().flat_map(|lane| &lane.bars);
        let cycles = plan.tasks.iter().map(|task| signed(task.cycle));
        let from_ns = all().map(|bar| bar.from_ns).min().unwrap_or(0).min(0);
        let to_ns = all().map(|bar| bar.to_ns).chain(cycles).max().unwrap_or(0);
        Self { from_ns, to_ns: to_ns.max(from_ns + 1), lanes }
    }

    /// As lines of letters, so many of them for the time, with a legend.
    pub(crate) fn text(&self, columns: usize) -> String {
        let longest = self.lanes.iter().map(|lane| lane.name.chars().count()).max().unwrap_or(0);
        let names = longest.min(24);
        let columns = columns.saturating_sub(names + 3).clamp(20, 96);
        let mut text = String::new();
        let at = |ns: i64| {
            let part = (ns - self.from_ns) as f64 / (self.to_ns - self.from_ns) as f64;
            ((part * columns as f64) as usize).min(columns - 1)
        };
        for lane in &self.lanes {
            let mut letters = vec!['.'; columns];
            for (kind, letter, ..) in KINDS {
                for bar in lane.bars.iter().filter(|bar| bar.kind == kind) {
                    letters[at(bar.from_ns)..=at(bar.to_ns)].fill(letter);
                }
            }
            let name: String = lane.name.chars().take(names).collect();
            text.push_str(&format!("{name:names$} |{}|\n", String::from_iter(letters)));
        }
        let ends = format!("{:.1} µs", self.to_ns as f64 / 1e3);
        let begins = format!("{:.1} µs", self.from_ns as f64 / 1e3);
        let gap = columns.saturating_sub(begins.chars().count() + ends.chars().count());
        text.push_str(&format!("{:names$}  {begins}{}{ends}\n", "", " ".repeat(gap)));
        let legend: Vec<_> =
            self.shown().map(|(_, letter, _, words)| format!("{letter} {words}")).collect();
        text.push_str(&format!("{}\n", legend.join(", ")));
        text
    }

    /// Kinds that there are.
    fn shown(&self) -> impl Iterator<Item = &'static (BarKind, char, &'static str, &'static str)> {
        KINDS.iter().filter(|(kind, ..)| {
            self.lanes.iter().flat_map(|lane| &lane.bars).any(|bar| bar.kind == *kind)
        })
    }

    /// As a file.
    pub(crate) fn file(&self) -> String {
        let drawing = self.draw().into_string();
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{drawing}\n")
    }

    fn draw(&self) -> Markup {
        let (width, below) = (NAMES + TIMES + 40.0, LANE * self.lanes.len());
        let height = below + 2 * LANE;
        let ticks =
            (0..=STEPS).map(|step| self.from_ns + (self.to_ns - self.from_ns) * step / STEPS);
        html! {
            svg xmlns="http://www.w3.org/2000/svg" class="cycle" role="img"
                viewBox=(format!("0 0 {width} {height}")) width=(width) height=(height) {
                title { "One cycle: tasks and SubDevices with SYNC0" }
                style { (PreEscaped(STYLE)) }
                @for at in ticks {
                    @let x = format!("{:.1}", self.place(at));
                    line class="grid" x1=(x) x2=(x) y1="0" y2=(below) {}
                    text class="faint" x=(x) y=(below + 14) text-anchor="middle" {
                        (format!("{:.1} µs", at as f64 / 1e3))
                    }
                }
                @for (number, lane) in self.lanes.iter().enumerate() {
                    @let top = LANE * number;
                    text class=[(lane.verdict == Some(TimingVerdict::Fail)).then_some("fail")]
                        x="4" y=(top + 16) { (lane.name) }
                    @for (kind, ..) in KINDS {
                        @for bar in lane.bars.iter().filter(|bar| bar.kind == kind) {
                            (self.bar(bar, top))
                        }
                    }
                }
                @for (number, (_, _, class, words)) in self.shown().enumerate() {
                    @let x = 4 + 130 * number;
                    rect class=(class) x=(x) y=(below + LANE) width="10" height="10" {}
                    text x=(x + 14) y=(below + LANE + 9) { (words) }
                }
            }
        }
    }

    fn bar(&self, bar: &Bar, top: usize) -> Markup {
        let (left, right) = (self.place(bar.from_ns), self.place(bar.to_ns));
        let (_, _, class, words) = bar.kind.described();
        html! {
            rect class=(class) x=(format!("{left:.1}")) y=(top + 4) height=(LANE - 8)
                width=(format!("{:.1}", (right - left).max(LEAST))) {
                title { (words) " " (bar.title) ", " (span(bar.from_ns, bar.to_ns)) }
            }
        }
    }

    fn place(&self, at: i64) -> f64 {
        NAMES + TIMES * (at - self.from_ns) as f64 / (self.to_ns - self.from_ns) as f64
    }
}

/// `300.0 µs`, `-20.0 to 26.7 µs`.
fn span(from_ns: i64, to_ns: i64) -> String {
    let us = |ns: i64| format!("{:.1}", ns as f64 / 1e3);
    match from_ns == to_ns {
        true => format!("{} µs", us(from_ns)),
        false => format!("{} to {} µs", us(from_ns), us(to_ns)),
    }
}

fn signed(span: Span) -> i64 {
    i64::try_from(span.as_nanos()).unwrap_or(i64::MAX)
}

/// A task: its frames at the reference clock, and its program before or behind them.
fn task_lane(plan: &Plan, timing: &PlanTiming, options: &TimingOptions, number: usize) -> Lane {
    let task = &plan.tasks[number];
    let begins = plan.cycle_begin_ns(task);
    let frames = timing.frames.iter().filter(|frame| frame.task == number);
    let mut bars: Vec<Bar> = frames
        .map(|frame| Bar {
            kind: BarKind::Frame,
            from_ns: frame.earliest_ns.saturating_sub(begins),
            to_ns: frame.latest_ns.saturating_sub(begins),
            title: frame.number.to_string(),
        })
        .collect();
    let takes = options.execution.iter().find(|(name, _)| *name == task.name);
    if let Some((_, takes)) = takes {
        let (from_ns, to_ns) = match task.io_at {
            IoAt::TaskBegin => (0, signed(*takes)),
            IoAt::TaskEnd => (-signed(*takes), 0),
        };
        bars.push(Bar { kind: BarKind::Program, from_ns, to_ns, title: task.name.clone() });
    }
    let word = match task.io_at {
        IoAt::TaskBegin => "task-begin",
        IoAt::TaskEnd => "task-end",
    };
    Lane { name: format!("{} ({word})", task.name), verdict: None, bars }
}

/// The bars of a SubDevice: its frames and those of the next cycle, and its work behind each SYNC0 in between.
fn bars(times: &CycleTimes, has_inputs: bool) -> Vec<Bar> {
    let cycle = signed(times.cycle);
    let mut bars = Vec::new();
    for frame in &times.frames {
        let title = match frame.fetches {
            true => format!("{} (inputs)", frame.frame),
            false => frame.frame.to_string(),
        };
        let mut bar = |kind, by: i64| {
            bars.push(Bar {
                kind,
                from_ns: frame.earliest_ns.saturating_add(by),
                to_ns: frame.latest_ns.saturating_add(by),
                title: title.clone(),
            });
        };
        bar(if frame.own { BarKind::Frame } else { BarKind::OtherFrame }, 0);
        bar(BarKind::NextFrame, cycle);
    }
    let often = (times.sync0_cycle < times.cycle).then_some(times.sync0_cycle);
    let step = often.map_or(cycle, signed).max(1);
    let signals = (0..).map(|number| times.sync0_ns.saturating_add(step.saturating_mul(number)));
    // As many as a plot can show.
    for sync0 in signals.take_while(|at| *at < cycle).take(200) {
        let mut bar = |kind, from: Span, to: Span| {
            bars.push(Bar {
                kind,
                from_ns: sync0.saturating_add(signed(from)),
                to_ns: sync0.saturating_add(signed(to)),
                title: String::new(),
            });
        };
        bar(BarKind::Sync0, Span::ZERO, Span::ZERO);
        if let Some(read) = times.outputs_read {
            bar(BarKind::Read, Span::ZERO, read);
        }
        if has_inputs {
            bar(BarKind::Latch, times.input_latch, times.input_latch);
        }
        if let Some(written) = times.inputs_written {
            bar(BarKind::Written, times.input_latch, written);
        }
    }
    bars
}
