//! Second look: a diagnosis after something was done about a finding of an earlier one.
//!
//! Causes that no evidence can tell apart are told apart by doing: another cable, another device, another card, and a
//! look whether the trouble is still there. What stays clears the part that was exchanged; what is gone blames it, once
//! the look has lasted longer than the trouble took to show before.

use std::str::FromStr;

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::topology::End;
use serde::{Deserialize, Serialize};

use super::{Diagnosis, EndReport, FindingReport, Number, PlaceReport, Severity};
use crate::model::reported::{ExchangeOutcome, ExchangePlace, Part, PartExchange};

/// Repair between two looks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RepairStep {
    part: Part,
    /// The device, by its number from 1, where the place of the finding does not say it.
    device: Option<u32>,
}

impl FromStr for RepairStep {
    type Err = String;

    /// `exchanged-cable`, `exchanged-card`, `exchanged-device` or `exchanged-device:NUMBER`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (word, number) = match text.split_once(':') {
            Some((word, number)) => (word, Some(number)),
            None => (text, None),
        };
        let part = match word {
            "exchanged-cable" => Part::Cable,
            "exchanged-device" => Part::Device,
            "exchanged-card" => Part::Card,
            _ => {
                return Err(format!(
                    "`{text}`: expected exchanged-cable, exchanged-card, exchanged-device or \
                     exchanged-device:NUMBER"
                ));
            }
        };
        let device = match number {
            None => None,
            Some(number) if part == Part::Device => {
                let number = number.parse().ok().filter(|number| *number >= 1);
                Some(number.ok_or_else(|| {
                    format!("`{text}`: expected the number of a SubDevice, from 1")
                })?)
            }
            Some(_) => return Err(format!("`{text}`: only a device has a number")),
        };
        Ok(Self { part, device })
    }
}

/// Outcome of an earlier finding.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SecondLook {
    /// Its name in the earlier diagnosis.
    pub finding: String,
    /// Its code.
    pub code: String,
    /// Its place.
    pub place: PlaceReport,
    /// Part that was exchanged since then.
    pub part: PartReport,
    /// Its outcome.
    pub outcome: SecondLookOutcome,
    /// Length of this look.
    pub looked_ns: Number,
    /// Time that the earlier look took to show it.
    pub shown_after_ns: Number,
    /// Length of a look that is long enough to say that it is gone.
    pub long_enough_ns: Number,
}

/// A kind of part.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PartReport {
    /// A cable with its plugs.
    Cable,
    /// A SubDevice.
    Device,
    /// The MainDevice's network card.
    Card,
}

/// Outcome of an earlier finding.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SecondLookOutcome {
    /// It is there again: the part that was exchanged is not it.
    Stayed,
    /// It is not there, what it rests on was judged, and this look lasted ten seconds and three times as long as it had
    /// taken to show, or longer.
    Gone,
    /// It is not there, but too little was judged, or for too short a time, to say that it is gone.
    NotYet,
}

/// A look is long enough when it lasts so many times as long as the trouble took to show before …
const LONG_ENOUGH: u64 = 3;
/// … and so long at least, in ns: what shows at once may stay away by chance for a moment.
const LEAST_NS: u64 = 10_000_000_000;

/// An earlier finding, and what was exchanged since then.
#[derive(Clone, PartialEq, Debug)]
pub struct EarlierLook {
    finding: FindingReport,
    step: RepairStep,
}

impl EarlierLook {
    /// The first finding of an earlier diagnosis that the step is about.
    ///
    /// # Errors
    /// In words, when it has no finding at whose place such a part is.
    pub fn of(previous: &Diagnosis, step: RepairStep) -> Result<Self, String> {
        let fits = |finding: &&FindingReport| at(finding, step).is_some();
        let finding = previous.findings.iter().find(fits).ok_or_else(|| {
            let what = match step.part {
                Part::Cable => "a link between two ports",
                Part::Device if step.device.is_none() => {
                    "a SubDevice; name it at a link: `exchanged-device:NUMBER`"
                }
                Part::Device => "this SubDevice",
                Part::Card => "the card or the way to it",
            };
            format!("none of its {} findings is at {what}", previous.findings.len())
        })?;
        Ok(Self { finding: finding.clone(), step })
    }

    /// The exchange as the rules weigh it: what is found again at that place stayed there.
    #[must_use]
    pub fn exchange(&self) -> Option<PartExchange> {
        let at = at(&self.finding, self.step)?;
        Some(PartExchange { part: self.step.part, at, to: None, outcome: ExchangeOutcome::Stayed })
    }

    /// Its outcome, by a diagnosis that looked for `looked_ns`.
    #[must_use]
    pub fn compare(&self, now: &Diagnosis, looked_ns: u64) -> SecondLook {
        let earlier = &self.finding;
        let shown_after = earlier.confirmed_ns.unwrap_or(earlier.opened_ns).0;
        // Another kind of trouble at that place, or a note, is not this one.
        let is_again = |finding: &FindingReport| {
            finding.class == earlier.class
                && finding.severity != Severity::Info
                && is_same_place(&finding.place, &earlier.place)
        };
        let is_there = now
            .findings
            .iter()
            .any(|finding| is_again(finding) || finding.consequences.iter().any(is_again));
        let is_judged = now.coverage.essential_gaps().next().is_none();
        let long_enough = shown_after.saturating_mul(LONG_ENOUGH).max(LEAST_NS);
        let outcome = if is_there {
            SecondLookOutcome::Stayed
        } else if is_judged && looked_ns >= long_enough {
            SecondLookOutcome::Gone
        } else {
            SecondLookOutcome::NotYet
        };
        SecondLook {
            finding: earlier.id.clone(),
            code: earlier.code.clone(),
            place: earlier.place.clone(),
            part: match self.step.part {
                Part::Cable => PartReport::Cable,
                Part::Device => PartReport::Device,
                Part::Card => PartReport::Card,
            },
            outcome,
            looked_ns: Number(looked_ns),
            shown_after_ns: Number(shown_after),
            long_enough_ns: Number(long_enough),
        }
    }
}

/// Place of the part of a step, by the place of a finding.
fn at(finding: &FindingReport, step: RepairStep) -> Option<ExchangePlace> {
    let ends = match &finding.place {
        PlaceReport::Link { a, b, .. } => Some((end(*a)?, end((*b)?)?)),
        PlaceReport::Device { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    };
    match (step.part, &finding.place) {
        (Part::Cable, _) => ends.map(|(a, b)| ExchangePlace::Ends(a, b)),
        (Part::Device, PlaceReport::Device { no, .. })
            if step.device.is_none_or(|of| of == *no) =>
        {
            DeviceId::from_no(*no).map(ExchangePlace::Device)
        }
        (Part::Device, _) => {
            let id = DeviceId::from_no(step.device?)?;
            let (a, b) = ends?;
            [a, b].iter().any(|end| end.node() == Some(id)).then_some(ExchangePlace::Device(id))
        }
        (Part::Card, PlaceReport::Host) => Some(ExchangePlace::Host),
        (Part::Card, _) => matches!(ends?.0, End::MainDevice(_)).then_some(ExchangePlace::Host),
    }
}

fn end(end: EndReport) -> Option<End<DeviceId>> {
    match DeviceId::from_no(end.no) {
        Some(id) => Some(End::Controller(id, Port::from_letter(end.port)?)),
        None => Some(End::MainDevice(if end.port == 'B' { Path::B } else { Path::A })),
    }
}

/// True if two places are one, whichever direction of a link they name.
fn is_same_place(one: &PlaceReport, other: &PlaceReport) -> bool {
    match (one, other) {
        (PlaceReport::Link { a, b, .. }, PlaceReport::Link { a: a2, b: b2, .. }) => {
            a == a2 && (b == b2 || b.is_none() || b2.is_none())
        }
        (_, _) => one == other,
    }
}
