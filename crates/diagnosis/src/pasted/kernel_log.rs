//! Lines of the IgH EtherCAT Master in a kernel log: links, SubDevices that answer, states, AL status codes,
//! working counters, datagrams that did not come back.
//!
//! Reference: the master's messages, `EtherCAT ERROR 0-3: …` with the index of the master and the position of the
//! SubDevice. What comes while it starts (it scans, a link comes up, process data fill) is not counted.

mod message;

use self::message::{Start, of_device, of_master};
use super::fact::{Block, Fact, FactKind, Format, SubDeviceRef};
use super::stamp::{Stamp, at_begin};
use super::text::{Line, leading_number, so_many};
use crate::observation_file::{ObservedMainDevice, ReadDevice};

/// What comes so soon after a start belongs to it, in seconds.
const START_S: f64 = 1.5;
/// The same in lines, where no times are given.
const START_LINES: usize = 4;

/// A line of the log.
struct KernelEntry<'l> {
    stamp: Option<Stamp>,
    from: MessageSource,
    text: &'l str,
}

/// Whose line it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum MessageSource {
    /// The master, by its index.
    Master(u64),
    /// A SubDevice of a master, by its position.
    Device(u64, u16),
    /// The module, which serves all masters.
    Module,
    /// The driver of a network card.
    Card,
    /// Another part of the kernel.
    Other,
}

fn entry<'l>(line: &'l Line<'_>) -> Option<KernelEntry<'l>> {
    let (stamp, rest) = at_begin(&line.text);
    // Between time and message stand host and program.
    let found = rest.match_indices("EtherCAT").find_map(|(at, _)| sender(&rest[at..]));
    let (from, text) = match found {
        Some(found) => found,
        None if is_link_of_card(rest) => (MessageSource::Card, rest),
        None if matches!(stamp, Some(Stamp::Uptime(_)))
            || (stamp.is_some() && rest.contains(" kernel:")) =>
        {
            (MessageSource::Other, rest)
        }
        None => return None,
    };
    Some(KernelEntry { stamp, from, text: text.trim() })
}

/// `EtherCAT ERROR 0-3: …`, `EtherCAT WARNING 0: …`, `EtherCAT 0-main-3: …`, `EtherCAT: …`.
fn sender(text: &str) -> Option<(MessageSource, &str)> {
    let rest = text.strip_prefix("EtherCAT")?;
    let (head, message) = rest.split_once(':')?;
    let head = head.trim();
    let head = ["ERROR", "WARNING", "DEBUG"]
        .into_iter()
        .find_map(|level| head.strip_prefix(level))
        .unwrap_or(head)
        .trim();
    if head.is_empty() {
        return Some((MessageSource::Module, message));
    }
    let mut parts = head.split('-');
    let master = parts.next()?.trim().parse().ok()?;
    let position = parts.map(str::trim).find(|part| !["main", "backup"].contains(part));
    let from = match position {
        None => MessageSource::Master(master),
        Some(position) => MessageSource::Device(master, position.parse().ok()?),
    };
    Some((from, message))
}

/// `igb 0000:02:00.0 eth0: igb: eth0 NIC Link is Down`.
fn is_link_of_card(text: &str) -> bool {
    ["Link is Up", "Link is Down", "link becomes ready", "link down"]
        .iter()
        .any(|one| text.contains(one))
}

/// Takes all lines of the log in a row.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    // A log that begins elsewhere in the kernel is one where it comes to EtherCAT.
    if entry(lines.first()?)?.from == MessageSource::Other && foreign(lines) > 0 {
        return None;
    }
    let mut block = Block::new(Format::KernelLog);
    let (end, unused) = super::fact::extent(lines, |line| entry(line).is_some());
    (block.lines, block.unused) = (end, unused);
    let entries: Vec<KernelEntry<'_>> = lines[..end].iter().filter_map(entry).collect();
    let mut reader = LogReader::of(&entries);
    for (at, entry) in entries.iter().enumerate() {
        reader.read(at, entry);
    }
    let of_others = entries.iter().filter(|one| reader.is_of_another(one.from)).count();
    let others = entries.iter().filter(|one| matches!(one.from, MessageSource::Other)).count();
    let mut what = "kernel log of the IgH EtherCAT Master".to_owned();
    let aside = [
        (others, "line", "not of EtherCAT"),
        (of_others, "line", "of another master"),
        (reader.starts, "count", "of a start"),
    ];
    let aside: Vec<String> = aside
        .iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, what, of)| format!("{} {of}", so_many(*count, what)))
        .collect();
    if !aside.is_empty() {
        what += &format!(" (left aside: {})", aside.join(", "));
    }
    block.what = what;
    block.facts = reader.done();
    Some(block)
}

/// How many lines of other parts of the kernel stand at the begin, where nothing of EtherCAT follows them in the same
/// log.
pub(super) fn foreign(lines: &[Line<'_>]) -> usize {
    let mut count = 0;
    for line in lines {
        match entry(line).map(|entry| entry.from) {
            Some(MessageSource::Other | MessageSource::Card) => count += 1,
            Some(MessageSource::Master(_) | MessageSource::Device(..) | MessageSource::Module) => {
                return 0;
            }
            None if line.is_blank() => count += 1,
            None => break,
        }
    }
    count
}

struct LogReader<'e> {
    entries: &'e [KernelEntry<'e>],
    master: Option<u64>,
    facts: Vec<Fact>,
    /// The latest line that tells of a start, and where it stood.
    start: Option<(usize, Option<Stamp>)>,
    /// How many counts were of a start.
    starts: usize,
    /// Whether the line has been at work.
    was_up: bool,
    /// Whether a link that came up follows at all.
    comes_up: bool,
    domains: message::Domains,
    /// The request that was refused last, until its code comes.
    refused: Option<(u16, u16, u8)>,
}

impl<'e> LogReader<'e> {
    fn of(entries: &'e [KernelEntry<'e>]) -> Self {
        let master = entries.iter().find_map(|one| match one.from {
            MessageSource::Master(master) | MessageSource::Device(master, _) => Some(master),
            MessageSource::Module | MessageSource::Card | MessageSource::Other => None,
        });
        let mut reader = Self {
            entries,
            master,
            facts: Vec::new(),
            start: None,
            starts: 0,
            was_up: false,
            comes_up: entries.iter().any(|one| message::link(one.text) == Some(true)),
            domains: message::Domains::default(),
            refused: None,
        };
        // From here on counts begin at 0.
        if let Some(first) = entries.first() {
            let nothing = FactKind::Added(Box::default());
            reader.facts.push(Fact { stamp: first.stamp, what: nothing });
        }
        reader
    }

    fn is_of_another(&self, from: MessageSource) -> bool {
        match from {
            MessageSource::Master(master) | MessageSource::Device(master, _) => {
                Some(master) != self.master
            }
            MessageSource::Module | MessageSource::Card | MessageSource::Other => false,
        }
    }

    fn tell(&mut self, stamp: Option<Stamp>, what: FactKind) {
        self.facts.push(Fact { stamp, what });
    }

    /// Whether a line comes shortly after a start.
    fn is_start(&self, at: usize, stamp: Option<Stamp>) -> bool {
        let Some((begun, since)) = self.start else { return false };
        match stamp.zip(since).and_then(|(now, since)| now.since(since)) {
            Some(seconds) => (0.0..=START_S).contains(&seconds),
            None => at - begun <= START_LINES,
        }
    }

    fn read(&mut self, at: usize, entry: &KernelEntry<'_>) {
        if self.is_of_another(entry.from) {
            return;
        }
        match entry.from {
            MessageSource::Master(_) | MessageSource::Module | MessageSource::Card => {
                self.read_master(at, entry)
            }
            MessageSource::Device(_, position) => self.read_device(position, entry),
            MessageSource::Other => {}
        }
    }

    fn read_master(&mut self, at: usize, entry: &KernelEntry<'_>) {
        let stamp = entry.stamp;
        if let Some(up) = message::link(entry.text) {
            if up {
                self.start = Some((at, stamp));
            }
            // A link that is down before the line was ever up is on its way up.
            let is_first = !up && !self.was_up && self.comes_up;
            if !is_first {
                let main = ObservedMainDevice { link: Some(up), ..ObservedMainDevice::default() };
                self.tell(stamp, FactKind::Main(Box::new(main)));
            }
            self.was_up |= up;
            return;
        }
        if let Some((domain, received, expected)) = message::domain(entry.text) {
            self.domains.note(domain, received, expected, stamp);
            return;
        }
        let Some(told) = of_master(entry.text) else { return };
        if told.start == Start::Begins {
            self.start = Some((at, stamp));
        }
        let is_count = told.is_count();
        if is_count && self.is_start(at, stamp) {
            self.starts += 1;
            return;
        }
        self.was_up |= told.main.answering.is_some_and(|count| count > 0);
        match is_count {
            true => self.tell(stamp, FactKind::Added(Box::new(told.main))),
            false if told.tells() => self.tell(stamp, FactKind::Main(Box::new(told.main))),
            false => {}
        }
    }

    fn read_device(&mut self, position: u16, entry: &KernelEntry<'_>) {
        let whom = SubDeviceRef::Position(position);
        if let Some((index, subindex)) = message::refused_request(entry.text) {
            self.refused = Some((position, index, subindex));
            return;
        }
        if let Some(code) = message::abort_code(entry.text) {
            if let Some((of, index, subindex)) =
                self.refused.take().filter(|(of, ..)| *of == position)
            {
                let whom = SubDeviceRef::Position(of);
                self.tell(entry.stamp, FactKind::Abort { whom, index, subindex, code });
            }
            return;
        }
        let read = of_device(entry.text);
        if read != ReadDevice::default() {
            self.tell(entry.stamp, FactKind::Read(whom, Box::new(read)));
        }
    }

    fn done(mut self) -> Vec<Fact> {
        let last = self.entries.last().and_then(|entry| entry.stamp);
        self.facts.extend(self.domains.facts(last));
        self.facts
    }
}

/// The number at the begin of a message, and what is counted.
fn counted(text: &str) -> Option<(u64, &str)> {
    let (count, rest) = leading_number(text)?;
    Some((count, rest.trim()))
}

#[cfg(test)]
mod tests;
