//! Words for states, as each tool writes them.

use linesman_proto::port::Port;
use linesman_proto::register::AlStatus;
use linesman_proto::state::DeviceState;

/// What a word for a state says.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct StateWord {
    /// The state, as observation files write it; `None` where only flags are given.
    pub(super) state: Option<String>,
    /// Ports without a link that should have one, where the state is not given.
    pub(super) missing: Vec<Port>,
}

/// Reads `OP`, `ERR SAFEOP`, `SAFEOP + ERROR`, `SAFEOP+ERROR`, `Safe-Op`, `INIT NO_COMM`, `LNK_MIS B`.
pub(super) fn read(text: &str) -> Option<StateWord> {
    let upper = text.to_ascii_uppercase().replace('+', " ");
    let upper = upper.replace("LNK ", "LNK_").replace("LNK:", "LNK_").replace("NO COMM", "NO_COMM");
    let upper = upper
        .replace("PRE-OP", "PREOP")
        .replace("SAFE-OP", "SAFEOP")
        .replace("INIT ERR", "INIT_ERR");
    let words: Vec<&str> = upper.split([' ', ',', '\t']).filter(|word| !word.is_empty()).collect();
    if words.is_empty() {
        return None;
    }
    let is_error = words.iter().any(|word| matches!(*word, "ERR" | "ERROR"));
    let others: Vec<&str> =
        words.iter().copied().filter(|word| !matches!(*word, "ERR" | "ERROR")).collect();
    let plain = others.join(" ").replace("BOOTSTRAP", "BOOT");
    let whole = if is_error { format!("ERR {plain}") } else { plain };
    if let Ok(state) = whole.parse::<DeviceState>() {
        return Some(StateWord { state: Some(state.to_string()), missing: Vec::new() });
    }
    // Flags without a state.
    let flags: DeviceState = format!("OP {whole}").parse().ok()?;
    // A letter alone is a port of nothing.
    let has_flags = flags.0 & 0x0FF0 != 0;
    let missing = flags.contains(DeviceState::MISSING_LINK);
    let ports = Port::ALL.into_iter().filter(|port| missing && flags.ports()[*port]);
    has_flags.then(|| StateWord { state: None, missing: ports.collect() })
}

/// AL status in hexadecimal or decimal digits, as registers and some tools give it.
pub(super) fn of_status(status: u64) -> Option<String> {
    let status = AlStatus(u16::try_from(status).ok()? & 0x1F);
    status.state().state()?;
    Some(DeviceState(status.0).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_of_all_tools_are_read() {
        for (text, expected) in [
            ("OP", "OP"),
            ("ERR SAFEOP", "ERR SAFEOP"),
            ("SAFEOP + ERROR", "ERR SAFEOP"),
            ("SAFEOP+ERROR", "ERR SAFEOP"),
            ("Safe-Op", "SAFEOP"),
            ("Pre-Op Err", "ERR PREOP"),
            ("OP LNK MIS B", "OP LNK_MIS B"),
            ("INIT NO_COMM", "INIT NO_COMM"),
            ("INIT VPRS INIT_ERR LNK_ADD C", "INIT VPRS INIT_ERR LNK_ADD C"),
        ] {
            assert_eq!(read(text).unwrap().state.as_deref(), Some(expected), "{text}");
        }
        let flags = read("LNK_MIS B").unwrap();
        assert_eq!((flags.state, flags.missing), (None, vec![Port::B]));
        for text in ["", "EL1008", "running", "???", "B", "ERR"] {
            assert_eq!(read(text), None, "{text}");
        }
        assert_eq!(of_status(0x14).as_deref(), Some("ERR SAFEOP"));
        assert_eq!(of_status(0), None);
    }
}
