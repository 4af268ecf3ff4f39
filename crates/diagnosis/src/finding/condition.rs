//! Conditions: the statement of a rule at one moment, with place, cause and evidence.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::time::Instant;
use serde::{Deserialize, Serialize};

use super::Place;
use crate::model::{Rise, Seen};
use crate::rule::RulePage;

/// How bad it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Worth knowing; nothing is wrong with the line.
    Info,
    /// The line works, but not as it should.
    Warning,
    /// The line does not work as it should.
    Error,
}

/// What to do, a sentence.
pub type Action = String;

/// The first step with counts of which no earlier value is known.
const MAY_BE_OLD: &str = "The counts may be old, since no earlier values are known: clear the counters \
                          and watch; only what rises is of now.";

/// Something is wrong: what a rule says of the line as it stands.
///
/// The same trouble must come back with the same page and spot each time the rule looks (see
/// [`Place::is_same_spot`]): that is how it stays one finding. It is for as long as the rule reports
/// it; `is_active` says whether it still lasts.
#[derive(Clone, PartialEq, Debug)]
pub struct Condition {
    /// The rule that says so.
    pub page: &'static RulePage,
    /// How bad, where the rule finds it other than its page says.
    pub severity: Severity,
    /// Where, most likely.
    pub place: Place,
    /// Why, most likely.
    pub cause: FaultName,
    /// How sure of place and cause, 0 to 1.
    pub confidence: f64,
    /// What else it may be, most likely first. Confidences with the one above add up to at most 1.
    pub alternatives: Vec<Alternative>,
    /// When it began, or was first seen.
    pub since: Instant,
    /// Whether it is certain that something is wrong there, be the cause as unsure as it may.
    pub is_confirmed: bool,
    /// When the proof was seen, once confirmed.
    pub confirmed_at: Option<Instant>,
    /// When it ended; `None` while it lasts.
    pub ended: Option<Instant>,
    /// What shows it, most telling first.
    pub evidence: Vec<Evidence>,
    /// What to do, most promising first.
    pub actions: Vec<Action>,
    /// What this condition is about. It hangs beneath another condition that explains all of it;
    /// with nothing here it never does.
    pub symptoms: Vec<Symptom>,
    /// What follows from this condition.
    pub explains: Vec<Symptom>,
    /// True where the place follows from the amount of a sum alone, which many places together can make: what takes a
    /// part of the sum at that time explains this.
    pub is_by_sum_alone: bool,
}

/// Something that a fault can bring about, as the link between conditions.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Symptom {
    /// A controller does not answer any more.
    Silent(DeviceId),
    /// A controller's share of a working counter is missing.
    WorkingCounter(DeviceId),
    /// A controller left the state it was in by itself, or reports an error.
    StateLost(DeviceId),
    /// A controller's firmware sent an emergency.
    Emergency(DeviceId),
    /// A controller's mailbox answers late, or not at all.
    Mailbox(DeviceId),
    /// Inputs of a controller are not renewed any more.
    InputsStill(DeviceId),
    /// Frames do not come back.
    FramesLost,
    /// Frames come back late.
    FramesLate,
    /// Damaged frames or symbols are counted at a port of a controller.
    PortErrors(DeviceId, Port),
    /// Damaged frames are counted by the card.
    CardErrors,
    /// A port of a controller has no link any more.
    LinkDown(DeviceId, Port),
    /// A port of a controller lost its link for a while that nobody saw: only its counter tells.
    LinkCounted(DeviceId, Port),
    /// The card has no link any more.
    NoCarrier,
    /// Nothing comes back at all.
    NobodyAnswers,
    /// Error counters are cleared, and nobody here does so.
    CountersCleared,
}

/// Another explanation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Alternative {
    /// Why.
    pub cause: FaultName,
    /// Where, if elsewhere than the condition says.
    pub place: Option<Place>,
    /// How sure, 0 to 1.
    pub confidence: f64,
}

/// What shows it.
#[derive(Clone, PartialEq, Debug)]
pub struct Evidence {
    /// Where it comes from.
    pub kind: EvidenceKind,
    /// When.
    pub at: Option<Instant>,
    /// The frame's number.
    pub frame: Option<u64>,
    /// The controller.
    pub device: Option<DeviceId>,
    /// The port.
    pub port: Option<Port>,
    /// The register.
    pub register: Option<RegisterAddress>,
    /// Its value before.
    pub before: Option<u64>,
    /// Its value after.
    pub after: Option<u64>,
    /// In words.
    pub text: String,
}

/// Where evidence comes from.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EvidenceKind {
    /// A frame.
    Frame,
    /// A register that a frame, or a person, read.
    Register,
    /// The host.
    Host,
}

impl Condition {
    /// A condition with neither evidence nor alternatives yet, opened but not confirmed, with the
    /// severity of its page.
    #[must_use]
    pub fn new(page: &'static RulePage, place: Place, cause: FaultName, since: Instant) -> Self {
        Self {
            page,
            severity: page.severity,
            place,
            cause,
            confidence: 1.0,
            alternatives: Vec::new(),
            since,
            is_confirmed: false,
            confirmed_at: None,
            ended: None,
            evidence: Vec::new(),
            actions: Vec::new(),
            symptoms: Vec::new(),
            explains: Vec::new(),
            is_by_sum_alone: false,
        }
    }

    /// How sure of place and cause.
    #[must_use]
    pub fn confidence(mut self, confidence: f64) -> Self {
        self.confidence = confidence;
        self
    }

    /// With another explanation at the same place.
    #[must_use]
    pub fn or(mut self, cause: FaultName, confidence: f64) -> Self {
        self.alternatives.push(Alternative { cause, place: None, confidence });
        self
    }

    /// With another explanation at another place.
    #[must_use]
    pub fn or_at(mut self, cause: FaultName, place: Place, confidence: f64) -> Self {
        self.alternatives.push(Alternative { cause, place: Some(place), confidence });
        self
    }

    /// Certain since `at`.
    #[must_use]
    pub const fn confirmed(mut self, at: Instant) -> Self {
        self.is_confirmed = true;
        self.confirmed_at = Some(at);
        self
    }

    /// Over since `at`.
    #[must_use]
    pub const fn ended(mut self, at: Instant) -> Self {
        self.ended = Some(at);
        self
    }

    /// What shows it may have been counted long ago: worth a look, and no error.
    #[must_use]
    pub fn may_be_old(mut self) -> Self {
        self.severity = self.severity.min(Severity::Warning);
        self.actions.insert(0, MAY_BE_OLD.to_owned());
        self
    }

    /// With another piece of evidence.
    #[must_use]
    pub fn shown_by(mut self, evidence: Evidence) -> Self {
        self.evidence.push(evidence);
        self
    }

    /// With something to do.
    #[must_use]
    pub fn advise(mut self, action: impl Into<Action>) -> Self {
        self.actions.push(action.into());
        self
    }

    /// About these symptoms.
    #[must_use]
    pub fn about(mut self, symptoms: impl IntoIterator<Item = Symptom>) -> Self {
        self.symptoms.extend(symptoms);
        self
    }

    /// Explains these symptoms.
    #[must_use]
    pub fn explaining(mut self, symptoms: impl IntoIterator<Item = Symptom>) -> Self {
        self.explains.extend(symptoms);
        self
    }

    /// Whether a symptom is among what this condition explains.
    #[must_use]
    pub fn accounts_for(&self, symptom: &Symptom) -> bool {
        // Who does not answer at all does not answer by its mailbox either, and renews no inputs.
        let is_silent = matches!(symptom, Symptom::Mailbox(id) | Symptom::InputsStill(id)
            if self.explains.contains(&Symptom::Silent(*id)));
        self.explains.contains(symptom) || is_silent
    }
}

impl Evidence {
    /// A frame shows it.
    #[must_use]
    pub fn frame(at: Instant, frame: u64, text: impl Into<String>) -> Self {
        Self { frame: Some(frame), ..Self::new(EvidenceKind::Frame, Some(at), text) }
    }

    /// A register shows it.
    #[must_use]
    pub fn register<T>(
        device: DeviceId,
        register: RegisterAddress,
        seen: &Seen<T>,
        text: impl Into<String>,
    ) -> Self {
        Self {
            frame: seen.frame,
            device: Some(device),
            register: Some(register),
            ..Self::new(EvidenceKind::Register, Some(seen.at), text)
        }
    }

    /// A counter that rose shows it.
    #[must_use]
    pub fn rise(
        device: DeviceId,
        register: RegisterAddress,
        port: Option<Port>,
        rise: &Rise,
        text: impl Into<String>,
    ) -> Self {
        Self {
            frame: rise.frame,
            device: Some(device),
            port,
            register: Some(register),
            before: Some(rise.before),
            after: Some(rise.after),
            ..Self::new(EvidenceKind::Register, Some(rise.at), text)
        }
    }

    /// The host noticed it.
    #[must_use]
    pub fn host(at: Option<Instant>, text: impl Into<String>) -> Self {
        Self::new(EvidenceKind::Host, at, text)
    }

    /// With the values before and after.
    #[must_use]
    pub const fn values(mut self, before: Option<u64>, after: Option<u64>) -> Self {
        self.before = before;
        self.after = after;
        self
    }

    /// At a port.
    #[must_use]
    pub const fn port(mut self, port: Port) -> Self {
        self.port = Some(port);
        self
    }

    fn new(kind: EvidenceKind, at: Option<Instant>, text: impl Into<String>) -> Self {
        Self {
            kind,
            at,
            frame: None,
            device: None,
            port: None,
            register: None,
            before: None,
            after: None,
            text: text.into(),
        }
    }
}
