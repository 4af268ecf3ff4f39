//! A firmware file: one line of text, then anything.

use linesman_proto::mailbox::foe::FoeErrorCode;

const WORDS: &str = "Linesman firmware";

/// What a firmware file says of itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FirmwareImage<'a> {
    /// The type of device it is for.
    pub type_name: &'a str,
    /// Its version, as object 0x100A is to show it.
    pub version: &'a str,
    /// What is behind the first line.
    pub body: &'a [u8],
}

impl<'a> FirmwareImage<'a> {
    /// Reads a file and checks its sum.
    ///
    /// # Errors
    /// [`FoeErrorCode::PROGRAM_ERROR`] for what is no firmware file, [`FoeErrorCode::CHECKSUM`] for
    /// one that is damaged.
    pub fn parse(file: &'a [u8]) -> Result<Self, FoeErrorCode> {
        let no_firmware = FoeErrorCode::PROGRAM_ERROR;
        let end = file.iter().position(|letter| *letter == b'\n').ok_or(no_firmware)?;
        let (line, body) = (&file[..end], &file[end + 1..]);
        let line = std::str::from_utf8(line).map_err(|_| no_firmware)?;
        let line = line.strip_prefix(WORDS).ok_or(no_firmware)?;
        let mut words = line.split_whitespace();
        let (Some(type_name), Some(version), Some(sum), None) =
            (words.next(), words.next(), words.next(), words.next())
        else {
            return Err(no_firmware);
        };
        let sum = u32::from_str_radix(sum, 16).map_err(|_| no_firmware)?;
        if crc32fast::hash(body) != sum {
            return Err(FoeErrorCode::CHECKSUM);
        }
        Ok(Self { type_name, version, body })
    }

    /// Makes a file. Type and version are words.
    #[must_use]
    pub fn build(type_name: &str, version: &str, body: &[u8]) -> Vec<u8> {
        let sum = crc32fast::hash(body);
        let mut file = format!("{WORDS} {type_name} {version} {sum:08X}\n").into_bytes();
        file.extend_from_slice(body);
        file
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_this_text() {
        let file = FirmwareImage::build("EL6601", "12", b"123456789");
        assert_eq!(file, b"Linesman firmware EL6601 12 CBF43926\n123456789");
        let image = FirmwareImage::parse(&file).unwrap();
        assert_eq!(
            (image.type_name, image.version, image.body),
            ("EL6601", "12", &b"123456789"[..])
        );
    }

    #[test]
    fn what_is_none_is_refused() {
        for (file, code) in [
            (&b""[..], 0x800B),
            (b"Linesman firmware EL6601 12 CBF43926", 0x800B),
            (b"Linesman firmware EL6601 CBF43926\n123456789", 0x800B),
            (b"Linesman firmware EL6601 12 CBF4392X\n123456789", 0x800B),
            (b"Linesman firmware EL6601 12 CBF43926 more\n123456789", 0x800B),
            (b"\xFF\xFE\n", 0x800B),
            (b"Linesman firmware EL6601 12 CBF43926\n123456788", 0x800C),
        ] {
            assert_eq!(FirmwareImage::parse(file), Err(FoeErrorCode(code)), "{file:?}");
        }
    }
}
