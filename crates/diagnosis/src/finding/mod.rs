//! What is wrong: [`Condition`] is what a rule says at one moment, [`Finding`] is a condition with a
//! life.

pub mod condition;
pub mod place;

pub use condition::{Action, Alternative, Condition, Evidence, EvidenceKind, Severity, Symptom};
pub use place::{LinkDirection, LinkEnd, Place};
