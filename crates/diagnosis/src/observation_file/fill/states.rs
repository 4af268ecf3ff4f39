//! States of all SubDevices over time.

use linesman_proto::address::DeviceId;
use linesman_proto::register::AlStatus;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};

use super::TimedReading;
use super::device::Values;
use crate::model::{NetworkModel, Seen};

/// AL status code of an expired watchdog.
const WATCHDOG: u16 = 0x001B;

/// Records the states of each step.
///
/// A file does not say what was asked for. Who was in a state without an error was asked to be there; who is
/// in a lower one later left it by itself, as long as somebody else is still there.
pub(super) fn teach(model: &mut NetworkModel, steps: &[TimedReading<'_>]) {
    let mut now: Vec<Option<AlState>> = vec![None; model.devices.len()];
    for (number, step) in steps.iter().enumerate() {
        let before = now.clone();
        for (index, read) in &step.devices {
            let state = read.state.filter(|_| !read.is_absent());
            if let (Some(state), Some(slot)) = (state, now.get_mut(*index)) {
                *slot = state.state().state();
            }
        }
        let is_last = number + 1 == steps.len();
        for (index, read) in &step.devices {
            let Some(device) = model.device_mut(DeviceId(*index as u32)) else { continue };
            if read.is_absent() {
                continue;
            }
            if let Some(status) = status(read, before.get(*index).copied().flatten()) {
                if read.al_code == Some(WATCHDOG) && device.al.requested.is_none() {
                    // Only who takes outputs misses them: it had been in OP.
                    device.al.requested =
                        Some(Seen::new(StateValue::Known(AlState::Op), step.at, None));
                    device.al.has_arrived = true;
                }
                let former = before.get(*index).copied().flatten();
                let asked_down = !status.error()
                    && former > status.state().state()
                    && !now.iter().any(|other| *other >= former);
                let requested = |state: AlState| Seen::new(StateValue::Known(state), step.at, None);
                if asked_down && let Some(state) = status.state().state() {
                    device.al.requested = Some(requested(state));
                }
                device.al.record_status(status, step.at, None);
                let reached = status.state().state().filter(|_| !status.error() && !is_last);
                if let Some(state) = reached
                    && former.is_none_or(|former| former <= state || asked_down)
                {
                    device.al.requested = Some(requested(state));
                    device.al.has_arrived = true;
                }
            }
            if let Some(code) = read.al_code {
                device.al.record_code(AlStatusCode(code), step.at, None);
            }
        }
    }
}

/// AL status as a reading shows it. A code without the error bit, or without a state, is of an error: but for
/// OP, which a SubDevice leaves with one.
fn status(read: &Values, before: Option<AlState>) -> Option<AlStatus> {
    const ERROR: u16 = 0x10;
    let has_code = read.al_code.is_some_and(|code| code != 0);
    match read.state {
        Some(state) => {
            let status = AlStatus(u16::from(state.device_byte() & 0x1F));
            let is_in_op = status.state().state() == Some(AlState::Op);
            Some(if has_code && !is_in_op { AlStatus(status.0 | ERROR) } else { status })
        }
        None if has_code => {
            // An expired watchdog leads to SAFEOP.
            let told = if read.al_code == Some(WATCHDOG) { Some(AlState::SafeOp) } else { before };
            Some(AlStatus(told.map_or(0, |state| u16::from(state.bits())) | ERROR))
        }
        None => None,
    }
}
