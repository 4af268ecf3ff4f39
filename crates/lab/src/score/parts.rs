//! Parts of a score: cases that several processes or machines have played, to be added up as if one had.

use super::case::ScoreOptions;
use super::outcome::CaseReport;
use super::tally::Tally;
use crate::part::{PartError, SeedPart};

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.score-part/1";

/// Cases of a range of seeds.
pub type ScorePart = SeedPart<ScoreOptions, CaseReport>;

/// Adds parts up, in the order of their seeds: the same as one run over the whole range.
///
/// # Errors
/// [`PartError`]: parts that are not of one program, one set of options and one range without a gap.
pub fn merge(parts: Vec<ScorePart>) -> Result<Tally, PartError> {
    let whole = SeedPart::join(parts, SCHEMA, |case| case.seed)?;
    let mut tally = Tally::new(whole.options);
    whole.cases.iter().for_each(|case| tally.add(case));
    Ok(tally)
}

/// A span as nanoseconds.
pub(super) mod span_ns {
    use linesman_proto::time::Span;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::score) fn serialize<S: Serializer>(
        span: &Span,
        out: S,
    ) -> Result<S::Ok, S::Error> {
        span.as_nanos().serialize(out)
    }

    pub(in crate::score) fn deserialize<'d, D: Deserializer<'d>>(
        from: D,
    ) -> Result<Span, D::Error> {
        Ok(Span::ns(u64::deserialize(from)?))
    }
}

/// A span as nanoseconds, or none.
pub(super) mod span_ns_or_none {
    use linesman_proto::time::Span;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::score) fn serialize<S: Serializer>(
        span: &Option<Span>,
        out: S,
    ) -> Result<S::Ok, S::Error> {
        span.map(Span::as_nanos).serialize(out)
    }

    pub(in crate::score) fn deserialize<'d, D: Deserializer<'d>>(
        from: D,
    ) -> Result<Option<Span>, D::Error> {
        Ok(Option::<u64>::deserialize(from)?.map(Span::ns))
    }
}
