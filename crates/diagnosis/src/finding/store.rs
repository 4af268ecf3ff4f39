//! Store of the findings of a run: opening, closing, and consequences.
//!
//! A rule says each time anew what holds or held. What it says for the first time opens a finding;
//! what it says no longer it took back, and the finding goes without a trace, since it never was
//! true. A condition that is over stays as a closed finding; when the same trouble comes again after
//! that, it is another finding.

use linesman_proto::time::{Instant, Span};

use super::{Condition, Place, Severity, Symptom};

/// What follows from a condition may show so long after its end: SubDevices are asked one by one, and
/// links need seconds to come back.
const AFTER: Span = Span::s(3);
/// The same for what is only counted: errors follow at once, and are read soon after.
const AFTER_COUNTED: Span = Span::s(1);
/// Damaged frames at the card so long before its link is lost are not of that: a contact that opens spoils frames for some ms.
const BEFORE_OUTAGE: Span = Span::ms(500);

/// A finding that has been over for so long stays, though the rule does not speak of it any more.
const SETTLED: Span = Span::s(2);

/// Most findings that are kept; the oldest ones that are over give way.
const MOST_KEPT: usize = 1_000;

/// A condition with a life.
#[derive(Clone, PartialEq, Debug)]
pub struct Finding {
    /// Its number in this run, from 1.
    pub id: u32,
    /// What the rule says of it now.
    pub condition: Condition,
    /// When it began.
    pub opened: Instant,
    /// When it was certain.
    pub confirmed: Option<Instant>,
    /// When it was over.
    pub closed: Option<Instant>,
    /// When it was over for long enough to be history, whatever the rule says since.
    pub settled: Option<Instant>,
    /// The finding it follows from, by [`Finding::id`].
    pub parent: Option<u32>,
}

/// What happened to a finding.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Change {
    /// It is new.
    Opened,
    /// It is certain now.
    Confirmed,
    /// It is over.
    Closed,
    /// It was an error to report it: later evidence says otherwise.
    Withdrawn,
}

/// All findings of a run.
#[derive(Clone, Default, Debug)]
pub struct FindingStore {
    findings: Vec<Finding>,
    opened: u32,
}

impl FindingStore {
    /// Takes all that the rules say now, and tells what is news.
    pub fn update(
        &mut self,
        conditions: Vec<Condition>,
        now: Instant,
        mut tell: impl FnMut(Change, &Finding),
    ) {
        let mut before = std::mem::take(&mut self.findings);
        for finding in &mut before {
            let is_settled = |closed: &Instant| *closed + SETTLED <= now;
            finding.settled = finding.closed.filter(is_settled).or(finding.settled);
        }
        for condition in conditions {
            let known = before.iter().position(|finding| {
                is_same(&finding.condition, &condition)
                    && finding.closed.is_none_or(|closed| condition.since <= closed)
            });
            if known.is_none() {
                // The same trouble again: what was is history.
                while let Some(index) =
                    before.iter().position(|finding| is_same(&finding.condition, &condition))
                {
                    self.findings.push(before.remove(index));
                }
            }
            let (mut finding, is_new) = match known {
                Some(index) => (before.remove(index), false),
                None => (self.open(condition.clone()), true),
            };
            let was_confirmed = finding.confirmed.is_some();
            let was_closed = finding.closed.is_some();
            finding.opened = finding.opened.min(condition.since);
            if condition.is_confirmed {
                let at = condition.confirmed_at.unwrap_or(now).max(finding.opened);
                finding.confirmed = Some(finding.confirmed.map_or(at, |known| known.min(at)));
            }
            finding.closed = condition.ended.map(|at| at.max(finding.opened));
            finding.condition = condition;
            if is_new {
                tell(Change::Opened, &finding);
            }
            if !was_confirmed && finding.confirmed.is_some() {
                tell(Change::Confirmed, &finding);
            }
            if !was_closed && finding.closed.is_some() {
                tell(Change::Closed, &finding);
            }
            self.findings.push(finding);
        }
        for mut finding in before {
            if finding.settled.is_some() {
                // That it came again was an error; that it had been was none.
                finding.closed = finding.closed.or(finding.settled);
                self.findings.push(finding);
            } else {
                tell(Change::Withdrawn, &finding);
            }
        }
        self.findings.sort_by_key(|finding| finding.id);
        while self.findings.len() > MOST_KEPT {
            let Some(over) = self.findings.iter().position(|old| old.closed.is_some()) else {
                break;
            };
            self.findings.remove(over);
        }
        self.link_consequences();
    }

    /// All findings, oldest first.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Whether anything is wrong at present.
    #[must_use]
    pub fn has_open(&self) -> bool {
        self.findings.iter().any(|finding| finding.closed.is_none())
    }

    /// Whether any finding is about single SubDevices or links.
    #[must_use]
    pub fn names_devices(&self) -> bool {
        self.findings.iter().any(|finding| match finding.condition.place {
            Place::Link { .. } | Place::Device { .. } => true,
            Place::Network { .. } | Place::Host => false,
        })
    }

    /// Findings that follow from no other one, worst first, then in order of time.
    #[must_use]
    pub fn roots(&self) -> Vec<&Finding> {
        self.sorted(None)
    }

    /// What follows from a finding, worst first, then in order of time.
    #[must_use]
    pub fn consequences(&self, id: u32) -> Vec<&Finding> {
        self.sorted(Some(id))
    }

    /// The finding that explains this one.
    #[must_use]
    pub fn cause_of(&self, id: u32) -> Option<u32> {
        self.findings.iter().find(|finding| finding.id == id)?.parent
    }

    /// The worst that there is, or was.
    #[must_use]
    pub fn worst(&self) -> Option<Severity> {
        self.findings.iter().map(|finding| finding.condition.severity).max()
    }

    fn sorted(&self, parent: Option<u32>) -> Vec<&Finding> {
        let mut found: Vec<_> =
            self.findings.iter().filter(|finding| finding.parent == parent).collect();
        found.sort_by_key(|finding| {
            (std::cmp::Reverse(finding.condition.severity), finding.opened, finding.id)
        });
        found
    }

    fn open(&mut self, condition: Condition) -> Finding {
        self.opened += 1;
        let opened = condition.since;
        Finding {
            id: self.opened,
            condition,
            opened,
            confirmed: None,
            closed: None,
            settled: None,
            parent: None,
        }
    }

    /// Hangs each finding beneath the one that explains all of its symptoms.
    fn link_consequences(&mut self) {
        for finding in &mut self.findings {
            finding.parent = None;
        }
        for index in 0..self.findings.len() {
            let explaining = |other: &usize| {
                let (cause, effect) = (&self.findings[*other], &self.findings[index]);
                *other != index && explains(cause, effect) && !self.follows(*other, effect.id)
            };
            let best = (0..self.findings.len()).filter(explaining).max_by(|one, other| {
                let (one, other) = (&self.findings[*one], &self.findings[*other]);
                let confidence = one.condition.confidence.total_cmp(&other.condition.confidence);
                let severity = one.condition.severity.cmp(&other.condition.severity);
                severity.then(confidence).then(other.id.cmp(&one.id))
            });
            let of_sum = || self.foremost_of_several(index).or_else(|| self.known_beside(index));
            if let Some(best) = best.or_else(of_sum) {
                self.findings[index].parent = Some(self.findings[best].id);
            }
        }
    }

    /// Working counters are sums: what several findings take from one together, none of them explains
    /// alone. The one that explains most of it.
    fn foremost_of_several(&self, index: usize) -> Option<usize> {
        let effect = &self.findings[index];
        let symptoms = &effect.condition.symptoms;
        let is_sum = |symptom: &Symptom| matches!(symptom, Symptom::WorkingCounter(_));
        if symptoms.len() < 2 || !symptoms.iter().all(is_sum) {
            return None;
        }
        let explained = |other: usize, symptom: &Symptom| {
            let cause = &self.findings[other];
            other != index
                && !was_over(cause, effect, AFTER)
                && !began_after(cause, effect)
                && cause.condition.accounts_for(symptom)
                && !self.follows(other, effect.id)
        };
        let all = 0..self.findings.len();
        let is_covered =
            symptoms.iter().all(|symptom| all.clone().any(|other| explained(other, symptom)));
        let share = |other: &usize| {
            let explained = symptoms.iter().filter(|symptom| explained(*other, symptom)).count();
            (explained, std::cmp::Reverse(*other))
        };
        if is_covered { all.max_by_key(share) } else { None }
    }

    /// Finding that took a part of a sum while the amount of that sum alone named a place, and that is over. The missing
    /// part is known to have had another reason then, be it seen late.
    fn known_beside(&self, index: usize) -> Option<usize> {
        let effect = &self.findings[index];
        let closed = effect.closed.filter(|_| effect.condition.is_by_sum_alone)?;
        let takes_part = |other: &usize| {
            let cause = &self.findings[*other];
            let explains = &cause.condition.explains;
            *other != index
                && cause.confirmed.is_some()
                && !cause.condition.is_by_sum_alone
                && cause.condition.severity == Severity::Error
                && cause.opened <= closed
                && cause.closed.is_none_or(|end| effect.opened <= end)
                && explains.iter().any(|symptom| matches!(symptom, Symptom::WorkingCounter(_)))
                && !self.follows(*other, effect.id)
        };
        let confidence = |other: &usize| self.findings[*other].condition.confidence;
        (0..self.findings.len())
            .filter(takes_part)
            .max_by(|one, other| confidence(one).total_cmp(&confidence(other)).then(other.cmp(one)))
    }

    /// Whether a finding follows, at whatever remove, from the one called `id`.
    fn follows(&self, index: usize, id: u32) -> bool {
        let mut at = self.findings.get(index);
        // Each step goes up; there are never more steps than findings.
        for _ in 0..self.findings.len() {
            match at {
                Some(finding) if finding.id == id => return true,
                Some(finding) => {
                    let parent = finding.parent;
                    at = parent.and_then(|id| self.findings.iter().find(|other| other.id == id));
                }
                None => return false,
            }
        }
        true
    }
}

fn is_same(one: &Condition, other: &Condition) -> bool {
    one.page.code == other.page.code && one.place.is_same_spot(&other.place)
}

fn explains(cause: &Finding, effect: &Finding) -> bool {
    let symptoms = &effect.condition.symptoms;
    let counted = |symptom: &Symptom| {
        matches!(
            symptom,
            Symptom::PortErrors(..)
                | Symptom::LinkDown(..)
                | Symptom::LinkCounted(..)
                | Symptom::FramesLost
                | Symptom::CardErrors
        )
    };
    let after = if symptoms.iter().all(counted) { AFTER_COUNTED } else { AFTER };
    // What is only worth knowing has hurt nobody: who left its state did so for another reason.
    let is_hurt =
        |symptom: &Symptom| matches!(symptom, Symptom::StateLost(_) | Symptom::Emergency(_));
    let is_harmless = cause.condition.severity == Severity::Info;
    let hides_harm = is_harmless && symptoms.iter().any(is_hurt);
    !(symptoms.is_empty()
        || hides_harm
        || was_over(cause, effect, after)
        || began_after(cause, effect))
        && symptoms.iter().all(|symptom| cause.condition.accounts_for(symptom))
}

/// Whether a finding began so long after another one was over that this does not follow from it: what brings something
/// about may be noticed a little later than that, not when it is history.
///
/// Damaged frames that the card drops are told at once, so that what came of them long before an outage is none of its
/// doing, however long it went on.
fn began_after(cause: &Finding, effect: &Finding) -> bool {
    let is_of_card = effect.condition.symptoms.iter().all(|one| *one == Symptom::CardErrors);
    let is_outage = cause.condition.accounts_for(&Symptom::NoCarrier);
    let before = if is_outage { BEFORE_OUTAGE } else { AFTER_COUNTED };
    let was_before = is_of_card && effect.opened + before < cause.opened;
    was_before || effect.closed.is_some_and(|closed| closed + AFTER < cause.opened)
}

/// Whether a finding was over so long before another one that this does not follow from it.
fn was_over(cause: &Finding, effect: &Finding, after: Span) -> bool {
    cause.closed.is_some_and(|closed| closed + after < effect.opened)
}

#[cfg(test)]
mod tests {
    use linesman_config::fault::FaultName;
    use linesman_proto::address::{DeviceId, Network};

    use super::*;
    use crate::rule::working_counter::PAGE;

    /// Outage that takes the share of a SubDevice from a working counter, from `since` to `ended`, in ms.
    fn condition(device: u32, since: u64, ended: u64) -> Condition {
        let at = |ms| Instant::ZERO + Span::ms(ms);
        let place = Place::device(Network(0), DeviceId(device));
        let symptom = [Symptom::WorkingCounter(DeviceId(device))];
        Condition::new(&PAGE, place, FaultName::DeviceOff, at(since))
            .confirmed(at(since))
            .ended(at(ended))
            .explaining(symptom)
    }

    fn parent_of_guess(known: Condition) -> Option<u32> {
        let mine = [Symptom::WorkingCounter(DeviceId(9))];
        let mut guess = condition(9, 2_000, 2_500).about(mine);
        guess.is_by_sum_alone = true;
        let mut store = FindingStore::default();
        store.update(vec![known, guess], Instant::ZERO + Span::s(9), |_, _| {});
        store.findings()[1].parent
    }

    #[test]
    fn place_that_a_sum_alone_names_gives_way_to_what_is_known_to_have_taken_a_part_of_it() {
        assert_eq!(parent_of_guess(condition(3, 1_900, 2_100)), Some(1));
        assert_eq!(parent_of_guess(condition(3, 100, 1_900)), None, "it was over before");
        let mut warning = condition(3, 1_900, 2_100);
        warning.severity = Severity::Warning;
        assert_eq!(parent_of_guess(warning), None);
    }
}
