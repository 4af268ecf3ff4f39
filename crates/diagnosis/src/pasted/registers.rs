//! Registers that were read beside the cycle: `ethercat reg_read` of IgH with the commands that were typed, and lines of
//! the form `slave 3 0x0300: 00 12 …`, as programs with SOEM, pysoem or ethercrab print them.
//!
//! Reference: `CommandRegRead.cpp` and `DataTypeHandler.cpp` of IgH: without a type, bytes `0x00 0x12`; with one, the value
//! in hexadecimal and decimal. Numbers of SubDevices count from 1, unless one of them is 0; positions count from 0.

use super::fact::{Block, FactKind, Format, SubDeviceFact, SubDeviceRef};
use super::text::{Line, hex, so_many};
use super::{byte_list, register_values};
use crate::main_device::MainDeviceKind;
use crate::observation_file::ReadDevice;

/// Lines between two readings that say nothing of them: prompts, `sleep 60`, `date`.
const MOST_OTHERS: usize = 4;
/// Lines of output that one command prints at most.
const MOST_LINES: usize = 64;
/// Numbers from here on are station addresses.
const FIRST_STATION: u64 = 0x0100;

/// The SubDevice of a reading.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ReadingSubject {
    /// By its position, from 0.
    Position(u16),
    /// By a number that counts from 1, unless one of them is 0.
    Number(u16),
    /// By its station address.
    Station(u16),
    /// By its alias.
    Alias(u16),
}

impl ReadingSubject {
    const fn whom(self, counts_from_0: bool) -> SubDeviceRef {
        match self {
            Self::Position(position) => SubDeviceRef::Position(position),
            Self::Number(number) if counts_from_0 => SubDeviceRef::Position(number),
            Self::Number(number) => SubDeviceRef::Position(number.saturating_sub(1)),
            Self::Station(station) => SubDeviceRef::Named(String::new(), Some(station)),
            Self::Alias(alias) => SubDeviceRef::Alias(alias, 0),
        }
    }
}

/// One reading: from which register on, the bytes.
#[derive(Clone, PartialEq, Eq, Debug)]
struct ReadValue {
    of: ReadingSubject,
    start: u16,
    bytes: Vec<u8>,
}

/// Which SubDevices a command is about.
#[derive(Clone, PartialEq, Eq, Debug)]
enum CommandTarget {
    /// This one.
    One(ReadingSubject),
    /// These positions in turn, in a loop of the shell.
    Each(Vec<u16>),
    /// Positions from 0 on: of a loop that does not say which.
    Counting,
}

/// `ethercat reg_read` as it was typed.
#[derive(Clone, PartialEq, Eq, Debug)]
struct RegReadCommand {
    asked: CommandTarget,
    start: u16,
    /// Bytes; `None` where a type says it.
    size: Option<usize>,
    kind: Option<String>,
}

/// Whether a line is a command whose output is taken.
pub(super) fn is_command(line: &Line<'_>) -> bool {
    command(&line.text).is_some()
}

fn command(text: &str) -> Option<RegReadCommand> {
    let (before, rest) = text.split_once("reg_read")?;
    let rest = rest.split([';', '|', '>', '#']).next()?;
    let mut words = rest.split_whitespace().flat_map(|word| word.split('=')).peekable();
    let mut all = before.split_whitespace().collect::<Vec<_>>().into_iter();
    let (mut asked, mut kind, mut numbers) = (None, None, Vec::new());
    let mut option = |name: &str, value: Option<&str>| match name {
        "-p" | "--position" => {
            asked = value.map(|value| match value.parse() {
                Ok(position) => CommandTarget::One(ReadingSubject::Position(position)),
                Err(_) => positions(text).map_or(CommandTarget::Counting, CommandTarget::Each),
            });
        }
        "-a" | "--alias" => {
            asked = value
                .and_then(|value| value.parse().ok())
                .map(|alias| CommandTarget::One(ReadingSubject::Alias(alias)));
        }
        "-t" | "--type" => kind = value.map(str::to_owned),
        _ => {}
    };
    // Options may stand before the word, too.
    while let Some(word) = all.next() {
        if word.starts_with('-') {
            option(word, all.next());
        }
    }
    while let Some(word) = words.next() {
        match word.split_at_checked(2) {
            // `-p3`
            Some((name @ ("-p" | "-a" | "-t" | "-m"), value)) if !value.is_empty() => {
                option(name, Some(value));
            }
            _ if word.starts_with('-') => option(word, words.next()),
            _ => numbers.push(word),
        }
    }
    let number = |text: &str| match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(_) => hex(text).and_then(|value| u16::try_from(value).ok()),
        None => text.parse().ok(),
    };
    let start = number(numbers.first()?)?;
    let size = numbers.get(1).and_then(|size| number(size)).map(usize::from);
    Some(RegReadCommand { asked: asked?, start, size, kind })
}

/// Positions of `for i in 0 1 2; do`, `for i in $(seq 0 5); do`, `for i in {0..5}; do`.
fn positions(text: &str) -> Option<Vec<u16>> {
    let (_, rest) = text.split_once(" in ")?;
    let list = rest.split([';', '\n']).next()?.trim();
    let range = |from: &str, to: &str| -> Option<Vec<u16>> {
        let (from, to): (u16, u16) = (from.trim().parse().ok()?, to.trim().parse().ok()?);
        (from <= to).then(|| (from..=to).collect())
    };
    if let Some(inside) = list.strip_prefix('{').and_then(|list| list.strip_suffix('}')) {
        let (from, to) = inside.split_once("..")?;
        return range(from, to);
    }
    let sequence = list.trim_start_matches(['$', '(', '`']).trim_end_matches([')', '`']);
    if let Some(inside) = sequence.strip_prefix("seq ") {
        let mut ends = inside.split_whitespace();
        let (one, other) = (ends.next()?, ends.next());
        return match other {
            Some(to) => range(one, to),
            None => range("1", one),
        };
    }
    list.split_whitespace().map(|word| word.parse().ok()).collect()
}

/// The value that a typed output shows, as bytes; `0x1200 4608`.
fn typed(kind: &str, text: &str) -> Option<Vec<u8>> {
    let mut words = text.split_whitespace();
    let value = hex(words.next()?.strip_prefix("0x")?)?.to_le_bytes();
    let len = match kind {
        "int8" | "uint8" => 1,
        "int16" | "uint16" => 2,
        "int32" | "uint32" => 4,
        "int64" | "uint64" => 8,
        _ => return None,
    };
    // The same in decimal.
    let is_whole = words.next().is_some_and(|word| word.parse::<i128>().is_ok());
    (is_whole && words.next().is_none()).then(|| value[..len].to_vec())
}

/// `slave 3 0x0300: 00 12`, `position 2 reg 0x0110 = 0x30 0x5A`, `0x1001 0x0300: …`.
fn labelled(text: &str) -> Option<ReadValue> {
    let (label, rest) = text.split_once([':', '='])?;
    // `slave 3: 0x0300: 00 12`
    let (label, bytes) = match rest.split_once([':', '=']) {
        Some((more, bytes)) if register(more).is_some() => (format!("{label} {more}"), bytes),
        _ => (label.to_owned(), rest),
    };
    let start = register(&label)?;
    let words: Vec<&str> =
        label.split([' ', ',', '#', '(', ')', '\t']).filter(|word| !word.is_empty()).collect();
    let (_, before) = words.split_last()?;
    let before: Vec<&str> = before
        .iter()
        .copied()
        .filter(|word| !["reg", "register"].contains(&word.to_ascii_lowercase().as_str()))
        .collect();
    let (number, kind) = match before[..] {
        [number] => (number, "slave"),
        [kind, number] => (number, kind),
        _ => return None,
    };
    let bytes = byte_list::read(bytes)?;
    Some(ReadValue { of: of(kind, number)?, start, bytes })
}

/// The address at the end of a label, `0x0300`.
fn register(label: &str) -> Option<u16> {
    let word = label.split_whitespace().next_back()?.trim_end_matches([',', ')']);
    let digits = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X"))?;
    (digits.len() >= 3).then(|| u16::from_str_radix(digits, 16).ok())?
}

fn of(kind: &str, number: &str) -> Option<ReadingSubject> {
    let value = match number.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).ok()?,
        None => number.parse().ok()?,
    };
    let number = u16::try_from(value).ok()?;
    match kind.to_ascii_lowercase().as_str() {
        "station" | "address" | "addr" => Some(ReadingSubject::Station(number)),
        _ if value >= FIRST_STATION => Some(ReadingSubject::Station(number)),
        "position" | "pos" => Some(ReadingSubject::Position(number)),
        "slave" | "subdevice" | "sub" | "device" | "dev" | "no" | "nr" | "box" => {
            Some(ReadingSubject::Number(number))
        }
        _ => None,
    }
}

/// Takes one round of readings: up to the first one that was made before.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let mut round = Round::default();
    let (mut at, mut others) = (0, Vec::new());
    while let Some(line) = lines.get(at) {
        if line.is_blank() {
            at += 1;
            continue;
        }
        let found = match command(&line.text) {
            Some(command) => {
                output(&command, &lines[at + 1..]).map(|(values, len)| (values, len + 1))
            }
            None => labelled(line.trimmed()).map(|value| (vec![value], 1)),
        };
        let Some((values, len)) = found else {
            // A command that printed nothing, and lines between readings.
            round.is_igh |= command(&line.text).is_some();
            if (round.end == 0 && !round.is_igh) || others.len() >= MOST_OTHERS {
                break;
            }
            others.push(line.no);
            at += 1;
            continue;
        };
        if !round.add(values) {
            break;
        }
        let is_shell = command(&line.text).is_some();
        round.is_igh |= is_shell;
        round.unused.append(&mut others);
        at += len;
        round.end = at;
    }
    round.block(lines)
}

/// The values that a command printed, and on how many lines.
fn output(command: &RegReadCommand, lines: &[Line<'_>]) -> Option<(Vec<ReadValue>, usize)> {
    let mut values = Vec::new();
    let (mut end, mut bytes) = (0, Vec::new());
    for (at, line) in lines.iter().enumerate().take(MOST_LINES) {
        if line.is_blank() {
            continue;
        }
        let of = match (&command.asked, values.len()) {
            (CommandTarget::One(of), 0) => *of,
            (CommandTarget::One(_), _) => break,
            (CommandTarget::Each(positions), done) => match positions.get(done) {
                Some(position) => ReadingSubject::Position(*position),
                None => break,
            },
            (CommandTarget::Counting, done) => ReadingSubject::Position(u16::try_from(done).ok()?),
        };
        let typed = command.kind.as_deref().and_then(|kind| typed(kind, line.trimmed()));
        let told = typed.clone().or_else(|| byte_list::read(line.trimmed()));
        // Some print a label of their own in a loop.
        let Some(told) = told else {
            let is_label = !matches!(command.asked, CommandTarget::One(_))
                && self::command(&line.text).is_none();
            if is_label && bytes.is_empty() && !super::is_prompt(line) {
                continue;
            }
            break;
        };
        bytes.extend(told);
        let size = if typed.is_some() { None } else { command.size };
        if size.is_some_and(|size| bytes.len() < size) {
            continue;
        }
        let bytes = std::mem::take(&mut bytes);
        values.push(ReadValue { of, start: command.start, bytes });
        end = at + 1;
    }
    (end > 0).then_some((values, end))
}

/// Readings of each register once.
#[derive(Default)]
struct Round {
    values: Vec<ReadValue>,
    end: usize,
    unused: Vec<usize>,
    is_igh: bool,
}

impl Round {
    /// Adds values; false, without them, when one of them is a second reading.
    fn add(&mut self, values: Vec<ReadValue>) -> bool {
        let is_known = |value: &ReadValue| {
            self.values.iter().any(|known| (known.of, known.start) == (value.of, value.start))
        };
        if values.iter().any(is_known) {
            return false;
        }
        self.values.extend(values);
        true
    }

    fn block(self, lines: &[Line<'_>]) -> Option<Block> {
        if self.values.is_empty() {
            return None;
        }
        let mut block = Block::new(Format::Registers);
        (block.lines, block.unused) = (self.end.min(lines.len()), self.unused);
        if self.is_igh {
            block.kind = Some(MainDeviceKind::Igh);
        }
        let counts_from_0 = self.values.iter().any(|value| value.of == ReadingSubject::Number(0));
        let mut whom_of: Vec<SubDeviceRef> = Vec::new();
        let mut reads: Vec<(SubDeviceFact, ReadDevice)> = Vec::new();
        for ReadValue { of, start, bytes } in self.values {
            let whom = of.whom(counts_from_0);
            let at = whom_of.iter().position(|known| *known == whom).unwrap_or_else(|| {
                whom_of.push(whom.clone());
                reads.push(Default::default());
                reads.len() - 1
            });
            let (about, read) = &mut reads[at];
            about.open = about.open.or_else(|| register_values::open_ports(start, &bytes));
            if let ReadingSubject::Station(station) = of {
                about.station = Some(station);
            }
            register_values::fill(read, start, &bytes);
        }
        let kind = if self.is_igh { "`ethercat reg_read`" } else { "registers" };
        block.what = format!("{kind} of {}", so_many(whom_of.len(), "SubDevice"));
        for (whom, (about, read)) in whom_of.into_iter().zip(reads) {
            block.tell(FactKind::SubDeviceFact(whom.clone(), Box::new(about)));
            block.tell(FactKind::Read(whom, Box::new(read)));
        }
        Some(block)
    }
}

#[cfg(test)]
mod tests;
