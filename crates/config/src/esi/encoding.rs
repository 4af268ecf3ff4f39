//! Decoding of bytes to text: the encoding that the XML declaration names, else UTF-8.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8};

use super::error::EsiError;

/// The declaration stands within so many bytes, if there is one.
const DECLARATION: usize = 200;

/// The text of a file. Bytes that are not of their encoding become replacement characters: they are
/// found in comments and translated names of working files.
pub(crate) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, EsiError> {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        return Ok(encoding.decode_without_bom_handling(&bytes[mark..]).0);
    }
    let encoding = match declared(bytes) {
        None => UTF_8,
        Some(label) => Encoding::for_label(label.as_bytes()).ok_or_else(|| {
            let reason = format!("encoding \"{label}\" is not known; save it as UTF-8");
            EsiError::new(1, "XML declaration", reason)
        })?,
    };
    Ok(encoding.decode_without_bom_handling(bytes).0)
}

/// What the declaration says, such as `ISO-8859-1`.
fn declared(bytes: &[u8]) -> Option<String> {
    let head = &bytes[..bytes.len().min(DECLARATION)];
    let head: String = head.iter().copied().map(char::from).collect();
    let (declaration, _) = head.strip_prefix("<?xml")?.split_once("?>")?;
    let (_, rest) = declaration.split_once("encoding")?;
    let rest = rest.trim_start().strip_prefix('=')?.trim_start();
    let quote = rest.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    rest[1..].split(quote).next().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_declared_encoding_counts() {
        let latin = b"<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><a>1\xB5s</a>";
        assert!(decode(latin).unwrap().ends_with("<a>1\u{B5}s</a>"));
        let odd = b"<?xml version='1.0' encoding='ISO8859-1'?>\xE4";
        assert!(decode(odd).unwrap().ends_with('\u{E4}'));
        assert_eq!(decode("\u{FEFF}<a>\u{B5}</a>".as_bytes()).unwrap(), "<a>\u{B5}</a>");
        let wide: Vec<u8> =
            [0xFEFF, 0x3C, 0x61].iter().flat_map(|c: &u16| c.to_le_bytes()).collect();
        assert_eq!(decode(&wide).unwrap(), "<a");
        assert_eq!(decode(b"<a>\xFF</a>").unwrap(), "<a>\u{FFFD}</a>");
    }

    #[test]
    fn an_unknown_encoding_is_refused() {
        let error = decode(b"<?xml version=\"1.0\" encoding=\"EBCDIC-7\"?><a/>").unwrap_err();
        assert_eq!(
            error.to_string(),
            "line 1, XML declaration: encoding \"EBCDIC-7\" is not known; save it as UTF-8"
        );
    }
}
