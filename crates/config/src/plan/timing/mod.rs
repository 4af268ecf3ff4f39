//! Timing of a plan: whether each SubDevice with SYNC0 gets its outputs in time and has its inputs ready in time,
//! by how much, and which shift mends it where it does not.
//!
//! A calculation: what goes in is the plan and [`TimingOptions`], what comes out is [`PlanTiming`] with the sentences
//! that tell what was assumed. Nothing passes without evidence: where times of a SubDevice are not known, it is not
//! judged. Reference: S0 L225-274, L399-475, L611-714.

mod assumption;
mod device_timing;
mod estimate;
mod frame_time;
mod line_delay;
mod proposal;

#[cfg(test)]
mod tests;

use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;

use super::shift::signed;
use super::{DevicePlan, Plan};
use assumption::Assumed;
use frame_time::frame_times;

pub use assumption::TimingOptions;
pub use device_timing::{
    CycleTimes, DeviceTiming, FrameArrival, RuleTiming, SlowerTask, TimingVerdict,
};
pub use estimate::{InputsEstimate, OutputsEstimate};
pub use frame_time::FrameTime;

/// The timing of a plan.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PlanTiming {
    /// How early and how late the MainDevice sends at the most, as it is reckoned with.
    pub jitter: Span,
    /// The smallest shift of the outputs by rule of thumb.
    pub outputs: OutputsEstimate,
    /// The smallest shift of the inputs by rule of thumb; `None` where no SubDevice refers to it.
    pub inputs: Option<InputsEstimate>,
    /// The cyclic frames; none where nothing ties them to SYNC0.
    pub frames: Vec<FrameTime>,
    /// The SubDevices with SYNC0, in their order.
    pub devices: Vec<DeviceTiming>,
    /// The shift of the outputs with which all pass that refer to it, where they do not.
    pub outputs_shift: Option<Span>,
    /// The shift of the inputs with which all pass that refer to it, in ns, where they do not.
    pub inputs_shift_ns: Option<i64>,
    /// What was not given and is assumed.
    pub assumed: Vec<String>,
}

impl PlanTiming {
    /// What follows for the plan: one that fails decides, then one that was not judged.
    #[must_use]
    pub fn verdict(&self) -> TimingVerdict {
        let is = |verdict| self.devices.iter().any(|device| device.verdict == verdict);
        if is(TimingVerdict::Fail) {
            TimingVerdict::Fail
        } else if is(TimingVerdict::NotJudged) || self.devices.is_empty() {
            TimingVerdict::NotJudged
        } else {
            TimingVerdict::Pass
        }
    }
}

impl Plan {
    /// True if a SubDevice works in step with SYNC0.
    #[must_use]
    pub fn has_sync0(&self, device: DeviceId) -> bool {
        let clock = self.device(device).and_then(|device| device.settings.clock);
        clock.is_some_and(|clock| clock.sync0())
    }

    /// The timing of all SubDevices with SYNC0 (SYN-06, SYN-27, SYN-28).
    #[must_use]
    pub fn timing(&self, options: &TimingOptions) -> PlanTiming {
        let assumed = Assumed::of(self, options);
        let delays = line_delay::line_delays(self, &assumed);
        let frames = frame_times(self, &assumed);
        let clocked = self.devices.iter().filter(|device| self.has_sync0(device.id));
        let mut devices: Vec<DeviceTiming> = clocked
            .map(|device| {
                let delay = delays.get(device.id.index()).copied().unwrap_or_default();
                let times = match &frames {
                    Some(frames) => CycleTimes::of(self, device, frames, delay),
                    None => Err("no frame brings the time of the reference clock: nothing ties \
                                 the frames to SYNC0"),
                };
                match times {
                    Ok(times) => judged(self, device, times, assumed.margin),
                    Err(lacks) => DeviceTiming::unknown(self, device, lacks),
                }
            })
            .collect();
        for device in &mut devices {
            proposal::for_one(self, device, assumed.margin);
        }
        PlanTiming {
            jitter: assumed.jitter,
            outputs: estimate::outputs(self, &assumed),
            inputs: estimate::inputs(self, &assumed),
            outputs_shift: proposal::outputs_shift(self, &devices, assumed.margin),
            inputs_shift_ns: proposal::inputs_shift_ns(self, &devices, assumed.margin),
            frames: frames.unwrap_or_default(),
            devices,
            assumed: assumed.told,
        }
    }
}

fn judged(plan: &Plan, device: &DevicePlan, times: CycleTimes, margin: Span) -> DeviceTiming {
    let margins = times.margins(times.sync0_ns);
    let rule = |(left, frame): (i64, usize)| RuleTiming {
        verdict: match left >= signed(margin) {
            true => TimingVerdict::Pass,
            false => TimingVerdict::Fail,
        },
        margin_ns: Some(left),
        frame: Some(frame),
        lacks: String::new(),
    };
    let (after_frames, mut before_next) = (rule(margins.first), rule(margins.second));
    if let Some(lacks) = times.lacks(device) {
        // Without its work SYNC0 itself may come too late already; else nobody knows.
        if before_next.verdict == TimingVerdict::Pass {
            before_next = RuleTiming::not_judged(lacks);
        }
    }
    let min_cycle = device.sync_times.min_cycle();
    let too_fast = min_cycle.filter(|min_cycle| times.sync0_cycle < *min_cycle);
    let all = [after_frames.verdict, before_next.verdict];
    let verdict = if too_fast.is_some() || all.contains(&TimingVerdict::Fail) {
        TimingVerdict::Fail
    } else if all.contains(&TimingVerdict::NotJudged) {
        TimingVerdict::NotJudged
    } else {
        TimingVerdict::Pass
    };
    DeviceTiming {
        device: device.id,
        reference: plan.shift_reference(device),
        after_frames,
        before_next,
        too_fast,
        verdict,
        own_shift_ns: None,
        slower: None,
        assumed: assumed_of(device),
        times: Some(times),
    }
}

/// What is assumed of a SubDevice alone.
fn assumed_of(device: &DevicePlan) -> Vec<String> {
    let mut told = Vec::new();
    if !device.outputs.is_empty() && device.sync_times.outputs.calc_and_copy().is_none() {
        told.push(
            "the time it needs between frame and SYNC0 (0x1C32:06) is not known: taken as 0"
                .to_owned(),
        );
    }
    if device.sync_times.min_cycle().is_none() {
        told.push("its shortest cycle (0x1C32:05, 0x1C33:05) is not known: it is believed to bear this one".to_owned());
    }
    if device.settings.clock.is_some_and(|clock| clock.sync1()) {
        told.push("its SYNC1 is not judged".to_owned());
    }
    told
}
