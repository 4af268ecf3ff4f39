//! A type name is declared once in the workspace, unless the declarations are one concept on two sides.
//!
//! `type_names.toml` has both kinds of exceptions: `same` with places and a reason, which stays; and `known`, names that
//! mean several things and are to be replaced, which may only become fewer.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use serde::Deserialize;

use super::code::{self, TestFiles};
use crate::files::TextFile;

/// The exceptions.
const EXCEPTIONS: &str = "xtask/src/tidy/type_names.toml";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Exceptions {
    /// Names that mean several things: how often each is declared outside the places of `same`.
    #[serde(default)]
    known: BTreeMap<String, usize>,
    #[serde(default)]
    same: Vec<Same>,
}

/// One concept with declarations in several places.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Same {
    name: String,
    /// Files, or folders with all below them; each has at least one declaration.
    places: Vec<String>,
    reason: String,
}

/// Names that are declared more often than the exceptions allow, and exceptions that are not needed.
pub(super) fn check(files: &[TextFile], tests: &TestFiles, broken: &mut Vec<String>) -> Result<()> {
    let exceptions = files.iter().find(|file| file.path == EXCEPTIONS);
    let text = &exceptions.with_context(|| format!("{EXCEPTIONS}: it is not there"))?.text;
    let exceptions: Exceptions = toml::from_str(text).context(EXCEPTIONS)?;
    judge(&declarations(files, tests), &exceptions, broken);
    Ok(())
}

/// Where each name is declared: file and line.
type Declarations<'a> = BTreeMap<&'a str, Vec<(&'a str, usize)>>;

fn declarations<'a>(files: &'a [TextFile], tests: &TestFiles) -> Declarations<'a> {
    let mut found = Declarations::new();
    let in_workspace = |path: &str| path.starts_with("crates/") || path.starts_with("xtask/");
    for file in files.iter().filter(|file| file.is_rust() && in_workspace(&file.path)) {
        if tests.contain(&file.path) {
            continue;
        }
        for line in code::lines(&file.text) {
            if let Some(name) = declared(line.code) {
                found.entry(name).or_default().push((file.path.as_str(), line.number));
            }
        }
    }
    found
}

/// The name of the type that a line declares. A `type` with indentation belongs to a trait.
fn declared(code: &str) -> Option<&str> {
    let mut words = code
        .split_whitespace()
        .skip_while(|word| *word == "in" || word.starts_with("pub") || word.ends_with(')'));
    let keyword = words.next()?;
    let is_declaration = matches!(keyword, "struct" | "enum" | "trait" | "union")
        || (keyword == "type" && !code.starts_with(char::is_whitespace));
    let rest = words.next().filter(|_| is_declaration)?;
    let end = rest.find(|letter: char| !letter.is_alphanumeric() && letter != '_');
    Some(&rest[..end.unwrap_or(rest.len())]).filter(|name| !name.is_empty())
}

fn judge(found: &Declarations<'_>, exceptions: &Exceptions, broken: &mut Vec<String>) {
    for same in &exceptions.same {
        if same.reason.trim().is_empty() {
            broken.push(format!("{EXCEPTIONS}: {}: no reason", same.name));
        }
        let declared = found.get(same.name.as_str()).map_or(&[][..], Vec::as_slice);
        for place in &same.places {
            if !declared.iter().any(|(path, _)| path.starts_with(place.as_str())) {
                broken.push(format!("{EXCEPTIONS}: {}: none in {place}: remove it", same.name));
            }
        }
    }
    for (name, declared) in found {
        let known = exceptions.known.get(*name).copied();
        let others = others(name, declared, &exceptions.same);
        let is_apart = others.len() < declared.len();
        // One alone is no second use of the name.
        let count = if others.len() + usize::from(is_apart) > 1 { others.len() } else { 0 };
        if count > known.unwrap_or(0) {
            let at: Vec<String> =
                declared.iter().map(|(path, line)| format!("{path}:{line}")).collect();
            broken.push(format!(
                "the type name {name} is declared {} times ({}): name each by what it is; if it is one concept, \
                 put it into {EXCEPTIONS}",
                at.len(),
                at.join(", ")
            ));
        } else if let Some(known) = known.filter(|known| count < *known) {
            broken.push(fewer(name, known, count));
        }
    }
    for (name, known) in
        exceptions.known.iter().filter(|(name, _)| !found.contains_key(name.as_str()))
    {
        broken.push(fewer(name, *known, 0));
    }
}

/// Declarations outside the places where the name means the same.
fn others<'a>(name: &str, declared: &[(&'a str, usize)], same: &[Same]) -> Vec<(&'a str, usize)> {
    let places: Vec<&String> =
        same.iter().filter(|same| same.name == name).flat_map(|same| &same.places).collect();
    let is_other = |path: &str| !places.iter().any(|place| path.starts_with(place.as_str()));
    declared.iter().copied().filter(|(path, _)| is_other(path)).collect()
}

fn fewer(name: &str, known: usize, count: usize) -> String {
    match count {
        0 => format!("{EXCEPTIONS}: remove {name} from the known names"),
        _ => format!("{EXCEPTIONS}: {name}: lower {known} to {count}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken(texts: &[(&str, &str)], exceptions: &str) -> Vec<String> {
        let mut files: Vec<TextFile> =
            texts.iter().map(|(path, text)| TextFile::new(path, text)).collect();
        files.push(TextFile::new(EXCEPTIONS, exceptions));
        let mut broken = Vec::new();
        check(&files, &TestFiles::of(&files), &mut broken).unwrap();
        broken
    }

    const TWO: &[(&str, &str)] = &[
        ("crates/a/src/b.rs", "pub(crate) struct Line<'a> {\n"),
        ("crates/c/src/d.rs", "fn f() {}\ntrait Line: Send {\n"),
    ];

    #[test]
    fn second_declaration_of_a_name_is_found_with_both_places() {
        let lines = broken(TWO, "");
        assert_eq!(lines.len(), 1);
        assert!(lines[0].contains("(crates/a/src/b.rs:1, crates/c/src/d.rs:2)"), "{lines:?}");
    }

    #[test]
    fn tests_associated_types_and_words_in_comments_declare_nothing() {
        let text = "struct Line;\nimpl I for Line {\n    type Item = u8;\n}\n// struct Line;\n\
                    #[cfg(test)]\nmod tests {\n    struct Line;\n}\n";
        let other = "impl J for K {\n    type Item = u8;\n}\n";
        let files = [("crates/a/src/b.rs", text), ("crates/a/src/c.rs", other)];
        assert_eq!(broken(&files, ""), Vec::<String>::new());
    }

    #[test]
    fn one_concept_in_its_places_passes_and_a_third_place_does_not() {
        let same =
            "[[same]]\nname = \"Line\"\nplaces = [\"crates/a/\", \"crates/c/\"]\nreason = \"r\"\n";
        assert_eq!(broken(TWO, same), Vec::<String>::new());
        let third = [TWO, &[("crates/e/src/f.rs", "enum Line {\n")]].concat();
        assert_eq!(broken(&third, same).len(), 1);
        assert_eq!(broken(&TWO[..1], same).len(), 1, "no longer in c");
    }

    #[test]
    fn known_names_may_become_fewer_but_not_more() {
        assert_eq!(broken(TWO, "[known]\nLine = 2\n"), Vec::<String>::new());
        let fewer = broken(&TWO[..1], "[known]\nLine = 2\n");
        assert_eq!(fewer, [format!("{EXCEPTIONS}: remove Line from the known names")]);
        let fewer = broken(TWO, "[known]\nLine = 3\n");
        assert_eq!(fewer, [format!("{EXCEPTIONS}: Line: lower 3 to 2")]);
    }
}
