//! Pages about the words that a control program sees: of a SubDevice, of the network, of a frame.

use linesman_proto::state::{AlState, DeviceState, NetworkState, StateValue};

use super::page::{Kind, Page};

/// The bits of a state word and what each says.
const DEVICE_BITS: [(u16, &str); 8] = [
    (
        DeviceState::ERROR,
        "ERR: the SubDevice signals an error in AL status; its AL status code says why",
    ),
    (
        DeviceState::WRONG_IDENTITY,
        "VPRS: vendor, product, revision or serial number is not the configured one",
    ),
    (DeviceState::INIT_ERROR, "INIT_ERR: a command of the start-up list failed"),
    (DeviceState::DISABLED, "DISABLED: switched off in the configuration"),
    (DeviceState::NOT_PRESENT, "NO_COMM: the SubDevice does not answer"),
    (DeviceState::LINK_ERROR, "LNK_ERR: a port has a link but no communication"),
    (DeviceState::MISSING_LINK, "LNK_MIS: a port where a neighbour is configured has no link"),
    (DeviceState::ADDITIONAL_LINK, "LNK_ADD: a port where no neighbour is configured has a link"),
];

/// A page about the state word that a control program sees of a SubDevice.
pub(super) fn device_state(word: DeviceState) -> Page {
    let set = DEVICE_BITS.into_iter().filter(|(bit, _)| word.contains(*bit));
    let mut says: Vec<String> = set.map(|(_, text)| format!("{text}.")).collect();
    let state = match word.state() {
        StateValue::Known(state) => format!("{}: its state.", state.name()),
        StateValue::Unknown(bits) => format!("{bits}: no state."),
    };
    says.insert(0, state);
    let ports: Vec<String> = word
        .ports()
        .iter()
        .filter(|(_, concerned)| **concerned)
        .map(|(port, _)| format!("port {port}"))
        .collect();
    if !ports.is_empty() {
        says.push(format!("{}: the ports that the link words are about.", ports.join(", ")));
    }
    let next = if word.contains(DeviceState::MISSING_LINK) {
        "Look at the cable at that port, and at the neighbour behind it: pulled, broken, or without power. \
         `linesman diagnose WHERE` names the link."
    } else if word.contains(DeviceState::ADDITIONAL_LINK) {
        "Compare the wiring with the configuration: mostly a cable is in another port than planned, and \
         the neighbour before shows LNK_MIS. `linesman scan WHERE --against machine.toml` compares."
    } else if word.contains(DeviceState::NOT_PRESENT) {
        "Look for the last SubDevice before it that still answers: the fault is at the link behind that one."
    } else if word.contains(DeviceState::WRONG_IDENTITY) {
        "Compare what is plugged with what is configured: `linesman scan WHERE --against machine.toml`."
    } else if word.contains(DeviceState::INIT_ERROR) {
        "Look in the log for the command that failed: mostly an SDO abort."
    } else if word.contains(DeviceState::ERROR) {
        "Ask for its AL status code, and for that page: `linesman explain 0x001B`."
    } else {
        ""
    };
    Page::new(Kind::DeviceState, format!("State word 0x{:04X}: {word}", word.0))
        .text(
            "What a control program sees of a SubDevice (TwinCAT: the variable State, and the column of the \
             Online list). The low byte is the software, the high byte the wiring.",
        )
        .list("says", says)
        .fact("do", next)
        .fact("see", "vendor documentation of the cyclic variable State")
}

/// Tells if a number is likely to be a state word: a state, and bits that go together.
pub(super) fn is_device_state(word: DeviceState) -> bool {
    let links = DeviceState::LINK_ERROR | DeviceState::MISSING_LINK | DeviceState::ADDITIONAL_LINK;
    let has_port = word.ports().iter().any(|(_, concerned)| *concerned);
    let says_more = word.0 & !(DeviceState::ERROR | 0x0F) != 0;
    word.state().state().is_some_and(|state| state != AlState::Boot)
        && says_more
        && !(has_port && word.contains(DeviceState::ERROR))
        && has_port == (word.0 & links != 0)
        && !word.contains(DeviceState::DISABLED)
}

/// A page about the state word of the network.
pub(super) fn network_state(word: NetworkState) -> Page {
    Page::new(Kind::NetworkState, format!("DevState 0x{:04X}: {word}", word.0))
        .text(
            "The state word that a control program sees of the whole network; 0 is: all is well. `linesman \
             online WHERE` shows the same.",
        )
        .list("bits", (0..13).map(|bit| {
            let one = NetworkState(1 << bit);
            let text = one.to_string();
            let text = text.trim_start_matches("Not OK - ").to_owned();
            let set = if word.contains(one.0) { "set" } else { "not set" };
            format!("0x{:04X}: {text} ({set})", one.0)
        }))
        .fact("see", "vendor documentation of the cyclic variable DevState")
}

/// A page about the word that tells which datagrams of a frame had a wrong working counter.
pub(super) fn frame_state(word: u16) -> Page {
    const MISSING: u16 = 0x8000;
    let failed: Vec<String> =
        (0..15).filter(|bit| word >> bit & 1 != 0).map(|bit| (bit + 1).to_string()).collect();
    let says = if word & MISSING != 0 {
        "the whole frame did not come back".to_owned()
    } else if failed.is_empty() {
        "all datagrams of the frame came back with the expected working counter".to_owned()
    } else {
        format!(
            "wrong working counter in datagram {} of the frame, counted from 1",
            failed.join(", ")
        )
    };
    Page::new(Kind::Value, format!("FrmXWcState 0x{word:04X}: {says}"))
        .text(
            "A bit for each datagram of a frame: 0x0001 is the first, 0x4000 the fifteenth; 0x8000 says that \
             the frame itself is missing.",
        )
        .fact(
            "do",
            "Look at the State of the SubDevices of these datagrams: the one that is not in OP is the \
             reason; the others are only in the same datagram. With 0x8000 look for lost frames.",
        )
        .fact("see", "vendor documentation of the cyclic variable FrmXWcState")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_words_are_told_from_other_numbers() {
        for word in [0x2408, 0x4861, 0x0101, 0x0071] {
            assert!(is_device_state(DeviceState(word)), "{word:#06X}");
        }
        for word in [0x0130, 0x2310, 0x6041, 0x0008, 0x0014, 0x4413, 0x8130, 0x1018] {
            assert!(!is_device_state(DeviceState(word)), "{word:#06X}");
        }
    }
}
