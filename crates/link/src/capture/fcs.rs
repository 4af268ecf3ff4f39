//! The frame check sequence, where a capture has it.
//!
//! Reference: IEEE 802.3 clause 3.2.9: CRC-32 over all before it, sent low byte first.

/// Length of the check sequence, in bytes.
pub(super) const FCS_LEN: usize = 4;

/// Whether the last four bytes are the right check sequence of those before them. `None` when
/// there are no four.
pub(super) fn intact(frame_with_fcs: &[u8]) -> Option<bool> {
    let (frame, fcs) = frame_with_fcs.split_last_chunk::<FCS_LEN>()?;
    Some(crc32fast::hash(frame) == u32::from_le_bytes(*fcs))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_of_crc_32() {
        // CRC-32/ISO-HDLC of "123456789" is 0xCBF43926.
        let mut bytes = b"123456789".to_vec();
        bytes.extend(0xCBF4_3926_u32.to_le_bytes());
        assert_eq!(intact(&bytes), Some(true));
        bytes[3] ^= 0x10;
        assert_eq!(intact(&bytes), Some(false));
        assert_eq!(intact(&bytes[..3]), None);
    }
}
