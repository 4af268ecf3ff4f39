//! An expression as a tree.

use std::ops::{Range, RangeInclusive};

use linesman_proto::time::{Instant, Span};

use super::Needs;
use super::error::ExpressionError;
use super::field::{FieldReference, Need};
use crate::knowledge::FindingTimes;

/// A part of an expression.
#[derive(Clone, Debug)]
pub(super) enum ExpressionNode {
    /// One of them.
    Or(Vec<Self>),
    /// An odd number of them.
    Xor(Vec<Self>),
    /// All of them.
    And(Vec<Self>),
    /// Not this.
    Not(Box<Self>),
    /// One datagram meets it all.
    OneDatagram(Box<Self>),
    /// A condition that has no parts.
    Leaf(Leaf),
}

/// A condition that has no parts.
#[derive(Clone, Debug)]
pub(super) enum Leaf {
    /// A field is there.
    Exists(FieldReference),
    /// Values of a field.
    Values(Test),
    /// SubDevices by words that are not looked up yet.
    SubDevices(Unresolved),
    /// The frame is near a finding.
    Around(Around),
}

/// Test of the values of a field.
#[derive(Clone, Debug)]
pub(super) struct Test {
    pub(super) reference: FieldReference,
    /// Bits that count, where not all do.
    pub(super) mask: Option<i128>,
    pub(super) ranges: Vec<RangeInclusive<i128>>,
    /// All values, not any.
    pub(super) all: bool,
    /// Outside of the ranges, not within.
    pub(super) outside: bool,
}

/// Test of SubDevices by words.
#[derive(Clone, Debug)]
pub(super) struct Unresolved {
    pub(super) test: Test,
    pub(super) comparison: Relation,
    pub(super) words: Vec<(SubDeviceWord, Option<SubDeviceWord>)>,
}

/// A word with its place.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct SubDeviceWord {
    pub(super) word: String,
    pub(super) at: Range<usize>,
}

/// Relation of a value to another.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Relation {
    Equal,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

impl Relation {
    /// The values that compare so with `value`.
    pub(super) const fn range(self, value: i128) -> RangeInclusive<i128> {
        match self {
            Self::Equal => value..=value,
            Self::Less => i128::MIN..=value.saturating_sub(1),
            Self::LessOrEqual => i128::MIN..=value,
            Self::Greater => value.saturating_add(1)..=i128::MAX,
            Self::GreaterOrEqual => value..=i128::MAX,
        }
    }
}

/// Nearness to findings.
#[derive(Clone, Debug)]
pub(super) struct Around {
    /// Identifier (`F2`), code (`H110`), name, or `any`.
    pub(super) finding: String,
    pub(super) at: Range<usize>,
    pub(super) span: Span,
    /// From and to, once it is resolved.
    pub(super) windows: Option<Vec<RangeInclusive<Instant>>>,
}

impl ExpressionNode {
    /// Goes through all leaves.
    pub(super) fn visit(&self, see: &mut impl FnMut(&Leaf)) {
        match self {
            Self::Or(parts) | Self::Xor(parts) | Self::And(parts) => {
                parts.iter().for_each(|part| part.visit(see));
            }
            Self::Not(part) | Self::OneDatagram(part) => part.visit(see),
            Self::Leaf(leaf) => see(leaf),
        }
    }

    /// Goes through all leaves, up to the first error.
    pub(super) fn visit_mut(
        &mut self,
        change: &mut impl FnMut(&mut Leaf) -> Result<(), ExpressionError>,
    ) -> Result<(), ExpressionError> {
        match self {
            Self::Or(parts) | Self::Xor(parts) | Self::And(parts) => {
                parts.iter_mut().try_for_each(|part| part.visit_mut(change))
            }
            Self::Not(part) | Self::OneDatagram(part) => part.visit_mut(change),
            Self::Leaf(leaf) => change(leaf),
        }
    }
}

impl Leaf {
    pub(super) fn add_needs(&self, needs: &mut Needs) {
        let reference = match self {
            Self::Exists(reference) => *reference,
            Self::Values(test) => test.reference,
            Self::SubDevices(_) | Self::Around(_) => {
                needs.whole = true;
                return;
            }
        };
        match reference.field.need {
            Need::Nothing => {}
            Need::Facts => needs.facts = true,
            Need::Whole => needs.whole = true,
        }
    }

    pub(super) fn resolve(
        &mut self,
        find: &mut impl FnMut(&str) -> Result<Vec<u32>, (String, String)>,
        findings: &[FindingTimes],
    ) -> Result<(), ExpressionError> {
        match self {
            Self::Exists(_) | Self::Values(_) => Ok(()),
            Self::SubDevices(unresolved) => {
                *self = Self::Values(unresolved.resolved(find)?);
                Ok(())
            }
            Self::Around(around) => around.resolve(findings),
        }
    }
}

impl Unresolved {
    fn resolved(
        &self,
        find: &mut impl FnMut(&str) -> Result<Vec<u32>, (String, String)>,
    ) -> Result<Test, ExpressionError> {
        let mut look_up = |word: &SubDeviceWord| {
            let wrong = |(reason, advice)| ExpressionError::new(word.at.clone(), reason, advice);
            find(&word.word).map_err(wrong)
        };
        let mut test = self.test.clone();
        for (from, to) in &self.words {
            let first = look_up(from)?;
            match to {
                Some(to) => {
                    let last = look_up(to)?;
                    let ends = (first.iter().min(), last.iter().max());
                    if let (Some(first), Some(last)) = ends {
                        test.ranges.push(i128::from(*first)..=i128::from(*last));
                    }
                }
                None => test
                    .ranges
                    .extend(first.iter().map(|no| self.comparison.range(i128::from(*no)))),
            }
        }
        Ok(test)
    }
}

impl Around {
    fn resolve(&mut self, findings: &[FindingTimes]) -> Result<(), ExpressionError> {
        let wanted = &self.finding;
        let is_any = wanted.eq_ignore_ascii_case("any");
        let is_meant = |finding: &&FindingTimes| is_any || finding.is_called(wanted);
        let mut windows: Vec<RangeInclusive<Instant>> = Vec::new();
        for finding in findings.iter().filter(is_meant) {
            let window = |at: &Instant| at.before(self.span)..=*at + self.span;
            windows.extend(finding.times.iter().map(window));
        }
        if windows.is_empty() {
            let reason = match is_any {
                true => "the capture has no finding with a time".to_owned(),
                false => format!("the capture has no finding `{wanted}` with a time"),
            };
            let known: Vec<String> = findings
                .iter()
                .map(|finding| format!("{} ({} {})", finding.id, finding.code, finding.name))
                .collect();
            let advice = match known.is_empty() {
                true => "see `linesman diagnose` of the same file".to_owned(),
                false => format!("name one of {}, or any", known.join(", ")),
            };
            return Err(ExpressionError::new(self.at.clone(), reason, advice));
        }
        windows.sort_by_key(|window| *window.start());
        let mut joined: Vec<RangeInclusive<Instant>> = Vec::new();
        for window in windows {
            match joined.last_mut() {
                Some(last) if *window.start() <= *last.end() => {
                    *last = *last.start()..=*last.end().max(window.end());
                }
                Some(_) | None => joined.push(window),
            }
        }
        self.windows = Some(joined);
        Ok(())
    }

    /// True if a time is near one of the findings.
    pub(super) fn holds(&self, time: Instant) -> bool {
        let Some(windows) = &self.windows else { return false };
        let next = windows.partition_point(|window| *window.end() < time);
        windows.get(next).is_some_and(|window| window.contains(&time))
    }
}
