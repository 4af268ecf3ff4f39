//! Messages of TwinCAT about SubDevices, and lists of emergencies, as text or CSV.
//!
//! Reference: `'Term 3 (EL4102)' (1003): abnormal state change (from 'OP' to 'SAFEOP') with code 0x1b.` with other
//! columns before and behind it; wording differs between versions, so only what carries a fact is looked for.

use std::collections::BTreeMap;

use super::fact::{Block, Fact, FactKind, Format, SubDeviceFact, SubDeviceRef, extent};
use super::stamp::{Stamp, at_begin, date};
use super::state_word;
use super::text::{Line, between, cells, hex, leading_number, so_many, type_in};
use super::twincat_online::address_in;
use crate::observation_file::{Count, ObservedMainDevice, ReadDevice, Word};

/// A message with whom it is about.
struct TwinCatMessage<'l> {
    stamp: Option<Stamp>,
    whom: SubDeviceRef,
    /// Where it is about a stretch: the last of it.
    last: Option<SubDeviceRef>,
    text: &'l str,
}

/// `'Term 5 (EL3154)' (1005)` at the begin of a text, and what follows.
fn subject(text: &str) -> Option<(SubDeviceRef, &str)> {
    let rest = text.strip_prefix('\'')?;
    let (name, rest) = rest.split_once('\'')?;
    let rest = rest.trim_start();
    let Some(inside) = rest.strip_prefix('(') else {
        return Some((SubDeviceRef::Named(name.to_owned(), None), rest));
    };
    let (number, rest) = inside.split_once(')')?;
    Some((SubDeviceRef::Named(name.to_owned(), Some(address_in(number)?)), rest))
}

fn stamp_of(line: &str, before: &str) -> Option<Stamp> {
    if let (Some(stamp), _) = at_begin(line) {
        return Some(stamp);
    }
    let by_cell = cells(line).iter().find_map(|cell| date(cell));
    // A time right before the message, without a column of its own.
    let words: Vec<&str> = before.split_whitespace().collect();
    let by_words = || {
        (0..words.len()).find_map(|from| {
            (from + 2..=words.len().min(from + 4))
                .rev()
                .find_map(|to| date(&words[from..to].join(" ")))
        })
    };
    by_cell.or_else(by_words).map(Stamp::Date)
}

fn message<'l>(line: &'l str) -> Option<TwinCatMessage<'l>> {
    // The first quoted name with an address behind it.
    let found = line.match_indices('\'').find_map(|(at, _)| {
        let (whom, rest) = subject(&line[at..])?;
        matches!(whom, SubDeviceRef::Named(_, Some(_))).then_some((at, whom, rest))
    });
    let (at, whom, mut rest) = found?;
    let stamp = stamp_of(line, &line[..at]);
    let mut last = None;
    let range = rest.trim_start().strip_prefix('-').map(str::trim_start).and_then(subject);
    if let Some((to, after)) = range {
        (last, rest) = (Some(to), after);
    }
    Some(TwinCatMessage { stamp, whom, last, text: rest.trim_start_matches([':', ' ']).trim() })
}

/// What a message tells; `None` when it is none of those that carry a fact.
fn facts(
    message: &TwinCatMessage<'_>,
    changes: &mut BTreeMap<SubDeviceRef, u64>,
) -> Option<Vec<FactKind>> {
    let text = message.text;
    let whom = || message.whom.clone();
    let lower = text.to_ascii_lowercase();
    let read = |read: ReadDevice| FactKind::Read(whom(), Box::new(read));
    if lower.contains("communication interrupted") || lower.contains("communication re-established")
    {
        let is_back = lower.contains("re-established");
        let to = message.last.clone().unwrap_or_else(whom);
        return Some(vec![FactKind::Interrupted { from: whom(), to, is_back }]);
    }
    if lower.contains("abnormal state change") {
        let count = changes.get(&message.whom).copied().unwrap_or_default() + 1;
        let [before, then] = abnormal_change(text, &lower, count)?;
        changes.insert(whom(), count);
        return Some(vec![read(before), read(then)]);
    }
    if lower.contains("state change aborted") {
        let back = quoted_state(text, &lower, "back to");
        let failed =
            ReadDevice { state: back, configuration_failed: Some(true), ..ReadDevice::default() };
        return Some(vec![read(failed)]);
    }
    if let Some((_, status)) = text.split_once("AL Status '") {
        let state = status.split('\'').next().and_then(hex).and_then(state_word::of_status);
        let code = between(text, "AL Status Code '", "'")
            .and_then(|code| hex(code.split_whitespace().next()?));
        let al_code =
            code.and_then(|code| u16::try_from(code).ok()).filter(|code| *code != 0).map(Word);
        return Some(vec![read(ReadDevice {
            state,
            al_code,
            configuration_failed: Some(true),
            ..ReadDevice::default()
        })]);
    }
    if let Some((_, rest)) = text.split_once("SDO Abort") {
        return Some(vec![sdo_abort(whom(), text, rest)?]);
    }
    if lower.contains("emergency") {
        return Some(vec![emergency(whom(), text)?]);
    }
    None
}

/// The state in quotation marks after a word; `lower` is the text in small letters.
fn quoted_state(text: &str, lower: &str, after: &str) -> Option<String> {
    let at = lower.find(after)? + after.len();
    let state = between(&text[at..], "'", "'")?;
    state_word::read(state)?.state
}

/// The readings before and after the abnormal change of a state, the `count`th of that SubDevice.
fn abnormal_change(text: &str, lower: &str, count: u64) -> Option<[ReadDevice; 2]> {
    let quoted = |after| quoted_state(text, lower, after);
    let (from, to) = (quoted("from")?, quoted("to '").or_else(|| quoted(" to"))?);
    let code = lower.split_once("code").and_then(|(_, code)| {
        hex(code.split(['.', ' ', ')', '-']).find(|word| !word.is_empty())?)
    });
    let code = code.and_then(|code| u16::try_from(code).ok()).filter(|code| *code != 0);
    let before = ReadDevice { state: Some(from), ..ReadDevice::default() };
    let then = match code {
        Some(code) => ReadDevice {
            state: Some(format!("ERR {to}")),
            al_code: Some(Word(code)),
            ..ReadDevice::default()
        },
        None => ReadDevice { state_changes: Some(Count(count)), ..ReadDevice::default() },
    };
    Some([before, then])
}

/// The refusal of an object; `rest` is what stands behind the words `SDO Abort`.
fn sdo_abort(whom: SubDeviceRef, text: &str, rest: &str) -> Option<FactKind> {
    let object =
        text.split_whitespace().find_map(|word| word.trim_end_matches(')').split_once(':'));
    let (index, subindex) = object?;
    let code =
        rest.split([',', ' ', '(', ')']).filter(|word| word.starts_with("0x")).find_map(hex)?;
    Some(FactKind::Abort {
        whom,
        index: u16::try_from(hex(index)?).ok()?,
        subindex: u8::try_from(hex(subindex)?).ok()?,
        code: u32::try_from(code).ok()?,
    })
}

/// `CoE - Emergency (Hex: 8611, 08, '29 00 00 00 00')`.
fn emergency(whom: SubDeviceRef, text: &str) -> Option<FactKind> {
    let inside = text.split_once("Hex:").map_or(text, |(_, inside)| inside);
    let mut numbers = inside
        .split(|one: char| !one.is_ascii_hexdigit() && one != 'x')
        .filter(|part| !part.is_empty());
    let code = numbers.find(|part| part.trim_start_matches("0x").len() == 4).and_then(hex)?;
    let rest: Vec<u8> = numbers.filter_map(|part| u8::try_from(hex(part)?).ok()).collect();
    Some(FactKind::Emergency {
        whom,
        code: u16::try_from(code).ok()?,
        register: rest.first().copied(),
        data: rest.get(1..).unwrap_or_default().iter().copied().take(5).collect(),
    })
}

/// `Frame missed 10 times (frame no. 0)`.
fn missed(text: &str) -> Option<u64> {
    let (_, rest) = text.split_once("rame missed ")?;
    let (count, rest) = leading_number(rest)?;
    rest.trim_start().starts_with("times").then_some(count)
}

fn is_header(line: &str) -> bool {
    line.contains("Timestamp") && line.contains("Message")
}

/// Takes messages in a row.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let mut changes = BTreeMap::new();
    let tells = |line: &str,
                 changes: &mut BTreeMap<SubDeviceRef, u64>|
     -> Option<(Option<Stamp>, Vec<FactKind>)> {
        if let Some(count) = missed(line) {
            let main =
                ObservedMainDevice { lost: Some(Count(count)), ..ObservedMainDevice::default() };
            return Some((stamp_of(line, line), vec![FactKind::Added(Box::new(main))]));
        }
        let message = message(line)?;
        Some((message.stamp, facts(&message, changes)?))
    };
    let first = &lines.first()?.text;
    if !is_header(first) {
        tells(first, &mut changes)?;
    }
    changes.clear();
    let mut block = Block::new(Format::Messages);
    let mut told: Vec<Fact> = Vec::new();
    let mut count = 0;
    (block.lines, block.unused) = extent(lines, |line| {
        if is_header(&line.text) {
            return true;
        }
        let Some((stamp, facts)) = tells(&line.text, &mut changes) else { return false };
        count += 1;
        told.extend(facts.into_iter().map(|what| Fact { stamp, what }));
        true
    });
    if told.is_empty() {
        return None;
    }
    block.what = so_many(count, "TwinCAT message");
    for name in told.iter().filter_map(|fact| whom(&fact.what)).cloned().collect::<Vec<_>>() {
        block.tell(FactKind::SubDeviceFact(name.clone(), Box::new(about(&name))));
    }
    // Frames that were missed are counted from 0 on.
    if let Some(first) = told.first() {
        block.tell_at(first.stamp, FactKind::Added(Box::default()));
    }
    block.facts.extend(told);
    Some(block)
}

const fn whom(what: &FactKind) -> Option<&SubDeviceRef> {
    match what {
        FactKind::Read(whom, _)
        | FactKind::Emergency { whom, .. }
        | FactKind::Abort { whom, .. } => Some(whom),
        FactKind::SubDeviceFact(..)
        | FactKind::Main(_)
        | FactKind::Added(_)
        | FactKind::WorkingCounter(..)
        | FactKind::Interrupted { .. } => None,
    }
}

fn about(whom: &SubDeviceRef) -> SubDeviceFact {
    match whom {
        SubDeviceRef::Named(name, station) => SubDeviceFact {
            name: Some(name.clone()).filter(|name| !name.is_empty()),
            type_name: type_in(name).map(str::to_owned),
            station: *station,
            ..SubDeviceFact::default()
        },
        SubDeviceRef::Position(_) | SubDeviceRef::Alias(..) => SubDeviceFact::default(),
    }
}

/// What a column of a list of emergencies holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum MessageColumn {
    Time,
    Device,
    Address,
    No,
    Code,
    Register,
    Data,
    Other,
}

fn column(title: &str) -> MessageColumn {
    let title = title.trim().to_ascii_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| title.contains(word));
    match title.as_str() {
        "no" | "no." | "nr" | "#" | "number" => return MessageColumn::No,
        "addr" | "address" | "addr." => return MessageColumn::Address,
        _ => {}
    }
    if has(&["time", "date", "zeit", "stamp"]) {
        MessageColumn::Time
    } else if has(&["register"]) {
        MessageColumn::Register
    } else if has(&["code", "emergency"]) {
        MessageColumn::Code
    } else if has(&["device", "slave", "name", "source", "box", "terminal"]) {
        MessageColumn::Device
    } else if has(&["data", "bytes"]) {
        MessageColumn::Data
    } else {
        MessageColumn::Other
    }
}

/// A code as lists write it: `0x8611`, `8611` (hexadecimal by custom), or a longer decimal number.
fn emergency_code(text: &str) -> Option<u16> {
    let text = text.trim().trim_end_matches(['h', 'H']);
    let value = match text.len() {
        4 => hex(text),
        _ if text.starts_with("0x") || text.starts_with("0X") => hex(text),
        _ => text.parse().ok(),
    };
    u16::try_from(value?).ok()
}

/// Takes a list of emergencies with a header.
pub(super) fn take_table(lines: &[Line<'_>]) -> Option<Block> {
    let columns: Vec<MessageColumn> =
        cells(&lines.first()?.text).iter().map(|title| column(title)).collect();
    let has = |wanted: MessageColumn| columns.contains(&wanted);
    let names = has(MessageColumn::Device) || has(MessageColumn::Address) || has(MessageColumn::No);
    if !has(MessageColumn::Code) || !names || columns.len() < 2 {
        return None;
    }
    let row = |line: &str| -> Option<(Option<Stamp>, FactKind, SubDeviceFact)> {
        let cells = cells(line);
        let cell = |wanted: MessageColumn| {
            let at = columns.iter().position(|column| *column == wanted)?;
            cells.get(at).map(String::as_str).filter(|cell| !cell.is_empty())
        };
        let code = emergency_code(cell(MessageColumn::Code)?)?;
        let number = |column| {
            cell(column).and_then(|cell| leading_number(cell.trim())).map(|(number, _)| number)
        };
        let station = number(MessageColumn::Address).and_then(|number| u16::try_from(number).ok());
        let device = cell(MessageColumn::Device);
        let whom = match (number(MessageColumn::No), device, station) {
            (Some(no @ 1..=0xFFFF), None, None) => {
                SubDeviceRef::Position(u16::try_from(no - 1).ok()?)
            }
            (_, Some(name), station) => match subject(name) {
                Some((whom, _)) => whom,
                None => SubDeviceRef::Named(name.to_owned(), station),
            },
            (_, None, Some(station)) => SubDeviceRef::Named(String::new(), Some(station)),
            (_, None, None) => return None,
        };
        let bytes = cell(MessageColumn::Data).unwrap_or_default();
        let data = bytes
            .split([' ', '-', ','])
            .filter_map(|byte| u8::try_from(hex(byte)?).ok())
            .take(5)
            .collect();
        let register = cell(MessageColumn::Register).and_then(|cell| u8::try_from(hex(cell)?).ok());
        let stamp = cell(MessageColumn::Time)
            .and_then(|cell| date(cell).map(Stamp::Date).or_else(|| at_begin(cell).0));
        let about = about(&whom);
        Some((stamp, FactKind::Emergency { whom, code, register, data }, about))
    };
    let mut block = Block::new(Format::Messages);
    let (end, unused) = extent(&lines[1..], |line| row(&line.text).is_some());
    if end == 0 {
        return None;
    }
    (block.lines, block.unused) = (end + 1, unused);
    let rows: Vec<_> = lines[1..=end].iter().filter_map(|line| row(&line.text)).collect();
    block.what = format!("list of emergencies, {}", so_many(rows.len(), "row"));
    for (stamp, what, about) in rows {
        if let Some(whom) = whom(&what) {
            block.tell(FactKind::SubDeviceFact(whom.clone(), Box::new(about)));
        }
        block.tell_at(stamp, what);
    }
    Some(block)
}

#[cfg(test)]
#[allow(clippy::wildcard_enum_match_arm, reason = "helpers of tests")]
mod tests {
    use super::super::text::lines;
    use super::*;
    use crate::observation_file::Date;

    fn told(text: &str) -> Vec<FactKind> {
        let block = take(&lines(text)).unwrap();
        let facts = block.facts.into_iter().map(|fact| fact.what);
        facts
            .filter(|what| !matches!(what, FactKind::SubDeviceFact(..) | FactKind::Added(_)))
            .collect()
    }

    fn states(text: &str) -> Vec<(Option<String>, Option<u16>)> {
        let read = told(text).into_iter().filter_map(|what| match what {
            FactKind::Read(_, read) => Some((read.state, read.al_code.map(|code| code.0))),
            _ => None,
        });
        read.collect()
    }

    #[test]
    fn state_changes_are_read_with_their_codes() {
        let state = |text: &str| Some(text.to_owned());
        assert_eq!(
            states(
                "'Term 3 (EL4102)' (1003): abnormal state change (from 'OP' to 'SAFEOP') with code 0x1b.\n"
            ),
            [(state("OP"), None), (state("ERR SAFEOP"), Some(0x1B))]
        );
        assert_eq!(
            states(
                "'Term 5 (EL3154)' (1005): state change aborted (requested 'PREOP', back to 'INIT').\n"
            ),
            [(state("INIT"), None)]
        );
        assert_eq!(
            states(
                "'Term 5 (EL3154)' (1005): 'INIT to PREOP' failed! Error: 'check device state for PREOP'. AL Status \
                 '0x0011' read and '0x0002' expected. AL Status Code '0x0014 - No valid firmware'\n"
            ),
            [(state("ERR INIT"), Some(0x14))]
        );
        let without =
            told("'Box 1 (SSC-Device)' (1001): abnormal state change (from 'OP' to 'SAFEOP')\n");
        assert!(
            matches!(&without[1], FactKind::Read(_, read) if read.state_changes == Some(Count(1)))
        );
    }

    #[test]
    fn interruptions_aborts_and_emergencies_are_read() {
        let text = "\
'Term 64 (EK1100)' (1015) - 'Term 70 (EL1262)' (1021) Communication interrupted
'Term 64 (EK1100)' (1015) Communication re-established
'Term 14 (EL4102)' (1002): CoE ('InitDown' 0x10f0:01) - SDO Abort ('Attempt to write a read only object.', 0x06010002).
'Drive 3 (EL7201)' (1003): CoE - Emergency (Hex: 8611, 20, '29 00 00 00 01').
Frame missed 10 times (frame no. 0)
";
        let all = told(text);
        let named = |name: &str, at| SubDeviceRef::Named(name.to_owned(), Some(at));
        assert!(matches!(&all[0], FactKind::Interrupted { from, to, is_back: false }
            if *from == named("Term 64 (EK1100)", 1015) && *to == named("Term 70 (EL1262)", 1021)));
        assert!(matches!(&all[1], FactKind::Interrupted { from, to, is_back: true } if from == to));
        assert!(matches!(
            &all[2],
            FactKind::Abort { index: 0x10F0, subindex: 1, code: 0x0601_0002, .. }
        ));
        assert!(
            matches!(&all[3], FactKind::Emergency { code: 0x8611, register: Some(0x20), data, .. }
            if data[..] == [0x29, 0, 0, 0, 1])
        );
        assert_eq!(take(&lines(text)).unwrap().what, "5 TwinCAT messages");
    }

    #[test]
    fn times_are_read_from_columns_and_from_before_the_message() {
        let message =
            "'Term 3 (EL4102)' (1003): state change aborted (requested 'OP', back to 'SAFEOP').";
        let expected = Some(Stamp::Date(Date::read("2015-07-24T10:36:32.840").unwrap()));
        for line in [
            format!("TwinCAT System (10000)\t24/07/2015 10:36:32 840 ms\t{message}"),
            format!("\"Error\";\"24.07.2015 10:36:32 840 ms\";\"{message}\""),
            format!("24.07.2015 10:36:32 840 ms {message}"),
        ] {
            let block = take(&lines(&line)).unwrap();
            assert_eq!(block.facts.last().unwrap().stamp, expected, "{line}");
        }
    }

    #[test]
    fn lists_of_emergencies_are_read_by_their_columns() {
        let text = "Timestamp;Device;Code;Register;Data\n\
            20.11.2026 10:00:00;Drive 3 (EL7201);0x8611;20;29 00 00 00 01\n20.11.2026 10:00:05;'Term 5 (EL3154)' (1005);5441;;\n";
        let block = take_table(&lines(text)).unwrap();
        assert_eq!((block.lines, block.what.as_str()), (3, "list of emergencies, 2 rows"));
        let codes: Vec<_> = block
            .facts
            .iter()
            .filter_map(|fact| match &fact.what {
                FactKind::Emergency { whom, code, .. } => {
                    Some((whom.clone(), *code, fact.stamp.is_some()))
                }
                _ => None,
            })
            .collect();
        assert_eq!(
            codes,
            [
                (SubDeviceRef::Named("Drive 3 (EL7201)".to_owned(), None), 0x8611, true),
                (SubDeviceRef::Named("Term 5 (EL3154)".to_owned(), Some(1005)), 0x5441, true),
            ]
        );
        assert!(take_table(&lines("Code;Description\n1;x\n")).is_none());
    }

    #[test]
    fn other_sentences_with_quotes_are_left_alone() {
        for text in [
            "it's (1003) what",
            "'Term 3' (1003): all is well",
            "'a' (b): SDO Abort",
            "Frame missed often",
        ] {
            assert!(take(&lines(text)).is_none(), "{text}");
        }
    }
}
