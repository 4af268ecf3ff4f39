//! Building of the report from findings.

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::time::Instant;
use linesman_proto::topology::End;

use super::{
    AlternativeReport, DirectionReport, EndReport, EvidenceReport, FindingReport, FindingState,
    Number, PlaceReport, calibration,
};
use crate::finding::{
    Alternative, Evidence, Finding, FindingStore, LinkDirection, LinkEnd, Place, told_apart_by,
};

/// A finding with all that follows from it.
#[must_use]
pub fn finding(book: &FindingStore, finding: &Finding) -> FindingReport {
    let consequences = book.consequences(finding.id);
    let mut report = alone(finding);
    report.consequences =
        consequences.into_iter().map(|below| self::finding(book, below)).collect();
    report
}

/// What a finding is called in this run.
#[must_use]
pub fn name(id: u32) -> String {
    format!("F{id}")
}

/// A finding without what follows from it.
#[must_use]
pub fn alone(finding: &Finding) -> FindingReport {
    let condition = &finding.condition;
    let page = condition.page;
    let state = match (finding.closed, finding.confirmed) {
        (Some(_), _) => FindingState::Closed,
        (None, Some(_)) => FindingState::Confirmed,
        (None, None) => FindingState::Opened,
    };
    FindingReport {
        id: name(finding.id),
        code: page.code.to_owned(),
        name: page.name.to_owned(),
        severity: condition.severity,
        class: page.class,
        state,
        opened_ns: time(finding.opened),
        confirmed_ns: finding.confirmed.map(time),
        closed_ns: finding.closed.map(time),
        place: place(&condition.place),
        cause: condition.cause,
        confidence: rounded(calibration::measured(condition.confidence)),
        alternatives: condition
            .alternatives
            .iter()
            .map(|other| alternative(condition.cause, condition.confidence, other))
            .collect(),
        evidence: condition.evidence.iter().map(evidence).collect(),
        actions: condition.actions.clone(),
        consequences: Vec::new(),
    }
}

/// A place.
#[must_use]
pub fn place(place: &Place) -> PlaceReport {
    match *place {
        Place::Link { network, a, b, direction } => PlaceReport::Link {
            network: network.0,
            a: end(a),
            b: b.map(end),
            direction: direction.map(|direction| match direction {
                LinkDirection::AToB => DirectionReport::AToB,
                LinkDirection::BToA => DirectionReport::BToA,
                LinkDirection::Both => DirectionReport::Both,
            }),
        },
        Place::Device { network, device } => {
            PlaceReport::Device { network: network.0, no: device.no() }
        }
        Place::Network { network } => PlaceReport::Network { network: network.0 },
        Place::Host => PlaceReport::Host,
    }
}

fn end(end: LinkEnd) -> EndReport {
    match end {
        End::MainDevice(path) => {
            EndReport { no: 0, port: if path.index() == 0 { 'A' } else { 'B' } }
        }
        End::Controller(device, port) => EndReport { no: device.no(), port: port.letter() },
    }
}

fn alternative(first: FaultName, said: f64, alternative: &Alternative) -> AlternativeReport {
    AlternativeReport {
        cause: alternative.cause,
        place: alternative.place.as_ref().map(place),
        confidence: rounded(calibration::beside(said, alternative.confidence)),
        told_apart_by: told_apart_by(first, alternative.cause).map(str::to_owned),
    }
}

fn evidence(evidence: &Evidence) -> EvidenceReport {
    EvidenceReport {
        kind: evidence.kind,
        time_ns: evidence.at.map(time),
        frame: evidence.frame.map(Number),
        no: evidence.device.map(DeviceId::no),
        port: evidence.port.map(Port::letter),
        register: evidence.register.map(|register| register.0),
        before: evidence.before.map(Number),
        after: evidence.after.map(Number),
        text: evidence.text.clone(),
    }
}

const fn time(at: Instant) -> Number {
    Number(at.as_nanos())
}

/// Down to whole per cent: more would pretend, and what adds up to 1 still does.
fn rounded(confidence: f64) -> f64 {
    (confidence.clamp(0.0, 1.0) * 100.0 + 1e-9).floor() / 100.0
}
