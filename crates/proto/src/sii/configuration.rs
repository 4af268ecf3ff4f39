//! Words 0..=7: what the controller loads into its own registers at power-on, and the checksum that
//! guards them.
//!
//! Reference: S2 on registers 0x0140..0x0153, 0x0012, 0x0982; ETG.1000.6 §5.4. A controller that
//! finds the checksum wrong sets bit 11 of register 0x0502 and starts without its configuration.

use crate::address::StationAlias;

/// What words 0..=6 ask the controller to be.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Configuration {
    /// Process data interface, register 0x0140: 0x04 digital I/O, 0x05 SPI, 0x07 E-bus bridge, ...
    pub pdi_control: u8,
    /// ESC configuration, register 0x0141: bit 0 device emulation, bit 2 SYNC unit, bit 3 latch
    /// unit, bits 1 and 4..=7 enhanced link detection.
    pub esc_configuration: u8,
    /// PDI configuration, registers 0x0150 and 0x0151.
    pub pdi_configuration: u16,
    /// Length of the SYNC pulse in units of 10 ns, register 0x0982.
    pub sync_impulse: u16,
    /// Extended PDI configuration, register 0x0152.
    pub pdi_configuration_2: u16,
    /// Configured station alias, register 0x0012. 0 means none.
    pub station_alias: StationAlias,
    /// Words 5 and 6: registers 0x0142 and 0x0144 where the controller has them, else reserved.
    pub esc_configuration_2: [u16; 2],
}

impl Configuration {
    /// The configuration in the first 14 bytes of an image.
    #[must_use]
    pub const fn from_bytes(bytes: &[u8; 14]) -> Self {
        const fn word(bytes: &[u8; 14], index: usize) -> u16 {
            u16::from_le_bytes([bytes[2 * index], bytes[2 * index + 1]])
        }
        Self {
            pdi_control: bytes[0],
            esc_configuration: bytes[1],
            pdi_configuration: word(bytes, 1),
            sync_impulse: word(bytes, 2),
            pdi_configuration_2: word(bytes, 3),
            station_alias: StationAlias(word(bytes, 4)),
            esc_configuration_2: [word(bytes, 5), word(bytes, 6)],
        }
    }

    /// The first 14 bytes of an image.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; 14] {
        let words = [
            u16::from_le_bytes([self.pdi_control, self.esc_configuration]),
            self.pdi_configuration,
            self.sync_impulse,
            self.pdi_configuration_2,
            self.station_alias.value(),
            self.esc_configuration_2[0],
            self.esc_configuration_2[1],
        ];
        let mut bytes = [0; 14];
        for (slot, word) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(words) {
            *slot = word.to_le_bytes();
        }
        bytes
    }

    /// Length of the SYNC pulse in ns; 0 means that the application must acknowledge it.
    #[must_use]
    pub const fn sync_impulse_ns(&self) -> u32 {
        self.sync_impulse as u32 * 10
    }

    /// Whether the controller answers AL control by itself (register 0x0141 bit 0): a simple device
    /// without a processor, whose AL status needs no error acknowledge.
    #[must_use]
    pub const fn device_emulation(&self) -> bool {
        self.esc_configuration & 0x01 != 0
    }
}

/// What word 7 says about words 0..=6.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Checksum {
    /// It fits. Building computes it anew.
    #[default]
    Valid,
    /// 0x88A4, which tells the controller not to check; meant for development only.
    Skipped,
    /// Something else, kept as it was found. Building writes it back, so that a damaged image can
    /// be reproduced; set it to [`Checksum::Valid`] to mend the image.
    Wrong(u16),
}

impl Checksum {
    /// The value of word 7 that makes a controller skip the check.
    pub const SKIP: u16 = 0x88A4;

    /// Judges word 7 by the 14 bytes before it.
    #[must_use]
    pub const fn judge(word: u16, guarded: &[u8; 14]) -> Self {
        let [low, _] = word.to_le_bytes();
        if word == Self::SKIP {
            Self::Skipped
        } else if low == checksum(guarded) {
            Self::Valid
        } else {
            Self::Wrong(word)
        }
    }

    /// Word 7 for these 14 bytes.
    #[must_use]
    pub const fn word(self, guarded: &[u8; 14]) -> u16 {
        match self {
            Self::Valid => checksum(guarded) as u16,
            Self::Skipped => Self::SKIP,
            Self::Wrong(word) => word,
        }
    }
}

/// CRC-8 of words 0..=6: polynomial x⁸+x²+x+1 (0x07), initial value 0xFF, most significant bit
/// first, no final inversion.
///
/// Reference: ETG.1000.6 §5.4; verified against images of real devices.
#[must_use]
pub const fn checksum(guarded: &[u8; 14]) -> u8 {
    let mut crc = 0xFFu8;
    let mut at = 0;
    while at < guarded.len() {
        crc ^= guarded[at];
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x80 != 0 { (crc << 1) ^ 0x07 } else { crc << 1 };
            bit += 1;
        }
        at += 1;
    }
    crc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_of_real_devices_come_out() {
        let table: [([u8; 14], u8); 5] = [
            // EK1100, EL2004, EL2828, NI 9144, EasyCAT: as their makers programmed them.
            ([0x00, 0x0D, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], 0x46),
            ([0x04, 0x01, 0, 0, 0, 0, 0x0F, 0, 0, 0, 0, 0, 0, 0], 0xD8),
            ([0x04, 0x01, 0, 0, 0, 0, 0xFF, 0, 0, 0, 0, 0, 0, 0], 0xE2),
            ([0x08, 0x00, 0, 0x66, 0, 0x01, 0, 0, 0, 0, 0, 0, 0, 0], 0x0A),
            ([0x80, 0x02, 0, 0x6E, 0xFF, 0, 0xFF, 0, 0, 0, 0, 0, 0, 0], 0xB6),
        ];
        for (guarded, expected) in table {
            assert_eq!(checksum(&guarded), expected, "{guarded:02X?}");
        }
    }

    #[test]
    fn a_checksum_is_valid_skipped_or_wrong() {
        let guarded = [0x00, 0x0D, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for (word, expected) in [
            (0x0046, Checksum::Valid),
            (0x1246, Checksum::Valid),
            (0x88A4, Checksum::Skipped),
            (0x0047, Checksum::Wrong(0x0047)),
        ] {
            assert_eq!(Checksum::judge(word, &guarded), expected, "word 0x{word:04X}");
        }
        assert_eq!(Checksum::Valid.word(&guarded), 0x0046);
        assert_eq!(Checksum::Skipped.word(&guarded), 0x88A4);
        assert_eq!(Checksum::Wrong(0xBEEF).word(&guarded), 0xBEEF);
    }

    #[test]
    fn every_word_of_the_configuration_keeps_its_place() {
        let bytes: [u8; 14] = std::array::from_fn(|at| 0x10 + at as u8);
        let configuration = Configuration::from_bytes(&bytes);
        assert_eq!(configuration.pdi_control, 0x10);
        assert_eq!(configuration.esc_configuration, 0x11);
        assert_eq!(configuration.sync_impulse, 0x1514);
        assert_eq!(configuration.station_alias, StationAlias(0x1918));
        assert_eq!(configuration.esc_configuration_2, [0x1B1A, 0x1D1C]);
        assert_eq!(configuration.to_bytes(), bytes);
    }
}
