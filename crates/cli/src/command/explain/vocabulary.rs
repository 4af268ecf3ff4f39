//! Words: of EtherCAT, of other tools and their messages, and of our own glossary.
//!
//! They are pages of the guide with a heading for each word. The line `Also:` beneath it lists other
//! spellings and what the message looks like as a whole, numbers included; any numbers will match.

use super::page::{Kind, Page};
use super::topic::{self, Topic};

/// A text with fewer letters that ends in a topic is shown together with it.
const SHORT: usize = 250;

/// Words of one source.
struct Source {
    /// The tool that uses them.
    whose: &'static str,
    text: &'static str,
}

/// Words of everybody.
const COMMON: &str = "EtherCAT";

const SOURCES: &[Source] = &[
    Source { whose: COMMON, text: include_str!("../../../../../docs/guide/words/ethercat.md") },
    Source { whose: "TwinCAT", text: include_str!("../../../../../docs/guide/words/twincat.md") },
    Source { whose: "IgH", text: include_str!("../../../../../docs/guide/words/igh.md") },
    Source { whose: "SOEM", text: include_str!("../../../../../docs/guide/words/soem.md") },
    Source {
        whose: "ethercrab",
        text: include_str!("../../../../../docs/guide/words/ethercrab.md"),
    },
];

const GLOSSARY: &str = include_str!("../../../../../docs/GLOSSARY.md");

/// A word.
#[derive(Clone, Copy)]
pub(super) struct Word {
    whose: &'static str,
    /// The word itself.
    pub(super) name: &'static str,
    also: &'static str,
    text: &'static str,
}

impl Word {
    /// Its spellings, its name first.
    pub(super) fn spellings(self) -> impl Iterator<Item = &'static str> {
        let also = self.also.split('`').skip(1).step_by(2);
        std::iter::once(self.name).chain(also)
    }

    fn is(self, wanted: &str, signature: fn(&str) -> String) -> bool {
        self.spellings().any(|spelling| signature(spelling) == wanted)
    }

    /// Tells if it is a word of EtherCAT, not one of another tool.
    pub(super) fn is_common(self) -> bool {
        self.whose == COMMON
    }

    /// As a page.
    pub(super) fn page(self) -> Page {
        let page =
            Page::new(Kind::Word, format!("{}: {}", self.whose, self.name)).markdown(self.text);
        match self.topic() {
            Some(topic) => page.markdown(topic.body()),
            None => page,
        }
    }

    /// The topic that a short text does nothing but lead to.
    fn topic(self) -> Option<&'static Topic> {
        let (_, name) = self.text.rsplit_once("`linesman explain ")?;
        let name = name.strip_suffix("`.").filter(|_| self.text.len() < SHORT)?;
        topic::find(name)
    }
}

/// All words.
pub(super) fn all() -> impl Iterator<Item = Word> {
    SOURCES.iter().flat_map(|source| {
        source.text.split("\n## ").skip(1).map(|part| {
            let (name, rest) = part.split_once('\n').unwrap_or((part, ""));
            let rest = rest.trim();
            let (also, text) = match rest.strip_prefix("Also: ") {
                Some(rest) => rest.split_once("\n\n").unwrap_or((rest, "")),
                None => ("", rest),
            };
            Word { whose: source.whose, name: name.trim(), also, text: text.trim() }
        })
    })
}

/// The words that are written like this; numbers in a message may be any.
pub(super) fn find(asked: &str) -> Vec<Word> {
    let exact = letters(asked);
    if exact.is_empty() {
        return Vec::new();
    }
    let found: Vec<Word> = all().filter(|word| word.is(&exact, letters)).collect();
    if !found.is_empty() {
        return found;
    }
    let pattern = with_any_number(asked);
    all().filter(|word| word.is(&pattern, with_any_number)).collect()
}

/// The words that a line of a log has in it, longest spelling first: messages of several words, and
/// names in capitals.
pub(super) fn within(line: &str) -> Vec<Word> {
    let tokens = tokens(line);
    let mut found: Vec<(usize, Word)> = all()
        .filter_map(|word| {
            let spelt = word.spellings().filter(|spelling| is_telling(spelling));
            let longest = spelt
                .map(self::tokens)
                .filter(|wanted| !wanted.is_empty() && contains(&tokens, wanted))
                .map(|wanted| wanted.len())
                .max()?;
            Some((longest, word))
        })
        .collect();
    found.sort_by_key(|(len, _)| std::cmp::Reverse(*len));
    found.into_iter().map(|(_, word)| word).collect()
}

/// Tells if a spelling can be looked for within a line: two words or more, or capitals.
fn is_telling(spelling: &str) -> bool {
    let is_name =
        spelling.len() > 3 && spelling.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    is_name || tokens(spelling).len() > 1
}

fn contains(line: &[String], wanted: &[String]) -> bool {
    line.windows(wanted.len()).any(|part| part == wanted)
}

/// A row of our glossary that is about this word.
pub(super) fn glossary(asked: &str) -> Option<Page> {
    let wanted = letters(asked);
    let row = GLOSSARY.lines().find(|line| {
        let first = line.strip_prefix('|').and_then(|line| line.split('|').next());
        first.is_some_and(|names| {
            let names = names.split([',', '·']).flat_map(|name| {
                let bare = name.split('(').next().unwrap_or_default();
                let short = name.split(['(', ')']).nth(1).unwrap_or_default();
                [letters(bare), letters(short)]
            });
            names.into_iter().any(|name| !name.is_empty() && name == wanted)
        })
    })?;
    let mut cells = row.split('|').map(|cell| cell.trim().replace("**", "")).skip(1);
    let (name, meaning) = (cells.next()?, cells.next()?);
    let is_heading = name == "word" || name.starts_with("---");
    (!is_heading)
        .then(|| Page::new(Kind::Word, format!("Glossary: {name}")).text(format!("{meaning}.")))
}

/// The letters and digits of a spelling, which is all that counts.
fn letters(text: &str) -> String {
    let letters = text.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|letter| letter.to_ascii_lowercase()).collect()
}

/// The same with any number as `#`: `Frm0WcState` and `Frm12WcState` are one.
fn with_any_number(text: &str) -> String {
    tokens(text).concat()
}

/// The words of a line as one text, a space between any two.
pub(super) fn words(line: &str) -> String {
    tokens(line).join(" ")
}

/// The words of a line in lower case; numbers, hexadecimal ones too, are `#`, and so are the digits
/// within a word.
fn tokens(line: &str) -> Vec<String> {
    let words = line.split(|letter: char| !letter.is_ascii_alphanumeric());
    words.filter(|word| !word.is_empty()).map(token).collect()
}

fn token(word: &str) -> String {
    let hex = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X"));
    if hex.is_some() || word.bytes().all(|byte| byte.is_ascii_digit()) {
        return "#".to_owned();
    }
    let mut token = String::new();
    for letter in word.chars() {
        match letter {
            '0'..='9' if token.ends_with('#') => {}
            '0'..='9' => token.push('#'),
            letter => token.push(letter.to_ascii_lowercase()),
        }
    }
    token
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(words: &[Word]) -> Vec<&'static str> {
        words.iter().map(|word| word.name).collect()
    }

    #[test]
    fn every_word_has_a_text_and_no_spelling_is_there_twice_in_a_source() {
        for source in SOURCES {
            let mut seen = Vec::new();
            for word in all().filter(|word| word.whose == source.whose) {
                assert!(word.text.len() > 40, "{}: {:?}", word.name, word.text);
                assert!(!word.text.starts_with("Also"), "{}", word.name);
                for spelling in word.spellings() {
                    let spelling = letters(spelling);
                    assert!(!spelling.is_empty(), "{}", word.name);
                    assert!(!seen.contains(&spelling), "{}: {spelling} twice", word.name);
                    seen.push(spelling);
                }
            }
            assert!(seen.len() > 5, "{}", source.whose);
        }
    }

    #[test]
    fn messages_are_found_whatever_their_numbers() {
        let line = "[ 12.3] EtherCAT WARNING 0: 17 datagrams UNMATCHED!";
        assert_eq!(names(&within(line)), ["UNMATCHED"]);
        assert_eq!(names(&find("Frm12WcState")), ["FrmXWcState"]);
        assert_eq!(names(&find("unmatched")), ["UNMATCHED"]);
        assert!(
            names(&within("Domain 0: Working counter changed to 2/3."))
                .contains(&"Working counter changed")
        );
        assert!(within("nothing that anybody says").is_empty());
        assert!(find("!!!").is_empty() && find("").is_empty());
    }

    #[test]
    fn our_own_words_are_in_the_glossary() {
        assert_eq!(glossary("sync unit").unwrap().title(), "Glossary: sync unit");
        assert!(glossary("WKC").unwrap().title().contains("working counter"));
        assert!(glossary("word").is_none() && glossary("---").is_none());
        assert!(glossary("nonsense").is_none());
    }
}
