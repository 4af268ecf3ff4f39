//! States that the MainDevice asked for and SubDevices were read in, in order of time.

use std::collections::BTreeMap;

use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::report::Number;
use linesman_proto::register::{AlControl, AlStatus};
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use serde::{Deserialize, Serialize};

use crate::access::{DatagramAccess, DatagramTarget};

const AL_CONTROL: u16 = 0x0120;
const AL_STATUS: u16 = 0x0130;
const AL_STATUS_CODE: u16 = 0x0134;
/// Number of entries back to which the other copy of a request is looked for.
const COPIES_APART: usize = 64;
/// Most entries that are kept.
const MOST: usize = 20_000;

/// A request for a state, or a reading that differs from the one before.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StateEventReport {
    /// When.
    pub at_ns: Number,
    /// The number of the frame that shows it.
    pub frame: Number,
    /// Number of the SubDevice; `null` for all of them, and for one that is not known.
    pub no: Option<u32>,
    /// Its station address, where the datagram names it.
    pub station: Option<u16>,
    /// Its position from 1, where the datagram names it.
    pub position_no: Option<u32>,
    /// `asked` (AL control was written), `read` (AL status), `code` (AL status code).
    pub what: StateEvent,
    /// The state: `INIT`, `PREOP`, `BOOT`, `SAFEOP`, `OP`; of several that were read together all that may be there,
    /// as `INIT+PREOP`. `null` for a code.
    pub state: Option<String>,
    /// The value of the register.
    pub value: u16,
    /// Of a request: that it acknowledges an error. Of a reading: that an error is signalled.
    pub error: bool,
    /// Number of SubDevices that answered; `null` where the frame did not come back.
    pub wkc: Option<u16>,
}

/// Kind of a state event.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StateEvent {
    /// AL control (0x0120) was written.
    Asked,
    /// AL status (0x0130) was read.
    Read,
    /// AL status code (0x0134) was read.
    Code,
}

/// One entry.
#[derive(Clone, Copy, Debug)]
struct StateEntry {
    at: u64,
    frame: u64,
    target: DatagramTarget,
    what: StateEvent,
    value: u16,
    wkc: Option<u16>,
}

/// States over time.
#[derive(Clone, Default, Debug)]
pub struct StateLog {
    entries: Vec<StateEntry>,
    /// AL status and code as last read.
    last: BTreeMap<DatagramTarget, (Option<u16>, Option<u16>)>,
    left_out: u64,
}

impl StateLog {
    /// Takes a datagram.
    pub(crate) fn access(&mut self, access: &DatagramAccess<'_>) {
        if matches!(access.target, DatagramTarget::Logical(_) | DatagramTarget::Nobody) {
            return;
        }
        if let Some([control]) = access.written_at(AL_CONTROL, 1) {
            let value = u16::from(*control);
            if !(access.is_further_copy && self.add_copy(access, value)) {
                self.push(access, StateEvent::Asked, value);
            }
        }
        if access.address.0 > AL_STATUS_CODE || access.effect.multiple_write {
            return;
        }
        let word = |address, len| {
            let bytes = access.read_at(address, len)?;
            Some(bytes.iter().rev().fold(0, |value, byte| value << 8 | u16::from(*byte)))
        };
        // Many poll the first byte alone, which has state and error.
        let status = word(AL_STATUS, 2).or_else(|| word(AL_STATUS, 1));
        let (old_status, old_code) = self.last.get(&access.target).copied().unwrap_or_default();
        if let Some(status) = status.filter(|status| Some(*status) != old_status) {
            self.push(access, StateEvent::Read, status);
            self.last.entry(access.target).or_default().0 = Some(status);
        }
        // Codes of several SubDevices ORed together mean nothing.
        let code = word(AL_STATUS_CODE, 2).filter(|_| access.target != DatagramTarget::All);
        if let Some(code) = code.filter(|code| *code != old_code.unwrap_or(0)) {
            self.push(access, StateEvent::Code, code);
            self.last.entry(access.target).or_default().1 = Some(code);
        }
    }

    /// Adds another copy of a request to the entry of the first one; `false` where there is none.
    fn add_copy(&mut self, access: &DatagramAccess<'_>, value: u16) -> bool {
        let mut latest = self.entries.iter_mut().rev().take(COPIES_APART);
        let is_it = |entry: &&mut StateEntry| {
            (entry.what, entry.value, entry.target) == (StateEvent::Asked, value, access.target)
        };
        let Some(entry) = latest.find(is_it) else { return false };
        // The sum of all copies so far.
        if access.wkc > entry.wkc {
            entry.wkc = access.wkc;
            (entry.at, entry.frame) = (access.at.as_nanos(), access.frame);
        }
        true
    }

    fn push(&mut self, access: &DatagramAccess<'_>, what: StateEvent, value: u16) {
        if self.entries.len() == MOST {
            self.left_out += 1;
            return;
        }
        let (at, frame, target, wkc) =
            (access.at.as_nanos(), access.frame, access.target, access.wkc);
        self.entries.push(StateEntry { at, frame, target, what, value, wkc });
    }

    /// The entries as a report, and how many were left out.
    pub(crate) fn report(&self, model: &NetworkModel) -> (Vec<StateEventReport>, Number) {
        let entries = self.entries.iter().map(|entry| entry.report(model));
        (entries.collect(), Number(self.left_out))
    }
}

impl StateEntry {
    fn report(&self, model: &NetworkModel) -> StateEventReport {
        let (state, error) = match self.what {
            StateEvent::Asked => {
                let control = AlControl(self.value);
                (Some(name(control.requested())), control.acknowledges_error())
            }
            StateEvent::Read if self.target == DatagramTarget::All => {
                let states = AlState::from_or(self.value as u8);
                (Some(ored(self.value as u8)), states.any_error())
            }
            StateEvent::Read => {
                let status = AlStatus(self.value);
                (Some(name(status.state())), status.error())
            }
            StateEvent::Code => (None, self.value != 0),
        };
        let (station, position_no) = named(self.target);
        StateEventReport {
            at_ns: Number(self.at),
            frame: Number(self.frame),
            no: self.target.device(model).map(|id| id.no()),
            station,
            position_no,
            what: self.what,
            state,
            value: self.value,
            error,
            wkc: self.wkc,
        }
    }
}

/// Station address and position (from 1), as a datagram names them.
pub(crate) fn named(target: DatagramTarget) -> (Option<u16>, Option<u32>) {
    match target {
        DatagramTarget::Station(station) => (Some(station.value()), None),
        DatagramTarget::Position(position) => (None, Some(u32::from(position.value()) + 1)),
        DatagramTarget::All | DatagramTarget::Nobody | DatagramTarget::Logical(_) => (None, None),
    }
}

fn name(value: StateValue) -> String {
    value.state().map_or_else(|| format!("0x{:02X}", value.bits()), |state| state.name().to_owned())
}

/// The states that may be behind an OR of several.
fn ored(value: u8) -> String {
    let states = AlState::from_or(value);
    let possible = AlState::ALL.into_iter().filter(|state| states.possible(*state));
    states.all_in().map_or_else(
        || possible.map(AlState::name).collect::<Vec<_>>().join("+"),
        |state| state.name().to_owned(),
    )
}

/// The meaning of an AL status code, in a word or two.
#[must_use]
pub fn code_name(code: u16) -> &'static str {
    AlStatusCode(code).explain().name
}
