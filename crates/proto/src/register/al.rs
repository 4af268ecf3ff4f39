//! AL control (0x0120) and AL status (0x0130): the state asked for, the state there is.
//!
//! Reference: S2 2.5.1 and 2.5.2. What the states are and which steps exist is in
//! [`crate::state`].

use std::fmt;

use crate::state::{AlState, AlStatusCode, StateValue};

const FLAG_4: u16 = 1 << 4;
const FLAG_5: u16 = 1 << 5;
const FLAG_6: u16 = 1 << 6;

const fn set(value: u16, bit: u16, on: bool) -> u16 {
    if on { value | bit } else { value & !bit }
}

/// The AL control register: what a MainDevice asks for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct AlControl(pub u16);

impl AlControl {
    /// A plain request for a state.
    #[must_use]
    pub const fn request(state: AlState) -> Self {
        Self(state.bits() as u16)
    }

    /// From the two bytes of the register.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_le_bytes(bytes))
    }

    /// The two bytes of the register.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    /// The register value.
    #[must_use]
    pub const fn value(self) -> u16 {
        self.0
    }

    /// The state asked for.
    #[must_use]
    pub const fn requested(self) -> StateValue {
        StateValue::from_bits(self.0 as u8)
    }

    /// Whether the MainDevice acknowledges the error in AL status. Not to be sent to a controller
    /// with device emulation, which would copy it to AL status as an error.
    #[must_use]
    pub const fn acknowledges_error(self) -> bool {
        self.0 & FLAG_4 != 0
    }

    /// Whether the MainDevice asks for the identification.
    #[must_use]
    pub const fn requests_identification(self) -> bool {
        self.0 & FLAG_5 != 0
    }

    /// Whether the MainDevice acknowledges the warning in AL status.
    #[must_use]
    pub const fn acknowledges_warning(self) -> bool {
        self.0 & FLAG_6 != 0
    }

    /// This request with or without the acknowledgement of an error.
    #[must_use]
    pub const fn with_error_acknowledge(self, on: bool) -> Self {
        Self(set(self.0, FLAG_4, on))
    }

    /// This request with or without the request for the identification.
    #[must_use]
    pub const fn with_identification_request(self, on: bool) -> Self {
        Self(set(self.0, FLAG_5, on))
    }

    /// This request with or without the acknowledgement of a warning.
    #[must_use]
    pub const fn with_warning_acknowledge(self, on: bool) -> Self {
        Self(set(self.0, FLAG_6, on))
    }
}

impl Default for AlControl {
    fn default() -> Self {
        Self::request(AlState::Init)
    }
}

impl fmt::Display for AlControl {
    /// `SAFEOP`, `INIT, error acknowledge`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.requested())?;
        for (bit, text) in [
            (FLAG_4, ", error acknowledge"),
            (FLAG_5, ", identification request"),
            (FLAG_6, ", warning acknowledge"),
        ] {
            if self.0 & bit != 0 {
                f.write_str(text)?;
            }
        }
        Ok(())
    }
}

/// The AL status register: what a SubDevice is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct AlStatus(pub u16);

impl AlStatus {
    /// The status of a SubDevice in a state, without error.
    #[must_use]
    #[inline]
    pub const fn new(state: AlState) -> Self {
        Self(state.bits() as u16)
    }

    /// From the two bytes of the register.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_le_bytes(bytes))
    }

    /// The two bytes of the register.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    /// The register value.
    #[must_use]
    pub const fn value(self) -> u16 {
        self.0
    }

    /// The state. Of broadcast data use [`AlState::from_or`] instead.
    #[must_use]
    #[inline]
    pub const fn state(self) -> StateValue {
        StateValue::from_bits(self.0 as u8)
    }

    /// Whether a request was refused or the SubDevice left its state on its own; then the AL status
    /// code says why.
    #[must_use]
    #[inline]
    pub const fn error(self) -> bool {
        self.0 & FLAG_4 != 0
    }

    /// Whether the AL status code register holds the identification instead of a code.
    #[must_use]
    pub const fn identification_loaded(self) -> bool {
        self.0 & FLAG_5 != 0
    }

    /// Whether the AL status code register holds a warning.
    #[must_use]
    pub const fn warning(self) -> bool {
        self.0 & FLAG_6 != 0
    }

    /// This status with or without error.
    #[must_use]
    pub const fn with_error(self, on: bool) -> Self {
        Self(set(self.0, FLAG_4, on))
    }

    /// This status with or without a loaded identification.
    #[must_use]
    pub const fn with_identification_loaded(self, on: bool) -> Self {
        Self(set(self.0, FLAG_5, on))
    }

    /// This status with or without a warning.
    #[must_use]
    pub const fn with_warning(self, on: bool) -> Self {
        Self(set(self.0, FLAG_6, on))
    }
}

impl Default for AlStatus {
    fn default() -> Self {
        Self::new(AlState::Init)
    }
}

impl fmt::Display for AlStatus {
    /// `OP`, `PREOP, error`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.state())?;
        for (bit, text) in
            [(FLAG_4, ", error"), (FLAG_5, ", identification loaded"), (FLAG_6, ", warning")]
        {
            if self.0 & bit != 0 {
                f.write_str(text)?;
            }
        }
        Ok(())
    }
}

/// How the register table writes AL control. Its low byte has all there is.
pub(super) fn view_control(offset: u16, data: &[u8]) -> Option<String> {
    data.first().filter(|_| offset == 0).map(|low| AlControl(u16::from(*low)).to_string())
}

/// How the register table writes AL status. Its low byte has all there is.
pub(super) fn view_status(offset: u16, data: &[u8]) -> Option<String> {
    data.first().filter(|_| offset == 0).map(|low| AlStatus(u16::from(*low)).to_string())
}

/// How the register table writes the AL status code.
pub(super) fn view_code(offset: u16, data: &[u8]) -> Option<String> {
    let bytes = data.first_chunk().filter(|_| offset == 0)?;
    Some(AlStatusCode(u16::from_le_bytes(*bytes)).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: SW-01 partial, ESC-15 partial
    #[test]
    fn the_dump_of_the_sources() {
        // AL control 0x0004, AL status 0x0012: SAFEOP was asked for, PREOP with error is there.
        let control = AlControl::from_bytes([0x04, 0x00]);
        let status = AlStatus::from_bytes([0x12, 0x00]);
        assert_eq!(control, AlControl::request(AlState::SafeOp));
        assert_eq!(status, AlStatus::new(AlState::PreOp).with_error(true));
        assert_eq!(status.state(), StateValue::Known(AlState::PreOp));
        assert_eq!(
            (control.to_string(), status.to_string()),
            ("SAFEOP".into(), "PREOP, error".into())
        );
    }

    #[test]
    fn each_flag_is_its_own_bit() {
        let control = AlControl::request(AlState::Init);
        assert_eq!(control.with_error_acknowledge(true).value(), 0x0011);
        assert_eq!(control.with_identification_request(true).value(), 0x0021);
        assert_eq!(control.with_warning_acknowledge(true).value(), 0x0041);
        let status = AlStatus::new(AlState::Op);
        assert_eq!(status.with_error(true).value(), 0x0018);
        assert_eq!(status.with_identification_loaded(true).value(), 0x0028);
        assert_eq!(status.with_warning(true).value(), 0x0048);
        assert_eq!(AlStatus(0x0078).with_error(false).value(), 0x0068);
    }

    #[test]
    fn views_need_the_bytes_that_matter() {
        assert_eq!(view_status(0, &[0x18]).as_deref(), Some("OP, error"));
        assert_eq!(view_control(0, &[0x02]).as_deref(), Some("PREOP"));
        assert_eq!(view_status(1, &[0x00]), None);
        let code = view_code(0, &[0x1E, 0x00]);
        assert_eq!(code.as_deref(), Some("0x001E invalid input configuration"));
        assert_eq!(view_code(0, &[0x1E]), None);
    }
}
