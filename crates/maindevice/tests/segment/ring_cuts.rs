//! Rings whose cables are cut and mended at many moments of the cycle, one or two at a time, before the start or later:
//! cycles that are lost, and inputs that are shown as fresh although they are not. `cargo bench -p linesman-maindevice
//! --bench ring_cuts` does it with a long ring.

use linesman_config::plan::Plan;
use linesman_maindevice::{Event, Options};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::FaultId;

use crate::bench::Bench;

const CYCLE: Span = Span::ms(1);
/// Frames of the longest ring here are on their way for less than that.
const IN_FLIGHT: Span = Span::us(100);
/// A link that comes up, and whoever comes back by it, need no longer than that.
const MENDED: Span = Span::s(10);

pub(crate) fn cut(bench: &mut Bench, place: &str) -> FaultId {
    let entry = FaultEntry::new("link-open".parse().unwrap()).at(place);
    bench.segment.inject(bench.now, &entry).unwrap()
}

/// A ring of boxes with inputs and outputs.
pub(crate) struct RingOfBoxes {
    text: String,
    cables: Vec<String>,
    plan: Plan,
}

/// How many events cost no cycle, one, and more.
pub(crate) type LostCycles = [u32; 3];

impl RingOfBoxes {
    pub(crate) fn new(count: usize) -> Self {
        let mut text = "name = \"boxes\"\n".to_owned();
        let mut cables = Vec::new();
        let mut on = "maindevice".to_owned();
        for number in 0..count {
            text += &format!(
                "[[device]]\nname = \"B{number}\"\ntype = \"EP2308-0001\"\non = \"{on}\"\ncable_m = 10.0\n"
            );
            cables.push(format!("{on}-B{number}.A"));
            on = format!("B{number}.B");
        }
        cables.push(format!("{on}-maindevice.B"));
        text += &format!("[ring]\ncloses_at = \"{on}\"\n");
        let plan = bench(&text).start(AlState::Op);
        Self { text, cables, plan }
    }

    /// A bench on which it runs, with this cable open before.
    pub(crate) fn running(&self, open: Option<&str>) -> (Bench, Option<FaultId>) {
        let mut bench = bench(&self.text);
        let fault = open.map(|cable| cut(&mut bench, cable));
        bench.run_for(Span::ms(10));
        bench.device.start(bench.now, self.plan.clone());
        let all = bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached));
        assert!(all, "{open:?}: not all reach OP: {:#?}", bench.events.last());
        bench.judged = self.plan.devices.first().map(|device| device.id);
        bench.judged_too = self.plan.devices.iter().map(|device| device.id).collect();
        (bench, fault)
    }

    /// Cuts and mends every cable at such moments. A cycle is lost when the process data of any SubDevice are not valid in
    /// it.
    pub(crate) fn lost_cycles(&self, phases: u32) -> (LostCycles, LostCycles) {
        let (mut bench, _) = self.running(None);
        let (mut when_cut, mut when_mended) = (LostCycles::default(), LostCycles::default());
        let note = |table: &mut LostCycles, lost: u64| table[lost.min(2) as usize] += 1;
        for cable in &self.cables {
            for phase in 0..phases {
                let at = moment(phase, phases);
                run_into_cycle(&mut bench, at);
                let before = bench.bad_cycles;
                let fault = cut(&mut bench, cable);
                bench.run_for(Span::ms(20));
                note(&mut when_cut, bench.bad_cycles - before);
                run_into_cycle(&mut bench, at);
                let before = bench.bad_cycles;
                bench.segment.heal(bench.now, fault);
                assert!(is_whole_again(&mut bench), "{cable}, {phase}");
                bench.run_for(Span::ms(20));
                note(&mut when_mended, bench.bad_cycles - before);
                bench.events.clear();
            }
        }
        (when_cut, when_mended)
    }

    /// Starts with each cable open, in turn; closes it. How many starts there were, and how many inputs were stale.
    pub(crate) fn started_open(&self) -> (u32, u64) {
        let (mut starts, mut stale) = (0, 0);
        for cable in &self.cables {
            let (mut bench, fault) = self.running(Some(cable));
            assert_eq!(bench.device.ring_intact(), Some(false), "{cable}");
            stale += self.stale(&mut bench, Span::ms(30), &[]);
            bench.segment.heal(bench.now, fault.unwrap());
            assert!(is_whole_again(&mut bench), "{cable}");
            stale += self.stale(&mut bench, Span::ms(30), &[]);
            starts += 1;
        }
        (starts, stale)
    }

    /// Cuts two cables, for each `step`-th pair of them, and mends them. Pairs, and inputs that were stale. Who is between is
    /// out of reach and said to be, and nobody else.
    pub(crate) fn two_cuts(&self, step: usize) -> (u32, u64) {
        let (mut bench, _) = self.running(None);
        let (mut pairs, mut stale) = (0, 0);
        let count = self.cables.len();
        let all =
            (0..count).flat_map(|first| (first + 1..count).map(move |second| (first, second)));
        for (first, second) in all.step_by(step) {
            let faults = [first, second].map(|at| cut(&mut bench, &self.cables[at]));
            // The box in front of which a cable lies has its number.
            let between: Vec<DeviceId> =
                (first..second).map(|number| DeviceId(number as u32)).collect();
            stale += self.until_all_but(&mut bench, &between);
            stale += self.stale(&mut bench, Span::ms(20), &between);
            for fault in faults {
                bench.segment.heal(bench.now, fault);
            }
            stale += self.until_all_but(&mut bench, &[]);
            bench.events.clear();
            pairs += 1;
        }
        (pairs, stale)
    }

    /// Switches each box off, in turn, and on again. How many there were, and how many inputs were stale.
    pub(crate) fn one_off(&self) -> (u32, u64) {
        let (mut bench, _) = self.running(None);
        let mut stale = 0;
        for (number, device) in self.plan.devices.iter().enumerate() {
            let entry = FaultEntry::new("device-off".parse().unwrap()).device(format!("B{number}"));
            let fault = bench.segment.inject(bench.now, &entry).unwrap();
            stale += self.until_all_but(&mut bench, &[device.id]);
            stale += self.stale(&mut bench, Span::ms(20), &[device.id]);
            bench.segment.heal(bench.now, fault);
            stale += self.until_all_but(&mut bench, &[]);
            bench.events.clear();
        }
        (self.plan.devices.len() as u32, stale)
    }

    /// Goes on until all are valid but these, and the ring is whole if there are none. How many inputs were stale meanwhile.
    fn until_all_but(&self, bench: &mut Bench, absent: &[DeviceId]) -> u64 {
        let is_so = |bench: &Bench| {
            let is_right = |id: DeviceId| bench.device.quality(id).valid != absent.contains(&id);
            self.plan.devices.iter().all(|device| is_right(device.id))
                && (!absent.is_empty() || bench.device.ring_intact() == Some(true))
        };
        let (end, mut stale) = (bench.now + MENDED, 0);
        while !is_so(bench) {
            assert!(bench.now < end, "all but {absent:?}: {:#?}", bench.events.last());
            stale += self.stale(bench, Span::ms(20), &[]);
        }
        stale
    }

    /// Lets inputs change with each cycle and counts those that are shown as valid with a value of more than three cycles
    /// ago. Of `absent`, if there are any, nobody must be valid and all others must.
    fn stale(&self, bench: &mut Bench, span: Span, absent: &[DeviceId]) -> u64 {
        const REMEMBERED: u64 = 3;
        let mut stale = 0;
        for step in 1..=span.as_nanos() / CYCLE.as_nanos() {
            // The low four bits of the count of cycles.
            let value = |back: u64| (step.wrapping_sub(back) % 16) as u8;
            for device in &self.plan.devices {
                let signals = bench.segment.inputs(device.id).to_vec();
                for (bit, signal) in signals.into_iter().take(4).enumerate() {
                    let is_on = value(0) >> bit & 1;
                    bench.segment.signals_mut().set(signal, i32::from(is_on));
                }
            }
            bench.run_for(CYCLE);
            for device in &self.plan.devices {
                let valid = bench.device.quality(device.id).valid;
                let inputs = bench.device.inputs()[device.inputs.clone()][0] & 0x0F;
                let is_fresh = (0..=REMEMBERED).any(|back| value(back) == inputs);
                stale += u64::from(valid && !is_fresh && step > REMEMBERED);
                if !absent.is_empty() {
                    assert_eq!(valid, !absent.contains(&device.id), "{:?}", device.id);
                }
            }
        }
        stale
    }
}

fn bench(text: &str) -> Bench {
    Bench::with_options(text, Options { ring: true, ..Options::default() })
}

fn is_whole_again(bench: &mut Bench) -> bool {
    bench.run_until(MENDED, |event| matches!(event, Event::Ring { intact: true }))
}

/// When something happens in the cycle: half of the phases are spread over all of it, half over the time in which its frames
/// are on their way.
fn moment(phase: u32, phases: u32) -> Span {
    let half = u64::from(phases / 2);
    let phase = u64::from(phase);
    match phase.checked_sub(half) {
        None => Span::ns(CYCLE.as_nanos() * phase / half),
        Some(phase) => Span::ns(IN_FLIGHT.as_nanos() * phase / half),
    }
}

/// Goes on until so long after the begin of the cycle after the next.
fn run_into_cycle(bench: &mut Bench, at: Span) {
    let next = bench.device.next_cycle(0).unwrap();
    bench.run_for((next + CYCLE + at).since(bench.now));
}

#[test]
fn every_cable_of_a_ring_cut_and_mended_at_several_phases_costs_one_cycle_at_most() {
    let (when_cut, when_mended) = RingOfBoxes::new(4).lost_cycles(40);
    assert_eq!((when_cut[2], when_mended[2]), (0, 0), "{when_cut:?} {when_mended:?}");
    assert_eq!(when_cut.iter().sum::<u32>(), 5 * 40);
}

#[test]
fn ring_starts_with_each_cable_open_and_bears_two_cuts_and_a_box_that_is_off_with_nothing_stale() {
    let ring = RingOfBoxes::new(4);
    assert_eq!(ring.started_open(), (5, 0));
    assert_eq!(ring.two_cuts(1), (10, 0));
    assert_eq!(ring.one_off(), (4, 0));
}
