//! Pages about the states of the EtherCAT state machine.

use linesman_proto::register::AlStatus;
use linesman_proto::state::AlState;

use super::page::{Kind, Page};

/// A page about a state, or about a state with the error bit.
pub(super) fn state(state: AlState, error: bool) -> Page {
    let name = state.name();
    let title = if error { format!("State {name} with error") } else { format!("State {name}") };
    let mut page = Page::new(Kind::State, title);
    if error {
        page = page.text(format!(
            "The SubDevice is in {name} and the error bit of AL status is set: it refused the state that \
             was asked for, or left a higher one by itself. It takes no request but INIT until the error \
             is acknowledged.",
        ));
        page = page.steps([
            "Read the AL status code (0x0134): it says why. `linesman state WHERE` shows it; `linesman \
             explain 0x001B` says what a code means."
                .to_owned(),
            match state {
                AlState::SafeOp => "In SAFEOP the code is mostly 0x001B (outputs stayed away), 0x001A, 0x002C \
                    or 0x002D (out of step with SYNC)."
                    .to_owned(),
                AlState::PreOp => "In PREOP the code is mostly 0x001D or 0x001E (process data do not fit), \
                    0x0030 or 0x0035 (SYNC settings)."
                    .to_owned(),
                AlState::Init | AlState::Boot => "In INIT the code is mostly 0x0016 (mailbox), 0x0014 \
                    (firmware), 0x0050 or 0x0051 (EEPROM)."
                    .to_owned(),
                AlState::Op => "In OP an error bit is rare: a device emulated by its controller copies it \
                    when a MainDevice acknowledges an error that it does not have."
                    .to_owned(),
            },
            "Mend the cause, then acknowledge: `linesman state WHERE DEVICE --acknowledge`, or write the present \
             state with bit 4 to 0x0120."
                .to_owned(),
        ]);
    } else {
        let (text, entered) = words(state);
        page = page.text(text).fact("entered", entered);
    }
    let yes = |on: bool| if on { "yes" } else { "no" };
    let works = format!(
        "mailbox {}, inputs {}, outputs {}",
        yes(state.has_mailbox()),
        yes(state.has_inputs()),
        yes(state.has_outputs())
    );
    let value = format!(
        "0x{:02X} in register 0x0130: {} in bits 0-3, bit 4 is the error bit",
        AlStatus::new(state).with_error(error).value(),
        state.bits()
    );
    page.fact("works", works).fact("AL status", value)
}

const fn words(state: AlState) -> (&'static str, &'static str) {
    match state {
        AlState::Init => (
            "No communication on the application layer: neither mailbox nor process data. The \
             MainDevice has access to the registers of the controller only.",
            "After power-on, and whenever the MainDevice asks for it.",
        ),
        AlState::Boot => (
            "Firmware update: the mailbox works with its boot settings, for FoE only.",
            "From INIT only, on devices that have it; the only way out leads to INIT.",
        ),
        AlState::PreOp => (
            "The mailbox works, process data do not. SyncManagers and FMMUs for the process data \
             are set up here, and SDOs of the start-up list are written.",
            "From INIT, once the mailbox SyncManagers 0 and 1 fit.",
        ),
        AlState::SafeOp => (
            "The mailbox works and inputs are valid, while outputs stay in their safe state.",
            "From PREOP, once SyncManagers and FMMUs of the process data fit; or out of OP, when \
             outputs stop coming (AL status code 0x001B) or the device finds a fault.",
        ),
        AlState::Op => {
            ("Normal work: inputs and outputs are valid.", "From SAFEOP, once outputs come.")
        }
    }
}

/// The state that people write with or without an error: `SAFEOP+ERR`, `SAFE_OP + ERROR`, `PREOP E`,
/// `ERR SAFEOP`, `EC_STATE_SAFE_OP`, `pre-operational`.
pub(super) fn named(text: &str) -> Option<(AlState, bool)> {
    let mut rest = text.to_ascii_uppercase();
    // INIT_ERR is another tool's word for a start-up command that failed.
    if !rest.starts_with("INIT") {
        rest = rest.replace("_ERR", " ERR");
    }
    rest = rest.replace("OPERATIONAL", "OP").replace("BOOTSTRAP", "BOOT").replace(['-', '_'], "");
    for noise in ["ECSTATE", "STATE"] {
        rest = rest.replace(noise, "");
    }
    let mut words: Vec<&str> = rest
        .split(|letter: char| !letter.is_ascii_alphanumeric())
        .filter(|w| !w.is_empty())
        .collect();
    let count = words.len();
    words.retain(|word| !matches!(*word, "E" | "ERR" | "ERROR"));
    let error = words.len() < count;
    let name: String = words.concat();
    let name = match name.as_str() {
        "PRE" => "PREOP",
        "SAFE" => "SAFEOP",
        other => other,
    };
    AlState::from_name(name).filter(|_| words.len() <= 2).map(|state| (state, error))
}

/// A page about a value of AL status, if it is one.
pub(super) fn al_status(value: u16) -> Option<Page> {
    let status = AlStatus(value);
    let state = status.state().state().filter(|_| value < 0x80)?;
    let title = format!("AL status 0x{value:04X}: {status}");
    let page = Page::new(Kind::Value, title).text(
        "A value of register 0x0130: the state in bits 0 to 3, bit 4 the error bit, bit 5 says that 0x0134 \
         holds the identification.",
    );
    let next = match status.error() {
        true => format!(
            "Ask for 0x0134, the AL status code, which says why: `linesman explain {}+ERR`.",
            state.name()
        ),
        false => format!("More: `linesman explain {}`.", state.name()),
    };
    Some(page.fact("do", next).fact("see", "S2 2.5.2"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_known_in_all_spellings() {
        use AlState::{Boot, Init, Op, PreOp, SafeOp};
        for (text, expected) in [
            ("SAFEOP", (SafeOp, false)),
            ("safe-op", (SafeOp, false)),
            ("SAFEOP+ERR", (SafeOp, true)),
            ("SAFEOP + ERROR", (SafeOp, true)),
            ("SAFE_OP + ERROR", (SafeOp, true)),
            ("SAFEOP ERROR", (SafeOp, true)),
            ("ERR SAFEOP", (SafeOp, true)),
            ("SafeOp|Error", (SafeOp, true)),
            ("PREOP  E", (PreOp, true)),
            ("Pre-Operational", (PreOp, false)),
            ("EC_STATE_PRE_OP", (PreOp, false)),
            ("EC_STATE_OPERATIONAL", (Op, false)),
            ("Safe Operational", (SafeOp, false)),
            ("State INIT", (Init, false)),
            ("INIT ERROR", (Init, true)),
            ("SAFEOP_ERROR", (SafeOp, true)),
            ("OP  +", (Op, false)),
            ("bootstrap", (Boot, false)),
            ("BOOT", (Boot, false)),
        ] {
            let found = named(text);
            assert_eq!(found, Some(expected), "{text}");
        }
        for text in ["", "ERR", "RUN", "stop", "OP LNK_MIS B", "SAFEOP IN SAFEOP", "INIT_ERR"] {
            assert_eq!(named(text), None, "{text}");
        }
    }
}
