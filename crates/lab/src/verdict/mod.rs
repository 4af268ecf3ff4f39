//! Comparison of a verdict with the truth.
//!
//! A verdict is right when it names what was injected. It is *admitted* when it names something
//! that the same evidence allows: no reading on a live line tells a cut cable from a dead neighbour.
//! What is admitted follows from physics ([`admit`], [`sets`], shown by [`proof`]), never from what the
//! diagnosis likes to say.

pub mod admit;
pub mod claim;
pub mod judge;
pub mod proof;
pub mod repair;
pub mod sets;
pub mod site;

pub use admit::{Admitted, Hop, Scene, Truth, TruthPlace};
pub use claim::{Claim, Naming};
pub use site::{Site, Way};

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use sets::AdmittedSet;

/// How well a claim fits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(into = "String")]
pub enum Grade {
    /// It is not so, and the evidence says it is not.
    Wrong,
    /// The evidence allows it, with the reason why.
    Admitted(&'static str),
    /// It is what was injected.
    Exact,
}

impl Grade {
    /// Whether an honest diagnosis may say it.
    #[must_use]
    pub fn is_right(self) -> bool {
        self != Self::Wrong
    }

    /// The set that admits it, if it is one that does.
    #[must_use]
    pub fn set(self) -> Option<&'static AdmittedSet> {
        match self {
            Self::Admitted(why) => sets::ALL.iter().copied().find(|set| set.why == why),
            Self::Wrong | Self::Exact => None,
        }
    }
}

/// `wrong`, `exact`, or the name of the set.
impl From<Grade> for String {
    fn from(grade: Grade) -> Self {
        match grade {
            Grade::Wrong => "wrong".to_owned(),
            Grade::Exact => "exact".to_owned(),
            Grade::Admitted(why) => grade.set().map_or(why, |set| set.name).to_owned(),
        }
    }
}

impl<'de> Deserialize<'de> for Grade {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let name = String::deserialize(from)?;
        match name.as_str() {
            "wrong" => Ok(Self::Wrong),
            "exact" => Ok(Self::Exact),
            _ => {
                let set = sets::ALL.iter().find(|set| set.name == name);
                set.map(|set| Self::Admitted(set.why)).ok_or_else(|| {
                    D::Error::custom(format!(
                        "no set of causes is called `{name}`; expected wrong, exact or a set's name"
                    ))
                })
            }
        }
    }
}

/// How well a claim fits a fault, place and cause apart.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct Match {
    /// The place, whatever the cause.
    pub place: Grade,
    /// Cause and place together.
    pub cause: Grade,
}

impl Match {
    /// Nothing fits.
    pub const NONE: Self = Self { place: Grade::Wrong, cause: Grade::Wrong };

    /// Whether place and cause are right or admitted.
    #[must_use]
    pub fn is_right(self) -> bool {
        self.cause.is_right()
    }
}

/// How well `claim` fits `truth`.
#[must_use]
pub fn matches(truth: &Truth, scene: &Scene<'_>, claim: Claim) -> Match {
    let mut best = Match::NONE;
    for Admitted { cause, site, set } in admit::admitted(truth, scene) {
        if !site.covers(claim.site) {
            continue;
        }
        let grade = set.map_or(Grade::Exact, |set| Grade::Admitted(set.why));
        best.place = best.place.max(grade);
        if cause == claim.cause {
            best.cause = best.cause.max(grade);
        }
    }
    best
}
