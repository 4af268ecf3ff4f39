//! A ring with clocks in which much happens: groups join and leave at random ports while cables break and are mended.
//! `cargo bench -p linesman-maindevice --bench ring_soak` does it a thousand times.

use linesman_config::plan::{
    ClockSettings, DevicePlan, HotConnectGroup, IdentificationCheck, Plan, PlanOptions,
};
use linesman_maindevice::{Event, Options};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment_file::SegmentFile;
use linesman_sim::truth::FaultId;

use crate::bench::Bench;
use crate::hot_connect::{source, story};
use crate::ring_cuts::cut;

/// Interval at which clocks are compared.
const SAMPLED: Span = Span::ms(5);
/// Entries of the log that are kept.
const LOGGED: usize = 60;
/// Whoever does not join by then never does.
const PATIENCE: Span = Span::s(8);

/// A group that is plugged in and out: its first SubDevice, its second one, and the ports where it fits.
struct Tool {
    first: &'static str,
    second: &'static str,
    /// Of [`PLACES`].
    fast: bool,
}

const TOOLS: [Tool; 3] = [
    Tool { first: "Z0", second: "W0", fast: false },
    Tool { first: "X0", second: "Y0", fast: true },
    Tool { first: "X1", second: "Y1", fast: true },
];

/// Ports for tools, the fast connecting ones and the usual ones.
const PLACES: [(&str, bool); 8] = [
    ("J3.D", false),
    ("J3.B", false),
    ("J0.D", true),
    ("J0.B", true),
    ("J1.D", true),
    ("J1.B", true),
    ("J2.D", true),
    ("J2.B", true),
];
/// Planned place of each tool, of [`PLACES`].
const PLANNED: [usize; 3] = [0, 2, 3];

/// The segment file: couplers in a ring with a terminal each, and junctions at three of them. Clocks of couplers come before the tools
/// and behind them.
fn with_tools() -> (SegmentFile, Vec<String>) {
    let mut text = "name = \"ring with tools\"\nseed = 3\n".to_owned();
    let mut cables = Vec::new();
    let mut on = "maindevice".to_owned();
    let junction = |name: &str, kind: &str, on: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    let tool = |at: usize| {
        let Tool { first, second, fast } = TOOLS[at];
        let kind = if fast { "EK1101-0080" } else { "EK1101" };
        let (on, _) = PLACES[PLANNED[at]];
        format!(
            "[[device]]\nname = \"{first}\"\ntype = \"{kind}\"\non = \"{on}\"\nid = {}\n\
             [[device]]\nname = \"{second}\"\ntype = \"EL3102\"\non = \"{first}.B\"\n",
            5 + at
        )
    };
    for number in 0..6 {
        let ppm = (number * 37 % 101) as f64 - 50.0;
        text += &format!(
            "[[device]]\nname = \"K{number}\"\ntype = \"EK1100\"\non = \"{on}\"\ncable_m = 20.0\nclock_ppm = {ppm:.1}\n\
             [[device]]\nname = \"T{number}\"\ntype = \"EL2008\"\non = \"K{number}.B\"\n"
        );
        // In processing order, as the plan counts them: of a junction the contact behind it comes last.
        match number {
            1 => text += &(junction("J3", "EK1122", "T1.B") + &tool(0)),
            2 => {
                text += &(junction("J0", "EK1122-0080", "T2.B") + &tool(1) + &tool(2));
                text += &junction("J1", "EK1122-0080", "J0.C");
            }
            4 => text += &junction("J2", "EK1122-0080", "T4.B"),
            _ => {}
        }
        cables.push(format!("{on}-K{number}.A"));
        on = format!("K{number}.C");
    }
    cables.push(format!("{on}-maindevice.B"));
    text += &format!("[ring]\ncloses_at = \"{on}\"\n");
    (SegmentFile::parse(&text).unwrap(), cables)
}

fn options() -> Options {
    Options { ring: true, ..Options::default() }
}

/// Its plan: the tools may be absent, and couplers and some terminals have clocks that are used.
fn plan_with_tools(file: &SegmentFile) -> Plan {
    let mut bench = Bench::of(file, options());
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    let mut groups = Vec::new();
    for (at, tool) in TOOLS.iter().enumerate() {
        let first = bench.id(tool.first);
        let device = &mut planned[first.index()];
        let (source, value) = (source(&device.profile), 5 + at as u32);
        device.settings.identification =
            Some(IdentificationCheck { source, value, compulsory: true });
        groups.push(HotConnectGroup {
            name: tool.first.to_owned(),
            members: vec![first, DeviceId(first.0 + 1)],
            optional: true,
            places: Vec::new(),
        });
    }
    let is_clocked = |name: &str| ["EK1100", "EL3102"].contains(&name);
    for device in planned.iter_mut().filter(|one| is_clocked(&one.profile.type_name)) {
        device.settings.clock = Some(ClockSettings::default());
    }
    let options = PlanOptions { groups, clock_datagrams: true, ..PlanOptions::default() };
    Plan::build(&planned, inventory.tree().clone(), &options).unwrap()
}

/// How far the clocks of these are apart, in ns.
fn spread(bench: &Bench, devices: &[DeviceId]) -> i64 {
    let time = |id: &DeviceId| bench.segment.controller(*id).unwrap().system_time(bench.now);
    let times: Vec<u64> = devices.iter().map(time).collect();
    let off = times.iter().map(|time| i64::from(time.wrapping_sub(times[0]) as u32 as i32));
    off.clone().max().unwrap() - off.min().unwrap()
}

/// What is observed while much happens.
#[derive(Default, Debug)]
pub(crate) struct Observed {
    pub(crate) cycles: u64,
    /// At usual ports, and at fast connecting ones.
    pub(crate) joins: [u32; 2],
    pub(crate) slowest: [Span; 2],
    pub(crate) leaves: u32,
    pub(crate) cuts: u32,
    pub(crate) mends: u32,
    /// Cycles in which data of SubDevices that stay were not valid: by a cut or a mending, as a tool was pulled whose frame it was, and
    /// without either.
    pub(crate) lost_by_break: u32,
    pub(crate) lost_by_pull: u32,
    pub(crate) lost_else: u32,
    /// Greatest distance between clocks of those that stay, samples in which it was above 100 ns, and all samples.
    pub(crate) worst_ns: i64,
    pub(crate) apart: u64,
    pub(crate) samples: u64,
    /// The first of those samples.
    apart_at: Option<Instant>,
    /// Events up to then, the latest last.
    log: Vec<String>,
    /// Greatest distance of the clock of one that had just joined from that of the first SubDevice.
    pub(crate) newcomer_ns: i64,
    /// When tools were pulled.
    pulled: Vec<Instant>,
    /// When cables were cut, and when the ring was found open or whole.
    disturbed: Vec<Instant>,
}

/// A running ring with its tools.
struct RingWithTools {
    bench: Bench,
    cables: Vec<String>,
    /// Of those that stay.
    clocks: Vec<DeviceId>,
    stream: Stream,
    observed: Observed,
    broken: Option<FaultId>,
    is_in: [bool; 3],
    /// Place of each tool now, or its last one: the segment keeps the port of one that is out for it.
    last: [usize; 3],
}

impl RingWithTools {
    fn running(seed: u64) -> Self {
        let (file, cables) = with_tools();
        let plan = plan_with_tools(&file);
        let mut bench = Bench::of(&file, options());
        for tool in &TOOLS {
            bench.segment.unplug(bench.now, tool.first).unwrap();
        }
        bench.run_for(Span::ms(10));
        bench.device.start(bench.now, plan.clone());
        let all = bench.run_until(Span::s(20), |event| matches!(event, Event::AllReached));
        assert!(all, "{}", story(&bench));
        // Clocks learn their speeds.
        bench.run_for(Span::s(20));
        bench.events.clear();
        let is_fixed = |device: &&DevicePlan| plan.group_of(device.id).is_none();
        let fixed = plan.devices.iter().filter(is_fixed);
        bench.judged_too = fixed.clone().map(|device| device.id).collect();
        bench.judged = bench.judged_too.first().copied();
        let clocked = fixed.filter(|device| device.settings.clock.is_some());
        let clocks = clocked.map(|device| device.id).collect();
        let (observed, stream) = (Observed::default(), Seed(seed).stream("ring soak"));
        let (is_in, last) = ([false; 3], PLANNED);
        Self { bench, cables, clocks, stream, observed, broken: None, is_in, last }
    }

    fn drawn(&mut self, count: usize) -> usize {
        self.stream.between(0, count as u64 - 1) as usize
    }

    /// Goes on for a while; the first event of this kind ends it.
    fn watch(&mut self, span: Span, until: impl Fn(&Event) -> bool) -> bool {
        let end = self.bench.now + span;
        let mut done = false;
        while !done && self.bench.now < end {
            done = self.bench.run_until(SAMPLED, &until);
            let apart = spread(&self.bench, &self.clocks);
            self.observed.samples += 1;
            self.observed.apart += u64::from(apart > 100);
            self.observed.worst_ns = self.observed.worst_ns.max(apart);
            self.note(story(&self.bench));
            if apart > 100 {
                self.observed.apart_at.get_or_insert(self.bench.now);
            }
            let is_of_ring = |event: &Event| matches!(event, Event::Ring { .. });
            let changed = self.bench.events.iter().filter(|(_, event)| is_of_ring(event));
            self.observed.disturbed.extend(changed.map(|(at, _)| *at));
            self.bench.events.clear();
        }
        done
    }

    /// Adds to the log, as long as clocks were never apart.
    fn note(&mut self, what: String) {
        let log = &mut self.observed.log;
        if self.observed.apart_at.is_none() && !what.is_empty() {
            log.push(what);
            log.drain(..log.len().saturating_sub(LOGGED));
        }
    }

    /// Plugs a tool in at a random free port that fits.
    fn plug(&mut self, at: usize) {
        let is_free = |place: &usize| {
            let of_others = self.last.iter().enumerate().filter(|(other, _)| *other != at);
            PLACES[*place].1 == TOOLS[at].fast
                && of_others.into_iter().all(|(_, last)| last != place)
        };
        let free: Vec<usize> = (0..PLACES.len()).filter(is_free).collect();
        let place = free[self.drawn(free.len())];
        let on = (place != self.last[at]).then(|| PLACES[place].0.parse().unwrap());
        self.note(format!(
            "{} {} plugged in at {}",
            self.bench.now, TOOLS[at].first, PLACES[place].0
        ));
        self.bench.segment.plug(self.bench.now, TOOLS[at].first, on.as_ref()).unwrap();
        self.last[at] = place;
    }

    /// Pulls a tool, at any moment of the cycle.
    fn pull(&mut self, at: usize) {
        let moment = Span::us(self.stream.between(0, 1_000));
        self.bench.run_for(moment);
        self.bench.segment.unplug(self.bench.now, TOOLS[at].first).unwrap();
        self.note(format!("{} {} pulled", self.bench.now, TOOLS[at].first));
        self.observed.pulled.push(self.bench.now);
        self.observed.leaves += 1;
    }

    /// Mends the cable that is cut, or cuts one, after a while.
    fn cut_or_mend(&mut self) {
        let before = Span::us(self.stream.between(0, 200_000));
        self.watch(before, |_| false);
        match self.broken.take() {
            Some(fault) => {
                self.note(format!("{} mended", self.bench.now));
                self.bench.segment.heal(self.bench.now, fault);
                self.observed.mends += 1;
            }
            // A second break would take SubDevices out of reach: the link has to be up again.
            None if self.bench.device.ring_intact() != Some(true) => {}
            None => {
                let at = self.drawn(self.cables.len());
                self.observed.disturbed.push(self.bench.now);
                self.note(format!("{} {} cut", self.bench.now, self.cables[at]));
                self.broken = Some(cut(&mut self.bench, &self.cables[at]));
                self.observed.cuts += 1;
            }
        }
    }

    /// Waits for a tool that was plugged in then.
    fn join(&mut self, at: usize, plugged: Instant) {
        let is_here =
            |event: &Event| matches!(event, Event::GroupJoined { group, .. } if *group == at);
        let has_joined = self.bench.device.network_status().unwrap().groups()[at].has_joined();
        let done = has_joined || self.watch(PATIENCE, is_here);
        assert!(done, "{} does not join: {:?}", TOOLS[at].first, self.observed);
        let newcomer = self.bench.id(TOOLS[at].second);
        let off = spread(&self.bench, &[self.clocks[0], newcomer]);
        self.observed.newcomer_ns = self.observed.newcomer_ns.max(off);
        let kind = usize::from(TOOLS[at].fast);
        self.observed.joins[kind] += 1;
        let took = self.bench.now.since(plugged);
        self.observed.slowest[kind] = self.observed.slowest[kind].max(took);
    }

    /// Sorts the cycles that were lost by what was near.
    fn finish(mut self) -> Observed {
        let near = |times: &[Instant], bad: Instant| {
            times.iter().any(|at| bad.as_nanos().abs_diff(at.as_nanos()) < 3_000_000)
        };
        let observed = &mut self.observed;
        observed.cycles = self.bench.cycles;
        for bad in self.bench.bad_at {
            match () {
                () if near(&observed.disturbed, bad) => observed.lost_by_break += 1,
                // A frame that is in the branch at the moment in which its cable is pulled is lost.
                () if near(&observed.pulled, bad) => observed.lost_by_pull += 1,
                () => observed.lost_else += 1,
            }
        }
        self.observed
    }
}

/// Tools join so often, and leave, at random free ports; meanwhile cables of the ring break and are mended, one at a time. `told` hears
/// of each hundredth join.
pub(crate) fn soak(seed: u64, joins: u32, mut told: impl FnMut(u32)) -> Observed {
    let mut ring = RingWithTools::running(seed);
    let mut joined = 0;
    for step in 0.. {
        if joined == joins {
            break;
        }
        let at = ring.drawn(TOOLS.len());
        let joins = !ring.is_in[at];
        ring.is_in[at] = joins;
        let plugged = ring.bench.now;
        if joins {
            ring.plug(at)
        } else {
            ring.pull(at)
        }
        if step % 4 == 1 {
            // In the midst of that.
            ring.cut_or_mend();
        }
        if joins {
            ring.join(at, plugged);
            joined += 1;
            if joined % 100 == 0 {
                told(joined);
            }
        } else {
            let span = Span::ms(ring.stream.between(150, 400));
            ring.watch(span, |_| false);
        }
    }
    ring.finish()
}

// proves: RED-13 (S)
#[test]
fn groups_join_and_leave_a_ring_with_clocks_while_its_cables_break() {
    let observed = soak(11, 200, |_| ());
    let Observed { joins, cuts, mends, leaves, slowest, .. } = observed;
    assert_eq!(observed.lost_else, 0, "{observed:?}");
    assert!(observed.lost_by_break <= cuts + mends, "{observed:?}");
    assert!(observed.lost_by_pull <= leaves / 10, "{observed:?}");
    // One frame finds a group there, or gone, before the delays behind it are measured again.
    assert!(observed.worst_ns <= 200 && observed.apart <= observed.samples / 50, "{observed:?}");
    // It has just begun to learn its speed.
    assert!(observed.newcomer_ns <= 5_000, "{observed:?}");
    assert!(joins[0] >= 40 && joins[1] >= 100 && cuts >= 20, "{observed:?}");
    assert!(slowest[0] < Span::s(4) && slowest[1] < Span::ms(300), "{observed:?}");
}
