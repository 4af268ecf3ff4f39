//! The score as programs read it, `linesman.score/2`.

use std::collections::BTreeMap;

use linesman_config::fault::FaultName;
use serde::Serialize;

use super::listen::report::ListenedReport;
use super::rate::Rate;
use super::set_trial::{SetOutcome, SetTrial};

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.score/2";

/// A whole score. What is said first of a case with one fault is held against the truth; a case
/// counts when the truth log shows an effect, whether or not it was seen.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScoreReport {
    /// `linesman.score/2`.
    pub schema: String,
    /// Name and version of the program.
    pub tool: String,
    /// From the first seed up to, not including, the second.
    pub seeds: (u64, u64),
    /// The only fault that was put in, if it was chosen.
    pub fault: Option<FaultName>,
    /// Whether only recordings were judged.
    pub capture_only: bool,
    /// What was other than the diagnosis expects, if anything.
    pub perturbed: Option<String>,
    /// How the MainDevice drove the line: `own`, or a habit of others.
    pub habit: String,
    /// Cases: one for each seed.
    pub cases: u64,
    /// Cases in which a fault had an effect.
    pub effective_cases: u64,
    /// Single faults: share whose place the first finding names.
    pub place_at_1: f64,
    /// Single faults: share whose cause and place the first finding names.
    pub cause_at_1: f64,
    /// The same, counting places of causes that no evidence can tell apart.
    pub place_at_1_set: f64,
    /// The same, counting causes that no evidence can tell apart.
    pub cause_at_1_set: f64,
    /// Single faults: share that is mended by an exchange of the part that the first finding blames.
    pub repair_at_1: f64,
    /// Runs, or beginnings of runs, in which nothing was wrong.
    pub healthy_runs: u64,
    /// Those of them in which something was said, be it a note; and lines that did not come up.
    pub false_alarms: u64,
    /// Method of a course: clear the counters, watch, look who is missing, who counts first, and who is not in OP.
    pub baseline: Baseline,
    /// To say nothing.
    pub no_diagnosis: Baseline,
    /// Single faults.
    pub single: GroupReport,
    /// Two faults at once: whether the first two findings name both.
    pub double: DoubleReport,
    /// Single faults among counters full of old errors.
    pub masked: GroupReport,
    /// Single faults where no controller counts forwarded errors.
    pub without_forwarded: GroupReport,
    /// Single faults where the card's counters were not known.
    pub without_card_counters: GroupReport,
    /// Single faults in rings.
    pub rings: GroupReport,
    /// Single faults beside rare errors of another cable.
    pub beside_background: GroupReport,
    /// Single faults in plants with a hot connect group.
    pub with_hot_connect: GroupReport,
    /// Faults that are in none of the figures, by name.
    pub left_out: BTreeMap<String, LeftOut>,
    /// Runs in which nothing was wrong.
    pub healthy: HealthyReport,
    /// Single faults by the number of their effects.
    pub by_effects: Vec<Bucket>,
    /// How often findings were right that were so sure: cause and place, without admitted sets.
    pub calibration: Vec<Bin>,
    /// How far confidence is from that on average, weighted by findings: 0 is honest.
    pub calibration_error: f64,
    /// Hard faults at a cycle of 1 ms: share whose cause was named within 100 ms of virtual time, live.
    pub named_in_100_ms: BTreeMap<String, Rate>,
    /// Single faults by name.
    pub per_fault: BTreeMap<String, GroupReport>,
    /// Listeners beside a MainDevice with the habits of others; with `own` there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listened: Option<ListenedReport>,
    /// Sets that made answers right, played again with the causes that were named; none where that was not tried.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub sets: BTreeMap<String, SetReport>,
    /// Seeds that could not be played, and why.
    pub unplayable: Vec<String>,
    /// Cases that were judged wrongly, or with findings that nothing explains; at most 2,000.
    pub wrong: Vec<WrongReport>,
}

/// A way to find faults without this program.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// Single faults: share whose place it names.
    pub place_at_1: f64,
}

/// Faults of one kind.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroupReport {
    /// How many, with an effect.
    pub faults: u64,
    /// The live diagnosis; `null` when only recordings were judged.
    pub live: Option<SideReport>,
    /// The diagnosis of the recordings alone.
    pub capture: SideReport,
    /// The method of a course.
    pub baseline: Rate,
    /// Exchanges that were tried on account of the live diagnosis; `null` when none were.
    pub repairs_tried: Option<RepairReport>,
}

/// Faults that were mended by exchanges of what the diagnosis blamed, with a look again after each that was in vain.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RepairReport {
    /// By the first exchange.
    pub mended_by_first: Rate,
    /// By one of the first two.
    pub by_second: Rate,
    /// By one of the first three.
    pub by_third: Rate,
}

/// How the diagnosis did.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SideReport {
    /// The place is right.
    pub place_at_1: Rate,
    /// Cause and place are right.
    pub cause_at_1: Rate,
    /// The place is right or admitted.
    pub place_at_1_set: Rate,
    /// Cause and place are right or admitted.
    pub cause_at_1_set: Rate,
    /// The part that the first finding blames is the one that carries it.
    pub repair_at_1: Rate,
    /// Faults that did harm, of which a note was all that was said: they count as not found.
    pub notes_instead: u64,
    /// Warnings and errors that nothing explains.
    pub other_findings: u64,
    /// Cycles from the first effect to the first finding at the right place: half of them took no
    /// longer.
    pub cycles_median: Option<u64>,
    /// 95 of 100 took no longer.
    pub cycles_95: Option<u64>,
}

/// Two faults in one case.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoubleReport {
    /// Both places are right or admitted, live.
    pub both_places: Rate,
    /// Both causes are right or admitted, live.
    pub both_causes: Rate,
    /// Both places, by the recordings alone.
    pub both_places_capture: Rate,
    /// Both causes, by the recordings alone.
    pub both_causes_capture: Rate,
    /// One behind the other, live.
    pub in_line: PairRates,
    /// On different branches, live.
    pub on_branches: PairRates,
    /// Begun at one moment, live.
    pub at_one_moment: PairRates,
    /// Begun one after the other, live.
    pub one_after_the_other: PairRates,
    /// Each fault by itself.
    pub faults: GroupReport,
}

/// Pairs of faults of which each has a finding of its own.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairRates {
    /// Both places are right or admitted.
    pub both_places: Rate,
    /// Both causes are right or admitted.
    pub both_causes: Rate,
}

/// Faults of one name that are in none of the figures.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// The truth log shows no effect.
    pub no_effect: u64,
    /// Nothing that anybody can see tells the line from the planned one.
    pub unseen: u64,
    /// It acted, and the other one of two did not: two findings were looked at, and it is no single fault.
    pub alone_of_two: u64,
    /// No plant that was drawn has a place for it.
    pub no_place: u64,
    /// The line did not come up before anything was wrong; that counts as a false alarm.
    pub not_up: u64,
}

/// Runs in which nothing was wrong.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HealthyReport {
    /// Without any finding, notes included, live.
    pub silent: Rate,
    /// Without any finding, by the recordings alone.
    pub silent_capture: Rate,
    /// Time in which nothing was wrong, of all lines together, in hours.
    pub line_hours: f64,
    /// Findings in that time, notes included, live.
    pub findings: u64,
    /// Findings by the recordings alone.
    pub findings_capture: u64,
    /// Findings in a thousand hours, live.
    pub per_1000_hours: Option<f64>,
    /// Upper end of the 95 % interval of that.
    pub per_1000_hours_at_most: Option<f64>,
    /// What they were accused of.
    pub alarms: Vec<String>,
    /// Accusations by the recordings alone, beside those of the live diagnosis; empty where recordings alone are
    /// judged.
    pub alarms_capture: Vec<String>,
}

/// Faults that acted so often.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bucket {
    /// At least.
    pub from: u64,
    /// At most; `null` without bound.
    pub to: Option<u64>,
    /// They.
    #[serde(flatten)]
    pub group: GroupReport,
}

/// Findings that were about so sure.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bin {
    /// Their mean confidence.
    pub confidence: f64,
    /// How often they were right.
    pub right: Rate,
}

/// Single cases that one set made right: whether the cause that was named leaves the same frames and observations as the
/// one that was drawn.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SetReport {
    /// It does.
    pub same: u64,
    /// It does not, with the seed, both causes and the first difference.
    pub parted: Vec<String>,
    /// It could not be played, with the seed, both causes and why.
    pub not_tried: Vec<String>,
}

impl SetReport {
    pub(super) fn add(&mut self, seed: u64, drawn: FaultName, trial: &SetTrial) {
        let text = |what: &str| format!("seed {seed}: {drawn} named {}: {what}", trial.cause);
        match &trial.outcome {
            SetOutcome::Same(_) => self.same += 1,
            SetOutcome::Parted(difference) => self.parted.push(text(difference)),
            SetOutcome::NotTried(why) => self.not_tried.push(text(why)),
        }
    }
}

/// A case that was judged wrongly.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WrongReport {
    /// Its seed.
    pub seed: u64,
    /// SubDevices.
    pub devices: u64,
    /// Whether it is a ring.
    pub ring: bool,
    /// What was injected.
    pub fault: String,
    /// How often it acted.
    pub effects: u64,
    /// What was said live.
    pub live: Option<String>,
    /// What was said of the recording.
    pub capture: String,
    /// All that was said, live where the live diagnosis was judged; at most twelve findings.
    pub findings: Vec<String>,
}
