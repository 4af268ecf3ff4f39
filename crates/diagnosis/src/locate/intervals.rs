//! Intervals of time, such as those between two readings.

use linesman_proto::time::{Instant, Span};

/// From when to when something happened.
pub type TimeInterval = (Instant, Instant);

/// Stretches of time in order, none of which touches the next.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Intervals(Vec<TimeInterval>);

impl Intervals {
    /// Whether one of them overlaps a stretch.
    #[must_use]
    pub fn meet(&self, spell: TimeInterval) -> bool {
        let next = self.0.partition_point(|other| other.1 <= spell.0);
        self.0.get(next).is_some_and(|other| meet(*other, spell))
    }

    /// Length of the parts of a stretch that they cover.
    #[must_use]
    pub fn overlap(&self, spell: TimeInterval) -> Span {
        let first = self.0.partition_point(|other| other.1 <= spell.0);
        let met = self.0[first..].iter().take_while(|other| other.0 < spell.1);
        let parts = met.map(|other| other.1.min(spell.1).since(other.0.max(spell.0)));
        parts.fold(Span::ZERO, |all, part| all + part)
    }
}

impl FromIterator<TimeInterval> for Intervals {
    fn from_iter<T: IntoIterator<Item = TimeInterval>>(spells: T) -> Self {
        let mut all: Vec<TimeInterval> = spells.into_iter().collect();
        all.sort_unstable();
        all.dedup_by(|later, earlier| {
            let touches = later.0 <= earlier.1;
            if touches {
                earlier.1 = earlier.1.max(later.1);
            }
            touches
        });
        Self(all)
    }
}

/// Whether two stretches overlap.
pub(super) fn meet(one: TimeInterval, other: TimeInterval) -> bool {
    one.0 < other.1 && other.0 < one.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(us: u64) -> Instant {
        Instant::from_nanos(us * 1_000)
    }

    #[test]
    fn stretches_that_touch_are_one() {
        let spells: Intervals = [(7, 9), (1, 3), (3, 4), (2, 3), (12, 12)]
            .map(|(a, b)| (at(a), at(b)))
            .into_iter()
            .collect();
        let expected = [(1, 4), (7, 9), (12, 12)].map(|(a, b)| (at(a), at(b)));
        assert_eq!(spells.0, expected);
        for (from, to, meets) in [
            (0, 1, false),
            (0, 2, true),
            (4, 7, false),
            (3, 8, true),
            (8, 8, true),
            (9, 12, false),
            (11, 13, true),
        ] {
            assert_eq!(spells.meet((at(from), at(to))), meets, "{from} to {to}");
        }
    }

    #[test]
    fn stretch_is_covered_as_far_as_others_overlap_it() {
        let spells: Intervals =
            [(1, 4), (7, 9), (20, 30)].map(|(a, b)| (at(a), at(b))).into_iter().collect();
        for (from, to, us) in
            [(0, 1, 0), (0, 40, 15), (3, 8, 2), (4, 7, 0), (21, 22, 1), (31, 40, 0)]
        {
            assert_eq!(spells.overlap((at(from), at(to))), Span::us(us), "{from} to {to}");
        }
    }
}
