//! Plants that are other than the diagnosis expects: how far the score falls when a number of the model
//! is not that of the world.

use std::fmt;
use std::str::FromStr;

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{FaultEntry, SegmentFile, Value};

/// What is other than expected.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Perturbation {
    /// Cables of 1 to 100 m, whatever was planned.
    Delays,
    /// Hits, bursts, openings and strange frames ten times as often, or a tenth; contacts bounce up to
    /// 60 times when a link comes up.
    Rates,
    /// Of each device for itself it is chance whether it counts forwarded errors, whatever its type.
    Forwarded,
    /// One exchange in ten in which error counters are read is not seen.
    LostReads,
    /// Another tool clears error counters now and then.
    ClearedCounters,
    /// Controllers count as other families do: of each it is chance whether it counts forwarded errors and whether it
    /// makes a symbol error anew when it passes a bad frame on.
    Counting,
    /// A link is noisy for a moment before it opens.
    Bursts,
}

impl Perturbation {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Delays,
        Self::Rates,
        Self::Forwarded,
        Self::LostReads,
        Self::ClearedCounters,
        Self::Counting,
        Self::Bursts,
    ];

    /// The name on the command line and in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Delays => "delays",
            Self::Rates => "rates",
            Self::Forwarded => "forwarded",
            Self::LostReads => "lost-reads",
            Self::ClearedCounters => "cleared-counters",
            Self::Counting => "counting",
            Self::Bursts => "bursts",
        }
    }

    /// Changes the plant.
    pub fn plant(self, file: &mut SegmentFile, stream: &mut Stream) {
        match self {
            Self::Delays => {
                for device in file.devices.iter_mut().filter(|device| device.cable_m.is_some()) {
                    device.cable_m = Some(stream.log_uniform(1.0, 100.0).round());
                }
            }
            Self::Rates => file.noise_at_link_up = Some(stream.log_uniform(3.0, 60.0).round()),
            Self::Forwarded => {
                for device in &mut file.devices {
                    device.counts_forwarded = Some(stream.chance(0.5));
                }
            }
            Self::Counting => {
                for device in &mut file.devices {
                    device.counts_forwarded = Some(stream.chance(0.5));
                    device.remakes_symbol_errors = Some(stream.chance(0.5));
                }
            }
            Self::LostReads | Self::ClearedCounters | Self::Bursts => {}
        }
    }

    /// Changes a fault.
    pub fn fault(self, entry: &mut FaultEntry, stream: &mut Stream) {
        if self != Self::Rates {
            return;
        }
        let factor = if stream.chance(0.5) { 10.0 } else { 0.1 };
        for key in ["hits_per_s", "bursts_per_s", "openings_per_s", "frames_per_s"] {
            let Some(value) = entry.parameters.get_mut(key) else { continue };
            if let Some(number) = value.as_number() {
                *value = Value::Number((number * factor).max(0.01));
            }
        }
    }

    /// What somebody does on the line beside the faults of the case.
    #[must_use]
    pub fn beside(self, stream: &mut Stream) -> Option<FaultEntry> {
        (self == Self::ClearedCounters).then(|| {
            let rate = (stream.log_uniform(0.5, 5.0) * 100.0).round() / 100.0;
            FaultEntry::new(FaultName::SecondMainDevice)
                .with("does", "clear-counters")
                .with("frames_per_s", rate)
        })
    }

    /// Trouble at the place of a fault for a moment before the fault itself, and how long it lasts.
    #[must_use]
    pub fn before(self, fault: &FaultEntry, stream: &mut Stream) -> Option<(FaultEntry, Span)> {
        let opens = ["link-open", "link-flapping", "ring-open"].contains(&fault.kind.as_str());
        let at = fault.at.clone().filter(|_| self == Self::Bursts && opens)?;
        let rate = stream.log_uniform(100.0, 5_000.0).round();
        let mut entry = FaultEntry::new(FaultName::CableDegraded).with("hits_per_s", rate);
        entry.at = Some(at);
        Some((entry, Span::ms(stream.between(5, 200))))
    }

    /// The share of exchanges with counters that are not seen.
    #[must_use]
    pub fn unseen(self) -> f64 {
        if self == Self::LostReads { 0.1 } else { 0.0 }
    }
}

impl fmt::Display for Perturbation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Perturbation {
    type Err = String;

    fn from_str(given: &str) -> Result<Self, String> {
        let names = Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|one| one.name() == given);
        found.ok_or_else(|| format!("no perturbation is called `{given}`; the names are: {names}"))
    }
}

#[cfg(test)]
mod tests {
    use linesman_sim::seed::Seed;

    use super::super::{ScoreOptions, case::Case};
    use super::*;

    #[test]
    fn each_changes_what_it_says_and_nothing_else() {
        let drawn = |perturb| {
            let options = ScoreOptions { perturb, ..ScoreOptions::default() };
            Case::draw(9, 0, &options).file
        };
        let plain = drawn(None);
        for one in Perturbation::ALL {
            assert_eq!(one.name().parse(), Ok(one));
            let file = drawn(Some(one));
            let changes_plant = matches!(
                one,
                Perturbation::Delays
                    | Perturbation::Rates
                    | Perturbation::Forwarded
                    | Perturbation::Counting
            );
            assert_eq!(file != plain, changes_plant, "{one}");
            assert_eq!(file.devices.len(), plain.devices.len());
        }
        let mut entry = FaultEntry::new(FaultName::EmcNoise).with("hits_per_s", 100.0);
        Perturbation::Rates.fault(&mut entry, &mut Seed(1).stream("rates"));
        let rate = entry.parameters["hits_per_s"].as_number();
        assert!(rate == Some(1_000.0) || rate == Some(10.0), "{rate:?}");
        assert!("speed".parse::<Perturbation>().is_err_and(|error| error.contains("lost-reads")));
    }
}
