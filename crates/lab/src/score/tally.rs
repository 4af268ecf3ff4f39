//! Tally of cases, in the order of their seeds.

use std::collections::BTreeMap;

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;

use super::case::{CaseKind, ScoreOptions};
use super::judge::{Accusations, Judged};
use super::listen::tally::ListenTally;
use super::outcome::{CaseReport, FaultOutcome};
use super::rate::{Count, at_most, per_1000_hours, rounded};
use super::repair_trial::MOST_EXCHANGES;
use super::report::{
    Baseline, Bin, Bucket, DoubleReport, GroupReport, HealthyReport, LeftOut, PairRates,
    RepairReport, SCHEMA, ScoreReport, SetReport, SideReport, WrongReport,
};
use super::unplayable::Unplayable;
use crate::habit::Habit;
use crate::verdict::{Grade, Match};

/// Bins of confidence.
const BINS: usize = 10;
/// Cases shown in which the first finding was wrong.
const MOST_WRONG: usize = 2_000;

/// Faults that leave no doubt that something is wrong.
const HARD: [FaultName; 5] = [
    FaultName::LinkOpen,
    FaultName::DeviceOff,
    FaultName::SupplyOff,
    FaultName::BrownOut,
    FaultName::SyncLost,
];
/// At this cycle it is measured how soon they are named.
const FAST_CYCLE: Span = Span::ms(1);
/// Named so soon they are named fast.
const SOON: Span = Span::ms(100);

/// By effects: up to so many.
const EFFECTS: [(u64, u64); 4] = [(1, 1), (2, 9), (10, 99), (100, u64::MAX)];

/// What a side said of faults, live or of recordings.
#[derive(Clone, Debug, Default)]
struct Side {
    place: Count,
    cause: Count,
    place_set: Count,
    cause_set: Count,
    repair: Count,
    notes: u64,
    others: u64,
    cycles: Vec<u64>,
}

impl Side {
    fn add(&mut self, fault: &FaultOutcome, judged: &Judged) {
        let fits = held(fault, judged);
        self.notes += u64::from(!is_answer(fault, judged));
        self.repair.add(judged.is_repaired && is_answer(fault, judged));
        self.place.add(fits.place == Grade::Exact);
        self.cause.add(fits.cause == Grade::Exact);
        self.place_set.add(fits.place.is_right());
        self.cause_set.add(fits.cause.is_right());
        self.others += judged.others;
        self.cycles.extend(judged.cycles);
    }

    fn report(&self) -> SideReport {
        let mut cycles = self.cycles.clone();
        cycles.sort_unstable();
        let at = |share: f64| {
            let last = cycles.len().checked_sub(1)?;
            cycles.get((last as f64 * share).round() as usize).copied()
        };
        SideReport {
            place_at_1: self.place.rate(),
            cause_at_1: self.cause.rate(),
            place_at_1_set: self.place_set.rate(),
            cause_at_1_set: self.cause_set.rate(),
            repair_at_1: self.repair.rate(),
            notes_instead: self.notes,
            other_findings: self.others,
            cycles_median: at(0.5),
            cycles_95: at(0.95),
        }
    }
}

/// Faults of one kind.
#[derive(Clone, Debug, Default)]
struct Group {
    faults: u64,
    live: Side,
    capture: Side,
    baseline: Count,
    /// By number of exchanges, of repairs that were tried.
    mended: [Count; MOST_EXCHANGES as usize],
}

impl Group {
    fn add(&mut self, fault: &FaultOutcome) {
        self.faults += 1;
        if let (Some(trial), Some(live)) = (fault.repair, &fault.live) {
            let mended_by = trial.mended_by.filter(|_| is_answer(fault, live));
            for (number, count) in (1..).zip(&mut self.mended) {
                count.add(mended_by.is_some_and(|by| by <= number));
            }
        }
        if let Some(live) = &fault.live {
            self.live.add(fault, live);
        }
        self.capture.add(fault, &fault.capture);
        self.baseline.add(fault.baseline);
    }

    fn report(&self) -> GroupReport {
        let [mended_by_first, by_second, by_third] = self.mended.map(|count| count.rate());
        GroupReport {
            repairs_tried: (mended_by_first.of > 0).then_some(RepairReport {
                mended_by_first,
                by_second,
                by_third,
            }),
            faults: self.faults,
            live: (self.live.place.rate().of > 0).then(|| self.live.report()),
            capture: self.capture.report(),
            baseline: self.baseline.rate(),
        }
    }
}

/// Fit of the answer to a fault: a note that something is worth knowing is no answer where something is wrong.
fn held(fault: &FaultOutcome, judged: &Judged) -> Match {
    if is_answer(fault, judged) { judged.fits } else { Match::NONE }
}

/// False for a note where something is wrong.
const fn is_answer(fault: &FaultOutcome, judged: &Judged) -> bool {
    fault.is_bearable || !judged.is_note
}

/// Both faults of a case.
#[derive(Clone, Copy, Debug, Default)]
struct Pairs {
    places: Count,
    causes: Count,
}

impl Pairs {
    fn add(&mut self, fits: &[Match]) {
        if fits.is_empty() {
            return;
        }
        self.places.add(fits.iter().all(|one| one.place.is_right()));
        self.causes.add(fits.iter().all(|one| one.cause.is_right()));
    }

    fn report(self) -> PairRates {
        PairRates { both_places: self.places.rate(), both_causes: self.causes.rate() }
    }
}

/// How sure findings were, and how often they were right.
#[derive(Clone, Copy, Debug, Default)]
struct Confidence {
    count: Count,
    sum: f64,
}

/// Cases added up.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    options: ScoreOptions,
    seeds: Option<(u64, u64)>,
    cases: u64,
    effective: u64,
    unplayable: Vec<String>,
    left_out: BTreeMap<String, LeftOut>,
    healthy: Count,
    healthy_capture: Count,
    healthy_for: Span,
    findings_of_healthy: [u64; 2],
    alarms: Vec<String>,
    alarms_capture: Vec<String>,
    single: Group,
    masked: Group,
    without_forwarded: Group,
    rings: Group,
    without_card: Group,
    double: Group,
    pairs: Pairs,
    pairs_capture: Pairs,
    pairs_by_kind: [Pairs; 4],
    background: Group,
    with_groups: Group,
    by_effects: [Group; EFFECTS.len()],
    per_fault: BTreeMap<FaultName, Group>,
    confidence: [Confidence; BINS],
    fast: BTreeMap<FaultName, Count>,
    listened: ListenTally,
    sets: BTreeMap<String, SetReport>,
    wrong: Vec<WrongReport>,
}

impl Tally {
    /// Nothing so far.
    #[must_use]
    pub fn new(options: ScoreOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// Adds a case. To be called in the order of seeds.
    pub fn add(&mut self, case: &CaseReport) {
        let first = self.seeds.map_or(case.seed, |(first, _)| first);
        self.seeds = Some((first, case.seed + 1));
        self.cases += 1;
        if let Some(why) = &case.unplayable {
            self.unplayable.push(format!("seed {}: {why}", case.seed));
            for name in &case.drawn {
                let left_out = self.left_out.entry(name.name().to_owned()).or_default();
                match why {
                    Unplayable::NoPlace(_) => left_out.no_place += 1,
                    Unplayable::NotUp(_) => left_out.not_up += 1,
                }
            }
            // Nobody can be judged by a line that does not come up, and nobody may leave it out.
            if matches!(why, Unplayable::NotUp(_)) {
                self.healthy.add(false);
            }
        }
        if let Some([live, capture]) = &case.healthy {
            let said = if self.options.judges_live() { live } else { capture };
            self.healthy.add(said.is_silent());
            self.healthy_capture.add(capture.is_silent());
            self.healthy_for += case.healthy_for;
            for (sum, one) in self.findings_of_healthy.iter_mut().zip([said, capture]) {
                *sum += (one.alarms.len() + one.notes.len()) as u64;
            }
            let seed = case.seed;
            let alarms = |said: &Accusations| -> Vec<String> {
                let all = said.alarms.iter().chain(&said.notes);
                all.map(|alarm| format!("seed {seed}: {alarm}")).collect()
            };
            self.alarms.extend(alarms(said));
            if self.options.judges_live() {
                self.alarms_capture.extend(alarms(capture));
            }
        }
        self.listened.add_healthy(case);
        for fault in &case.faults {
            let left_out = self.left_out.entry(fault.name.name().to_owned()).or_default();
            left_out.no_effect += u64::from(fault.effects == 0);
            left_out.unseen += u64::from(fault.effects > 0 && fault.is_unseen);
        }
        let acted: Vec<&FaultOutcome> =
            case.faults.iter().filter(|one| one.effects > 0 && !one.is_unseen).collect();
        self.effective += u64::from(!acted.is_empty());
        if case.kind == CaseKind::Double && acted.len() == 2 {
            let live: Vec<Match> =
                acted.iter().filter_map(|one| Some(held(one, one.live.as_ref()?))).collect();
            let capture: Vec<Match> = acted.iter().map(|one| held(one, &one.capture)).collect();
            self.pairs.add(&live);
            self.pairs_capture.add(&capture);
            let first = if live.is_empty() { &capture } else { &live };
            let pair = case.pair;
            let is_together = pair.apart == Span::ZERO;
            let kinds = [pair.is_in_line, !pair.is_in_line, is_together, !is_together];
            for (pairs, is_so) in self.pairs_by_kind.iter_mut().zip(kinds) {
                pairs.add(if is_so { first } else { &[] });
            }
            for fault in acted {
                self.double.add(fault);
                self.note_wrong(case, fault);
            }
            return;
        }
        // With one of two faults that did nothing, two findings were looked at: it is no single one.
        if case.kind == CaseKind::Double {
            for fault in acted {
                self.left_out.entry(fault.name.name().to_owned()).or_default().alone_of_two += 1;
            }
            return;
        }
        for fault in acted {
            self.add_single(case, fault);
        }
    }

    fn add_single(&mut self, case: &CaseReport, fault: &FaultOutcome) {
        self.single.add(fault);
        self.listened.add(case, fault);
        if let Some(trial) = &fault.set_trial {
            self.sets.entry(trial.set.clone()).or_default().add(case.seed, fault.name, trial);
        }
        if case.kind == CaseKind::Masked {
            self.masked.add(fault);
        }
        if !case.forwarded {
            self.without_forwarded.add(fault);
        }
        if case.is_ring {
            self.rings.add(fault);
        }
        if !case.host_counters {
            self.without_card.add(fault);
        }
        if case.has_background {
            self.background.add(fault);
        }
        if case.has_group {
            self.with_groups.add(fault);
        }
        let of_effects = EFFECTS.iter().position(|(_, most)| fault.effects <= *most);
        if let Some(group) = of_effects.and_then(|at| self.by_effects.get_mut(at)) {
            group.add(fault);
        }
        self.per_fault.entry(fault.name).or_default().add(fault);
        let judged = fault.live.as_ref().unwrap_or(&fault.capture);
        if !judged.said.is_empty() {
            let bin = ((judged.confidence * BINS as f64) as usize).min(BINS - 1);
            self.confidence[bin].count.add(held(fault, judged).cause == Grade::Exact);
            self.confidence[bin].sum += judged.confidence;
        }
        if case.cycle == FAST_CYCLE && HARD.contains(&fault.name) && fault.live.is_some() {
            let is_fast = judged.named_after.is_some_and(|after| after <= SOON);
            self.fast.entry(fault.name).or_default().add(is_fast);
        }
        self.note_wrong(case, fault);
    }

    fn note_wrong(&mut self, case: &CaseReport, fault: &FaultOutcome) {
        let live = fault.live.as_ref();
        let is_right = |judged: &Judged| held(fault, judged).is_right();
        let is_all_right = live.is_none_or(is_right) && is_right(&fault.capture);
        let has_others = live.is_some_and(|judged| judged.others > 0);
        if (is_all_right && !has_others) || self.wrong.len() >= MOST_WRONG {
            return;
        }
        self.wrong.push(WrongReport {
            seed: case.seed,
            devices: case.devices as u64,
            ring: case.is_ring,
            fault: fault.entry.clone(),
            effects: fault.effects,
            live: live.map(|judged| verdict(fault, judged)),
            capture: verdict(fault, &fault.capture),
            findings: live.unwrap_or(&fault.capture).findings.iter().take(12).cloned().collect(),
        });
    }

    /// The sum.
    #[must_use]
    pub fn report(&self) -> ScoreReport {
        let single = self.single.report();
        let first = single.live.clone().unwrap_or_else(|| single.capture.clone());
        let bins = self.confidence.iter().filter(|bin| bin.count.rate().of > 0).map(|bin| {
            let right = bin.count.rate();
            Bin { confidence: rounded(bin.sum / right.of as f64), right }
        });
        let bins: Vec<Bin> = bins.collect();
        let (healthy, healthy_capture) = (self.healthy.rate(), self.healthy_capture.rate());
        let hours = self.healthy_for.as_nanos() as f64 / 3.6e12;
        ScoreReport {
            schema: SCHEMA.to_owned(),
            tool: concat!("linesman ", env!("CARGO_PKG_VERSION")).to_owned(),
            seeds: self.seeds.unwrap_or_default(),
            fault: self.options.fault,
            capture_only: self.options.capture_only,
            perturbed: self.options.perturb.map(|one| one.name().to_owned()),
            habit: self.options.habit.name().to_owned(),
            cases: self.cases,
            effective_cases: self.effective,
            place_at_1: first.place_at_1.share,
            cause_at_1: first.cause_at_1.share,
            place_at_1_set: first.place_at_1_set.share,
            cause_at_1_set: first.cause_at_1_set.share,
            healthy_runs: healthy.of,
            false_alarms: healthy.of - healthy.right,
            repair_at_1: first.repair_at_1.share,
            baseline: Baseline { place_at_1: single.baseline.share },
            no_diagnosis: Baseline { place_at_1: 0.0 },
            single,
            double: DoubleReport {
                both_places: self.pairs.places.rate(),
                both_causes: self.pairs.causes.rate(),
                both_places_capture: self.pairs_capture.places.rate(),
                both_causes_capture: self.pairs_capture.causes.rate(),
                in_line: self.pairs_by_kind[0].report(),
                on_branches: self.pairs_by_kind[1].report(),
                at_one_moment: self.pairs_by_kind[2].report(),
                one_after_the_other: self.pairs_by_kind[3].report(),
                faults: self.double.report(),
            },
            masked: self.masked.report(),
            without_forwarded: self.without_forwarded.report(),
            without_card_counters: self.without_card.report(),
            rings: self.rings.report(),
            beside_background: self.background.report(),
            with_hot_connect: self.with_groups.report(),
            left_out: self
                .left_out
                .iter()
                .filter(|(_, left_out)| **left_out != LeftOut::default())
                .map(|(name, left_out)| (name.clone(), *left_out))
                .collect(),
            healthy: HealthyReport {
                silent: healthy,
                silent_capture: healthy_capture,
                line_hours: rounded(hours),
                findings: self.findings_of_healthy[0],
                findings_capture: self.findings_of_healthy[1],
                per_1000_hours: per_1000_hours(self.findings_of_healthy[0] as f64, hours),
                per_1000_hours_at_most: per_1000_hours(at_most(self.findings_of_healthy[0]), hours),
                alarms: self.alarms.clone(),
                alarms_capture: self.alarms_capture.clone(),
            },
            by_effects: EFFECTS
                .iter()
                .zip(&self.by_effects)
                .map(|((from, to), group)| Bucket {
                    from: *from,
                    to: (*to != u64::MAX).then_some(*to),
                    group: group.report(),
                })
                .collect(),
            calibration_error: calibration_error(&bins),
            calibration: bins,
            named_in_100_ms: self
                .fast
                .iter()
                .map(|(name, count)| (name.name().to_owned(), count.rate()))
                .collect(),
            per_fault: self
                .per_fault
                .iter()
                .map(|(name, group)| (name.name().to_owned(), group.report()))
                .collect(),
            listened: (self.options.habit != Habit::Own).then(|| self.listened.report()),
            sets: self.sets.clone(),
            unplayable: self.unplayable.clone(),
            wrong: self.wrong.clone(),
        }
    }
}

/// The expected calibration error: how far share and confidence are apart in each bin, weighted by
/// its findings.
fn calibration_error(bins: &[Bin]) -> f64 {
    let all: u64 = bins.iter().map(|bin| bin.right.of).sum();
    let apart =
        bins.iter().map(|bin| (bin.confidence - bin.right.share).abs() * bin.right.of as f64);
    // The sum of nothing is a negative zero.
    rounded(apart.sum::<f64>().abs() / (all.max(1)) as f64)
}

/// What was said, and how well it fits.
fn verdict(fault: &FaultOutcome, judged: &Judged) -> String {
    let fits = held(fault, judged);
    let mark = match (fits.place.is_right(), fits.cause.is_right()) {
        (true, true) => "right",
        (true, false) => "wrong cause",
        (false, _) if judged.is_note && judged.fits.place.is_right() => "a note only",
        (false, _) => "wrong place",
    };
    let said = if judged.said.is_empty() { "nothing" } else { &judged.said };
    let others = match judged.others {
        0 => String::new(),
        others => format!(", and {others} more that nothing explains"),
    };
    format!("{mark}: {said}{others}")
}
