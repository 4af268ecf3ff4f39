//! Working counters in a line, and what they tell when they are not the expected ones.

use super::found::Found;
use super::page::{Kind, Page};
use super::prefixed_number::{Token, tokens};
use super::vocabulary;

/// Adds how far a working counter is off, where a line tells both.
pub(super) fn add(line: &str, found: &mut Found) {
    let lower = line.to_ascii_lowercase();
    let about = ["wkc", "working counter", "workingcounter", "wc "];
    if !about.iter().any(|word| lower.contains(word)) {
        return;
    }
    // SOEM says by negative numbers that there was no frame.
    if ["-1", "-2", "-3"].iter().any(|number| lower.contains(number)) {
        found.extend(94, vocabulary::find("EC_NOFRAME").into_iter().map(vocabulary::Word::page));
        return;
    }
    let (mut got, mut expected) = (None, None);
    let mut before = "";
    let mut rest = lower.as_str();
    if let Some(at) = about.iter().filter_map(|word| lower.find(word)).min() {
        rest = &lower[at..];
    }
    for token in tokens(rest) {
        match token {
            Token::Word(word) => before = word,
            Token::Number(numbers) => {
                let decimal = numbers.iter().find(|number| number.decimal).or(numbers.first());
                let value = decimal.and_then(|number| number.word());
                match before {
                    "expected" | "of" => expected = expected.or(value),
                    "received" | "got" => got = got.or(value),
                    _ if got.is_none() => got = value,
                    _ => expected = expected.or(value),
                }
            }
        }
    }
    match (got, expected) {
        (Some(got), Some(expected)) => found.add(94, deficit(got, expected)),
        (Some(_), None) => {
            found.extend(84, vocabulary::find("WKC").into_iter().map(vocabulary::Word::page));
        }
        (None, _) => {}
    }
}

/// A page about a working counter that is not the expected one.
fn deficit(got: u16, expected: u16) -> Page {
    let title = format!("Working counter {got}, expected {expected}");
    let page = Page::new(Kind::WorkingCounter, title);
    let text = match expected.checked_sub(got) {
        None => "It is higher than expected: two SubDevices answer to one address, or FMMUs overlap."
            .to_owned(),
        Some(0) => "It is as expected: the data of this datagram are valid.".to_owned(),
        Some(_) if got == 0 => "Nobody obeyed: the SubDevices are gone, have lost their address, or are not \
            in a state that serves this datagram. An answer with 0 that came within some µs is often the \
            MainDevice's own frame (`linesman explain own-frames`)."
            .to_owned(),
        Some(1) => "It is 1 too low: one SubDevice does not give its inputs (of LRW or LRD), or does not take \
            its outputs (of LWR)."
            .to_owned(),
        Some(2) => "It is 2 too low: of LRW one SubDevice does not take its outputs, as in SAFEOP; of LRD or \
            LWR two SubDevices do not obey."
            .to_owned(),
        Some(3) => "It is 3 too low: of LRW one SubDevice with inputs and outputs does not take part, or \
            three with inputs only."
            .to_owned(),
        Some(deficit) => format!(
            "It is {deficit} too low: of LRW each SubDevice that is missing takes 1 for inputs, 2 for outputs, \
             3 for both; of LRD and LWR 1 each. Several SubDevices are missing, often all behind one link."
        ),
    };
    page.text(text)
        .steps([
            "Read the state of each SubDevice in the datagram: the one that is not in OP, or does not \
             answer, is the reason. The others are in the same datagram, no more."
                .to_owned(),
            "If its state has the error bit, its AL status code says why (`linesman explain 0x001B`)."
                .to_owned(),
            "`linesman diagnose trace.pcapng` or `linesman diagnose listen:eth0` names the SubDevice from the \
             frames."
                .to_owned(),
        ])
        .fact("see", "ETG.1000.4, working counter; `linesman explain WKC`")
}
