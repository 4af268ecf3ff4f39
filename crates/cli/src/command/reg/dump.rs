//! Registers word by word: address, hexadecimal, decimal and as text, as tools for controllers show them.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::describe;
use serde::Serialize;

use crate::output::{Output, Table};

/// A word of a controller's memory.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Word {
    /// Where it is.
    pub(super) address: u16,
    /// Its value, the low byte first on the line.
    pub(super) value: u16,
    /// Its two bytes as text; `.` for what is none.
    pub(super) text: String,
    /// The register that begins in it, or that it belongs to; `null` where there is none.
    pub(super) name: Option<String>,
}

/// The words of `data`, which was read from `from` on.
pub(super) fn words(from: RegisterAddress, data: &[u8]) -> Vec<Word> {
    let letter = |byte: u8| if byte.is_ascii_graphic() { char::from(byte) } else { '.' };
    let word = |(index, bytes): (usize, &[u8])| {
        let (low, high) = (bytes[0], bytes.get(1).copied().unwrap_or(0));
        let address = from.0.wrapping_add(2 * index as u16);
        Word {
            address,
            value: u16::from_le_bytes([low, high]),
            text: [letter(low), letter(high)].iter().collect(),
            name: describe(RegisterAddress(address)).map(|found| found.title()),
        }
    };
    data.chunks(2).enumerate().map(word).collect()
}

/// The words as a table; stretches of zeros where no register is are left out.
pub(super) fn text(words: &[Word], output: &Output) -> String {
    let mut table = Table::new(&["address", "hex", "decimal", "text", "register"], output.paint());
    for word in words.iter().filter(|word| word.name.is_some() || word.value != 0) {
        table.row([
            format!("{:04X}", word.address),
            format!("0x{:04X}", word.value),
            word.value.to_string(),
            word.text.clone(),
            word.name.clone().unwrap_or_default(),
        ]);
    }
    table.render()
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: ESC-15
    #[test]
    fn the_words_of_the_sources_come_out_in_all_columns() {
        let rows = [
            (0x0100_u16, 0xFC01_u16, 64_513, ".."),
            (0x0110, 0x5617, 22_039, ".V"),
            (0x0120, 0x0004, 4, ".."),
            (0x0130, 0x0012, 18, ".."),
            (0x0134, 0x001E, 30, ".."),
            (0x0140, 0x0E05, 3_589, ".."),
        ];
        for (address, value, decimal, text) in rows {
            let [word] = &words(RegisterAddress(address), &value.to_le_bytes())[..] else {
                panic!("one word");
            };
            assert_eq!((word.address, word.value, word.text.as_str()), (address, value, text));
            assert_eq!(u32::from(word.value), decimal);
            assert!(word.name.is_some(), "{address:#06X}");
        }
    }
}
