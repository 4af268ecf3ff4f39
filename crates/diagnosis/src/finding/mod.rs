//! What is wrong: [`Condition`] is what a rule says at one moment, [`Finding`] is a condition with a
//! life.

pub mod book;
pub mod condition;
pub mod place;

pub use book::{Book, Change, Finding};
pub use condition::{Action, Alternative, Condition, Evidence, EvidenceKind, Severity, Symptom};
pub use place::{LinkDirection, LinkEnd, Place};
