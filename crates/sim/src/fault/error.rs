//! Errors of faults that cannot be injected.

use linesman_config::fault::FaultName;

use super::{KINDS, Kind};
use crate::segment_file::FaultEntry;

/// A fault entry that cannot be used: which one, which key, what was given, what can be.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FaultError {
    /// No fault is called so.
    #[error("{entry}: no fault is called `{given}`{}; a segment knows: {}", did_you_mean(.near.as_ref()), all())]
    UnknownKind {
        /// Which entry.
        entry: String,
        /// What was given.
        given: String,
        /// A name that is nearly that.
        near: Option<String>,
    },
    /// A fault of the catalogue that a segment cannot have yet.
    #[error("{entry}: a segment cannot have the fault `{kind}`; it knows: {}", all())]
    NotHere {
        /// Which entry.
        entry: String,
        /// What was given.
        kind: FaultName,
    },
    /// A fault that is in the line from its making on.
    #[error(
        "{entry}: `{kind}` is built in: it cannot come while the line runs; write it into the segment file"
    )]
    BuiltIn {
        /// Which entry.
        entry: String,
        /// What was given.
        kind: String,
    },
    /// A key that the kind does not have.
    #[error("{entry} ({kind}): unknown key `{key}`{}; this kind takes: {allowed}", did_you_mean(.near.as_ref()))]
    UnknownKey {
        /// Which entry.
        entry: String,
        /// Its kind.
        kind: FaultName,
        /// What was given.
        key: String,
        /// A key that is nearly that.
        near: Option<String>,
        /// The keys it has.
        allowed: String,
    },
    /// A value that cannot be.
    #[error("{entry}: `{key}` is {given}, expected {allowed}")]
    Value {
        /// Which entry.
        entry: String,
        /// Which key.
        key: String,
        /// What was given.
        given: String,
        /// What can be.
        allowed: String,
    },
    /// A place that is not there, or is none for this kind.
    #[error("{entry} ({kind}): {given}; expected {allowed}")]
    Place {
        /// Which entry.
        entry: String,
        /// Its kind.
        kind: FaultName,
        /// What is wrong with what was given.
        given: String,
        /// What can be.
        allowed: String,
    },
    /// Keys that do not go together.
    #[error("{entry} ({kind}): {what}")]
    Combination {
        /// Which entry.
        entry: String,
        /// Its kind.
        kind: FaultName,
        /// What does not go together.
        what: String,
    },
}

impl FaultError {
    pub(super) fn unknown_kind(label: &str, entry: &FaultEntry) -> Self {
        let near = nearest(&entry.kind, KINDS.iter().map(|kind| kind.name.name()));
        Self::UnknownKind { entry: label.to_owned(), given: entry.kind.clone(), near }
    }

    pub(super) fn unknown_key(label: &str, kind: &Kind, key: &str) -> Self {
        let keys =
            || kind.place.keys().iter().copied().chain(kind.parameters.iter().map(|p| p.key));
        let common =
            ["from_ms", "to_ms", "at_ms", "every_ms", "random", "for_ms", "times", "burst"];
        let near = nearest(key, keys().chain(common));
        let allowed = keys().chain(common).collect::<Vec<_>>().join(", ");
        let (entry, key) = (label.to_owned(), key.to_owned());
        Self::UnknownKey { entry, kind: kind.name, key, near, allowed }
    }
}

fn did_you_mean(near: Option<&String>) -> String {
    near.map_or(String::new(), |near| format!(" (did you mean `{near}`?)"))
}

fn all() -> String {
    KINDS.iter().map(|kind| kind.name.name()).collect::<Vec<_>>().join(", ")
}

/// The word that is nearest to `given`, if it is near: at most a third of it must change.
pub(super) fn nearest<'a>(given: &str, words: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let distances = words.into_iter().map(|word| (distance(given, word), word));
    let (far, word) = distances.min_by_key(|(far, _)| *far)?;
    let longest = given.chars().count().max(word.chars().count());
    (far * 3 <= longest).then(|| word.to_owned())
}

/// How many letters must be put in, left out or replaced.
fn distance(one: &str, other: &str) -> usize {
    let other: Vec<char> = other.chars().collect();
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (i, a) in one.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, b) in other.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_misses_are_found() {
        let words = ["link-open", "link-flapping", "emc-noise"];
        assert_eq!(nearest("emc_noise", words), Some("emc-noise".to_owned()));
        assert_eq!(nearest("linkopen", words), Some("link-open".to_owned()));
        assert_eq!(nearest("banana", words), None);
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
    }
}
