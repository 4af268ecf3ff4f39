//! Expectation of a story on an object that is read through a mailbox.
//!
//! ```text
//! expect object NAME 0x1018:1 = 0x00000002
//! expect object NAME 0x1018:1 aborted 0x06020000
//! expect object NAME 0x1018:1 read | refused | unanswered
//! ```
//! A step takes as long as the answer does; `within` is not for it.

use linesman_maindevice::mailbox::Why;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;

use super::assertion::{Amount, amount, value};
use super::step::Words;
use crate::lab::Lab;

/// An object and what must come of reading it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Reading {
    /// Whose.
    pub device: String,
    /// Which.
    pub object: ObjectAddress,
    /// What must come of it.
    pub outcome: Outcome,
}

/// What must come of reading an object.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// Any value.
    Read,
    /// This value, lowest byte first.
    Value(Vec<u8>),
    /// A number, lowest byte first, that is one of these.
    Number(Amount),
    /// The transfer is aborted with this code.
    Aborted(u32),
    /// The mailbox answers with an error of its own.
    Refused,
    /// Nobody answers, or nobody takes the request.
    Unanswered,
}

impl Reading {
    pub(super) fn parse(words: &mut Words<'_>) -> Result<Self, String> {
        let (device, at) = (words.next().to_owned(), words.next());
        let wrong = || format!("`{at}` is no object, such as `0x1018:1`");
        let (index, subindex) = at.split_once(':').ok_or_else(wrong)?;
        let index = index.strip_prefix("0x").and_then(|hex| u16::from_str_radix(hex, 16).ok());
        let subindex = subindex.parse().map_err(|_| wrong())?;
        let object = ObjectAddress::new(index.ok_or_else(wrong)?, subindex);
        let outcome = match words.next() {
            "read" => Outcome::Read,
            "refused" => Outcome::Refused,
            "unanswered" => Outcome::Unanswered,
            "=" => {
                let text = words.next();
                let wrong = || format!("`{text}` is no value, such as `0x5A37`");
                Outcome::Value(value(text).ok_or_else(wrong)?)
            }
            word @ (">=" | "<=") => {
                let rest = std::mem::take(&mut words.rest);
                Outcome::Number(amount(&format!("{word} {rest}"))?)
            }
            "aborted" => {
                let text = words.next();
                let code =
                    text.strip_prefix("0x").and_then(|hex| u32::from_str_radix(hex, 16).ok());
                Outcome::Aborted(code.ok_or_else(|| format!("`{text}` is no abort code"))?)
            }
            other => {
                return Err(format!(
                    "`{other}`: expected `= 0x…`, `>= 3`, `<= 3`, `aborted 0x…`, `read`, `refused` or `unanswered`"
                ));
            }
        };
        Ok(Self { device, object, outcome })
    }

    /// Reads it and says what came instead.
    pub(super) fn check(&self, id: DeviceId, lab: &mut Lab) -> Result<(), String> {
        let result = lab.read_object(id, self.object).map_err(|error| error.to_string())?;
        let why = result.as_ref().map(|result| result.as_ref().map_err(|error| &error.why));
        let fits = match (&self.outcome, why) {
            (Outcome::Read, Some(Ok(_)))
            | (Outcome::Refused, Some(Err(Why::Mailbox { .. })))
            | (
                Outcome::Unanswered,
                Some(Err(Why::NoAnswer { .. } | Why::MailboxFull { .. })) | None,
            ) => true,
            (Outcome::Value(wanted), Some(Ok(found))) => wanted == found,
            (Outcome::Number(wanted), Some(Ok(found))) => wanted.takes(number(found)),
            (Outcome::Aborted(wanted), Some(Err(Why::Aborted { code, .. }))) => {
                code.value() == *wanted
            }
            _ => false,
        };
        if fits {
            return Ok(());
        }
        Err(match result {
            None => "nothing came of it".to_owned(),
            Some(Ok(data)) => format!("it was read: {data:02X?}, lowest byte first"),
            Some(Err(error)) => error.to_string(),
        })
    }
}

/// The number that up to eight bytes hold, lowest first.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().take(8).fold(0, |number, byte| number << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Reading, String> {
        Reading::parse(&mut Words { rest: text })
    }

    #[test]
    fn what_comes_of_an_object_can_be_written() {
        let object = ObjectAddress::new(0x1018, 1);
        for (text, outcome) in [
            ("T1 0x1018:1 read", Outcome::Read),
            ("T1 0x1018:1 = 0x00000002", Outcome::Value(vec![2, 0, 0, 0])),
            ("T1 0x1018:1 aborted 0x06020000", Outcome::Aborted(0x0602_0000)),
            ("T1 0x1018:1 refused", Outcome::Refused),
            ("T1 0x1018:1 unanswered", Outcome::Unanswered),
            ("T1 0x1018:1 >= 3", Outcome::Number(amount(">= 3").unwrap())),
        ] {
            let device = "T1".to_owned();
            assert_eq!(read(text), Ok(Reading { device, object, outcome }), "{text}");
        }
        for (text, expected) in [
            ("T1 1018:1 read", "is no object"),
            ("T1 0x1018 read", "is no object"),
            ("T1 0x1018:1 = 2", "is no value"),
            ("T1 0x1018:1 aborted", "is no abort code"),
            ("T1 0x1018:1 there", "expected `= 0x"),
        ] {
            assert!(read(text).unwrap_err().contains(expected), "{text}");
        }
    }
}
