//! Pasted texts: output of other tools, one or several in a file, read as one observation.
//!
//! Each format has a file that takes its lines off the front of the text, as far as they go, and says what
//! they tell as facts ([`fact`]). [`gather`] puts the facts of all blocks together to an observation file: SubDevices
//! by position, station address or name, times on one scale, wiring as told or as assumed. Nothing is taken
//! for 0 that is not told.

mod byte_list;
mod ethtool;
mod fact;
mod gather;
mod igh_domains;
mod igh_master;
mod igh_slaves;
mod kernel_log;
mod kickcat_counters;
mod register_values;
mod registers;
mod soem_slaveinfo;
mod stamp;
mod state_word;
mod text;
mod twincat_messages;
mod twincat_online;
mod wiring;

use fact::Block;
use serde::{Deserialize, Serialize};
use text::Line;

pub use text::decode;

use crate::observation_file::ObservationFile;

/// A pasted text that was read.
#[derive(Clone, Debug)]
pub struct Pasted {
    /// All of it as one observation.
    pub file: ObservationFile,
    /// What was understood, and what not.
    pub understood: Understood,
}

/// What was understood of a pasted text, and what not.
#[derive(Clone, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Understood {
    /// What was understood, in the order of the text.
    pub blocks: Vec<UnderstoodBlock>,
    /// Lines that were not understood, at most [`LINES_KEPT`](Self::LINES_KEPT).
    pub ignored: Vec<IgnoredLine>,
    /// How many there are.
    pub ignored_count: usize,
    /// What was assumed, since the text does not say it.
    pub assumed: Vec<String>,
}

/// A stretch of text that was understood.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct UnderstoodBlock {
    /// What it is.
    pub what: String,
    /// Its first line, from 1.
    pub from: usize,
    /// Its last line.
    pub to: usize,
}

/// A line that was not understood.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct IgnoredLine {
    /// Its number, from 1.
    pub line: usize,
    /// What it says; the begin of it, where it is long.
    pub text: String,
}

impl Understood {
    /// So many lines that were not understood are kept.
    pub const LINES_KEPT: usize = 100;
    /// So much of each.
    const TEXT_KEPT: usize = 120;

    fn ignore(&mut self, line: &Line<'_>) {
        self.ignored_count += 1;
        if self.ignored.len() < Self::LINES_KEPT {
            let shown = |one: char| if one.is_control() { '\u{fffd}' } else { one };
            let text = line.trimmed().chars().map(shown).take(Self::TEXT_KEPT).collect();
            self.ignored.push(IgnoredLine { line: line.no, text });
        }
    }
}

/// The formats that are taken, with how each begins.
pub const FORMATS: &[(&str, &str)] = &[
    ("`ethercat slaves -v`", "=== Master 0, Slave 0 ==="),
    ("`ethercat slaves`", "0  0:0  PREOP  +  EK1100 EtherCAT-Koppler"),
    ("`ethercat master`", "Master0 / Phase: Operation"),
    ("`ethercat domains`", "Domain0: LogBaseAddr 0x00000000, Size 6, WorkingCounter 0/1"),
    ("kernel log of IgH EtherCAT", "[ 12.5] EtherCAT 0: Domain 0: Working counter changed to 2/3."),
    ("`ethercat reg_read`", "$ ethercat reg_read -p 0 0x0300 20 / 0x00 0x00 …"),
    ("registers", "slave 1 0x0300: 00 00 …"),
    ("KickCAT error counters", "slave 1 / Port 0 / invalid frame: 0"),
    ("SOEM `slaveinfo`", "3 slaves found and configured. / Slave:1"),
    ("`ethtool -S`", "NIC statistics: / rx_crc_errors: 0"),
    ("TwinCAT Online list", "1;1001;Term 1 (EK1100);OP;0, 15"),
    ("TwinCAT messages", "'Term 3 (EL4102)' (1003): abnormal state change (from 'OP' to 'SAFEOP')"),
    ("TwinCAT emergencies", "Timestamp;Device;Code / 20.11.2026 10:00:00;Term 3 (EL4102);0x8611"),
];

/// Nothing of a text was understood.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "nothing in these {lines} lines was understood{first}. Taken are, one or several after each other, an observation \
     file in TOML or what these print: {formats}", formats = format_list()
)]
pub struct NothingUnderstood {
    /// How many lines there are.
    pub lines: usize,
    first: String,
}

fn format_list() -> String {
    let all: Vec<String> =
        FORMATS.iter().map(|(name, begin)| format!("{name} (such as: {begin})")).collect();
    all.join("; ")
}

type Take = fn(&[Line<'_>]) -> Option<Block>;

/// The formats in the order in which they are tried: those with the clearest beginning first.
const TAKES: &[Take] = &[
    igh_slaves::take,
    igh_slaves::take_list,
    igh_master::take,
    igh_domains::take,
    registers::take,
    kickcat_counters::take,
    soem_slaveinfo::take,
    ethtool::take,
    kernel_log::take,
    twincat_messages::take_table,
    twincat_messages::take,
    twincat_online::take,
    twincat_online::take_frames,
];

/// Reads a pasted text.
///
/// # Errors
/// [`NothingUnderstood`] when no line is of a known format.
pub fn read(text: &str) -> Result<Pasted, NothingUnderstood> {
    let lines = text::lines(text);
    let mut understood = Understood::default();
    let mut blocks: Vec<Block> = Vec::new();
    let mut at = 0;
    while let Some(line) = lines.get(at) {
        if line.is_blank() || (is_prompt(line) && !registers::is_command(line)) {
            at += 1;
            continue;
        }
        let Some(mut block) = TAKES.iter().find_map(|take| take(&lines[at..])) else {
            // None of a whole run of kernel messages would be taken.
            let run = kernel_log::foreign(&lines[at..]).max(1);
            let run = &lines[at..at + run];
            run.iter().filter(|line| !line.is_blank()).for_each(|line| understood.ignore(line));
            at += run.len();
            continue;
        };
        let taken = &lines[at..at + block.lines.clamp(1, lines.len() - at)];
        for unused in taken.iter().filter(|line| block.unused.contains(&line.no)) {
            understood.ignore(unused);
        }
        let last = taken.iter().rev().find(|line| !line.is_blank());
        block.from = line.no;
        block.to = last.map_or(line.no, |last| last.no);
        block.shell = at
            .checked_sub(1)
            .and_then(|before| lines.get(before))
            .map(|line| line.text.to_string());
        at += taken.len();
        blocks.push(block);
    }
    if blocks.is_empty() {
        let first = understood.ignored.first().map_or(String::new(), |line| {
            format!(", from line {} (\"{}\") on", line.line, line.text)
        });
        return Err(NothingUnderstood { lines: lines.len(), first });
    }
    let (file, assumed) = gather::gather(&blocks, &mut understood);
    understood.assumed = assumed;
    understood.ignored.sort_by_key(|line| line.line);
    Ok(Pasted { file, understood })
}

/// Whether a line is a command that somebody typed to get the text.
fn is_prompt(line: &Line<'_>) -> bool {
    const TOOLS: [&str; 8] =
        ["ethercat ", "ethtool ", "dmesg", "journalctl", "slaveinfo", "sudo ", "cat ", "tail "];
    let text = line.trimmed();
    let has_sign = text.starts_with(['$', '#', '>', '%'])
        || text.contains("$ ")
        || text.contains("# ")
        || text.starts_with("PS ");
    let names_tool = TOOLS.iter().any(|tool| text.contains(tool.trim_end()));
    let begins_with_tool = TOOLS.iter().any(|tool| text.starts_with(tool));
    (has_sign && names_tool) || (begins_with_tool && text.len() < 80 && !text.contains(':'))
}

#[cfg(test)]
mod tests;
