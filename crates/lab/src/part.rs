//! A part of what many seeds make: the cases of a range that one process or machine has played, to be added up as if one had
//! played them all.

use serde::{Deserialize, Serialize};

/// Cases of a range of seeds.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeedPart<O, C> {
    /// Name and version of the format.
    pub schema: String,
    /// Name and version of the program that played them, its commit included.
    pub tool: String,
    /// From the first seed up to, not including, the second.
    pub seeds: (u64, u64),
    /// Choices, the same in all parts.
    pub options: O,
    /// The cases, in the order of their seeds.
    pub cases: Vec<C>,
}

/// Why parts do not add up.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PartError {
    /// There are none.
    #[error("no part was given")]
    None,
    /// Another program, or another state of it, judged otherwise.
    #[error(
        "seeds {0}.. were played by `{1}`, and seeds {2}.. by `{3}`: parts of one program only add up"
    )]
    Tool(u64, String, u64, String),
    /// Other choices.
    #[error("seeds {0}.. and seeds {1}.. were played with different options")]
    Options(u64, u64),
    /// A gap or an overlap.
    #[error(
        "one part ends before seed {0}, the next begins with seed {1}: ranges must follow one another"
    )]
    Range(u64, u64),
    /// A part has not the cases that it says.
    #[error("the part of seeds {0}..{1} has {2} cases")]
    Count(u64, u64, usize),
    /// A file of another kind.
    #[error("the format is `{0}`, expected `{1}`")]
    Schema(String, &'static str),
}

impl<O: PartialEq, C> SeedPart<O, C> {
    /// Joins parts to the one that a single run over the whole range makes.
    ///
    /// # Errors
    /// [`PartError`]: parts that are not of one program, one set of options and one range without a gap.
    pub fn join(
        mut parts: Vec<Self>,
        schema: &'static str,
        seed_of: impl Fn(&C) -> u64,
    ) -> Result<Self, PartError> {
        parts.sort_by_key(|part| part.seeds);
        let mut parts = parts.into_iter();
        let mut whole = parts.next().ok_or(PartError::None)?;
        whole.check(schema, &seed_of)?;
        let begin = whole.seeds.0;
        for part in parts {
            part.check(schema, &seed_of)?;
            let (from, to) = part.seeds;
            if part.tool != whole.tool {
                return Err(PartError::Tool(begin, whole.tool, from, part.tool));
            }
            if part.options != whole.options {
                return Err(PartError::Options(begin, from));
            }
            if from != whole.seeds.1 {
                return Err(PartError::Range(whole.seeds.1, from));
            }
            whole.cases.extend(part.cases);
            whole.seeds.1 = to;
        }
        Ok(whole)
    }

    fn check(&self, schema: &'static str, seed_of: impl Fn(&C) -> u64) -> Result<(), PartError> {
        if self.schema != schema {
            return Err(PartError::Schema(self.schema.clone(), schema));
        }
        let (from, to) = self.seeds;
        if self.cases.iter().map(seed_of).ne(from..to) {
            return Err(PartError::Count(from, to, self.cases.len()));
        }
        Ok(())
    }
}
