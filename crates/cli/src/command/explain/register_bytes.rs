//! Bytes of registers behind their address, as tools print them: `0x0300: 00 12 00 00`.

use super::found::Found;
use super::{bare_number, registers};

/// Most registers that are told of one line.
const MOST: u8 = 8;
/// Likelihood of the first one; each one behind it comes after.
const FIRST: u8 = 97;

/// Adds what the registers hold that the bytes fill.
pub(super) fn add(text: &str, found: &mut Found) {
    let Some((address, data)) = parse(text) else { return };
    let (mut at, mut likelihood) = (0, FIRST);
    while at < data.len() && likelihood > FIRST - MOST {
        let register = address.checked_add(at as u16).and_then(bare_number::register_at);
        let Some(register) = register else {
            at += 1;
            continue;
        };
        let len = usize::from(register.register.len - register.offset);
        // Of a register that is cut off nothing is said.
        let Some(bytes) = data.get(at..at + len) else { return };
        let value = bytes.iter().take(8).rev().fold(0, |value, byte| value << 8 | u64::from(*byte));
        registers::add_value(&register, value, likelihood, found);
        at += len;
        likelihood -= 1;
    }
}

/// The address and the bytes behind it; words such as `slave 3` may stand before.
fn parse(text: &str) -> Option<(u16, Vec<u8>)> {
    let (before, rest) = text.split_once("0x")?;
    let digits = rest.find(|letter: char| !letter.is_ascii_hexdigit())?;
    let (address, rest) = rest.split_at(digits);
    let has_colon = rest.trim_start().starts_with([':', '=']);
    let is_word = before.is_empty() || before.ends_with([' ', ':', ',', '(']);
    if !is_word || !(3..=4).contains(&address.len()) {
        return None;
    }
    let byte = |word: &str| u8::from_str_radix(word, 16).ok().filter(|_| word.len() == 2);
    let data: Vec<u8> =
        rest.trim_matches([' ', ':', '=']).split(' ').map(byte).collect::<Option<_>>()?;
    // One alone may be anything without a sign of what it is.
    (has_colon || data.len() > 1).then_some((u16::from_str_radix(address, 16).ok()?, data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn address_and_bytes_are_read_as_tools_print_them() {
        let expected = Some((0x300, vec![0x00, 0x12]));
        for text in [
            "0x0300: 00 12",
            "0x300 00 12",
            "slave 3 0x0300: 00 12",
            "0x0300 = 00 12",
            "0x0300:00 12",
        ] {
            assert_eq!(parse(text), expected, "{text}");
        }
        assert_eq!(parse("0x0502: 80"), Some((0x502, vec![0x80])));
        for text in [
            "0x0300 20",
            "0x0300",
            "0x0300 = 0x0412",
            "0x0300: 00 1",
            "00 12",
            "0x030000: 00 12",
            "x0x0300: 00",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
