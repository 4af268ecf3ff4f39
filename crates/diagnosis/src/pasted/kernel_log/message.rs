//! Single messages of the IgH EtherCAT Master.

use std::collections::BTreeMap;

use super::super::fact::{Fact, FactKind};
use super::super::igh_domains::working_counter;
use super::super::stamp::Stamp;
use super::super::state_word;
use super::super::text::{between, hex, leading_number};
use super::counted;
use crate::observation_file::{
    Count, ObservedMainDevice, ObservedWorkingCounter, ReadDevice, Word,
};

/// Whether a message is of a start.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) enum Start {
    /// It begins one.
    Begins,
    /// It has nothing to do with one.
    #[default]
    No,
}

/// What a message of the master tells.
#[derive(Default, Debug)]
pub(super) struct LogEvent {
    pub(super) main: ObservedMainDevice,
    pub(super) start: Start,
}

impl LogEvent {
    /// Whether it counts what happened since the last such message.
    pub(super) const fn is_count(&self) -> bool {
        self.main.timed_out.is_some()
            || self.main.unmatched.is_some()
            || self.main.skipped.is_some()
            || self.main.corrupted.is_some()
    }

    /// Whether it tells anything but a start.
    pub(super) fn tells(&self) -> bool {
        self.main != ObservedMainDevice::default()
    }
}

/// `Link state of ecm0 changed to DOWN.`, or the line of a card's driver.
pub(super) fn link(text: &str) -> Option<bool> {
    let text = text.trim_end_matches('.');
    if let Some((_, state)) =
        text.split_once("Link state of ").and_then(|(_, rest)| rest.split_once("changed to "))
    {
        return match state.trim() {
            "UP" => Some(true),
            "DOWN" => Some(false),
            _ => None,
        };
    }
    if text.contains("Link is Down") || text.ends_with("link down") {
        return Some(false);
    }
    text.contains("Link is Up").then_some(true)
}

/// `Domain 0: Working counter changed to 7/9.`, `Domain 0: 3 working counter changes - now 9/9.`, and what is
/// expected when a domain is set up.
pub(super) fn domain(text: &str) -> Option<(u64, Option<u16>, u16)> {
    let rest = text.strip_prefix("Domain")?.trim_start();
    let (index, rest) = leading_number(rest)?;
    let rest = rest.strip_prefix(':')?.trim();
    if let Some((_, expected)) = rest.split_once("expected working counter ") {
        let (expected, _) = leading_number(expected)?;
        return Some((index, None, u16::try_from(expected).ok()?));
    }
    let (_, counter) = rest.split_once("changed to ").or_else(|| rest.split_once("- now "))?;
    let (received, expected) = working_counter(counter)?;
    Some((index, Some(received), expected))
}

/// A message of the master itself.
pub(super) fn of_master(text: &str) -> Option<LogEvent> {
    let mut told = LogEvent::default();
    const STARTS: [&str; 9] = [
        "Scanning bus",
        "Bus scanning completed",
        "Requesting master",
        "Starting EtherCAT-",
        "Master thread exited",
        "Releasing main device",
        "Releasing master",
        "Stopping",
        "Master driver",
    ];
    if STARTS.iter().any(|start| text.contains(start)) {
        told.start = Start::Begins;
        return Some(told);
    }
    // `Domain 0: Redundant link in use!`, `Domain 0: Redundant link unused again.`
    if text.contains("Redundant link ") {
        told.main.ring_open = Some(text.contains("in use"));
        return Some(told);
    }
    // `Datagram ffff8881 (main-0) was SKIPPED 3 times.`
    if let Some((_, rest)) = text.split_once("was SKIPPED ") {
        told.main.skipped = leading_number(rest).map(|(count, _)| Count(count));
        return Some(told);
    }
    if let Some(states) =
        text.split_once("Slave states on ").and_then(|(_, rest)| rest.split_once(": "))
    {
        if text.contains("main") {
            told.main.states = states_of(states.1);
        }
        return Some(told);
    }
    let (count, what) = counted(text)?;
    let slot = if what.contains("TIMED OUT") {
        &mut told.main.timed_out
    } else if what.contains("UNMATCHED") {
        &mut told.main.unmatched
    } else if what.contains("CORRUPTED") {
        &mut told.main.corrupted
    } else if what.starts_with("slave(s) responding on main") {
        told.main.answering = u16::try_from(count).ok();
        return Some(told);
    } else {
        return None;
    };
    *slot = Some(Count(count));
    Some(told)
}

/// `INIT, PREOP + ERROR`: bits of AL status.
fn states_of(text: &str) -> Option<u8> {
    let mut bits = 0;
    for word in text.trim_end_matches('.').split([',', '+', ' ']).filter(|word| !word.is_empty()) {
        bits |= match word {
            "INIT" => 1,
            "PREOP" => 2,
            "SAFEOP" => 4,
            "OP" => 8,
            "ERROR" => 16,
            _ => return None,
        };
    }
    (bits & 0x0F != 0).then_some(bits)
}

/// A message about a SubDevice.
pub(super) fn of_device(text: &str) -> ReadDevice {
    let mut read = ReadDevice::default();
    // `AL status message 0x001B: "Sync manager watchdog".`, `Unknown AL status code 0x8000.`
    let code = text
        .split_once("AL status message ")
        .or_else(|| text.split_once("Unknown AL status code "))
        .and_then(|(_, rest)| hex(rest.get(..6)?));
    read.al_code =
        code.and_then(|code| u16::try_from(code).ok()).filter(|code| *code != 0).map(Word);
    const STATES: [(&str, &str, &str); 4] = [
        ("slave refused state change (", "(", ")"),
        ("Slave has state error bit set (", "(", ")"),
        ("Changed to ", "Changed to ", " in the meantime"),
        ("Acknowledged state ", "Acknowledged state ", "."),
    ];
    for (mark, from, to) in STATES {
        if text.contains(mark) {
            let state = between(text, from, to).and_then(state_word::read);
            read.state = state.and_then(|word| word.state);
        }
    }
    if text.contains("did not sync after") {
        read.clock_failed = Some(true);
    }
    let failed = [
        "Timeout while setting state",
        "SDO configuration failed",
        "SoE configuration failed",
        "PDO configuration failed",
        "Failed to configure",
        "Timeout while acknowledging state",
    ];
    if failed.iter().any(|failed| text.contains(failed)) {
        read.configuration_failed = Some(true);
    }
    if text.contains("No response.") {
        read.state = Some("INIT NO_COMM".to_owned());
    }
    read
}

/// `SDO download 0x1C12:00 (1 bytes) aborted.`: which object was refused.
pub(super) fn refused_request(text: &str) -> Option<(u16, u8)> {
    let rest = text.strip_prefix("SDO download ").or_else(|| text.strip_prefix("SDO upload "))?;
    let object = rest.split(' ').next().filter(|_| rest.contains("aborted"))?;
    let (index, subindex) = object.split_once(':').unwrap_or((object, "0"));
    let index = u16::try_from(hex(index)?).ok()?;
    Some((index, u8::try_from(hex(subindex.trim_end_matches('.'))?).ok()?))
}

/// `SDO abort message 0x06010002: "…".`
pub(super) fn abort_code(text: &str) -> Option<u32> {
    let rest = text
        .split_once("SDO abort message ")
        .or_else(|| text.split_once("Unknown SDO abort code "))?
        .1;
    u32::try_from(hex(rest.get(..10)?)?).ok()
}

/// Working counters of domains over time.
#[derive(Default, Debug)]
pub(super) struct Domains(BTreeMap<u64, Vec<(Option<Stamp>, u16, u16)>>);

impl Domains {
    pub(super) fn note(
        &mut self,
        index: u64,
        received: Option<u16>,
        expected: u16,
        stamp: Option<Stamp>,
    ) {
        let told = self.0.entry(index).or_default();
        if let Some(received) = received {
            told.push((stamp, received, expected));
        }
    }

    /// What they tell: from when they were first complete; of one that never was, how it ended.
    pub(super) fn facts(&self, end: Option<Stamp>) -> Vec<Fact> {
        let mut facts = Vec::new();
        for (index, told) in &self.0 {
            let whole = told.iter().position(|(_, received, expected)| received >= expected);
            let from = whole.unwrap_or(told.len().saturating_sub(1));
            for (number, (stamp, received, expected)) in told.iter().enumerate().skip(from) {
                let counter = ObservedWorkingCounter {
                    name: Some(format!("domain {index}")),
                    expected: Some(*expected),
                    received: Some(*received),
                    ..ObservedWorkingCounter::default()
                };
                let is_last = number + 1 == told.len();
                let stamp = if is_last && whole.is_none() { end.or(*stamp) } else { *stamp };
                facts.push(Fact {
                    stamp,
                    what: FactKind::WorkingCounter(Box::new(counter), Vec::new()),
                });
            }
        }
        facts
    }
}
