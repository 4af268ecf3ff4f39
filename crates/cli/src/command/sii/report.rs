//! An EEPROM as JSON and as text.

use std::path::Path;

use linesman_proto::sii::word::SIZE;
use linesman_proto::sii::{Checksum, Image, Size};
use serde::Serialize;

use super::bytes_text;
use crate::command::service::DeviceReport;
use crate::output::Output;
use crate::version;

/// Most differences that are named.
const NAMED: usize = 32;

/// An EEPROM.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.sii/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// `read`, `write`, `verify` or `alias`.
    action: String,
    /// How many bytes were read, or were to be written.
    len: usize,
    /// Size of the EEPROM in bytes, as its size word says.
    size: usize,
    /// What is in it; `null` when it is no image.
    image: Option<ImageReport>,
    /// Where its bytes were saved, before anything was written; `null` when nothing was saved.
    saved: Option<String>,
    /// How many words were written; `null` when nothing was to be.
    words_written: Option<u32>,
    /// Words that are not as in the file, at most 32 of them; `null` unless compared.
    differences: Option<Vec<Difference>>,
    /// How many words differ.
    different_words: usize,
    /// The alias that the controller uses now; it takes a new one at power-on.
    alias_in_use: Option<u16>,
}

/// What is in an EEPROM.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct ImageReport {
    /// Vendor.
    vendor_id: u32,
    /// Product code.
    product_code: u32,
    /// Revision.
    revision: u32,
    /// Serial number; 0 for none.
    serial: u32,
    /// Station alias; 0 for none.
    alias: u16,
    /// `valid`, `skipped` (0x88A4, for development) or `wrong`.
    checksum: String,
    /// Order designation.
    r#type: String,
    /// Full name.
    name: String,
    /// Mailbox protocols.
    protocols: Vec<String>,
    /// Kinds of its categories, in order.
    categories: Vec<String>,
    /// What is odd about it.
    oddities: Vec<String>,
}

/// A word that is not as in the file.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Difference {
    /// Which word.
    word: u32,
    /// What is in the file.
    file: u16,
    /// What is in the EEPROM; `null` behind its end.
    eeprom: Option<u16>,
}

/// Size of an EEPROM as its size word says, but no less than what was read of it.
pub(super) fn size_of(bytes: &[u8]) -> usize {
    let word = bytes.get(SIZE.byte()..SIZE.byte() + 2).and_then(|word| word.first_chunk());
    let size = word.map_or(0, |word| Size(u16::from_le_bytes(*word)).bytes());
    // 0xFFFF was never programmed, 0 announces no room for anything: neither says a size.
    match word {
        Some([0xFF, 0xFF] | [0, 0]) | None => bytes.len().max(super::LARGEST as usize),
        Some(_) => size.max(bytes.len()),
    }
}

impl Report {
    fn of(device: DeviceReport, action: &str, bytes: &[u8]) -> Self {
        Self {
            schema: "linesman.sii/1".to_owned(),
            tool: version::tool(),
            device,
            action: action.to_owned(),
            len: bytes.len(),
            size: size_of(bytes),
            image: Image::parse(bytes).ok().map(|image| ImageReport::of(&image)),
            saved: None,
            words_written: None,
            differences: None,
            different_words: 0,
            alias_in_use: None,
        }
    }

    pub(super) fn read(device: DeviceReport, bytes: &[u8], saved: Option<&Path>) -> Self {
        let saved = saved.map(|path| path.display().to_string());
        Self { saved, ..Self::of(device, "read", bytes) }
    }

    pub(super) fn wrote(
        device: DeviceReport,
        action: &str,
        image: &[u8],
        words: u32,
        backup: &Path,
    ) -> Self {
        let saved = Some(backup.display().to_string());
        Self { saved, words_written: Some(words), ..Self::of(device, action, image) }
    }

    pub(super) fn alias(device: DeviceReport, bytes: &[u8], in_use: Option<u16>) -> Self {
        Self { alias_in_use: in_use, ..Self::of(device, "alias", bytes) }
    }

    pub(super) fn verified(device: DeviceReport, there: &[u8], image: &[u8], _file: &Path) -> Self {
        let word = |two: &[u8; 2]| u16::from_le_bytes(*two);
        let (wanted, found) = (image.as_chunks::<2>().0, there.as_chunks::<2>().0);
        let all: Vec<Difference> = (0..)
            .zip(wanted)
            .map(|(at, wanted)| Difference {
                word: at,
                file: word(wanted),
                eeprom: found.get(at as usize).map(word),
            })
            .filter(|one| one.eeprom != Some(one.file))
            .collect();
        let different_words = all.len();
        let differences = Some(all.into_iter().take(NAMED).collect());
        Self { differences, different_words, ..Self::of(device, "verify", there) }
    }

    /// Whether it is not as in the file.
    pub(super) fn differs(&self) -> bool {
        self.different_words > 0
    }

    pub(crate) fn text(&self, label: &str, output: &Output) -> String {
        let mut lines = vec![format!(
            "{label}: EEPROM of {}, {} {}",
            bytes_text(self.size),
            bytes_text(self.len),
            if self.action == "write" { "compared" } else { "read" }
        )];
        if let Some(words) = self.words_written {
            lines.push(match words {
                0 => "nothing had to be written: it was so already".to_owned(),
                1 => "1 word written and read back".to_owned(),
                words => format!("{words} words written and read back"),
            });
        }
        match &self.image {
            Some(image) => lines.extend(image.lines(output)),
            None => lines.push(output.paint().bad("no image: it is blank or too short")),
        }
        if let Some(alias) = self.alias_in_use {
            lines.push(format!("alias in use now: {alias}"));
        }
        if let Some(differences) = &self.differences {
            lines.push(match self.different_words {
                0 => "as in the file".to_owned(),
                words => output.paint().bad(&format!("{words} words are not as in the file:")),
            });
            lines.extend(differences.iter().map(|one| {
                let there = one.eeprom.map_or("-".to_owned(), |word| format!("0x{word:04X}"));
                format!("  word 0x{:04X}: file 0x{:04X}, EEPROM {there}", one.word, one.file)
            }));
        }
        if let Some(saved) = &self.saved {
            let what = if self.words_written.is_some() { "what was there" } else { "its bytes" };
            lines.push(format!("{what}: saved as {saved}"));
        }
        lines.push(String::new());
        lines.join("\n")
    }
}

impl ImageReport {
    fn of(image: &Image) -> Self {
        let identity = image.identity;
        Self {
            vendor_id: identity.vendor_id,
            product_code: identity.product_code,
            revision: identity.revision,
            serial: identity.serial_number,
            alias: image.configuration.station_alias.0,
            checksum: match image.checksum {
                Checksum::Valid => "valid",
                Checksum::Skipped => "skipped",
                Checksum::Wrong(_) => "wrong",
            }
            .to_owned(),
            r#type: image.order().unwrap_or_default().to_owned(),
            name: image.name().unwrap_or_default().to_owned(),
            protocols: image.protocols.names().map(str::to_owned).collect(),
            categories: image.categories.iter().map(|one| one.kind().to_string()).collect(),
            oddities: image.oddities.iter().map(ToString::to_string).collect(),
        }
    }

    fn lines(&self, output: &Output) -> Vec<String> {
        let mut lines = vec![
            format!("type {}, {}", self.r#type, self.name),
            format!(
                "vendor 0x{:08X}, product 0x{:08X}, revision 0x{:08X}, serial {}",
                self.vendor_id, self.product_code, self.revision, self.serial
            ),
            format!("alias {}", self.alias),
            match self.checksum.as_str() {
                "wrong" => output.paint().bad("checksum of the first words: wrong"),
                checksum => format!("checksum of the first words: {checksum}"),
            },
            format!(
                "protocols: {}",
                match self.protocols.join(", ").as_str() {
                    "" => "none",
                    names => names,
                }
            ),
            format!("categories: {}", self.categories.join(", ")),
        ];
        lines.extend(self.oddities.iter().map(|oddity| format!("odd: {oddity}")));
        lines
    }
}
