//! What a word like `eth0+eth1` or `sim:plant.toml` means: the same in every command.
//!
//! ```
//! use linesman_runtime::selector::Selector;
//!
//! let ring: Selector = "eth0+eth1".parse().unwrap();
//! assert_eq!(ring, Selector::Cards(vec!["eth0".into(), "eth1".into()]));
//! assert_eq!("trace.pcapng".parse(), Ok(Selector::Capture("trace.pcapng".into())));
//! ```

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Longest name of a network interface on Linux, in bytes.
const MAX_NAME_LEN: usize = 15;
/// Ends of file names that say "this is a capture"; each may be followed by `.gz`.
const CAPTURE_ENDS: [&str; 3] = [".pcapng", ".pcap", ".cap"];

/// Where frames come from.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub enum Selector {
    /// Network cards that this program drives: one, or two at the ends of a ring.
    Cards(Vec<String>),
    /// Network cards that this program only listens on: one or two.
    Listen(Vec<String>),
    /// A virtual segment, described by a file.
    Segment(PathBuf),
    /// A capture file.
    Capture(PathBuf),
    /// An observation file: what another tool has read.
    Observations(PathBuf),
}

impl Selector {
    /// The kinds, for messages.
    pub const HELP: &'static str = "eth0 (a network card), eth0+eth1 (a ring), listen:eth0 (beside another MainDevice), \
         sim:plant.toml (a virtual segment), capture:trace.pcapng (or any path ending in .pcap, \
         .pcapng or their .gz)";
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cards(names) => f.write_str(&names.join("+")),
            Self::Listen(names) => write!(f, "listen:{}", names.join("+")),
            Self::Segment(path) => write!(f, "sim:{}", path.display()),
            Self::Capture(path) => write!(f, "capture:{}", path.display()),
            Self::Observations(path) => path.display().fmt(f),
        }
    }
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
        "`{given}`: no network interface can be called so. Do: for a capture say `capture:{given}`, \
         for a virtual segment `sim:{given}`; cards are listed by `linesman interfaces`; the socket of \
         `linesman run --control` is there while that runs"
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
            Some(("capture", rest)) => return path(rest).map(Self::Capture),
            Some(("listen", rest)) => return cards(given, rest).map(Self::Listen),
            // A path may have a colon too.
            Some((kind, _)) if !kind.contains('/') && !is_capture(given) && !is_toml(given) => {
                let kind = kind.to_owned();
                return Err(SelectorError::UnknownKind { given: given.to_owned(), kind });
            }
            Some(_) | None => {}
        }
        if is_capture(given) {
            return path(given).map(Self::Capture);
        }
        if is_toml(given) {
            return path(given).map(Self::Observations);
        }
        cards(given, given).map(Self::Cards)
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

fn is_capture(path: &str) -> bool {
    let lower = path.to_ascii_lowercase();
    let name = lower.strip_suffix(".gz").unwrap_or(&lower);
    CAPTURE_ENDS.iter().any(|end| name.ends_with(end))
}

fn is_toml(path: &str) -> bool {
    path.to_ascii_lowercase().ends_with(".toml")
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
            ("capture:trace", Selector::Capture("trace".into())),
            ("trace.pcap", Selector::Capture("trace.pcap".into())),
            ("/tmp/a b/Trace.PCAPNG.gz", Selector::Capture("/tmp/a b/Trace.PCAPNG.gz".into())),
            ("./12:30.pcapng", Selector::Capture("./12:30.pcapng".into())),
            ("12:30.pcapng", Selector::Capture("12:30.pcapng".into())),
            ("read.toml", Selector::Observations("read.toml".into())),
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
            ("./plant", "`sim:./plant`"),
            ("an-interface-name-too-long", "linesman interfaces"),
        ];
        for (given, words) in rows {
            let error = given.parse::<Selector>().unwrap_err().to_string();
            assert!(error.contains(words), "{given}: {error}");
        }
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
