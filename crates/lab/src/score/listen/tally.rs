//! Tally of the answers of listeners.

use std::collections::BTreeMap;

use linesman_config::fault::FaultName::{self, *};

use super::super::outcome::{CaseReport, FaultOutcome};
use super::super::rate::Count;
use super::report::{
    HealthyListenedReport, HealthyPair, HealthyRates, ListenedReport, ListenerPair, ListenerReport,
    ListenersReport, WrongListened,
};
use super::{Listened, Listeners, Outcome, Pair};
use crate::verdict::Grade;

/// Cases shown in which a listener was wrong.
const MOST_WRONG: usize = 2_000;
/// The key of a MainDevice that stops.
const PAUSED: &str = "paused";

/// Faults whose place frames alone can tell.
const PLACED: [FaultName; 6] = [LinkOpen, DeviceOff, SupplyOff, BrownOut, HostDrops, LateFrames];
/// Faults that cost frames at a place that frames alone do not tell.
const NOISE: [FaultName; 6] =
    [CableDegraded, EmcNoise, TransmitterDamaged, ReceiverDamaged, DeviceInternal, NicDamaged];

/// One listener.
#[derive(Clone, Debug, Default)]
struct Column {
    no_trace: Count,
    place: Count,
    cause: Count,
    place_set: Count,
    cause_set: Count,
    named: Count,
    open: Count,
    missed: Count,
    wrong: Count,
    others: u64,
}

impl Column {
    fn add(&mut self, said: &Listened) {
        let fits = said.judged.fits;
        self.no_trace.add(said.outcome == Outcome::NoTrace);
        if said.outcome == Outcome::NoTrace {
            return;
        }
        self.place.add(fits.place == Grade::Exact);
        self.cause.add(fits.cause == Grade::Exact);
        self.place_set.add(fits.place.is_right());
        self.cause_set.add(fits.cause.is_right());
        self.named.add(said.is_named);
        self.open.add(said.outcome == Outcome::Open);
        self.missed.add(said.outcome == Outcome::Missed);
        self.wrong.add(said.outcome == Outcome::Wrong);
        self.others += said.judged.others;
    }

    fn report(&self) -> ListenerReport {
        ListenerReport {
            no_trace: self.no_trace.rate(),
            place_at_1: self.place.rate(),
            cause_at_1: self.cause.rate(),
            place_at_1_set: self.place_set.rate(),
            cause_at_1_set: self.cause_set.rate(),
            named: self.named.rate(),
            open: self.open.rate(),
            missed: self.missed.rate(),
            wrong: self.wrong.rate(),
            other_findings: self.others,
        }
    }
}

/// The listeners of a group of faults: from the start, during, after; each alone and with the project.
#[derive(Clone, Debug, Default)]
struct Group([[Column; 2]; 3]);

impl Group {
    fn add(&mut self, said: &Listeners) {
        let pairs = [Some(&said.start), said.during.as_ref(), said.after.as_ref()];
        for (columns, pair) in self.0.iter_mut().zip(pairs) {
            let Some(Pair { alone, with_project }) = pair else { continue };
            columns[0].add(alone);
            columns[1].add(with_project);
        }
    }

    fn report(&self) -> ListenersReport {
        let pair = |[alone, with_project]: &[Column; 2]| ListenerPair {
            alone: alone.report(),
            with_project: with_project.report(),
        };
        let [start, during, after] = &self.0;
        ListenersReport { start: pair(start), during: pair(during), after: pair(after) }
    }
}

/// Cases with listeners added up.
#[derive(Clone, Debug, Default)]
pub(in crate::score) struct ListenTally {
    single: Group,
    placed: Group,
    noise: Group,
    per_fault: BTreeMap<&'static str, Group>,
    healthy: [(Count, Count); 4],
    alarms: Vec<String>,
    wrong: Vec<WrongListened>,
}

impl ListenTally {
    /// Adds what was said of a healthy line.
    pub(in crate::score) fn add_healthy(&mut self, case: &CaseReport) {
        let Some(said) = &case.healthy_listened else { return };
        let names = ["from the start", "from the start, project", "late", "late, project"];
        for (((silent, healthy), said), name) in
            self.healthy.iter_mut().zip(&said.columns).zip(names)
        {
            silent.add(said.alarms.is_empty());
            healthy.add(said.is_healthy);
            for alarm in &said.alarms {
                self.alarms.push(format!("seed {} ({name}): {alarm}", case.seed));
            }
        }
    }

    /// Adds what was said of a single fault that had an effect.
    pub(in crate::score) fn add(&mut self, case: &CaseReport, fault: &FaultOutcome) {
        let Some(said) = &fault.listened else { return };
        self.single.add(said);
        let is_pause = fault.is_pause;
        if is_pause || PLACED.contains(&fault.name) {
            self.placed.add(said);
        }
        if NOISE.contains(&fault.name) {
            self.noise.add(said);
        }
        let key = if is_pause { PAUSED } else { fault.name.name() };
        self.per_fault.entry(key).or_default().add(said);
        let pairs = [
            ("start", Some(&said.start)),
            ("during", said.during.as_ref()),
            ("after", said.after.as_ref()),
        ];
        for (joined, pair) in pairs {
            let Some(Pair { alone, with_project }) = pair else { continue };
            self.note_wrong(case, fault, (joined, false), alone);
            self.note_wrong(case, fault, (joined, true), with_project);
        }
    }

    fn note_wrong(
        &mut self,
        case: &CaseReport,
        fault: &FaultOutcome,
        (joined, with_project): (&str, bool),
        said: &Listened,
    ) {
        let outcome = match said.outcome {
            Outcome::Missed => "missed",
            Outcome::Wrong => "wrong",
            Outcome::Open => "open",
            Outcome::Found | Outcome::NoTrace => return,
        };
        if self.wrong.len() < MOST_WRONG {
            self.wrong.push(WrongListened {
                seed: case.seed,
                devices: case.devices as u64,
                fault: fault.entry.clone(),
                joined: joined.to_owned(),
                with_project,
                outcome: outcome.to_owned(),
                said: said.judged.said.clone(),
            });
        }
    }

    /// The sum.
    pub(in crate::score) fn report(&self) -> ListenedReport {
        let rates = |(silent, healthy): (Count, Count)| HealthyRates {
            silent: silent.rate(),
            healthy: healthy.rate(),
        };
        let [start, start_project, late, late_project] = self.healthy.map(rates);
        ListenedReport {
            single: self.single.report(),
            placed: self.placed.report(),
            noise: self.noise.report(),
            per_fault: self
                .per_fault
                .iter()
                .map(|(name, group)| ((*name).to_owned(), group.report()))
                .collect(),
            healthy: HealthyListenedReport {
                start: HealthyPair { alone: start, with_project: start_project },
                late: HealthyPair { alone: late, with_project: late_project },
                alarms: self.alarms.clone(),
            },
            wrong: self.wrong.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::judge::LOSSES;
    use super::*;

    #[test]
    fn noise_costs_frames_whose_place_nothing_else_tells() {
        assert!(NOISE.iter().all(|name| LOSSES.contains(name)));
        assert!(PLACED.iter().all(|name| !NOISE.contains(name)));
    }
}
