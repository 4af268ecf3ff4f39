//! The steps of a story and their grammar.
//!
//! ```text
//! [at TIME] inject FAULT at PLACE [for TIME] [with KEY = VALUE, …]
//! [at TIME] inject FAULT at device NAME [for TIME] [with …]
//! [at TIME] inject FAULT at devices NAME, NAME [for TIME] [with …]
//! [at TIME] inject FAULT at supply NAME [for TIME] [with …]
//! [at TIME] heal [FAULT]
//! [at TIME] unplug NAME
//! [at TIME] plug NAME [on NAME.PORT]
//! [at TIME] write NAME ADDRESS = VALUE | now | clock of NAME
//! at TIME
//! [at TIME] expect verdict [on FAULT] [within TIME]
//! [at TIME] expect finding CODE|FAULT [at PLACE] [within TIME]
//! [at TIME] expect no finding [CODE|FAULT]
//! [at TIME] expect N finding(s)
//! [at TIME] expect healthy | inconclusive
//! [at TIME] expect all closed [within TIME]
//! [at TIME] expect line up [within TIME]
//! [at TIME] expect exit N
//! [at TIME] expect [no] log "WORDS"
//! [at TIME] expect object …     what comes of reading an object: see `object`
//! [at TIME] expect …            what is so on the segment: see `assertion`
//! ```
//! `PLACE` is `K1.C-B3.A` (a link), `K1.C>B3.A` (one direction), `device K1`, `host` or `network`.
//! `TIME` is a whole number of `us`, `ms` or `s`. Back-quotes are for the reader only.

use linesman_config::attachment::Attachment;
use linesman_config::fault::FaultName;
use linesman_proto::address::RegisterAddress;
use linesman_proto::time::Span;

use super::assertion::{self, Assertion};
use super::object::Reading;

/// A step and where it stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StepAt {
    /// Line in the story, from 1.
    pub line: usize,
    /// As it was written.
    pub text: String,
    /// When it happens, counted from the line being up; `None`: right after the one before.
    pub at: Option<Span>,
    /// What happens.
    pub step: Step,
}

/// What happens in a story.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Step {
    /// Time passes.
    Wait,
    /// A fault begins.
    Inject {
        /// The text of a `[[fault]]` entry of a segment file.
        entry: String,
        /// When it ends by itself; `None` for never.
        lasts: Option<Span>,
    },
    /// Faults end.
    Heal(Heal),
    /// The cable of a SubDevice is pulled.
    Unplug(String),
    /// It is plugged in again.
    Plug {
        /// Which SubDevice.
        device: String,
        /// Where; where it was unless said.
        on: Option<Attachment>,
    },
    /// The MainDevice writes a register of a SubDevice, beside its cycle.
    Write {
        /// Whose.
        device: String,
        /// Which.
        address: RegisterAddress,
        /// What.
        value: Written,
    },
    /// Something must be so.
    Expect {
        /// What.
        what: Expectation,
        /// How long it may take.
        within: Span,
    },
}

/// What is written into a register.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Written {
    /// These bytes, lowest first.
    Bytes(Vec<u8>),
    /// The time of the run, in ns, as eight bytes.
    Now,
    /// The system time of another SubDevice, read right before: what a datagram that reads at one
    /// and writes at the others does.
    ClockOf(String),
}

/// Which faults end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Heal {
    /// All that were injected.
    All,
    /// Those of this name.
    Named(FaultName),
}

/// How a finding is named.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum What {
    /// By its code, such as `H110`.
    Code(String),
    /// By its cause.
    Cause(FaultName),
}

/// What must be so.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Expectation {
    /// There is a finding whose place and cause fit what was injected, as far as evidence can
    /// tell; of this fault, or of each that acts.
    Verdict(Option<FaultName>),
    /// There is a finding, not a consequence of another, with this code or cause.
    Finding {
        /// Its code or cause.
        what: What,
        /// The text of its place, if that matters.
        place: Option<String>,
    },
    /// There is a finding, not a consequence of another, that has this cause at this place first or among what else it may be.
    Candidate {
        /// The cause.
        cause: FaultName,
        /// The text of its place.
        place: String,
    },
    /// There is none such, nor has there been one.
    NoFinding(Option<What>),
    /// There have been this many findings, consequences not counted.
    Findings(usize),
    /// The verdict is healthy.
    Healthy,
    /// The verdict is inconclusive.
    Inconclusive,
    /// There is no open finding.
    AllClosed,
    /// All SubDevices are in the target state.
    LineUp,
    /// What `diagnose` would exit with.
    Exit(u8),
    /// An entry of the MainDevice's log has these words since the last `inject`, or none has.
    Log {
        /// The words.
        words: String,
        /// Whether there must be one.
        told: bool,
    },
    /// Something is so on the segment, whatever the diagnosis says.
    Assertion(Assertion),
    /// Something comes of reading an object.
    Object(Reading),
}

/// Reads the text of a list item; the error says what was expected.
pub(crate) fn parse(text: &str) -> Result<(Option<Span>, Step), String> {
    let text = text.replace('`', "");
    let mut words = Words { rest: text.trim() };
    let at = if words.take("at") { Some(words.time()?) } else { None };
    let step = match words.next() {
        "" if at.is_some() => Step::Wait,
        "inject" => inject(&mut words)?,
        "heal" => match words.next() {
            "" | "all" => Step::Heal(Heal::All),
            name => Step::Heal(Heal::Named(fault(name)?)),
        },
        "unplug" => Step::Unplug(words.next().to_owned()),
        "plug" => {
            let device = words.next().to_owned();
            let on = if words.take("on") {
                let text = words.next();
                Some(text.parse().map_err(|_| format!("`{text}` is no port, such as `K1.C`"))?)
            } else {
                None
            };
            Step::Plug { device, on }
        }
        "expect" => expect(&mut words)?,
        "write" => write(&mut words)?,
        other => {
            return Err(format!(
                "`{other}` is no step: expected `inject`, `heal`, `unplug`, `plug`, `write` or `expect`, with or without \
                 `at TIME` before it"
            ));
        }
    };
    match words.rest {
        "" => Ok((at, step)),
        rest => Err(format!("`{rest}` is left over at the end of the step")),
    }
}

fn inject(words: &mut Words<'_>) -> Result<Step, String> {
    let name = fault(words.next())?;
    let mut entry = format!("kind = \"{name}\"\n");
    if !words.take("at") {
        return Err("a fault needs a place: `at K1.C-B3.A` or `at device K1`".to_owned());
    }
    let (place, parameters) = match words.rest.split_once(" with ") {
        Some((place, parameters)) => (place, Some(parameters)),
        None => (words.rest, None),
    };
    let (place, lasts) = match place.rsplit_once(" for ") {
        Some((place, time)) => (place, Some(Words { rest: time.trim() }.time()?)),
        None => (place, None),
    };
    let place = place.trim();
    if let Some(device) = place.strip_prefix("device ") {
        entry += &format!("device = {:?}\n", device.trim());
    } else if let Some(devices) = place.strip_prefix("devices ") {
        let devices: Vec<&str> = devices.split(',').map(str::trim).collect();
        entry += &format!("devices = {devices:?}\n");
    } else if let Some(supply) = place.strip_prefix("supply ") {
        entry += &format!("supply = {:?}\n", supply.trim());
    } else {
        entry += &format!("at = {place:?}\n");
    }
    for parameter in parameters.into_iter().flat_map(split_outside_brackets) {
        entry += parameter.trim();
        entry.push('\n');
    }
    words.rest = "";
    Ok(Step::Inject { entry, lasts })
}

fn write(words: &mut Words<'_>) -> Result<Step, String> {
    let (device, address) = assertion::place(words)?;
    let value = match words.next() {
        "now" => Written::Now,
        "clock" => {
            words.expect("of")?;
            Written::ClockOf(words.next().to_owned())
        }
        text => Written::Bytes(assertion::value(text).ok_or_else(|| {
            format!("`{text}` is no value: write `0x5A37`, `now` or `clock of K1`")
        })?),
    };
    Ok(Step::Write { device, address, value })
}

/// Splits `a = 1, b = ["x", "y"]` at the commas between parameters.
fn split_outside_brackets(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut depth, mut start) = (0_usize, 0);
    for (at, letter) in text.char_indices() {
        match letter {
            '[' => depth += 1,
            ']' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

fn expect(words: &mut Words<'_>) -> Result<Step, String> {
    let within = match words.rest.rsplit_once(" within ") {
        Some((rest, time)) => {
            words.rest = rest.trim_end();
            Words { rest: time.trim() }.time()?
        }
        None => Span::ZERO,
    };
    let what = match words.next() {
        "finding" => {
            let what = named(words.next())?;
            let place = words.take("at").then(|| std::mem::take(&mut words.rest).to_owned());
            Expectation::Finding { what, place }
        }
        "candidate" => {
            let cause = fault(words.next())?;
            words.expect("at")?;
            Expectation::Candidate { cause, place: std::mem::take(&mut words.rest).to_owned() }
        }
        "verdict" => {
            let on = words.take("on").then(|| fault(words.next())).transpose()?;
            Expectation::Verdict(on)
        }
        "no" if words.take("other") => {
            words.expect("counter")?;
            Expectation::Assertion(Assertion::NoOtherCounter)
        }
        "no" if words.take("log") => Expectation::Log { words: quoted(words)?, told: false },
        "log" => Expectation::Log { words: quoted(words)?, told: true },
        "no" if words.take("carrier") => Expectation::Assertion(Assertion::Carrier(false)),
        "no" => {
            words.expect("finding")?;
            let what = words.next();
            Expectation::NoFinding(if what.is_empty() { None } else { Some(named(what)?) })
        }
        "healthy" => Expectation::Healthy,
        "inconclusive" => Expectation::Inconclusive,
        "all" => {
            words.expect("closed")?;
            Expectation::AllClosed
        }
        "line" => {
            words.expect("up")?;
            Expectation::LineUp
        }
        "object" => Expectation::Object(Reading::parse(words)?),
        "exit" => {
            let status = words.next();
            Expectation::Exit(status.parse().map_err(|_| format!("`{status}` is no exit status"))?)
        }
        other => {
            if let Some(assertion) = Assertion::parse(other, words)? {
                return Ok(Step::Expect { what: Expectation::Assertion(assertion), within });
            }
            let count = other.parse().map_err(|_| {
                format!(
                    "`{other}` cannot be expected: expected `verdict`, `finding`, `candidate`, `no finding`, `N findings`, \
                     `healthy`, `inconclusive`, `all closed`, `line up`, `exit N`, `log \"…\"`, or something of the \
                     segment: `counter`, `no other counter`, `port`, `state`, `lost frames`, \
                     `answered`, `unanswered`, `working counter`, `reached`, `carrier`, `register`, `clock`, `object`"
                )
            })?;
            if !words.take("findings") {
                words.expect("finding")?;
            }
            Expectation::Findings(count)
        }
    };
    Ok(Step::Expect { what, within })
}

/// `"words"`: the rest of a step.
fn quoted(words: &mut Words<'_>) -> Result<String, String> {
    let rest = std::mem::take(&mut words.rest).trim();
    let inside = rest.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    let inside = inside.filter(|inside| !inside.is_empty());
    inside
        .map(str::to_owned)
        .ok_or_else(|| format!("`{rest}`: expected words of the log in double quotes"))
}

fn named(word: &str) -> Result<What, String> {
    let mut letters = word.chars();
    let is_code = letters.next().is_some_and(|c| c.is_ascii_uppercase())
        && word.len() == 4
        && letters.all(|c| c.is_ascii_digit());
    if is_code { Ok(What::Code(word.to_owned())) } else { fault(word).map(What::Cause) }
}

fn fault(word: &str) -> Result<FaultName, String> {
    word.parse().map_err(|error: linesman_config::fault::UnknownFault| error.to_string())
}

impl Expectation {
    /// It is about the segment itself, whatever the diagnosis says of it.
    #[must_use]
    pub const fn is_of_segment(&self) -> bool {
        matches!(self, Self::Assertion(_) | Self::Object(_) | Self::Log { .. } | Self::LineUp)
    }
}

/// The rest of a step, word by word.
pub(super) struct Words<'a> {
    pub(super) rest: &'a str,
}

impl<'a> Words<'a> {
    pub(super) fn next(&mut self) -> &'a str {
        let (word, rest) = self.rest.split_once(' ').unwrap_or((self.rest, ""));
        self.rest = rest.trim_start();
        word
    }

    pub(super) fn take(&mut self, word: &str) -> bool {
        let mut ahead = Words { rest: self.rest };
        let found = ahead.next() == word;
        if found {
            self.rest = ahead.rest;
        }
        found
    }

    pub(super) fn expect(&mut self, word: &str) -> Result<(), String> {
        if self.take(word) {
            return Ok(());
        }
        Err(format!("expected `{word}`, found `{}`", self.rest))
    }

    fn time(&mut self) -> Result<Span, String> {
        let (number, unit) = (self.next(), self.next());
        let wrong = || format!("`{number} {unit}` is no time: write such as `20 ms` or `2 s`");
        let number: u64 = number.parse().map_err(|_| wrong())?;
        match unit.trim_end_matches(':') {
            "us" => Ok(Span::us(number)),
            "ms" => Ok(Span::ms(number)),
            "s" => Ok(Span::s(number)),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Option<Span>, Step) {
        parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn faults_become_entries_of_a_segment_file() {
        let (at, step) =
            read("at 2 s: inject `emc-noise` at `K1.C>B3.A` with hits = 10, also = [\"a\", \"b\"]");
        assert_eq!(at, Some(Span::s(2)));
        let Step::Inject { entry, lasts: None } = step else { panic!("{step:?}") };
        assert_eq!(
            entry,
            "kind = \"emc-noise\"\nat = \"K1.C>B3.A\"\nhits = 10\nalso = [\"a\", \"b\"]\n"
        );
        let (_, step) = read("inject supply-off at devices K1, K2");
        let entry = "kind = \"supply-off\"\ndevices = [\"K1\", \"K2\"]\n".to_owned();
        assert_eq!(step, Step::Inject { entry, lasts: None });
        let (at, step) = read("inject device-off at device K1 for 20 ms");
        assert_eq!(at, None);
        let entry = "kind = \"device-off\"\ndevice = \"K1\"\n".to_owned();
        assert_eq!(step, Step::Inject { entry, lasts: Some(Span::ms(20)) });
    }

    #[test]
    fn expectations_are_read() {
        let finding =
            |what, place: &str| Expectation::Finding { what, place: Some(place.to_owned()) };
        let table = [
            (
                "expect finding H110 at K1.C-B3.A within 500 ms",
                finding(What::Code("H110".to_owned()), "K1.C-B3.A"),
                Span::ms(500),
            ),
            (
                "expect finding device-off at device K1",
                finding(What::Cause(FaultName::DeviceOff), "device K1"),
                Span::ZERO,
            ),
            ("expect verdict within 1 s", Expectation::Verdict(None), Span::s(1)),
            (
                "expect verdict on device-off",
                Expectation::Verdict(Some(FaultName::DeviceOff)),
                Span::ZERO,
            ),
            ("expect no finding", Expectation::NoFinding(None), Span::ZERO),
            (
                "expect no finding link-open",
                Expectation::NoFinding(Some(What::Cause(FaultName::LinkOpen))),
                Span::ZERO,
            ),
            ("expect 1 finding", Expectation::Findings(1), Span::ZERO),
            ("expect 2 findings within 1 s", Expectation::Findings(2), Span::s(1)),
            ("expect healthy", Expectation::Healthy, Span::ZERO),
            ("expect all closed within 2 s", Expectation::AllClosed, Span::s(2)),
            ("expect line up within 3 s", Expectation::LineUp, Span::s(3)),
            ("expect exit 1", Expectation::Exit(1), Span::ZERO),
            (
                "expect no log \"sync window\" within 1 s",
                Expectation::Log { words: "sync window".to_owned(), told: false },
                Span::s(1),
            ),
        ];
        for (text, what, within) in table {
            assert_eq!(read(text), (None, Step::Expect { what, within }), "{text}");
        }
        assert_eq!(read("at 40 ms"), (Some(Span::ms(40)), Step::Wait));
        assert_eq!(read("heal emc-noise").1, Step::Heal(Heal::Named(FaultName::EmcNoise)));
    }

    #[test]
    fn what_is_no_step_says_what_was_expected() {
        for (text, expected) in [
            ("wait a bit", "expected `inject`, `heal`, `unplug`, `plug`, `write` or `expect`"),
            ("at 2 inject link-open at a.A-b.A", "write such as `20 ms`"),
            ("inject link-opened at K1.A-K2.A", "the names are: link-open"),
            ("inject link-open", "a fault needs a place"),
            ("expect something", "`healthy`"),
            ("expect all open", "expected `closed`"),
            ("expect log sync window", "in double quotes"),
            ("expect healthy now", "`now` is left over"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
