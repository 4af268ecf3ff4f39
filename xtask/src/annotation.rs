//! `proves: ID [(KINDS)] [partial[: reason]], …`: which test shows which row.
//!
//! KINDS are the proof letters that the test meets, U, S, P or V; where they are not named they follow from the place of
//! the test ([`crate::kind`]), and a recording is always named.
//! In Rust it is a `//` comment directly above `#[test]`, in a story a line of its head, in an
//! interop program a `#` comment above the check. `partial` belongs to the row it stands behind; a
//! reason may hold commas, and ends where the next row begins.

use crate::files::TextFile;
use crate::kind::{Ability, Kinds};

/// One row that one test claims to show.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) struct Claim {
    pub(crate) id: String,
    pub(crate) extent: Extent,
    pub(crate) surface: Surface,
    /// The proof letters that it meets.
    pub(crate) kinds: Kinds,
    /// From the root.
    pub(crate) path: String,
    /// From 1.
    pub(crate) line: usize,
    /// The test's name.
    pub(crate) test: String,
}

impl Claim {
    pub(crate) fn is_full(&self) -> bool {
        self.extent == Extent::Full
    }
}

/// How much of the row is claimed.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Extent {
    /// Its acceptance case is asserted.
    Full,
    /// A part, and which one or what is missing, if said.
    Partial(Option<String>),
}

/// Where a test stands.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Surface {
    /// Beside the code.
    Unit,
    /// Through what others can call or run: `tests/` of a crate, a story, an interop check.
    Public,
}

/// Finds every annotation of the project; the second list is what is wrong with them.
pub(crate) fn claims(files: &[TextFile]) -> (Vec<Claim>, Vec<String>) {
    let mut claims = Vec::new();
    let mut errors = Vec::new();
    for file in files {
        let language = match file.path.split('/').next() {
            // This crate speaks about annotations; it carries none.
            Some("xtask") => continue,
            Some("scenarios") if file.path.ends_with(".md") => Language::Story,
            Some("interop") if file.path.ends_with(".py") => Language::Python,
            _ if file.is_rust() => Language::Rust,
            _ => continue,
        };
        read(file, language, &mut claims, &mut errors);
    }
    (claims, errors)
}

#[derive(Clone, Copy, Eq, PartialEq)]
enum Language {
    Rust,
    Python,
    Story,
}

impl Language {
    fn marker(self) -> &'static str {
        match self {
            Self::Rust => "// proves:",
            Self::Python => "# proves:",
            Self::Story => "proves:",
        }
    }

    /// What a line that continues the annotation begins with.
    fn continuation(self) -> Option<&'static str> {
        match self {
            Self::Rust => Some("// "),
            Self::Python => Some("# "),
            Self::Story => None,
        }
    }
}

fn read(file: &TextFile, language: Language, claims: &mut Vec<Claim>, errors: &mut Vec<String>) {
    let lines: Vec<&str> = file.text.lines().map(str::trim).collect();
    let surface = match language {
        Language::Rust if !is_integration_test(&file.path) => Surface::Unit,
        Language::Rust | Language::Python | Language::Story => Surface::Public,
    };
    for (index, line) in lines.iter().enumerate() {
        let Some(first) = line.strip_prefix(language.marker()) else { continue };
        let mut text = first.trim().to_owned();
        let mut next = index + 1;
        while let (Some(line), Some(mark)) = (lines.get(next), language.continuation()) {
            // Another annotation may follow at once; it is read on its own.
            if line.starts_with(language.marker()) {
                next += 1;
                while lines.get(next).is_some_and(|line| line.starts_with(mark)) {
                    next += 1;
                }
                break;
            }
            let Some(more) = line.strip_prefix(mark) else { break };
            text.push(' ');
            text.push_str(more.trim());
            next += 1;
        }
        let at = format!("{}:{}", file.path, index + 1);
        let test = match language {
            Language::Story => Some(story_name(&file.path)),
            Language::Rust => rust_test(&lines[next..]),
            Language::Python => python_check(&lines[next..]),
        };
        let Some(test) = test else {
            errors.push(format!("{at}: no test follows the annotation"));
            continue;
        };
        let rows = match parse(&text) {
            Ok(rows) => rows,
            Err(why) => {
                errors.push(format!("{at}: {why}"));
                continue;
            }
        };
        let ability = match language {
            Language::Story => Ability::of_story(),
            Language::Python => Ability::of_interop(),
            Language::Rust => Ability::of_rust(&file.path, &file.text, &test),
        };
        for ClaimedRow { id, named, extent } in rows {
            match ability.claim(&named) {
                Err(why) => errors.push(format!("{at}: {id}: {why}")),
                Ok(kinds) => {
                    let (path, test) = (file.path.clone(), test.clone());
                    claims.push(Claim { id, extent, surface, kinds, path, line: index + 1, test });
                }
            }
        }
    }
}

fn is_integration_test(path: &str) -> bool {
    let mut parts = path.split('/');
    parts.next() == Some("crates") && parts.nth(1) == Some("tests")
}

fn story_name(path: &str) -> String {
    path.trim_start_matches("scenarios/").trim_end_matches(".md").to_owned()
}

/// The name of the function under `#[test]`, which must come before anything else.
fn rust_test(lines: &[&str]) -> Option<String> {
    let mut is_test = false;
    for line in lines {
        if line.starts_with("#[test]") {
            is_test = true;
        } else if let Some(rest) = line.strip_prefix("fn ") {
            let end = rest.find(['(', '<'])?;
            return is_test.then(|| rest[..end].to_owned());
        } else if !(line.starts_with("#[") || line.starts_with("//")) {
            return None;
        }
    }
    None
}

fn python_check(lines: &[&str]) -> Option<String> {
    let line = lines.iter().find(|line| !line.starts_with('@') && !line.starts_with('#'))?;
    let rest = line.strip_prefix("def ")?;
    Some(rest[..rest.find('(')?].to_owned())
}

/// What an annotation says of one row.
struct ClaimedRow {
    id: String,
    /// The kinds that it names, none if it leaves them to the place.
    named: Kinds,
    extent: Extent,
}

/// Reads what stands behind the marker.
fn parse(text: &str) -> Result<Vec<ClaimedRow>, String> {
    let mut rows: Vec<ClaimedRow> = Vec::new();
    for part in text.split(',') {
        let part = part.trim();
        let (id, rest) = part.split_once(' ').unwrap_or((part, ""));
        if is_id(id) {
            let (named, rest) = named(rest.trim(), part)?;
            let extent = match rest.strip_prefix("partial").map(str::trim) {
                None if rest.is_empty() => Extent::Full,
                Some("" | ":") => Extent::Partial(None),
                Some(reason) if reason.starts_with(':') => {
                    Extent::Partial(Some(reason[1..].trim().to_owned()))
                }
                Some(_) | None => return Err(unreadable(part)),
            };
            rows.push(ClaimedRow { id: id.to_owned(), named, extent });
        } else if let Some(ClaimedRow { extent: Extent::Partial(Some(reason)), .. }) =
            rows.last_mut()
        {
            // A comma within a reason.
            reason.push_str(", ");
            reason.push_str(part);
        } else {
            return Err(unreadable(part));
        }
    }
    Ok(rows)
}

/// The letters in parentheses at the beginning of a text, and what follows them.
fn named<'a>(rest: &'a str, part: &str) -> Result<(Kinds, &'a str), String> {
    let Some(inside) = rest.strip_prefix('(') else { return Ok((Kinds::default(), rest)) };
    let (letters, rest) = inside.split_once(')').ok_or_else(|| unreadable(part))?;
    let kinds = Kinds::of(letters).map_err(|other| {
        format!("{part:?}: {other:?} is no kind of test; expected letters of USPV")
    })?;
    Ok((kinds, rest.trim()))
}

fn unreadable(item: &str) -> String {
    format!("{item:?} cannot be read; expected `ID [(KINDS)] [partial[: reason]], …`")
}

fn is_id(word: &str) -> bool {
    word.split_once('-').is_some_and(|(prefix, number)| {
        !prefix.is_empty()
            && prefix.bytes().all(|byte| byte.is_ascii_uppercase())
            && number.len() == 2
            && number.bytes().all(|byte| byte.is_ascii_digit())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(path: &str, text: &str) -> (Vec<(String, Extent, String)>, usize) {
        let (claims, errors) = claims(&[TextFile::new(path, text)]);
        let claims = claims.into_iter().map(|claim| (claim.id, claim.extent, claim.test)).collect();
        (claims, errors.len())
    }

    #[test]
    fn a_full_claim_names_row_and_test() {
        let (found, errors) =
            of("crates/a/tests/b.rs", "// proves: FRM-02, FRM-03\n#[test]\nfn all() {}\n");
        assert_eq!(errors, 0);
        assert_eq!(
            found,
            [
                ("FRM-02".into(), Extent::Full, "all".into()),
                ("FRM-03".into(), Extent::Full, "all".into())
            ]
        );
    }

    #[test]
    fn partial_belongs_to_the_row_before_it() {
        let text = "// proves: FRM-02 partial, FRM-03, HW-03 partial: a, b, HW-04\n\
                    #[test]\nfn all() {}\n";
        let (found, errors) = of("crates/a/src/b.rs", text);
        let extents: Vec<Extent> = found.into_iter().map(|(_, extent, _)| extent).collect();
        let reason = Extent::Partial(Some("a, b".into()));
        assert_eq!(
            (extents, errors),
            (vec![Extent::Partial(None), Extent::Full, reason, Extent::Full], 0)
        );
    }

    #[test]
    fn a_reason_runs_over_lines_and_may_hold_commas() {
        let text =
            "// proves: FRM-02 partial: reads, not\n// writes\n#[test]\n#[ignore]\nfn all() {}\n";
        let (found, errors) = of("crates/a/src/b.rs", text);
        assert_eq!(errors, 0);
        assert_eq!(found[0].1, Extent::Partial(Some("reads, not writes".into())));
    }

    #[test]
    fn two_annotations_above_one_test_are_both_read() {
        let text = "// proves: FRM-02\n// proves: HW-03 partial: a\n// b\n#[test]\nfn all() {}\n";
        let (found, errors) = of("crates/a/src/b.rs", text);
        assert_eq!((found.len(), errors), (2, 0));
        assert_eq!(found[0].1, Extent::Full);
        assert_eq!(found[1].1, Extent::Partial(Some("a b".into())));
    }

    #[test]
    fn an_annotation_without_a_test_is_an_error() {
        assert_eq!(of("crates/a/src/b.rs", "// proves: FRM-02\nfn helper() {}\n"), (vec![], 1));
        assert_eq!(of("crates/a/src/b.rs", "// proves: FRM-02\n"), (vec![], 1));
    }

    #[test]
    fn kinds_stand_in_parentheses_behind_the_row() {
        let text = "// proves: FRM-02 (P), HW-03 (U P) partial: a\n#[test]\n\
                    fn all() {\n    read(\"a.pcapng\");\n}\n";
        let (claims, errors) = claims(&[TextFile::new("crates/proto/tests/b.rs", text)]);
        assert!(errors.is_empty(), "{errors:?}");
        let kinds: Vec<String> = claims.iter().map(|claim| claim.kinds.to_string()).collect();
        assert_eq!(kinds, ["P", "UP"]);
        assert_eq!(claims[1].extent, Extent::Partial(Some("a".into())));
    }

    #[test]
    fn kinds_that_the_test_is_not_are_an_error() {
        for row in ["FRM-02 (V)", "FRM-02 (H)", "FRM-02 (P", "FRM-02 (P)"] {
            let text = format!("// proves: {row}\n#[test]\nfn all() {{\n}}\n");
            assert_eq!(of("crates/proto/tests/b.rs", &text), (vec![], 1), "{row}");
        }
    }

    #[test]
    fn what_is_no_row_is_an_error() {
        assert_eq!(of("crates/a/src/b.rs", "// proves: frames\n#[test]\nfn a() {}\n"), (vec![], 1));
        assert_eq!(of("scenarios/a.md", "proves: partial\n"), (vec![], 1));
    }

    #[test]
    fn stories_and_interop_checks_are_read() {
        let (found, errors) = of("scenarios/cut.md", "---\nproves: HW-10\n---\n");
        assert_eq!((found[0].2.as_str(), errors), ("cut", 0));
        let (found, errors) =
            of("interop/run.py", "# proves: JCT-04 partial: one cycle\n@check\ndef scan(line):\n");
        assert_eq!((found[0].2.as_str(), errors), ("scan", 0));
    }

    #[test]
    fn only_tests_folders_are_public() {
        assert!(is_integration_test("crates/sim/tests/wire.rs"));
        assert!(!is_integration_test("crates/sim/src/tests/wire.rs"));
        assert!(!is_integration_test("fuzz/tests/x.rs"));
    }
}
