//! Conversion of bytes to an [`Image`]; behind [`Image::parse`].
//!
//! Reference: ETG.1000.6 §5.4, ETG.2010. The order of the code is the order of the image.

use std::ops::Range;

use super::category::{Category, CategoryKind, RawCategory};
use super::clock::OpMode;
use super::configuration::{Checksum, Configuration, checksum};
use super::fmmu::FmmuUsage;
use super::general::General;
use super::image::{Identity, Image, Size};
use super::mailbox::{MailboxPair, Protocols};
use super::oddity::{Oddity, OddityKind, SiiError};
use super::pdo::{Pdo, PdoEntry};
use super::strings::{StringIndex, Strings};
use super::sync_manager::SyncManager;
use super::walk::{HEADER_WORDS, Step, Walk};
use super::word::{self, WordAddress};

/// Bytes of the fixed words.
const FIXED_LEN: usize = word::FIRST_CATEGORY.byte();

/// Parses a whole image.
pub(super) fn image(bytes: &[u8]) -> Result<Image, SiiError> {
    let Some((head, _)) = bytes.split_at_checked(SiiError::MIN_LEN) else {
        return Err(SiiError::TooShort { len: bytes.len() });
    };
    for byte in [0xFF, 0x00] {
        if head.iter().all(|&found| found == byte) {
            return Err(SiiError::Blank { byte });
        }
    }
    let mut parser = Parser { bytes, oddities: Vec::new(), references: Vec::new() };
    let mut image = parser.fixed_words();
    if bytes.len() >= FIXED_LEN {
        let end = parser.categories(&mut image.categories);
        parser.judge_size(image.size, end);
    }
    parser.judge_references(&image);
    image.oddities = parser.oddities;
    // References are judged last, yet a reader goes through the image from front to back.
    image.oddities.sort_by_key(|oddity| oddity.at);
    Ok(image)
}

struct Parser<'a> {
    bytes: &'a [u8],
    oddities: Vec<Oddity>,
    /// Who asks for which text; judged when all texts are known.
    references: Vec<(WordAddress, StringIndex)>,
}

impl<'a> Parser<'a> {
    fn note(&mut self, at: WordAddress, kind: OddityKind) {
        self.oddities.push(Oddity { at, kind });
    }

    fn refer(&mut self, at: WordAddress, index: StringIndex) {
        if !index.is_none() {
            self.references.push((at, index));
        }
    }

    fn word(&self, at: WordAddress) -> Option<u16> {
        let at = at.byte();
        Some(u16::from_le_bytes([*self.bytes.get(at)?, *self.bytes.get(at + 1)?]))
    }

    fn fixed_words(&mut self) -> Image {
        let mut fixed = Fixed([0; FIXED_LEN]);
        let len = self.bytes.len().min(FIXED_LEN);
        fixed.0[..len].copy_from_slice(&self.bytes[..len]);
        if len < FIXED_LEN {
            self.note(WordAddress::of_byte(len), OddityKind::HeaderCutOff);
        }
        let guarded: [u8; 14] = std::array::from_fn(|at| fixed.0[at]);
        let checksum_word = fixed.word(word::CHECKSUM);
        Image {
            configuration: Configuration::from_bytes(&guarded),
            checksum: self.checksum(checksum_word, &guarded),
            identity: Identity {
                vendor_id: fixed.long(word::VENDOR_ID),
                product_code: fixed.long(word::PRODUCT_CODE),
                revision: fixed.long(word::REVISION),
                serial_number: fixed.long(word::SERIAL_NUMBER),
            },
            legacy_delays: fixed.words(word::LEGACY_DELAYS),
            bootstrap_mailbox: MailboxPair::from_words(fixed.words(word::BOOTSTRAP_MAILBOX)),
            standard_mailbox: MailboxPair::from_words(fixed.words(word::STANDARD_MAILBOX)),
            protocols: Protocols(fixed.word(word::MAILBOX_PROTOCOLS)),
            vendor_words: fixed.words(word::VENDOR_WORDS),
            size: Size(fixed.word(word::SIZE)),
            version: fixed.word(word::VERSION),
            categories: Vec::new(),
            oddities: Vec::new(),
        }
    }

    fn checksum(&mut self, found: u16, guarded: &[u8; 14]) -> Checksum {
        let judged = Checksum::judge(found, guarded);
        let computed = checksum(guarded);
        match judged {
            Checksum::Valid if found != u16::from(computed) => {
                self.note(word::CHECKSUM, OddityKind::ChecksumHighByte { found });
            }
            Checksum::Valid => {}
            Checksum::Skipped => self.note(word::CHECKSUM, OddityKind::ChecksumSkipped),
            Checksum::Wrong(_) => {
                self.note(word::CHECKSUM, OddityKind::ChecksumWrong { found, computed });
            }
        }
        judged
    }

    /// Walks the categories; gives the byte behind the last.
    fn categories(&mut self, into: &mut Vec<Category>) -> usize {
        let mut walk = Walk::new();
        loop {
            let header_at = walk.header_at();
            let kind_word = self.word(header_at);
            let len_word = self.word(WordAddress(header_at.value() + 1));
            let (kind, len) = match (kind_word, len_word) {
                (Some(kind), Some(len)) => (kind, len),
                // The end marker may be the very last word of the EEPROM.
                (Some(0xFFFF), None) => (0xFFFF, 0),
                (_, None) | (None, Some(_)) => {
                    self.note(header_at, OddityKind::NoEndMarker);
                    return self.bytes.len();
                }
            };
            match walk.step(kind, len) {
                Step::End => return header_at.byte(),
                Step::EmptyHeaders => {
                    self.drop_empty_headers(into, header_at);
                    return header_at.byte();
                }
                Step::Category { start, end } => {
                    let kind = CategoryKind::from_code(kind);
                    let data = self.category_data(kind, len, start..end);
                    let category = self.category(kind, start, data);
                    self.judge_repetition(&category, header_at, into);
                    into.push(category);
                    if end.byte() > self.bytes.len() {
                        return self.bytes.len();
                    }
                }
            }
        }
    }

    /// Strings and General are there once; of a second one nobody could say which counts.
    fn judge_repetition(&mut self, new: &Category, at: WordAddress, known: &[Category]) {
        let kind = new.kind();
        let once = matches!(new, Category::Strings(_) | Category::General(_));
        if once && known.iter().any(|category| category.kind() == kind) {
            self.note(at, OddityKind::Repeated { kind });
        }
    }

    /// The empty headers that turned out to be filling were taken for categories at first.
    fn drop_empty_headers(&mut self, categories: &mut Vec<Category>, last_at: WordAddress) {
        let is_empty = |category: &Category| match category {
            Category::Raw(raw) => raw.kind() == CategoryKind::Nop && raw.data().is_empty(),
            Category::Strings(_)
            | Category::General(_)
            | Category::Fmmu(_)
            | Category::SyncManagers(_)
            | Category::TxPdos(_)
            | Category::RxPdos(_)
            | Category::OpModes(_) => false,
        };
        let mut first_at = last_at;
        while categories.last().is_some_and(is_empty) {
            categories.pop();
            first_at = WordAddress(first_at.value() - HEADER_WORDS);
        }
        self.note(first_at, OddityKind::EmptyHeaders);
    }

    /// The data of a category as far as they are there, in whole words.
    fn category_data(
        &mut self,
        kind: CategoryKind,
        announced: u16,
        range: Range<WordAddress>,
    ) -> &'a [u8] {
        let start = range.start.byte();
        let end = range.end.byte().min(self.bytes.len());
        let words = (end - start) / 2;
        if end < range.end.byte() {
            let found = words as u32;
            self.note(range.start, OddityKind::CategoryCutOff { kind, announced, found });
        }
        &self.bytes[start..start + 2 * words]
    }

    fn category(&mut self, kind: CategoryKind, at: WordAddress, data: &[u8]) -> Category {
        match kind {
            CategoryKind::Strings => Category::Strings(self.strings(at, data)),
            CategoryKind::General => Category::General(Box::new(self.general(at, data))),
            CategoryKind::Fmmu => {
                Category::Fmmu(data.iter().copied().map(FmmuUsage::from_code).collect())
            }
            CategoryKind::SyncManagers => {
                let records = self.records(kind, at, data);
                Category::SyncManagers(
                    records.iter().copied().map(SyncManager::from_bytes).collect(),
                )
            }
            CategoryKind::TxPdos => Category::TxPdos(self.pdos(kind, at, data)),
            CategoryKind::RxPdos => Category::RxPdos(self.pdos(kind, at, data)),
            CategoryKind::OpModes => Category::OpModes(self.op_modes(at, data)),
            CategoryKind::Nop
            | CategoryKind::DataTypes
            | CategoryKind::FmmuExtended
            | CategoryKind::SyncUnits
            | CategoryKind::End
            | CategoryKind::Other(_) => Category::Raw(RawCategory::from_image(kind, data)),
        }
    }

    /// The records of one length that fill a category.
    fn records<'d, const LEN: usize>(
        &mut self,
        kind: CategoryKind,
        at: WordAddress,
        data: &'d [u8],
    ) -> &'d [[u8; LEN]] {
        let (records, rest) = data.as_chunks::<LEN>();
        if !rest.is_empty() {
            let left = rest.len();
            let at = offset(at, data.len() - left);
            self.note(at, OddityKind::TrailingBytes { kind, left });
        }
        records
    }

    fn strings(&mut self, at: WordAddress, data: &[u8]) -> Strings {
        let parsed = Strings::parse(data);
        let found = parsed.strings.len();
        let announced = parsed.announced;
        if found < usize::from(announced) {
            self.note(at, OddityKind::StringsCutOff { announced, found });
        } else if parsed.left > 1 {
            // One byte fills up to a whole word.
            let kind = CategoryKind::Strings;
            let left = parsed.left;
            let behind = offset(at, data.len() - left);
            self.note(behind, OddityKind::TrailingBytes { kind, left });
        }
        parsed.strings
    }

    fn general(&mut self, at: WordAddress, data: &[u8]) -> General {
        let mut bytes = [0; General::LEN];
        let len = data.len().min(General::LEN);
        bytes[..len].copy_from_slice(&data[..len]);
        if data.len() < General::LEN {
            self.note(at, OddityKind::GeneralShort { len });
        } else if data.len() > General::LEN {
            let kind = CategoryKind::General;
            let left = data.len() - General::LEN;
            self.note(offset(at, General::LEN), OddityKind::TrailingBytes { kind, left });
        }
        let general = General::from_bytes(&bytes);
        for (byte, index) in [
            (0, general.group),
            (1, general.image),
            (2, general.order),
            (3, general.name),
            (14, general.group_again),
        ] {
            self.refer(offset(at, byte), index);
        }
        general
    }

    fn op_modes(&mut self, at: WordAddress, data: &[u8]) -> Vec<OpMode> {
        let records = self.records(CategoryKind::OpModes, at, data);
        let mut modes = Vec::with_capacity(records.len());
        for (number, record) in records.iter().enumerate() {
            let mode = OpMode::from_bytes(record);
            let names_at = offset(at, number * OpMode::LEN + 18);
            self.refer(names_at, mode.name);
            self.refer(names_at, mode.description);
            modes.push(mode);
        }
        modes
    }

    fn pdos(&mut self, kind: CategoryKind, at: WordAddress, data: &[u8]) -> Vec<Pdo> {
        let records = self.records::<{ Pdo::RECORD_LEN }>(kind, at, data);
        let mut records = records.iter().copied().zip(0..);
        let mut pdos = Vec::new();
        while let Some((header, place)) = records.next() {
            let header_at = offset(at, place * Pdo::RECORD_LEN);
            let (mut pdo, announced) = Pdo::header_from_bytes(header);
            self.refer(offset(header_at, 5), pdo.name);
            for (record, place) in records.by_ref().take(usize::from(announced)) {
                let entry = PdoEntry::from_bytes(record);
                self.refer(offset(at, place * Pdo::RECORD_LEN + 3), entry.name);
                pdo.entries.push(entry);
            }
            let (index, found) = (pdo.index, pdo.entries.len());
            if found < usize::from(announced) {
                self.note(header_at, OddityKind::PdoCutOff { index, announced, found });
            }
            pdos.push(pdo);
        }
        pdos
    }

    fn judge_size(&mut self, size: Size, used: usize) {
        if used > size.bytes() {
            self.note(word::SIZE, OddityKind::BeyondSize { used, size: size.bytes() });
        }
    }

    /// Looks for texts that are not there, once all categories are known.
    fn judge_references(&mut self, image: &Image) {
        let count = image.strings().map_or(0, Strings::len);
        for (at, index) in std::mem::take(&mut self.references) {
            if usize::from(index.0) > count {
                self.note(at, OddityKind::StringMissing { index, count });
            }
        }
    }
}

/// The word that holds byte `bytes` of something that begins at `at`.
const fn offset(at: WordAddress, bytes: usize) -> WordAddress {
    WordAddress::of_byte(at.byte() + bytes)
}

/// The fixed words.
struct Fixed([u8; FIXED_LEN]);

impl Fixed {
    const fn word(&self, at: WordAddress) -> u16 {
        u16::from_le_bytes([self.0[at.byte()], self.0[at.byte() + 1]])
    }

    const fn long(&self, at: WordAddress) -> u32 {
        let high = self.word(WordAddress(at.value() + 1));
        self.word(at) as u32 | (high as u32) << 16
    }

    fn words<const COUNT: usize>(&self, at: WordAddress) -> [u16; COUNT] {
        std::array::from_fn(|index| self.word(WordAddress(at.value() + index as u32)))
    }
}
