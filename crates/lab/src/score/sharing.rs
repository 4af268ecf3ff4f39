//! Findings of a case with two faults, shared out: each fault needs a finding of its own.

use linesman_diagnosis::report::Diagnosis;

use super::judge::Judged;
use super::outcome::FaultOutcome;
use super::play::{Active, First, Play};

impl Play<'_> {
    /// Each of two faults needs a finding of its own: where one finding fits both, the fault that has another one
    /// takes that.
    pub(super) fn each_its_own(
        &self,
        [(one, first), (other, second)]: [(&Active, &mut FaultOutcome); 2],
        live: &Diagnosis,
        recorded: &Diagnosis,
    ) {
        let without = |active: &Active, taken: &Judged, is_live: bool| {
            let taken = Some(taken.finding.as_str());
            let taken = if is_live { [taken, None] } else { [None, taken] };
            self.outcome(active, live, recorded, First::default(), taken)
        };
        if let (Some(a), Some(b)) = (&mut first.live, &mut second.live)
            && a.finding == b.finding
        {
            let a_else = without(one, b, true).and_then(|outcome| outcome.live);
            let b_else = without(other, a, true).and_then(|outcome| outcome.live);
            share_out((a, a_else), (b, b_else));
        }
        let (a, b) = (&mut first.capture, &mut second.capture);
        if a.finding == b.finding {
            let a_else = without(one, b, false).map(|outcome| outcome.capture);
            let b_else = without(other, a, false).map(|outcome| outcome.capture);
            share_out((a, a_else), (b, b_else));
        }
    }
}

/// Of two faults with one finding, gives one of them the finding that it has beside that: the one with which more of
/// the two are right, and the second one where both ways are alike.
fn share_out(
    (a, a_else): (&mut Judged, Option<Judged>),
    (b, b_else): (&mut Judged, Option<Judged>),
) {
    let times = |new: Judged, old: &Judged| Judged {
        cycles: old.cycles,
        named_after: old.named_after,
        ..new
    };
    let rank = |kept: &Judged, other: &Option<Judged>| {
        let right = |is_right: fn(&Judged) -> bool| {
            usize::from(is_right(kept)) + usize::from(other.as_ref().is_some_and(is_right))
        };
        (right(|one| one.fits.place.is_right()), right(Judged::is_right))
    };
    if rank(a, &b_else) >= rank(b, &a_else) {
        *b = times(b_else.unwrap_or(Judged::silence()), b);
    } else {
        *a = times(a_else.unwrap_or(Judged::silence()), a);
    }
}
