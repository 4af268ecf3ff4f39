//! Conversion of an [`Image`] to bytes; behind [`Image::build`].
//!
//! Reference: ETG.1000.6 §5.4, ETG.2010.

use super::category::{Category, CategoryKind};
use super::image::Image;
use super::pdo::Pdo;
use super::word::{self, WordAddress};

/// What fills a word up, and everything behind the end marker: an erased EEPROM reads so.
const FILL: u8 = 0xFF;

/// Why an image cannot be built.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BuildError {
    /// The count of a PDO's entries is one byte.
    #[error("SII PDO 0x{index:04X} has {entries} entries, at most 255 fit")]
    TooManyEntries {
        /// Index of the PDO.
        index: u16,
        /// Number of its entries.
        entries: usize,
    },
    /// The length of a category is one word.
    #[error("SII {kind} takes {words} words, at most 65535 fit")]
    CategoryTooLong {
        /// Its type.
        kind: CategoryKind,
        /// Words it would take.
        words: usize,
    },
}

/// Builds a whole image.
pub(super) fn image(image: &Image) -> Result<Vec<u8>, BuildError> {
    let mut bytes = vec![0; word::FIRST_CATEGORY.byte()];
    fixed_words(image, &mut bytes);
    for category in &image.categories {
        append(category, &mut bytes)?;
    }
    bytes.extend_from_slice(&CategoryKind::End.code().to_le_bytes());
    let len = image.size.bytes().max(bytes.len());
    bytes.resize(len, FILL);
    Ok(bytes)
}

fn fixed_words(image: &Image, bytes: &mut [u8]) {
    let mut put = |at: WordAddress, value: &[u8]| {
        bytes[at.byte()..at.byte() + value.len()].copy_from_slice(value);
    };
    let mut put_words = |at: WordAddress, words: &[u16]| {
        for (word, at) in words.iter().zip(at.value()..) {
            put(WordAddress(at), &word.to_le_bytes());
        }
    };
    let guarded = image.configuration.to_bytes();
    let checksum = image.checksum.word(&guarded);
    let identity = &image.identity;
    put_words(word::CHECKSUM, &[checksum]);
    put_words(word::LEGACY_DELAYS, &image.legacy_delays);
    put_words(word::BOOTSTRAP_MAILBOX, &image.bootstrap_mailbox.to_words());
    put_words(word::STANDARD_MAILBOX, &image.standard_mailbox.to_words());
    put_words(word::MAILBOX_PROTOCOLS, &[image.protocols.0]);
    put_words(word::VENDOR_WORDS, &image.vendor_words);
    put_words(word::SIZE, &[image.size.0]);
    put_words(word::VERSION, &[image.version]);
    put(word::PDI_CONTROL, &guarded);
    put(word::VENDOR_ID, &identity.vendor_id.to_le_bytes());
    put(word::PRODUCT_CODE, &identity.product_code.to_le_bytes());
    put(word::REVISION, &identity.revision.to_le_bytes());
    put(word::SERIAL_NUMBER, &identity.serial_number.to_le_bytes());
}

/// Appends header and data of a category.
fn append(category: &Category, bytes: &mut Vec<u8>) -> Result<(), BuildError> {
    let kind = category.kind();
    let header_at = bytes.len();
    bytes.extend_from_slice(&kind.code().to_le_bytes());
    bytes.extend_from_slice(&[0, 0]);
    let start = bytes.len();
    data(category, bytes)?;
    if !(bytes.len() - start).is_multiple_of(2) {
        bytes.push(FILL);
    }
    let words = (bytes.len() - start) / 2;
    let Ok(len) = u16::try_from(words) else {
        return Err(BuildError::CategoryTooLong { kind, words });
    };
    bytes[header_at + 2..start].copy_from_slice(&len.to_le_bytes());
    Ok(())
}

fn data(category: &Category, bytes: &mut Vec<u8>) -> Result<(), BuildError> {
    match category {
        Category::Strings(strings) => strings.build(bytes),
        Category::General(general) => bytes.extend_from_slice(&general.to_bytes()),
        Category::Fmmu(usages) => bytes.extend(usages.iter().map(|usage| usage.code())),
        Category::SyncManagers(records) => {
            bytes.extend(records.iter().flat_map(|record| record.to_bytes()));
        }
        Category::TxPdos(pdos) | Category::RxPdos(pdos) => append_pdos(pdos, bytes)?,
        Category::OpModes(modes) => bytes.extend(modes.iter().flat_map(|mode| mode.to_bytes())),
        Category::Raw(raw) => bytes.extend_from_slice(raw.data()),
    }
    Ok(())
}

fn append_pdos(pdos: &[Pdo], bytes: &mut Vec<u8>) -> Result<(), BuildError> {
    for pdo in pdos {
        let entries = pdo.entries.len();
        if entries > Pdo::MAX_ENTRIES {
            return Err(BuildError::TooManyEntries { index: pdo.index, entries });
        }
        pdo.build(bytes);
    }
    Ok(())
}
