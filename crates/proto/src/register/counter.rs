//! Difference of two readings of an error counter, and the sum over many of them.
//!
//! Reference: S2 2.9. The counters stop at 255 and somebody else may clear them at any time, so a
//! value by itself says little: only changes count, and a first reading is history. A tool that adds
//! them up shows totals of any size, which do not stop.

/// What happened to a counter between two readings.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct Difference {
    /// By how much it certainly rose. After a clear: what was counted since.
    pub rise: u64,
    /// It stands at 255 and counts no more: the true rise may be larger.
    pub saturated: bool,
    /// It fell: somebody cleared it, or the device lost its supply. What was counted between the
    /// first reading and the clear is lost.
    pub cleared: bool,
}

impl Difference {
    /// What two readings of the same counter tell, earlier one first.
    ///
    /// A clear can hide: if as many counts follow it as were there before, it looks like a rise.
    /// Where several counters are cleared together, as those of all ports are, the others give it
    /// away; [`ErrorCounters::since`](super::ErrorCounters::since) makes use of that.
    #[must_use]
    #[inline]
    pub const fn between(before: u8, after: u8) -> Self {
        match after.checked_sub(before) {
            Some(rise) => Self { rise: rise as u64, saturated: after == u8::MAX, cleared: false },
            None => Self::since_clear(after),
        }
    }

    /// What a reading tells when the counter is known to have been cleared since the last one.
    #[must_use]
    #[inline]
    pub const fn since_clear(after: u8) -> Self {
        Self { rise: after as u64, saturated: after == u8::MAX, cleared: true }
    }

    /// The same for totals that a tool keeps, which stop nowhere.
    #[must_use]
    pub const fn between_totals(before: u64, after: u64) -> Self {
        match after.checked_sub(before) {
            Some(rise) => Self { rise, saturated: false, cleared: false },
            None => Self { rise: after, saturated: false, cleared: true },
        }
    }

    /// Whether the rise is exact: no counts can have been lost at 255 or by a clear.
    #[must_use]
    #[inline]
    pub const fn is_exact(&self) -> bool {
        !self.saturated && !self.cleared
    }
}

/// A running total over many readings, through clears by whomever.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct Total {
    last: Option<u64>,
    rise: u64,
    clears: u32,
    lost: bool,
}

impl Total {
    /// Takes a reading. `None` for the first one, which is history and adds nothing.
    #[inline]
    pub fn record(&mut self, reading: u8) -> Option<Difference> {
        let before = self.last.replace(reading.into())?;
        let before = u8::try_from(before).unwrap_or(u8::MAX);
        Some(self.add(Difference::between(before, reading)))
    }

    /// Takes a reading of a total that a tool keeps. `None` for the first one.
    pub fn record_total(&mut self, reading: u64) -> Option<Difference> {
        let before = self.last.replace(reading)?;
        Some(self.add(Difference::between_totals(before, reading)))
    }

    /// Takes a reading of a counter that somebody else is known to have cleared since the last one,
    /// because another counter of its group fell.
    pub fn record_after_clear(&mut self, reading: u8) -> Option<Difference> {
        self.last.replace(reading.into())?;
        Some(self.add(Difference::since_clear(reading)))
    }

    /// Notes that we cleared the counter ourselves right after the last reading, best in the same
    /// frame: the next reading counts from 0, and nothing is lost.
    pub fn note_own_clear(&mut self) {
        self.last = Some(0);
        // One that stood at its end counts again, and from 0: all that it has counted since is exact.
        self.lost &= self.rise > 0;
    }

    /// Begins a new count: losses so far belong to the counts so far, and later rises are exact again.
    pub const fn begin_anew(&mut self) {
        self.lost = false;
    }

    /// All rises together.
    #[must_use]
    pub const fn rise(&self) -> u64 {
        self.rise
    }

    /// How often somebody else cleared it.
    #[must_use]
    pub const fn clears(&self) -> u32 {
        self.clears
    }

    /// True if [`rise`](Self::rise), since it [began anew](Self::begin_anew), is only a lower bound.
    #[must_use]
    pub const fn is_lower_bound(&self) -> bool {
        self.lost
    }

    /// The last reading.
    #[must_use]
    #[inline]
    pub const fn last(&self) -> Option<u64> {
        self.last
    }

    #[inline]
    fn add(&mut self, difference: Difference) -> Difference {
        self.rise = self.rise.saturating_add(difference.rise);
        self.clears += u32::from(difference.cleared);
        self.lost |= !difference.is_exact();
        difference
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_readings() {
        let exact = |rise| Difference { rise, saturated: false, cleared: false };
        let saturated = |rise| Difference { rise, saturated: true, cleared: false };
        let cleared = |rise| Difference { rise, saturated: false, cleared: true };
        let table = [
            (0, 0, exact(0)),
            (7, 7, exact(0)),
            (7, 9, exact(2)),
            (0, 254, exact(254)),
            (0, 255, saturated(255)),
            (250, 255, saturated(5)),
            (255, 255, saturated(0)),
            (255, 0, cleared(0)),
            (9, 3, cleared(3)),
        ];
        for (before, after, expected) in table {
            assert_eq!(Difference::between(before, after), expected, "{before} then {after}");
        }
    }

    #[test]
    fn a_first_reading_is_history() {
        let mut total = Total::default();
        assert_eq!(total.record(200), None);
        assert_eq!(total.rise(), 0);
        assert_eq!(total.record(203).unwrap().rise, 3);
        assert_eq!((total.rise(), total.is_lower_bound()), (3, false));
    }

    #[test]
    fn a_clear_by_somebody_makes_the_total_a_lower_bound() {
        let mut total = Total::default();
        total.record(10);
        total.record(12);
        total.record(1);
        assert_eq!((total.rise(), total.clears(), total.is_lower_bound()), (3, 1, true));
        // The counter reads more than before, but another one of its group fell.
        total.record_after_clear(4);
        assert_eq!((total.rise(), total.clears()), (7, 2));
    }

    #[test]
    fn our_own_clear_loses_nothing() {
        let mut total = Total::default();
        total.record(10);
        total.note_own_clear();
        total.record(4);
        assert_eq!((total.rise(), total.clears(), total.is_lower_bound()), (4, 0, false));
        // Clearing before anything was read makes the next reading count.
        let mut fresh = Total::default();
        fresh.note_own_clear();
        assert_eq!(fresh.record(2).unwrap().rise, 2);
    }

    #[test]
    fn totals_of_a_tool_stop_nowhere() {
        let mut total = Total::default();
        assert_eq!(total.record_total(255), None);
        let rise = total.record_total(154_656).unwrap();
        assert_eq!((rise.rise, rise.is_exact()), (154_401, true));
        assert_eq!(total.record_total(3).map(|fall| (fall.rise, fall.cleared)), Some((3, true)));
        assert_eq!((total.rise(), total.clears()), (154_404, 1));
    }

    proptest! {
        /// A counter that really counts, saturates and is cleared: the total never says more than
        /// happened.
        #[test]
        fn totals_never_exaggerate(
            steps in proptest::collection::vec((0u16..200, any::<bool>()), 1..40),
        ) {
            let mut counter = 0u8;
            let mut happened = 0u64;
            let mut total = Total::default();
            total.record(counter);
            for (events, clear) in steps {
                if clear {
                    counter = 0;
                }
                happened += u64::from(events);
                counter = u8::try_from(u16::from(counter) + events).unwrap_or(u8::MAX);
                total.record(counter);
                prop_assert!(total.rise() <= happened);
            }
        }

        /// Without clears and below 255 the total is exact.
        #[test]
        fn undisturbed_totals_are_exact(
            start in 0u8..100,
            steps in proptest::collection::vec(0u8..10, 1..15),
        ) {
            let mut counter = start;
            let mut total = Total::default();
            total.record(counter);
            for events in &steps {
                counter += events;
                total.record(counter);
            }
            let happened: u64 = steps.iter().map(|events| u64::from(*events)).sum();
            prop_assert_eq!(total.rise(), happened);
            prop_assert!(!total.is_lower_bound());
        }
    }
}
