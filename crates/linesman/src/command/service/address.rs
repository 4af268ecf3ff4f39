//! Which SubDevice a word means: `3`, `0x1003`, `alias:7`, `EL3204`, `B3`.

use linesman_proto::address::DeviceId;

use super::known::Known;
use crate::failure::Failure;

/// The SubDevice that a word means.
pub(super) fn find(devices: &[Known], place: &str, word: &str) -> Result<DeviceId, Failure> {
    let count = devices.len();
    let is = |condition: &dyn Fn(&Known) -> bool| -> Vec<DeviceId> {
        devices.iter().filter(|known| condition(known)).map(|known| known.id).collect()
    };
    let alias = |alias: u16| is(&|known| known.alias == alias && alias != 0);
    // A name is nobody else's; numbers and types come behind it.
    let by_name = is(&|known| known.name.as_deref() == Some(word));
    let found = if !by_name.is_empty() {
        by_name
    } else if let Some(number) = word.strip_prefix("alias:") {
        let wanted = number_of(number).ok_or_else(|| no_number(word, "an alias"))?;
        alias(wanted)
    } else if let Some(hex) = word.strip_prefix("0x") {
        let wanted = u16::from_str_radix(hex, 16);
        let wanted = wanted.map_err(|_| no_number(word, "a station address"))?;
        let station = is(&|known| known.station == wanted);
        if station.is_empty() { alias(wanted) } else { station }
    } else if word.bytes().all(|letter| letter.is_ascii_digit()) && !word.is_empty() {
        is(&|known| known.id.no().to_string() == word)
    } else {
        is(&|known| known.type_name.eq_ignore_ascii_case(word))
    };
    match found[..] {
        [one] => Ok(one),
        [] => {
            let reason = format!("{place}: `{word}`: none of its {count} SubDevices is called so");
            Err(Failure::new(
                reason,
                "name it by number (3), station address (0x1003), alias (alias:7) or name; \
                 `linesman scan` lists them",
            ))
        }
        [..] => {
            let numbers: Vec<String> = found.iter().map(|id| id.no().to_string()).collect();
            let reason = format!("{place}: `{word}` may be any of {}", numbers.join(", "));
            Err(Failure::new(reason, "name it by its number"))
        }
    }
}

fn number_of(text: &str) -> Option<u16> {
    match text.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

fn no_number(word: &str, what: &str) -> Failure {
    Failure::new(format!("`{word}`: expected {what}, 0 to 65535"), "for example 0x1003 or alias:7")
}
