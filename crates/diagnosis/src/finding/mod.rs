//! Findings: [`Condition`] is the statement of a rule at one moment, [`Finding`] a condition over time.

pub mod condition;
pub mod disambiguation;
pub mod place;
pub mod store;

pub use condition::{Action, Alternative, Condition, Evidence, EvidenceKind, Severity, Symptom};
pub use disambiguation::told_apart_by;
pub use place::{LinkDirection, LinkEnd, Place};
pub use store::{Change, Finding, FindingStore};
