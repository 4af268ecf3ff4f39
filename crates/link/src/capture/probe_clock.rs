//! Times of frames by the clock of a capture probe, which is finer than that of the computer that records.
//!
//! The first frame keeps its time in the file; the others follow by the probe's clock. Wireshark does the same.

use crate::unix_time::UnixTime;

/// Beyond this distance from the time in the file the probe has begun to count anew, in ns: its clock drifts less.
const STEP: i128 = 10_000_000_000;

/// The clock of a probe beside that of a file.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct ProbeClock {
    /// A time in the file, and that of the probe for the same frame.
    anchor: Option<(UnixTime, u64)>,
}

impl ProbeClock {
    /// The time of a frame that the file places at `recorded` and the probe at `probe_ns`. A file without times has
    /// those of the probe.
    pub(super) fn place(&mut self, recorded: Option<UnixTime>, probe_ns: u64) -> Option<UnixTime> {
        let recorded = recorded.unwrap_or(UnixTime::from_nanos(probe_ns.into()));
        let by_probe = |(time, at): (UnixTime, u64)| {
            UnixTime::from_nanos(time.as_nanos() + i128::from(probe_ns) - i128::from(at))
        };
        let placed = self.anchor.map(by_probe);
        let is_near = |placed: &UnixTime| {
            (placed.as_nanos() - recorded.as_nanos()).unsigned_abs() < STEP.unsigned_abs()
        };
        match placed.filter(is_near) {
            Some(placed) => Some(placed),
            None => {
                self.anchor = Some((recorded, probe_ns));
                Some(recorded)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_follow_the_first_by_the_clock_of_the_probe() {
        let mut clock = ProbeClock::default();
        let unix = |nanos: i128| UnixTime::from_nanos(1_700_000_000_000_000_000 + nanos);
        assert_eq!(clock.place(Some(unix(0)), 500), Some(unix(0)));
        // The computer was late to note it.
        assert_eq!(clock.place(Some(unix(90_000)), 3_500), Some(unix(3_000)));
        assert_eq!(clock.place(Some(unix(80_000)), 400), Some(unix(-100)));
        // The probe was switched off and on.
        assert_eq!(clock.place(Some(unix(60 * STEP)), 7), Some(unix(60 * STEP)));
        assert_eq!(clock.place(None, 8), Some(UnixTime::from_nanos(8)));
    }
}
