//! What a run leaves out: which of it is allowed, and what was not tried.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde::Deserialize;

const FILE: &str = "xtask/allowed-skips.toml";

/// The list of what may be left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AllowedSkips {
    #[serde(rename = "skip")]
    all: Vec<Allowed>,
}

/// One of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Allowed {
    /// Words of the line that tells it.
    says: String,
    /// What is not tried then.
    what: String,
    why: String,
}

impl AllowedSkips {
    pub(super) fn read(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(FILE)).context(FILE)?;
        let list: Self = toml::from_str(&text).context(FILE)?;
        if let Some(empty) = list.all.iter().find(|one| one.says.is_empty() || one.why.is_empty()) {
            anyhow::bail!("{FILE}: {:?}: `says` and `why` must not be empty", empty.what);
        }
        Ok(list)
    }

    fn of(&self, line: &str) -> Option<&Allowed> {
        self.all.iter().find(|one| line.contains(&one.says))
    }

    /// The first line that is not on the list.
    pub(super) fn unexpected<'a>(&self, lines: &'a [String]) -> Option<&'a str> {
        lines.iter().map(String::as_str).find(|line| self.of(line).is_none())
    }

    /// The last line of a run: what was not tried, and how often it was left out.
    pub(super) fn not_tried(&self, lines: &[String]) -> String {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for line in lines {
            *counts.entry(self.of(line).map_or(line.as_str(), |one| &one.what)).or_default() += 1;
        }
        if counts.is_empty() {
            return "nothing was left out".to_owned();
        }
        let all: Vec<String> = counts
            .into_iter()
            .map(|(what, count)| match count {
                1 => what.to_owned(),
                count => format!("{what} ({count} times)"),
            })
            .collect();
        format!("not tried: {}", all.join("; "))
    }
}

/// Whether nobody watches the run and what is left out unexpectedly fails.
pub(super) fn is_strict() -> bool {
    std::env::var_os("CI").is_some_and(|value| value == "true")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list() -> AllowedSkips {
        let text =
            "[[skip]]\nsays = \"LINESMAN_DATA\"\nwhat = \"recordings\"\nwhy = \"not ours\"\n";
        toml::from_str(text).unwrap()
    }

    #[test]
    fn skip_that_is_not_on_the_list_is_unexpected() {
        let lines = ["SKIPPED: no captures; set LINESMAN_DATA", "skip soem: not installed"];
        let lines = lines.map(str::to_owned);
        assert_eq!(list().unexpected(&lines), Some("skip soem: not installed"));
        assert_eq!(list().unexpected(&lines[..1]), None);
    }

    #[test]
    fn last_line_says_what_was_not_tried() {
        let lines = ["a LINESMAN_DATA", "b LINESMAN_DATA", "interop"].map(str::to_owned);
        assert_eq!(list().not_tried(&lines), "not tried: interop; recordings (2 times)");
        assert_eq!(list().not_tried(&[]), "nothing was left out");
    }

    #[test]
    fn list_of_the_project_can_be_read() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let list = AllowedSkips::read(root).unwrap();
        assert!(list.of("SKIPPED: no captures in x; set LINESMAN_DATA").is_some());
        assert!(list.of("skip soem_takes_the_line_to_op: pysoem is not installed").is_none());
    }
}
