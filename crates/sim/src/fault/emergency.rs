//! `emergency`: a device finds an error in itself or in what is wired to it, and reports it through
//! its mailbox. When the fault ends, it reports that the error is gone. Code 0xFF00 is a message of its own
//! diagnosis history (0x10F3): the data are severity (0 information, 1 warning, 2 error) and number of the text.
//!
//! Reference: ETG.1000.6, Emergency; codes as in CiA 301.

use linesman_config::fault::FaultName;
use linesman_proto::mailbox::coe::{Emergency, ErrorRegister};
use linesman_proto::time::{Instant, Span};

use super::{Kind, Parameter, PlaceRule, Shape};
use crate::wire::{Change, SoftwareChange, Source};

pub(super) const KIND: Kind = Kind {
    name: FaultName::Emergency,
    place: PlaceRule::Mailbox,
    parameters: &[
        Parameter {
            key: "code",
            meaning: "The error code.",
            shape: Shape::Whole { low: 0x0001, high: 0xFFFF, default: Some(0x5000) },
        },
        Parameter {
            key: "register",
            meaning: "The error register (object 0x1001) that comes with it.",
            shape: Shape::Whole { low: 0, high: 0xFF, default: Some(0x01) },
        },
        Parameter {
            key: "data",
            meaning: "Up to five bytes of the vendor, in hexadecimal: `\"01 02 03 04 05\"`.",
            shape: Shape::Text,
        },
        Parameter {
            key: "every_ms",
            meaning: "From one message to the next, in ms; 0 for a single one.",
            shape: Shape::Number { low: 0.0, high: 3.6e6, default: Some(0.0) },
        },
    ],
    start: |start| {
        let text = start.values.text("data").unwrap_or_default();
        let Some(data) = vendor_bytes(text) else {
            let what = format!("`data` is {text:?}: write up to five bytes such as \"01 02 A0\"");
            return Err(start.error(what));
        };
        let whole = |key| start.values.whole(key).unwrap_or(0);
        let emergency = Emergency {
            code: whole("code") as u16,
            register: ErrorRegister(whole("register") as u8),
            data,
        };
        let every = start.milliseconds("every_ms");
        let nodes = start.target.nodes;
        Ok(Box::new(Reports { nodes, emergency, every, at: start.from, next: 0 }))
    },
};

/// Reads bytes in hexadecimal, parted by spaces; what is left out is 0.
fn vendor_bytes(text: &str) -> Option<[u8; 5]> {
    let mut data = [0; 5];
    let mut slots = data.iter_mut();
    for word in text.split_whitespace() {
        let word = word.strip_prefix("0x").unwrap_or(word);
        *slots.next()? = u8::from_str_radix(word, 16).ok()?;
    }
    Some(data)
}

#[derive(Debug)]
struct Reports {
    nodes: Vec<usize>,
    emergency: Emergency,
    every: Span,
    at: Instant,
    next: usize,
}

impl Source for Reports {
    fn next_change(&mut self) -> Option<(Instant, Change)> {
        if self.next == self.nodes.len() {
            if self.every == Span::ZERO {
                return None;
            }
            self.at += self.every;
            self.next = 0;
        }
        let node = *self.nodes.get(self.next)?;
        self.next += 1;
        let change = SoftwareChange::Report(self.emergency);
        Some((self.at, Change::Software { node, change }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vendor_bytes_are_read_in_hexadecimal() {
        assert_eq!(vendor_bytes(""), Some([0; 5]));
        assert_eq!(vendor_bytes("01 a0 0xFF"), Some([1, 0xA0, 0xFF, 0, 0]));
        for wrong in ["1 2 3 4 5 6", "100", "x", "-1"] {
            assert_eq!(vendor_bytes(wrong), None, "{wrong}");
        }
    }
}
