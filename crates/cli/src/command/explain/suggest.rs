//! Names near to a word that is none.

use linesman_config::fault::FaultName;
use linesman_diagnosis::rule;
use linesman_proto::command::Command;
use linesman_proto::mailbox::coe::standard_object;
use linesman_proto::register;
use linesman_proto::state::status_code;

use super::{topic, vocabulary};

/// Most names that are suggested.
const MOST: usize = 8;
/// Least similarity of two names, from 0 to 1.
const ALIKE: f64 = 0.7;
/// Longer words are compared with nothing: no name is that long.
const MOST_LETTERS: usize = 60;

/// A name as it can be typed, and as it is shown.
struct Name {
    typed: String,
    shown: String,
}

fn same(name: &str) -> Name {
    Name { typed: name.to_owned(), shown: format!("`{name}`") }
}

fn names() -> Vec<Name> {
    let mut names: Vec<Name> = Vec::new();
    names.extend(rule::catalogue().into_iter().map(|page| Name {
        typed: page.name.to_owned(),
        shown: format!("{} ({})", page.code, page.name),
    }));
    names.extend(rule::catalogue().into_iter().map(|page| Name {
        typed: page.code.to_owned(),
        shown: format!("{} ({})", page.code, page.name),
    }));
    names.extend(FaultName::ALL.iter().map(|fault| same(fault.name())));
    names.extend(topic::ALL.iter().map(|topic| same(topic.name)));
    names.extend(Command::ALL.iter().map(|command| same(command.name())));
    names.extend(vocabulary::all().flat_map(|word| {
        word.spellings()
            .map(move |typed| Name { typed: typed.to_owned(), shown: format!("`{}`", word.name) })
    }));
    names.extend(register::ALL.iter().map(|register| same(register.name)));
    names.extend(standard_object::all().map(|object| Name {
        typed: object.name.to_owned(),
        shown: format!("{} ({})", object.first, object.name),
    }));
    names.extend(status_code::ALL.iter().map(|entry| Name {
        typed: entry.name.to_owned(),
        shown: format!("0x{:04X} ({})", entry.code.value(), entry.name),
    }));
    names
}

/// Names that have the word in them, then names that are spelt nearly like it.
pub(super) fn near(asked: &str) -> Vec<String> {
    let wanted = letters(asked);
    if wanted.is_empty() || wanted.len() > MOST_LETTERS {
        return Vec::new();
    }
    let mut ranked: Vec<(f64, String)> = names()
        .into_iter()
        .filter_map(|name| {
            let typed = letters(&name.typed);
            let alike = match wanted.len() > 2 && typed.contains(&wanted) {
                true => 1.0 + wanted.len() as f64 / typed.len() as f64,
                false => strsim::normalized_damerau_levenshtein(&typed, &wanted),
            };
            (alike >= ALIKE).then_some((alike, name.shown))
        })
        .collect();
    ranked.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    let mut shown: Vec<String> = Vec::new();
    for (_, name) in ranked {
        if !shown.contains(&name) {
            shown.push(name);
        }
    }
    shown.truncate(MOST);
    shown
}

fn letters(text: &str) -> String {
    let letters = text.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|letter| letter.to_ascii_lowercase()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_misses_are_told_the_nearest_first() {
        for (asked, expected) in [
            ("watchdog", "watchdog-starved"),
            ("link-opne", "`link-open`"),
            ("LRWW", "`LRW`"),
            ("unmached", "`UNMATCHED`"),
            ("statuswrod", "0x6041 (Statusword)"),
            ("H11", "H110 (damage-on-link)"),
        ] {
            let near = near(asked);
            assert!(near.iter().any(|name| name.contains(expected)), "{asked}: {near:?}");
            assert!(near.len() <= MOST);
        }
        assert!(near("link-opne")[0].contains("link-open"));
        assert!(near("zzzzqqqq").is_empty() && near("").is_empty());
        assert!(near(&"a".repeat(100_000)).is_empty());
    }
}
