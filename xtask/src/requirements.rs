//! `docs/requirements.toml`: every row the product is to fulfil.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

const FILE: &str = "docs/requirements.toml";

/// All rows, in areas.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Requirements {
    #[serde(rename = "area")]
    pub(crate) areas: Vec<Area>,
}

/// Rows of one subject.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Area {
    prefix: String,
    pub(crate) title: String,
    pub(crate) rows: Vec<Row>,
}

/// One row.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    /// Such as `FRM-12`.
    pub(crate) id: String,
    /// Letters of U, S, P, V, H: how it can be shown; see the file's head.
    pub(crate) proof: String,
    pub(crate) title: String,
    /// What a test asserts that shows all of the row.
    pub(crate) case: String,
    /// Letters of `proof` that cannot be met here, and why.
    #[serde(default)]
    pub(crate) without: BTreeMap<char, String>,
}

impl Row {
    /// A pure calculation: a unit test beside the code is proof enough.
    pub(crate) fn is_calculation(&self) -> bool {
        self.proof == "U"
    }

    fn check(&self) -> Result<()> {
        if self.proof.is_empty() || self.proof.chars().any(|letter| !"USPVH".contains(letter)) {
            bail!("proof is {:?}, expected letters of USPVH", self.proof);
        }
        if self.case.trim().is_empty() {
            bail!("the acceptance case is empty");
        }
        for (letter, why) in &self.without {
            if !self.proof.contains(*letter) {
                bail!(
                    "it is to do without {letter}, which is no letter of its proof {}",
                    self.proof
                );
            }
            if why.trim().is_empty() {
                bail!("it is to do without {letter}, but does not say why");
            }
        }
        Ok(())
    }
}

impl Requirements {
    /// Reads and checks the file.
    pub(crate) fn read(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(FILE)).context(FILE)?;
        let requirements: Self = toml::from_str(&text).context(FILE)?;
        let mut seen = BTreeSet::new();
        for area in &requirements.areas {
            for row in &area.rows {
                if row.id.split_once('-').map(|(prefix, _)| prefix) != Some(&area.prefix) {
                    bail!("{FILE}: {} stands in the area {}", row.id, area.prefix);
                }
                row.check().with_context(|| format!("{FILE}: {}", row.id))?;
                if !seen.insert(&row.id) {
                    bail!("{FILE}: {} stands there twice", row.id);
                }
            }
        }
        Ok(requirements)
    }

    /// The identifiers of all rows.
    pub(crate) fn ids(&self) -> BTreeSet<&str> {
        self.rows().map(|row| row.id.as_str()).collect()
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = &Row> {
        self.areas.iter().flat_map(|area| &area.rows)
    }
}
