//! Devices that a file describes, found without reading it: their types, product codes, revisions.
//!
//! A folder of a maker's descriptions has hundreds of megabytes. To find one device in it, only the
//! elements `Vendor/Id` and `Device/Type` of each file are looked at; the file that has it is read
//! then.

use super::{encoding, value};

/// A device of a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiHeader {
    /// Number of the vendor.
    pub vendor_id: u32,
    /// Its type, such as `EL2004`.
    pub type_name: String,
    /// Its product code.
    pub product_code: u32,
    /// Its revision.
    pub revision: u32,
    /// Where it stands in the text of the file, in bytes: within its element `Device`.
    pub at: usize,
}

/// Most devices of a file.
const MOST: usize = 100_000;

/// The devices of a file, in its order; none for what is no device description.
#[must_use]
pub fn headers(bytes: &[u8]) -> Vec<EsiHeader> {
    let Ok(text) = encoding::decode(bytes) else { return Vec::new() };
    let vendor_id = vendor(&text).unwrap_or(0);
    let mut headers = Vec::new();
    // Only the types of devices have a product code; `HideType`, `SubDevice` and the like are others.
    for (at, _) in text.match_indices("<Type ") {
        let Some(rest) = text.get(at + "<Type ".len()..) else { continue };
        let Some((attributes, rest)) = rest.split_once('>') else { continue };
        let Some(product_code) = attribute(attributes, "ProductCode") else { continue };
        let name = rest.split('<').next().unwrap_or("").trim();
        headers.push(EsiHeader {
            vendor_id,
            type_name: name.to_owned(),
            product_code,
            revision: attribute(attributes, "RevisionNo").unwrap_or(0),
            at,
        });
        if headers.len() >= MOST {
            break;
        }
    }
    headers
}

fn vendor(text: &str) -> Option<u32> {
    let (_, rest) = text.split_once("<Vendor")?;
    let (_, rest) = rest.split_once("<Id>")?;
    value::number(rest.split('<').next()?).ok()
}

fn attribute(attributes: &str, name: &str) -> Option<u32> {
    let (_, rest) = attributes.split_once(name)?;
    let rest = rest.trim_start().strip_prefix('=')?.trim_start();
    let quote = rest.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    value::number(rest.get(1..)?.split(quote).next()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_found_without_reading_the_file() {
        let text = br##"<EtherCATInfo><Vendor><Id>#x2</Id></Vendor><Descriptions><Devices>
            <Device><Type ProductCode="#x07d43052" RevisionNo='18'>EL2004</Type><HideType RevisionNo="1"/>
            <Dictionary><Type Any="1">UINT</Type></Dictionary></Device></Devices></Descriptions>"##;
        let expected = EsiHeader {
            vendor_id: 2,
            type_name: "EL2004".to_owned(),
            product_code: 0x07D4_3052,
            revision: 18,
            at: 87,
        };
        assert_eq!(headers(text), [expected]);
        assert_eq!(headers(b"name = 1"), []);
    }
}
