//! The Online list of TwinCAT, as text or CSV: states and errors of all SubDevices, registers as columns, and the
//! frames beneath it.
//!
//! Reference: `No`, `Addr`, `Name`, `State`, `CRC` (errors of each port, added up since the start, as many as the
//! device has ports), `Changes` (states left unasked, times it was gone, the latter from 1), `Reg:0300` (words).

use linesman_proto::port::Port;

use super::fact::{Block, FactKind, Format, SubDeviceFact, SubDeviceRef, extent};
use super::register_values;
use super::state_word::{self, StateWord};
use super::text::{Line, cells, count, leading_number, port, so_many, type_in, value_of};
use crate::observation_file::{Count, ObservedMainDevice, ReadDevice, ReadPort};

/// What a column holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum OnlineColumn {
    No,
    Address,
    Name,
    State,
    Crc,
    Changes,
    Register(u16),
    /// Damaged frames of one port.
    PortCrc(Port),
    Other,
}

fn column(title: &str) -> OnlineColumn {
    let title = title.trim().trim_matches(['>', '<', '\'']).trim();
    let lower = title.to_ascii_lowercase();
    match lower.as_str() {
        "no" | "no." | "nr" | "nr." | "number" | "#" | "pos" | "position" => {
            return OnlineColumn::No;
        }
        "addr" | "addr." | "address" | "adresse" | "ethercat addr" | "ethercat address" => {
            return OnlineColumn::Address;
        }
        "name" | "box name" | "device" | "device name" | "slave" | "subdevice" => {
            return OnlineColumn::Name;
        }
        "state" | "status" | "online" | "zustand" => return OnlineColumn::State,
        "crc" | "crc errors" | "crc error" => return OnlineColumn::Crc,
        "changes" => return OnlineColumn::Changes,
        _ => {}
    }
    if let Some(of) = lower.strip_prefix("crc port").or_else(|| lower.strip_prefix("crc ")) {
        return port(of.trim()).map_or(OnlineColumn::Other, OnlineColumn::PortCrc);
    }
    let digits = lower.strip_prefix("reg").unwrap_or(&lower).trim_start_matches([':', '.', ' ']);
    let digits = digits.strip_prefix("0x").unwrap_or(digits);
    let digits = digits.get(..4).unwrap_or("");
    match u16::from_str_radix(digits, 16) {
        Ok(register) if register < 0x1000 && lower.contains(digits) => {
            OnlineColumn::Register(register)
        }
        Ok(_) | Err(_) => OnlineColumn::Other,
    }
}

/// The columns of a table, where a line is its header.
fn header(line: &str) -> Option<Vec<OnlineColumn>> {
    let titles = match cells(line) {
        // Words of a header may stand a blank apart.
        titles if titles.len() < 3 => line.split_whitespace().map(str::to_owned).collect(),
        titles => titles,
    };
    let mut columns: Vec<OnlineColumn> = titles.iter().map(|title| column(title)).collect();
    let has = |wanted: OnlineColumn| columns.contains(&wanted);
    let counts = columns
        .iter()
        .filter(|one| matches!(one, OnlineColumn::Register(_) | OnlineColumn::PortCrc(_)))
        .count();
    let is_list = has(OnlineColumn::Name)
        && has(OnlineColumn::State)
        && (has(OnlineColumn::No) || has(OnlineColumn::Address));
    if !is_list && counts < 2 {
        return None;
    }
    // A table of registers has no title above the names.
    if !has(OnlineColumn::Name) && titles.first().is_some_and(String::is_empty) {
        columns[0] = OnlineColumn::Name;
    } else if !is_list && !has(OnlineColumn::Name) && !has(OnlineColumn::No) {
        columns.insert(0, OnlineColumn::Name);
    }
    Some(columns)
}

/// A row of the list.
#[derive(Clone, PartialEq, Default, Debug)]
struct OnlineRow {
    no: Option<u16>,
    address: Option<u16>,
    name: String,
    state: Option<StateWord>,
    crc: Vec<u64>,
    changes: Option<(u64, u64)>,
    ports: Vec<(Port, ReadPort)>,
    registers: Vec<(u16, u16)>,
    /// Whether a cell of it was not understood.
    is_partial: bool,
}

/// `SubDevice 12` or `slave 12`, in tables that have no other name.
fn number_in(name: &str) -> Option<u16> {
    let lower = name.trim().to_ascii_lowercase();
    let rest =
        ["slave", "subdevice", "box", "device"].iter().find_map(|word| lower.strip_prefix(word))?;
    rest.trim().parse().ok()
}

fn row_by(columns: &[OnlineColumn], line: &str) -> Option<OnlineRow> {
    let cells = cells(line);
    if cells.len() < 2 {
        return None;
    }
    let mut row = OnlineRow::default();
    let mut cells = cells.into_iter();
    let mut has_value = false;
    for (at, column) in columns.iter().enumerate() {
        let Some(cell) = cells.next() else { break };
        match column {
            OnlineColumn::No => row.no = cell.parse().ok(),
            OnlineColumn::Address => {
                row.address = count(&cell).and_then(|value| u16::try_from(value).ok())
            }
            OnlineColumn::Name => row.name = cell,
            OnlineColumn::State => {
                row.state = state_word::read(&cell);
                row.is_partial |= row.state.is_none() && !cell.is_empty();
                has_value |= row.state.is_some();
            }
            OnlineColumn::Crc => {
                // Commas part ports, and in a list with commas cells, too.
                let is_last = at + 1 == columns.len();
                let rest: Vec<String> = if is_last { cells.by_ref().collect() } else { Vec::new() };
                let whole = std::iter::once(cell).chain(rest).collect::<Vec<_>>().join(",");
                match crc(&whole) {
                    Some((counts, is_whole)) => {
                        (row.crc, row.is_partial) = (counts, row.is_partial | !is_whole)
                    }
                    None => row.is_partial |= !whole.trim_matches([',', '-', ' ']).is_empty(),
                }
            }
            OnlineColumn::Changes => row.changes = changes(&cell),
            OnlineColumn::Register(register) => {
                let value = count(&cell).and_then(|value| u16::try_from(value).ok());
                row.registers.extend(value.map(|value| (*register, value)));
                has_value |= value.is_some();
            }
            OnlineColumn::PortCrc(port) => {
                let read = count(&cell)
                    .map(|frames| ReadPort { frame: Some(Count(frames)), ..ReadPort::default() });
                has_value |= read.is_some();
                row.ports.extend(read.map(|read| (*port, read)));
            }
            OnlineColumn::Other => {}
        }
    }
    row.no = row.no.or_else(|| number_in(&row.name));
    let is_named = row.no.is_some() || row.address.is_some() || !row.name.is_empty();
    (is_named && has_value).then_some(row)
}

/// A row without a header: number, address, name, state, errors, a blank or more apart.
fn plain_row(line: &str) -> Option<OnlineRow> {
    let cells = cells(line);
    let words: Vec<&str> = match cells.len() {
        4.. => {
            let columns = [
                OnlineColumn::No,
                OnlineColumn::Address,
                OnlineColumn::Name,
                OnlineColumn::State,
                OnlineColumn::Crc,
            ];
            let row = row_by(&columns, line)?;
            let is_row = row.no.is_some() && row.address.is_some() && !row.name.is_empty();
            return (is_row && row.state.is_some()).then_some(row);
        }
        _ => line.split_whitespace().collect(),
    };
    let [no, address, rest @ ..] = &words[..] else { return None };
    let (no, address) = (no.parse().ok()?, address.parse().ok()?);
    const STATES: [&str; 10] =
        ["ERR", "INIT", "PREOP", "PRE-OP", "SAFEOP", "SAFE-OP", "OP", "BOOT", "LNK_MIS", "LNK"];
    let at = rest
        .iter()
        .skip(1)
        .position(|word| STATES.contains(&word.to_ascii_uppercase().as_str()))?
        + 1;
    // The state goes on as far as its words are known.
    let (end, state) = (at + 1..=rest.len())
        .rev()
        .find_map(|end| Some((end, state_word::read(&rest[at..end].join(" "))?)))?;
    let (crc, is_whole) = crc(&rest[end..].join(" ")).unwrap_or_default();
    Some(OnlineRow {
        no: Some(no),
        address: Some(address),
        name: rest[..at].join(" "),
        state: Some(state),
        is_partial: !is_whole && end < rest.len(),
        crc,
        ..OnlineRow::default()
    })
}

/// `0, 15 (18), 0`: one count for each port. A second count in brackets, of which nobody says what it is, makes
/// the row one that is not understood in whole.
fn crc(text: &str) -> Option<(Vec<u64>, bool)> {
    let parts: Vec<&str> = match text.contains(',') {
        true => text.split(',').map(str::trim).filter(|part| !part.is_empty()).collect(),
        // Some lists part them by a point.
        false if text.matches('.').count() == 1 => text.split('.').map(str::trim).collect(),
        false => vec![text.trim()],
    };
    let counts: Option<Vec<u64>> = parts.iter().map(|part| count(part)).collect();
    Some((counts.filter(|counts| (1..=4).contains(&counts.len()))?, !text.contains('(')))
}

/// `0, 1`: states left unasked, and times it was there.
fn changes(text: &str) -> Option<(u64, u64)> {
    let (states, present) = text.split_once([',', '.', '/'])?;
    Some((count(states)?, count(present)?))
}

/// The ports of a device in the order in which the list counts them.
fn ports_of(type_name: Option<&str>, entries: usize) -> &'static [Port] {
    // These have no port B.
    const WITHOUT_B: [&str; 3] = ["EK1121", "EK1521", "EK1561"];
    let lacks_b = type_name.is_some_and(|name| WITHOUT_B.iter().any(|one| name.starts_with(one)));
    if lacks_b && entries > 1 { &[Port::A, Port::C, Port::D] } else { &Port::ALL }
}

/// Takes a list with or without a header.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let first = lines.first()?;
    let columns = header(&first.text);
    let read = |text: &str| match &columns {
        Some(columns) => row_by(columns, text),
        None => plain_row(text),
    };
    let mut block = Block::new(Format::Online);
    let begin = usize::from(columns.is_some());
    let mut last: Option<u16> = None;
    let (end, unused) = extent(&lines[begin..], |line| {
        let Some(row) = read(&line.text) else { return false };
        // Numbers rise; a second list begins anew.
        let is_next = row.no.is_none() || row.no > last;
        if is_next {
            last = row.no.or(last);
        }
        is_next
    });
    if end == 0 {
        return None;
    }
    (block.lines, block.unused) = (begin + end, unused);
    let mut counted = 0;
    for line in &lines[begin..begin + end] {
        let Some(row) = read(&line.text) else { continue };
        counted += 1;
        if row.is_partial {
            block.unused.push(line.no);
        }
        tell(&mut block, row);
    }
    let kind = if columns
        .iter()
        .flatten()
        .any(|one| matches!(one, OnlineColumn::Register(_) | OnlineColumn::PortCrc(_)))
    {
        "list of registers"
    } else {
        "TwinCAT Online list"
    };
    block.what = format!("{kind} of {}", so_many(counted, "SubDevice"));
    Some(block)
}

fn tell(block: &mut Block, row: OnlineRow) {
    let whom = match (row.no, row.address) {
        (Some(no @ 1..), _) => SubDeviceRef::Position(no - 1),
        (_, Some(address)) => SubDeviceRef::Named(row.name.clone(), Some(address)),
        (Some(_) | None, None) => SubDeviceRef::Named(row.name.clone(), None),
    };
    let type_name = type_in(&row.name);
    let mut read = ReadDevice::default();
    let is_generic = number_in(&row.name).is_some() || row.name.is_empty();
    let about = SubDeviceFact {
        name: Some(row.name.clone()).filter(|_| !is_generic),
        type_name: type_name.map(str::to_owned),
        station: row.address.filter(|address| *address > 255),
        ..SubDeviceFact::default()
    };
    if let Some(state) = row.state {
        read.state = state.state;
        for port in state.missing {
            read.port_mut(port).link = Some(false);
        }
    }
    for (port, frames) in ports_of(type_name, row.crc.len()).iter().zip(&row.crc) {
        let into = read.port_mut(*port);
        (into.frame, into.total) = (Some(Count(*frames)), true);
    }
    for (port, told) in row.ports {
        *read.port_mut(port) = told;
    }
    for (address, word) in &row.registers {
        register_values::fill(&mut read, *address, &word.to_le_bytes());
    }
    if let Some((states, present)) = row.changes {
        read.state_changes = Some(Count(states));
        // The first time it was there is none at which it was gone.
        read.absences = Some(Count(present.saturating_sub(1)));
    }
    block.tell(FactKind::SubDeviceFact(whom.clone(), Box::new(about)));
    block.tell(FactKind::Read(whom, Box::new(read)));
}

/// A row of the frames beneath the list.
enum FrameRow {
    Sent(u64),
    Lost(u64),
    Errors { sent: u64, received: u64 },
    Other,
}

fn frame_row(line: &str) -> Option<FrameRow> {
    let text = line.trim().replace('\t', " ");
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let row = |name: &str| {
        let at = text.to_ascii_lowercase().find(name)?;
        Some(text[at + name.len()..].trim_start_matches([':', ';', ' ']).to_owned())
    };
    let sum = |rest: String| -> Option<u64> {
        let parts = rest.split(['+', ';']).map(str::trim).filter(|part| !part.is_empty());
        parts.map(count).try_fold(0_u64, |sum, part| Some(sum.saturating_add(part?)))
    };
    if let Some(rest) = row("send frames") {
        return Some(FrameRow::Sent(sum(rest)?));
    }
    if let Some(rest) = row("lost frames") {
        return Some(FrameRow::Lost(sum(rest)?));
    }
    if let Some(rest) = row("tx/rx errors") {
        let (sent, received) = rest.split_once('/')?;
        let clean = |text: &str| count(text.trim_matches([';', ' ']));
        return Some(FrameRow::Errors { sent: clean(sent)?, received: clean(received)? });
    }
    let starts = |begin: &str| text.to_ascii_lowercase().starts_with(begin);
    let is_state =
        value_of(&text, "Actual State").is_some() || value_of(&text, "Counter").is_some();
    let is_other =
        is_state || starts("counter ") || text.to_ascii_lowercase().contains("frames / sec");
    let is_buttons = starts("init pre-op")
        || starts("clear crc")
        || starts("save online")
        || starts("delete online");
    (is_other || is_buttons).then_some(FrameRow::Other)
}

/// Takes the counters of frames beneath the list.
pub(super) fn take_frames(lines: &[Line<'_>]) -> Option<Block> {
    frame_row(&lines.first()?.text)?;
    let mut block = Block::new(Format::Frames);
    let mut sent = 0;
    (block.lines, block.unused) = extent(lines, |line| {
        let row = frame_row(&line.text);
        sent += usize::from(matches!(row, Some(FrameRow::Sent(_))));
        row.is_some() && sent <= 1
    });
    let mut main = ObservedMainDevice::default();
    for line in &lines[..block.lines] {
        match frame_row(&line.text) {
            Some(FrameRow::Sent(count)) => main.sent = Some(Count(count)),
            Some(FrameRow::Lost(count)) => main.lost = Some(Count(count)),
            Some(FrameRow::Errors { sent, received }) => {
                (main.send_errors, main.crc) = (Some(Count(sent)), Some(Count(received)));
            }
            Some(FrameRow::Other) | None => {}
        }
    }
    if main == ObservedMainDevice::default() {
        return None;
    }
    block.what = "TwinCAT counters of frames".to_owned();
    block.tell(FactKind::Main(Box::new(main)));
    Some(block)
}

/// The number of an address such as `(1005)`.
pub(super) fn address_in(text: &str) -> Option<u16> {
    let (number, _) = leading_number(text.trim().trim_start_matches('('))?;
    u16::try_from(number).ok()
}

#[cfg(test)]
mod tests;
