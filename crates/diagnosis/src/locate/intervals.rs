//! Intervals of time, such as those between two readings.

use linesman_proto::time::Instant;

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
}
