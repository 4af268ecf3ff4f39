//! MainDevice in the report: its kind and what it reads.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{ErrorCounters, describe};
use serde::{Deserialize, Serialize};

use super::Number;
use crate::main_device::{Access, Certainty, MainDeviceKind, Mark};
use crate::model::NetworkModel;

/// The MainDevice that drives the line, recognised by its habits.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MainDeviceReport {
    /// Its kind.
    pub kind: MainDeviceKind,
    /// How sure the kind is.
    pub certainty: Certainty,
    /// By which marks it was recognised.
    pub marks: Vec<String>,
    /// The cycle of its process data; `null` where there are none, or not enough.
    pub cycle_ns: Option<Number>,
    /// Registers that it reads again and again, or clears.
    pub polls: Vec<PollReport>,
    /// Registers that tell of trouble, and that were not read while the line was watched.
    pub never_reads: Vec<RegisterReport>,
}

/// A register that is read again and again.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PollReport {
    /// Its address.
    pub register: u16,
    /// Bytes.
    pub len: u16,
    /// Its name.
    pub name: String,
    /// The access.
    pub how: Access,
    /// The usual time between two accesses to the same SubDevice.
    pub every_ns: Option<Number>,
}

/// A register.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RegisterReport {
    /// Its address.
    pub register: u16,
    /// Its name.
    pub name: String,
}

/// The MainDevice of a line; `None` before its first request.
pub(crate) fn report(model: &NetworkModel) -> Option<MainDeviceReport> {
    let recognised = model.habits.recognised()?;
    let cycle = model.cyclic.iter().filter_map(|cyclic| cyclic.sent.cycle()).min();
    let polls = model.habits.polls(model.now).into_iter().map(|poll| PollReport {
        register: poll.register.0,
        len: poll.len,
        name: name(poll.register, poll.len),
        how: poll.access,
        every_ns: poll.interval().map(|every| Number(every.as_nanos())),
    });
    let never = model
        .habits
        .never_reads()
        .filter(|(register, len)| !model.traffic.questions.have_read(*register, *len))
        .map(|(register, len)| RegisterReport { register: register.0, name: name(register, len) });
    Some(MainDeviceReport {
        kind: recognised.kind,
        certainty: recognised.certainty,
        marks: recognised.marks.into_iter().map(Mark::words).collect(),
        cycle_ns: cycle.map(|cycle| Number(cycle.as_nanos())),
        polls: polls.collect(),
        never_reads: never.collect(),
    })
}

/// A register's name; counters of all ports have one together.
fn name(register: RegisterAddress, len: u16) -> String {
    const LOST_LINKS: core::ops::Range<u16> = 0x0310..0x0314;
    if LOST_LINKS.contains(&register.0) {
        return "lost-link counters".to_owned();
    }
    if ErrorCounters::cover(register, usize::from(len)) {
        return "error counters".to_owned();
    }
    describe(register).map_or_else(|| format!("0x{:04X}", register.0), |found| found.title())
}
