//! SoE server of a drive that has no IDN to show: it answers each request with an error.
//!
//! Reference: ETG.1000.6, SoE (header and error codes). Its process data need no IDN to be read: MDT
//! and AT are what they are.

/// Length of the header: two bytes of switches, two of the IDN.
const HEADER: usize = 4;
/// Operation codes, bits 0 to 2.
const READ_REQUEST: u8 = 1;
const READ_RESPONSE: u8 = 2;
const WRITE_REQUEST: u8 = 3;
const WRITE_RESPONSE: u8 = 4;
/// Bit 4: an error code follows the header.
const ERROR: u8 = 0x10;
/// Bits 5 to 7: which drive.
const DRIVE: u8 = 0xE0;
/// There is no such IDN.
const NO_IDN: u16 = 0x1001;

/// The answer to a request; none to what asks for none.
pub(super) fn answer(request: &[u8]) -> Option<Vec<u8>> {
    let header = request.get(..HEADER)?;
    let response = match header[0] & 0x07 {
        READ_REQUEST => READ_RESPONSE,
        WRITE_REQUEST => WRITE_RESPONSE,
        _ => return None,
    };
    let mut answer = header.to_vec();
    answer[0] = response | ERROR | header[0] & DRIVE;
    answer.extend_from_slice(&NO_IDN.to_le_bytes());
    Some(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_refused_with_the_idn_they_ask_for() {
        // Read S-0-0051, value, drive 1; write S-0-0036.
        assert_eq!(answer(&[0x21, 0x40, 51, 0]), Some(vec![0x32, 0x40, 51, 0, 0x01, 0x10]));
        assert_eq!(answer(&[0x03, 0x40, 36, 0, 9, 9]), Some(vec![0x14, 0x40, 36, 0, 0x01, 0x10]));
        assert_eq!(answer(&[0x05, 0, 0, 0]), None, "a notification");
        assert_eq!(answer(&[0x01, 0]), None, "cut off");
    }
}
