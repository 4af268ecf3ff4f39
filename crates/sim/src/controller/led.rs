//! The RUN and ERR LEDs, and the registers that show them or take them over.
//!
//! Reference: S2 2.5.4 and 2.5.5: without override the RUN LED shows the state, the ERR LED the
//! error of the application layer. facts 4.2: single flash for a local error, double flash for the
//! process data watchdog, blinking for a configuration that was refused.

use linesman_proto::register::{self as r, AlControl, AlStatus};
use linesman_proto::state::{AlState, AlStatusCode, StateValue};

use super::core::Core;
use super::memory::at;

/// Bit 4 of both registers: the code replaces the automatic one.
const OVERRIDE: u8 = 1 << 4;

const OFF: u8 = 0x0;
const SINGLE_FLASH: u8 = 0x1;
const DOUBLE_FLASH: u8 = 0x2;
const BLINKING: u8 = 0xD;
const FLICKERING: u8 = 0xE;
const ON: u8 = 0xF;

/// What the RUN LED shows by itself.
fn run_code(status: AlStatus) -> u8 {
    match status.state() {
        StateValue::Known(AlState::Init) => OFF,
        StateValue::Known(AlState::PreOp) => BLINKING,
        StateValue::Known(AlState::Boot) => FLICKERING,
        StateValue::Known(AlState::SafeOp) => SINGLE_FLASH,
        StateValue::Known(AlState::Op) => ON,
        StateValue::Unknown(_) => OFF,
    }
}

/// What the ERR LED shows by itself. A request that was refused is a matter of configuration; a
/// state that was left without a request is a local error.
fn error_code(status: AlStatus, code: AlStatusCode, requested: AlControl) -> u8 {
    if !status.error() {
        return OFF;
    }
    if code == AlStatusCode::SYNC_MANAGER_WATCHDOG {
        return DOUBLE_FLASH;
    }
    if requested.requested() == status.state() { SINGLE_FLASH } else { BLINKING }
}

impl Core {
    /// The registers follow the application layer, unless they are overridden.
    pub(super) fn refresh_leds(&mut self) {
        let status = AlStatus(self.memory.u16(&r::AL_STATUS));
        let code = AlStatusCode(self.memory.u16(&r::AL_STATUS_CODE));
        let control = AlControl(self.memory.u16(&r::AL_CONTROL));
        let shown = [
            (at(&r::RUN_LED_OVERRIDE), run_code(status)),
            (at(&r::ERR_LED_OVERRIDE), error_code(status, code, control)),
        ];
        for (address, automatic) in shown {
            if self.memory.bytes()[address] & OVERRIDE == 0 {
                self.memory.put(address, &[automatic]);
            }
        }
    }
}
