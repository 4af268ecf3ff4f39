//! Selectors, words like `eth0+eth1` or `sim:plant.toml`: the same in every command.
//!
//! ```
//! use linesman_runtime::selector::Selector;
//!
//! let ring: Selector = "eth0+eth1".parse().unwrap();
//! assert_eq!(ring, Selector::Cards(vec!["eth0".into(), "eth1".into()]));
//! assert_eq!("trace.pcapng".parse(), Ok(Selector::File("trace.pcapng".into())));
//! ```

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use linesman_link::input::{STANDARD_INPUT, is_capture_name, is_text_name};
use linesman_link::interface;

/// Longest name of a network interface on Linux, in bytes.
const MAX_NAME_LEN: usize = 15;

/// Where frames come from.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub enum Selector {
    /// Network cards that this program drives: one, or two at the ends of a ring.
    Cards(Vec<String>),
    /// Network cards that this program only listens on: one or two.
    Listen(Vec<String>),
    /// A virtual segment, described by a file.
    Segment(PathBuf),
    /// A file, a pipe, or `-` for standard input: a capture, or a text with what another tool has
    /// read. Its bytes say which ([`Content`](linesman_link::input::Content)).
    File(PathBuf),
}

impl Selector {
    /// The kinds, for messages.
    pub const HELP: &'static str = "eth0 (a network card), eth0+eth1 (a ring), listen:eth0 (beside another MainDevice), \
         sim:plant.toml (a virtual segment), trace.pcapng (a capture; a name that might be a network \
         card with `capture:` in front), notes.txt (what another tool has read), - (standard input)";

    /// What a word means where both cards and files are taken: a word that might be a card is a file
    /// if there is one of that name and no such card.
    ///
    /// # Errors
    /// As parsing it, when there is no such file.
    pub fn resolve(given: &str) -> Result<Self, SelectorError> {
        let file = || Self::File(PathBuf::from(given));
        let is_there = || Path::new(given).exists();
        match given.parse() {
            Ok(Self::Cards(names)) if is_there() && !are_cards(&names) => Ok(file()),
            Err(_) if !given.is_empty() && is_there() => Ok(file()),
            parsed => parsed,
        }
    }
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cards(names) => f.write_str(&names.join("+")),
            Self::Listen(names) => write!(f, "listen:{}", names.join("+")),
            Self::Segment(path) => write!(f, "sim:{}", path.display()),
            Self::File(path) => {
                let text = path.display().to_string();
                let is_plain = text.parse() == Ok(self.clone());
                write!(f, "{}{text}", if is_plain { "" } else { "capture:" })
            }
        }
    }
}

/// Whether all of these are network cards of this host.
fn are_cards(names: &[String]) -> bool {
    // Without an answer of the kernel they are what they look like.
    interface::list()
        .map_or(true, |cards| names.iter().all(|name| cards.iter().any(|card| card.name == *name)))
}

/// A word that is no selector.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SelectorError {
    /// Nothing stands there, or nothing behind the colon.
    #[error("`{given}`: nothing is named. Do: name one of: {}", Selector::HELP)]
    Empty {
        /// The whole word.
        given: String,
    },
    /// The word before the colon is not known.
    #[error("`{given}`: `{kind}:` is not known. Do: name one of: {}", Selector::HELP)]
    UnknownKind {
        /// The whole word.
        given: String,
        /// What stands before the colon.
        kind: String,
    },
    /// More than two cards, or the same one twice.
    #[error("`{given}`: {what}. Do: name one card, or the two at the ends of the ring")]
    Cards {
        /// The whole word.
        given: String,
        /// What is wrong.
        what: &'static str,
    },
    /// It looks like a path, but of which kind of file?
    #[error(
        "`{given}`: there is no such file, and no network card can be called so. Do: check the path; \
         cards are listed by `linesman interfaces`"
    )]
    NotAnInterface {
        /// The whole word.
        given: String,
    },
}

impl FromStr for Selector {
    type Err = SelectorError;

    fn from_str(given: &str) -> Result<Self, SelectorError> {
        let path = |rest: &str| match rest.is_empty() {
            true => Err(SelectorError::Empty { given: given.to_owned() }),
            false => Ok(PathBuf::from(rest)),
        };
        if given.is_empty() {
            return Err(SelectorError::Empty { given: given.to_owned() });
        }
        match given.split_once(':') {
            Some(("sim", rest)) => return path(rest).map(Self::Segment),
            Some(("capture", rest)) => return path(rest).map(Self::File),
            Some(("listen", rest)) => return cards(given, rest).map(Self::Listen),
            // A path may have a colon too.
            Some((kind, _)) if !kind.contains('/') && !is_file_name(given) => {
                let kind = kind.to_owned();
                return Err(SelectorError::UnknownKind { given: given.to_owned(), kind });
            }
            Some(_) | None => {}
        }
        match is_file_name(given) {
            true => path(given).map(Self::File),
            false => cards(given, given).map(Self::Cards),
        }
    }
}

/// One name or two.
fn cards(given: &str, names: &str) -> Result<Vec<String>, SelectorError> {
    let names: Vec<&str> = names.split('+').collect();
    let wrong = |what| SelectorError::Cards { given: given.to_owned(), what };
    match names[..] {
        [""] => return Err(SelectorError::Empty { given: given.to_owned() }),
        [_] => {}
        [one, other] if one == other => return Err(wrong("the same card twice is no ring")),
        [_, _] => {}
        _ => return Err(wrong("a ring has two ends")),
    }
    if names.contains(&"") {
        return Err(wrong("a name is missing beside the `+`"));
    }
    if names.iter().any(|name| !may_be_interface(name)) {
        return Err(SelectorError::NotAnInterface { given: given.to_owned() });
    }
    Ok(names.into_iter().map(str::to_owned).collect())
}

/// Whether Linux would allow the name.
fn may_be_interface(name: &str) -> bool {
    let printable = |byte: u8| byte.is_ascii_graphic() && byte != b'/' && byte != b':';
    name.len() <= MAX_NAME_LEN && name != "." && name != ".." && name.bytes().all(printable)
}

/// Whether no card is called so, or the name says that it is a file.
fn is_file_name(given: &str) -> bool {
    given == STANDARD_INPUT || given.contains('/') || is_capture_name(given) || is_text_name(given)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn words(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn each_form_has_one_meaning() {
        let rows = [
            ("eth0", Selector::Cards(words(&["eth0"]))),
            ("eth0+eth1", Selector::Cards(words(&["eth0", "eth1"]))),
            ("enp3s0.100", Selector::Cards(words(&["enp3s0.100"]))),
            ("listen:eth0", Selector::Listen(words(&["eth0"]))),
            ("listen:eth0+eth1", Selector::Listen(words(&["eth0", "eth1"]))),
            ("sim:plant.toml", Selector::Segment("plant.toml".into())),
            ("sim:/tmp/a:b", Selector::Segment("/tmp/a:b".into())),
            ("capture:trace", Selector::File("trace".into())),
            ("trace.pcap", Selector::File("trace.pcap".into())),
            ("/tmp/a b/Trace.PCAPNG.gz", Selector::File("/tmp/a b/Trace.PCAPNG.gz".into())),
            ("trace.pcap.zst", Selector::File("trace.pcap.zst".into())),
            ("./12:30.pcapng", Selector::File("./12:30.pcapng".into())),
            ("12:30.pcapng", Selector::File("12:30.pcapng".into())),
            ("read.toml", Selector::File("read.toml".into())),
            ("notes.TXT", Selector::File("notes.TXT".into())),
            ("./online list.csv", Selector::File("./online list.csv".into())),
            ("./plant", Selector::File("./plant".into())),
            ("-", Selector::File("-".into())),
            ("trace.pcap1", Selector::Cards(words(&["trace.pcap1"]))),
        ];
        for (given, expected) in rows {
            assert_eq!(given.parse(), Ok(expected), "{given}");
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_what_would_be_right() {
        let rows = [
            ("", "eth0 (a network card)"),
            ("sim:", "sim:plant.toml"),
            ("listen:", "listen:eth0"),
            ("tap:eth0", "`tap:` is not known"),
            ("eth0+", "a name is missing"),
            ("eth0+eth0", "the same card twice"),
            ("a+b+c", "two ends"),
            ("an-interface-name-too-long", "linesman interfaces"),
        ];
        for (given, words) in rows {
            let error = given.parse::<Selector>().unwrap_err().to_string();
            assert!(error.contains(words), "{given}: {error}");
        }
    }

    #[test]
    fn a_file_that_is_there_is_one_unless_a_card_is_called_so() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("it:1");
        std::fs::write(&path, "").unwrap();
        let word = path.display().to_string();
        assert_eq!(Selector::resolve(&word), Ok(Selector::File(path)));
        // Tests run where `src` lies; every host has the loopback interface.
        assert_eq!(Selector::resolve("src"), Ok(Selector::File("src".into())));
        assert_eq!(Selector::resolve("lo"), Ok(Selector::Cards(words(&["lo"]))));
        assert_eq!(Selector::resolve("nobody0"), Ok(Selector::Cards(words(&["nobody0"]))));
        assert!(Selector::resolve("tap:eth0").is_err() && Selector::resolve("").is_err());
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_the_same_way(word in "[a-z:+./ ]{0,24}") {
            if let Ok(selector) = word.parse::<Selector>() {
                prop_assert_eq!(selector.to_string().parse::<Selector>(), Ok(selector));
            }
        }
    }
}
