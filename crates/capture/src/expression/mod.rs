//! Filter language: which frames of a capture are meant.
//!
//! Fields and operators are those of Wireshark's display filters, with the same meaning: a comparison is true of a frame
//! when it is true of any of its datagrams, and `!=` when it is true of all. Ours are `datagram(…)`, which asks that one
//! datagram meets all of it, `subdevice`, `register`, `cyclic`, `out`, `back`, `wkc.wrong` and `around(FINDING, TIME)`.
//!
//! Start with [`Expression::parse`]; [`Expression::needs`] says what has to be known beside the frame.

mod error;
mod evaluate;
pub mod field;
mod like;
mod node;
mod parse;
mod token;
pub mod value;

#[cfg(test)]
mod tests;

pub use error::ExpressionError;
pub use field::{FIELDS, FieldReference, FilterField};
pub use like::{like, like_datagrams};

use node::ExpressionNode;

use crate::knowledge::{DeviceIndex, FindingTimes};
use crate::row::CaptureRow;

/// A condition on frames.
#[derive(Clone, Debug)]
pub struct Expression {
    node: ExpressionNode,
}

/// Knowledge that an expression takes beside the frame.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Needs {
    /// What the frames before tell: which way it goes, expected working counters, the cycle.
    pub facts: bool,
    /// Knowledge of the whole capture: SubDevices, findings.
    pub whole: bool,
}

impl Expression {
    /// The condition that a text states.
    ///
    /// # Errors
    /// [`ExpressionError`] with the place in the text.
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        Ok(Self { node: parse::parse(text)? })
    }

    /// Knowledge that evaluating it takes.
    #[must_use]
    pub fn needs(&self) -> Needs {
        let mut needs = Needs::default();
        self.node.visit(&mut |leaf| leaf.add_needs(&mut needs));
        needs
    }

    /// Puts numbers in place of the SubDevices that are named, and times in place of findings.
    ///
    /// `find` gives the numbers, from 1, of all SubDevices that a word means.
    ///
    /// # Errors
    /// [`ExpressionError`] for a word that means none, and for a finding that there is not.
    pub fn resolve(
        &mut self,
        mut find: impl FnMut(&str) -> Result<Vec<u32>, (String, String)>,
        findings: &[FindingTimes],
    ) -> Result<(), ExpressionError> {
        self.node.visit_mut(&mut |leaf| leaf.resolve(&mut find, findings))
    }

    /// True if a frame meets it. Without `devices` no SubDevice is known.
    #[must_use]
    pub fn matches(&self, row: &CaptureRow<'_>, devices: Option<&DeviceIndex>) -> bool {
        evaluate::holds(&self.node, row, None, devices)
    }

    /// True if a datagram of a frame meets it by itself: fields of the frame and of this datagram count, those of the
    /// other datagrams do not.
    #[must_use]
    pub fn matches_datagram(
        &self,
        row: &CaptureRow<'_>,
        index: usize,
        devices: Option<&DeviceIndex>,
    ) -> bool {
        evaluate::holds(&self.node, row, Some(index), devices)
    }
}
