//! What is wrong: [`Condition`] is what a rule says at one moment, [`Finding`] is a condition with a
//! life.

pub mod apart;
pub mod book;
pub mod condition;
pub mod place;

pub use apart::told_apart_by;
pub use book::{Book, Change, Finding};
pub use condition::{Action, Alternative, Condition, Evidence, EvidenceKind, Severity, Symptom};
pub use place::{LinkDirection, LinkEnd, Place};
