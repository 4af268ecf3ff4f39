//! Assertions of a story on the segment itself, whatever a diagnosis says.
//!
//! ```text
//! expect counter NAME.PORT frame|physical|forwarded|lost-link AMOUNT [, …]
//! expect counter NAME processing-unit|pdi AMOUNT [, …]
//! expect no other counter
//! expect port NAME.PORT [open|closed] [with link|without link]
//! expect state NAME STATE [error CODE]
//! expect lost|damaged|vanished|dropped frames AMOUNT
//! expect answered | unanswered
//! expect working counter full|short
//! expect reached AMOUNT
//! expect carrier | no carrier
//! expect register NAME ADDRESS = VALUE
//! expect clock NAME off AMOUNT
//! ```
//! `AMOUNT` is `= 3`, `>= 3`, `<= 3` or `3..5`. Counters and frames are counted since the last
//! `inject` before the step, or since time 0.

use std::fmt;

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::state::AlState;
use linesman_sim::segment_file::parse_counter;

use super::step::Words;

/// How many there must be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Amount {
    low: u64,
    high: u64,
}

impl Amount {
    /// Whether a number is one of those.
    #[must_use]
    pub fn takes(self, number: u64) -> bool {
        (self.low..=self.high).contains(&number)
    }
}

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.low, self.high) {
            (low, high) if low == high => write!(f, "{low}"),
            (low, u64::MAX) => write!(f, "at least {low}"),
            (0, high) => write!(f, "at most {high}"),
            (low, high) => write!(f, "{low} to {high}"),
        }
    }
}

/// A counter of a SubDevice and how far it must have moved.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Moved {
    /// Whose.
    pub device: String,
    /// Which.
    pub counter: ErrorCounter,
    /// How far.
    pub amount: Amount,
}

/// What became of frames.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameFate {
    /// They came back damaged or not at all, or the host lost them.
    Lost,
    /// They came back damaged.
    Damaged,
    /// They did not come back.
    Vanished,
    /// They came back whole, and the host lost them.
    Dropped,
}

/// Something that must be so on the segment.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Assertion {
    /// Counters have moved so far.
    Counters(Vec<Moved>),
    /// None moved but those that were named since the last `inject`.
    NoOtherCounter,
    /// A port stands so.
    Port {
        /// Whose.
        device: String,
        /// Which.
        port: Port,
        /// Whether its loop is open, if that matters.
        open: Option<bool>,
        /// Whether it shows a link, if that matters.
        link: Option<bool>,
    },
    /// A SubDevice is in a state, with an error or without one.
    State {
        /// Who.
        device: String,
        /// The state.
        state: AlState,
        /// The AL status code; `None` for no error.
        error: Option<u16>,
    },
    /// So many frames of the MainDevice had this fate.
    Frames {
        /// Which.
        fate: FrameFate,
        /// How many.
        amount: Amount,
    },
    /// Frames come back, or none does.
    Answered(bool),
    /// Process data are served by all, or not.
    WorkingCounter {
        /// By all.
        full: bool,
    },
    /// So many controllers count in the last broadcast that came back.
    Reached(Amount),
    /// Card A has a carrier, or not.
    Carrier(bool),
    /// A register holds a value.
    Register {
        /// Whose.
        device: String,
        /// Where.
        address: RegisterAddress,
        /// Its bytes, lowest first.
        bytes: Vec<u8>,
    },
    /// The last time that was written into a clock was so far from its own (0x092C without its sign).
    Clock {
        /// Whose.
        device: String,
        /// How far, in ns.
        nanoseconds: Amount,
    },
}

impl Assertion {
    /// Reads an expectation that begins with `word`; `None` if it is none of these.
    pub(super) fn parse(word: &str, words: &mut Words<'_>) -> Result<Option<Self>, String> {
        Ok(Some(match word {
            "counter" => Self::Counters(counters(std::mem::take(&mut words.rest))?),
            "port" => port(words)?,
            "state" => state(words)?,
            "lost" => frames(FrameFate::Lost, words)?,
            "damaged" => frames(FrameFate::Damaged, words)?,
            "vanished" => frames(FrameFate::Vanished, words)?,
            "dropped" => frames(FrameFate::Dropped, words)?,
            "answered" => Self::Answered(true),
            "unanswered" => Self::Answered(false),
            "working" => {
                words.expect("counter")?;
                let full = match words.next() {
                    "full" => true,
                    "short" => false,
                    other => return Err(format!("`{other}`: expected `full` or `short`")),
                };
                Self::WorkingCounter { full }
            }
            "reached" => Self::Reached(amount(std::mem::take(&mut words.rest))?),
            "carrier" => Self::Carrier(true),
            "register" => register(words)?,
            "clock" => clock(words)?,
            _ => return Ok(None),
        }))
    }
}

fn frames(fate: FrameFate, words: &mut Words<'_>) -> Result<Assertion, String> {
    words.expect("frames")?;
    Ok(Assertion::Frames { fate, amount: amount(std::mem::take(&mut words.rest))? })
}

pub(super) fn amount(text: &str) -> Result<Amount, String> {
    let text = text.trim();
    let wrong = || format!("`{text}` is no amount: write `= 3`, `>= 3`, `<= 3` or `3..5`");
    let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong());
    let (low, high) = if let Some(rest) = text.strip_prefix(">=") {
        (number(rest)?, u64::MAX)
    } else if let Some(rest) = text.strip_prefix("<=") {
        (0, number(rest)?)
    } else if let Some((low, high)) = text.split_once("..") {
        (number(low)?, number(high)?)
    } else {
        let exactly = number(text.strip_prefix('=').unwrap_or(text))?;
        (exactly, exactly)
    };
    if low > high { Err(wrong()) } else { Ok(Amount { low, high }) }
}

fn counters(text: &str) -> Result<Vec<Moved>, String> {
    text.split(',').map(|part| counter(part.trim())).collect()
}

/// `T2.A frame = 3` or `T2 processing-unit >= 1`.
fn counter(text: &str) -> Result<Moved, String> {
    let wrong = || {
        format!(
            "`{text}` is no counter: write `T2.A frame = 3` (or physical, forwarded, lost-link), or \
             `T2 processing-unit >= 1` (or pdi)"
        )
    };
    let mut words = Words { rest: text };
    let (name, what) = (words.next(), words.next().replace('-', "_"));
    let of_port = end(name).and_then(|(device, port)| {
        parse_counter(&format!("{port}.{what}")).map(|counter| (device, counter))
    });
    let (device, counter) =
        of_port.or_else(|| Some((name, parse_counter(&what)?))).ok_or_else(wrong)?;
    Ok(Moved { device: device.to_owned(), counter, amount: amount(words.rest)? })
}

/// `T2.A`.
fn end(text: &str) -> Option<(&str, Port)> {
    let (device, letter) = text.rsplit_once('.')?;
    let mut letters = letter.chars();
    let port = Port::from_letter(letters.next()?)?;
    letters.next().is_none().then_some((device, port))
}

fn port(words: &mut Words<'_>) -> Result<Assertion, String> {
    let text = words.next();
    let (device, port) = end(text).ok_or_else(|| format!("`{text}` is no port, such as `T2.B`"))?;
    let (mut open, mut link) = (None, None);
    loop {
        match words.next() {
            "" => break,
            "open" => open = Some(true),
            "closed" => open = Some(false),
            with @ ("with" | "without") => {
                words.expect("link")?;
                link = Some(with == "with");
            }
            other => {
                return Err(format!(
                    "`{other}`: expected `open`, `closed`, `with link` or `without link`"
                ));
            }
        }
    }
    if open.is_none() && link.is_none() {
        return Err(format!("how `{text}` stands: `open`, `closed`, `with link`, `without link`"));
    }
    Ok(Assertion::Port { device: device.to_owned(), port, open, link })
}

fn state(words: &mut Words<'_>) -> Result<Assertion, String> {
    let (device, name) = (words.next().to_owned(), words.next());
    let state = AlState::from_name(name).ok_or_else(|| format!("`{name}` is no state"))?;
    let error = match words.take("error") {
        false => None,
        true => {
            let code = words.next();
            let bytes = value(code).filter(|bytes| bytes.len() <= 2);
            let bytes = bytes.ok_or_else(|| format!("`{code}` is no AL status code"))?;
            Some(bytes.iter().rev().fold(0, |code, byte| code << 8 | u16::from(*byte)))
        }
    };
    Ok(Assertion::State { device, state, error })
}

fn register(words: &mut Words<'_>) -> Result<Assertion, String> {
    let (device, address) = place(words)?;
    let text = words.next();
    let bytes = value(text).ok_or_else(|| format!("`{text}` is no value, such as `0x5A37`"))?;
    Ok(Assertion::Register { device, address, bytes })
}

/// `T2 0x0110 =`: a register of a SubDevice.
pub(super) fn place(words: &mut Words<'_>) -> Result<(String, RegisterAddress), String> {
    let (device, address) = (words.next().to_owned(), words.next());
    let hex = address.strip_prefix("0x").and_then(|hex| u16::from_str_radix(hex, 16).ok());
    let address = hex.ok_or_else(|| format!("`{address}` is no register, such as `0x0110`"))?;
    words.expect("=")?;
    Ok((device, RegisterAddress(address)))
}

/// `T2 off <= 1000`.
fn clock(words: &mut Words<'_>) -> Result<Assertion, String> {
    let device = words.next().to_owned();
    words.expect("off")?;
    let nanoseconds = amount(std::mem::take(&mut words.rest))?;
    Ok(Assertion::Clock { device, nanoseconds })
}

/// `0x1234`: as many bytes as pairs of digits, lowest first.
pub(super) fn value(text: &str) -> Option<Vec<u8>> {
    let digits = text.strip_prefix("0x")?;
    if digits.is_empty() || digits.len() % 2 != 0 || !digits.is_ascii() {
        return None;
    }
    let pairs = (0..digits.len()).step_by(2).rev();
    pairs.map(|at| u8::from_str_radix(&digits[at..at + 2], 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<Assertion>, String> {
        let mut words = Words { rest: text };
        let word = words.next();
        Assertion::parse(word, &mut words)
    }

    #[test]
    fn what_is_so_can_be_written() {
        let exactly = |number| Amount { low: number, high: number };
        let moved =
            |device: &str, counter, amount| Moved { device: device.to_owned(), counter, amount };
        let table = [
            (
                "counter T2.A frame = 3, K1 processing-unit >= 1",
                Assertion::Counters(vec![
                    moved("T2", ErrorCounter::InvalidFrame(Port::A), exactly(3)),
                    moved("K1", ErrorCounter::ProcessingUnit, Amount { low: 1, high: u64::MAX }),
                ]),
            ),
            (
                "counter J1/2.C lost-link 3..5",
                Assertion::Counters(vec![moved(
                    "J1/2",
                    ErrorCounter::LostLink(Port::C),
                    Amount { low: 3, high: 5 },
                )]),
            ),
            (
                "port T2.B closed without link",
                Assertion::Port {
                    device: "T2".to_owned(),
                    port: Port::B,
                    open: Some(false),
                    link: Some(false),
                },
            ),
            (
                "state T2 SAFEOP error 0x001B",
                Assertion::State {
                    device: "T2".to_owned(),
                    state: AlState::SafeOp,
                    error: Some(0x001B),
                },
            ),
            (
                "lost frames <= 1",
                Assertion::Frames { fate: FrameFate::Lost, amount: Amount { low: 0, high: 1 } },
            ),
            ("unanswered", Assertion::Answered(false)),
            ("working counter short", Assertion::WorkingCounter { full: false }),
            ("reached 5", Assertion::Reached(exactly(5))),
            (
                "register K1 0x0110 = 0x5A37",
                Assertion::Register {
                    device: "K1".to_owned(),
                    address: RegisterAddress(0x0110),
                    bytes: vec![0x37, 0x5A],
                },
            ),
        ];
        for (text, expected) in table {
            assert_eq!(read(text), Ok(Some(expected)), "{text}");
        }
        assert_eq!(read("healthy"), Ok(None));
    }

    #[test]
    fn what_cannot_be_says_what_can() {
        for (text, expected) in [
            ("counter T2.A frames = 3", "is no counter"),
            ("counter T2 frame = 3", "is no counter"),
            ("counter T2.A frame", "is no amount"),
            ("counter T2.A frame 5..3", "is no amount"),
            ("port T2 open", "is no port"),
            ("port T2.B", "how `T2.B` stands"),
            ("port T2.B wide", "expected `open`"),
            ("state T2 RUN", "is no state"),
            ("state T2 OP error 27", "is no AL status code"),
            ("lost links = 3", "expected `frames`"),
            ("working counter halved", "`full` or `short`"),
            ("register K1 110 = 0x00", "is no register"),
            ("register K1 0x0110 = 0x123", "is no value"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
