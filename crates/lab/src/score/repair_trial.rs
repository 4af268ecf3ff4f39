//! Repairs that are tried, as whoever reads the report would: the blamed part is exchanged; where the fault did not sit
//! in it, the line is played again with the fault still there, and what is found then chooses the next part.

use linesman_diagnosis::model::reported::PartExchange;
use linesman_diagnosis::report::second_look::{EarlierLook, RepairStep};
use linesman_diagnosis::report::{Diagnosis, FindingReport};
use linesman_proto::topology::Tree;
use serde::{Deserialize, Serialize};

use super::case::{Case, ScoreOptions};
use super::play::Play;
use crate::verdict::repair::{self, RepairedPart};
use crate::verdict::{Claim, Truth};

/// Exchanges that are tried before somebody else is called.
pub const MOST_EXCHANGES: u8 = 3;

/// Outcome of the exchanges that were tried for a fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct RepairTrial {
    /// Number of the exchange that mended it, from 1; `None` where none did of [`MOST_EXCHANGES`].
    pub mended_by: Option<u8>,
}

/// Tries the parts in the order in which one diagnosis after the other blames them.
///
/// A fault is gone when its carrier was exchanged ([`linesman_sim::fault::FaultCarrier`]). A cable, a SubDevice or the card
/// that was exchanged in vain is told to the next look, as by `diagnose --after`; whoever has seen to anything else in
/// vain goes on with the next cause that was named.
pub(super) fn try_repairs(
    case: &Case,
    options: &ScoreOptions,
    truth: &Truth,
    tree: &Tree,
    first_look: (&Diagnosis, &str),
) -> RepairTrial {
    let carriers = repair::mending(truth, tree);
    let mut tried: Vec<RepairedPart> = Vec::new();
    let mut exchanges: Vec<PartExchange> = Vec::new();
    let (diagnosis, name) = first_look;
    let mut finding = finding_named(diagnosis, name).cloned();
    let mut diagnosis = diagnosis.clone();
    for number in 1..=MOST_EXCHANGES {
        let next = finding.as_ref().and_then(|finding| next_part(finding, &tried));
        let (Some(part), Some(blaming)) = (next, finding.take()) else { break };
        if carriers.contains(&part) {
            return RepairTrial { mended_by: Some(number) };
        }
        tried.push(part);
        let exchanged = step(part).and_then(|step| {
            diagnosis.findings = vec![blaming.clone()];
            EarlierLook::of(&diagnosis, step).ok()?.exchange()
        });
        finding = match exchanged {
            // What is known is known already.
            None => Some(blaming),
            Some(exchange) => {
                exchanges.push(exchange);
                let Some(again) = look_again(case, options, exchanges.clone()) else { break };
                diagnosis = again;
                let is_same = |one: &&FindingReport| one.id == blaming.id;
                let same = diagnosis.findings.iter().find(is_same);
                same.or(diagnosis.findings.first()).cloned()
            }
        };
    }
    RepairTrial { mended_by: None }
}

/// The finding with a name, be it beneath another.
pub(super) fn finding_named<'d>(diagnosis: &'d Diagnosis, name: &str) -> Option<&'d FindingReport> {
    let findings = diagnosis.findings.iter();
    let mut all = findings.flat_map(|one| std::iter::once(one).chain(&one.consequences));
    all.find(|finding| finding.id == name)
}

/// The first part that a finding blames and that was not exchanged yet, by its causes in their order.
fn next_part(finding: &FindingReport, tried: &[RepairedPart]) -> Option<RepairedPart> {
    let claims = std::iter::once(Claim::of(finding)).chain(Claim::alternatives(finding));
    claims.filter_map(repair::blamed).find(|part| !tried.contains(part))
}

/// The step as it is told to the next look; `None` for what is no exchange of a cable, a SubDevice or the card.
fn step(part: RepairedPart) -> Option<RepairStep> {
    let text = match part {
        RepairedPart::Cable(_) => "exchanged-cable".to_owned(),
        RepairedPart::Device(id) => format!("exchanged-device:{}", id.no()),
        RepairedPart::Card => "exchanged-card".to_owned(),
        RepairedPart::NoiseSource(_)
        | RepairedPart::Supply(_)
        | RepairedPart::Settings(_)
        | RepairedPart::Wiring(_)
        | RepairedPart::Computer
        | RepairedPart::OtherSender => return None,
    };
    text.parse().ok()
}

/// The same line with the same fault, by an engine that was told what was exchanged in vain.
fn look_again(
    case: &Case,
    options: &ScoreOptions,
    exchanges: Vec<PartExchange>,
) -> Option<Diagnosis> {
    let options = ScoreOptions { tries_repairs: false, ..*options };
    let mut play = Play::told(case, &options, exchanges).ok()?;
    play.live_diagnosis().ok()
}
