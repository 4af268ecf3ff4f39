//! The SII of a device: the words that were read, the rest from an image of the same device, or what
//! a blank EEPROM holds.

use linesman_proto::register as r;
use linesman_proto::sii::{self, word};

use crate::replay::learn::DeviceSeen;

/// Smallest EEPROM, in bytes.
const SMALLEST: usize = 2_048;
/// Largest word that is believed to be there.
const LARGEST_WORD: u32 = 0x4_0000;
/// Bytes that the checksum guards.
const GUARDED: usize = 14;

/// What is not known of a device's configuration and had to be chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Choice {
    /// SII byte 0.
    pub(super) pdi_control: u8,
    /// SII byte 1.
    pub(super) esc_configuration: u8,
}

/// The identity as far as it was read: vendor, product, revision.
pub(super) fn identity(seen: &DeviceSeen) -> [Option<u32>; 3] {
    [word::VENDOR_ID, word::PRODUCT_CODE, word::REVISION].map(|at| seen.sii_u32(at.value()))
}

/// Whether an image is that of the same product and revision.
pub(super) fn is_of(image: &[u8], identity: [Option<u32>; 3]) -> bool {
    let at = |word: word::WordAddress| {
        let bytes = image.get(word.byte()..)?.first_chunk()?;
        Some(u32::from_le_bytes(*bytes))
    };
    let [vendor, product, revision] = identity;
    product.is_some()
        && vendor == at(word::VENDOR_ID)
        && product == at(word::PRODUCT_CODE)
        && revision == at(word::REVISION)
}

/// The image of a device.
pub(super) fn compose(seen: &DeviceSeen, same: Option<&[u8]>, choice: Choice) -> Vec<u8> {
    let last = seen.sii.keys().rev().find(|word| **word < LARGEST_WORD).copied().unwrap_or(0);
    let said = seen.sii.get(&word::SIZE.value()).filter(|size| **size < 0x1000);
    let said = said.map_or(0, |size| (usize::from(*size) + 1) * 128);
    let len = SMALLEST.max(said).max((last as usize + 1) * 2).max(same.map_or(0, <[u8]>::len));
    let mut image = vec![0xFF; len.next_power_of_two()];
    match same {
        Some(same) => image[..same.len()].copy_from_slice(same),
        None => {
            image[..GUARDED].fill(0);
            // No mailbox, where none was read.
            let fixed = word::BOOTSTRAP_MAILBOX.byte()..word::VENDOR_WORDS.byte();
            image[fixed].fill(0);
        }
    }
    (image[0], image[1]) = (choice.pdi_control, choice.esc_configuration);
    for (register, byte) in [(r::PDI_CONTROL, 0), (r::ESC_CONFIGURATION_A0, 1)] {
        if let Some(value) = seen.byte(register.address) {
            image[byte] = value;
        }
    }
    for (word, value) in seen.sii.iter().filter(|(word, _)| **word < LARGEST_WORD) {
        let at = *word as usize * 2;
        image[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }
    fit_checksum(seen, &mut image);
    image
}

/// The checksum of the configuration area is right: it is computed where it was not read; where it
/// was, a byte that was not read is chosen to fit.
fn fit_checksum(seen: &DeviceSeen, image: &mut [u8]) {
    let at = word::CHECKSUM.byte();
    let Some(mut guarded) = image.first_chunk::<GUARDED>().copied() else { return };
    if !seen.sii.contains_key(&word::CHECKSUM.value()) {
        image[at] = sii::checksum(&guarded);
        image[at + 1] = 0;
        return;
    }
    let unread = [2usize, 3, 6, 7, 4, 5, 10, 11, 12, 13]
        .into_iter()
        .find(|byte| !seen.sii.contains_key(&(*byte as u32 / 2)));
    let Some(byte) = unread else { return };
    for value in 0..=u8::MAX {
        guarded[byte] = value;
        if sii::checksum(&guarded) == image[at] {
            image[byte] = value;
            return;
        }
    }
}
