//! Content to be programmed into the EEPROM: element `Eeprom` (ETG.2000).

use linesman_proto::sii::{Configuration, MailboxPair};

use super::error::EsiError;
use super::value;
use super::xml::Element;

/// Content of an EEPROM, as far as the rest of the description does not tell it.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct EsiEeprom {
    /// Its length in bytes.
    pub byte_size: u32,
    /// Words 0 to 6.
    pub configuration: Configuration,
    /// Words 0x14 to 0x17.
    pub bootstrap: MailboxPair,
    /// Further categories: type and content.
    pub categories: Vec<(u16, Vec<u8>)>,
    /// A whole image, which stands for everything else.
    pub image: Option<Vec<u8>>,
}

/// The content that an element `Eeprom` describes.
pub(super) fn eeprom(element: &Element) -> Result<EsiEeprom, EsiError> {
    let bytes = |element: &Element| value::bytes(element.text()).map_err(|why| element.error(why));
    let within = |error: EsiError| error.within("Eeprom");
    let mut eeprom = EsiEeprom {
        byte_size: element.child_number("ByteSize")?.unwrap_or(0),
        ..EsiEeprom::default()
    };
    if let Some(data) = element.child("Data") {
        eeprom.image = Some(bytes(data).map_err(within)?);
    }
    if let Some(data) = element.child("ConfigData") {
        let found = bytes(data).map_err(within)?;
        let mut words = [0; 14];
        // Word 7 is the checksum, which is computed.
        let len = found.len().min(words.len());
        if found.len() > 16 {
            let reason = format!("{} bytes, expected at most 16", found.len());
            return Err(within(data.error(reason)));
        }
        words[..len].copy_from_slice(&found[..len]);
        eeprom.configuration = Configuration::from_bytes(&words);
    }
    if let Some(data) = element.child("BootStrap") {
        let found = bytes(data).map_err(within)?;
        let words: [u8; 8] = found.as_slice().try_into().map_err(|_| {
            let reason = format!("{} bytes, expected 8: two addresses and lengths", found.len());
            within(data.error(reason))
        })?;
        let (words, _) = words.as_chunks::<2>();
        let words = std::array::from_fn(|at| u16::from_le_bytes(words[at]));
        eeprom.bootstrap = MailboxPair::from_words(words);
    }
    for category in element.children("Category") {
        let number = category.child_number("CatNo").map_err(within)?.unwrap_or(0);
        let mut data = category.child("Data").map_or(Ok(Vec::new()), bytes).map_err(within)?;
        if !data.len().is_multiple_of(2) {
            data.push(0xFF);
        }
        eeprom.categories.push((number, data));
    }
    Ok(eeprom)
}
