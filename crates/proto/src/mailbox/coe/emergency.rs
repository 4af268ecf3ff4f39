//! Emergencies: a SubDevice reports an error without being asked.
//!
//! Reference: ETG.1000.6, Emergency; the classes of codes are those of CiA 301. Code (u16), error
//! register (u8), five bytes of the vendor.

pub mod code;

use std::fmt;

use super::message::CoeError;
use crate::mailbox::header::BufferTooSmall;

/// An emergency.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Emergency {
    /// What happened; 0x0000..=0x00FF means that an error is gone.
    pub code: u16,
    /// Which sorts of errors are there now, as in object 0x1001.
    pub register: ErrorRegister,
    /// More about it, as the vendor (or, for class ESM, the protocol) has it.
    pub data: [u8; 5],
}

impl Emergency {
    /// Length behind the CoE header in bytes.
    pub const LEN: usize = 8;

    /// Which class of errors the code belongs to.
    #[must_use]
    pub const fn class(&self) -> EmergencyClass {
        EmergencyClass::of(self.code)
    }

    pub(super) fn parse(body: &[u8]) -> Result<Self, CoeError> {
        let (&[low, high, register, data @ ..], _) =
            CoeError::first::<{ Self::LEN }>(body, "CoE emergency")?;
        let code = u16::from_le_bytes([low, high]);
        Ok(Self { code, register: ErrorRegister(register), data })
    }

    pub(super) fn write(&self, body: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let body = BufferTooSmall::check(body, Self::LEN)?;
        body[..2].copy_from_slice(&self.code.to_le_bytes());
        body[2] = self.register.0;
        body[3..].copy_from_slice(&self.data);
        Ok(Self::LEN)
    }
}

impl fmt::Display for Emergency {
    /// `0x4310 temperature, errors: temperature; data 01 02 03 04 05`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} {}", self.code, self.class().text())?;
        let sorts: Vec<&str> = self.register.names().collect();
        if !sorts.is_empty() {
            write!(f, ", errors: {}", sorts.join(", "))?;
        }
        f.write_str("; data")?;
        self.data.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

/// Which sorts of errors a SubDevice has, object 0x1001.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct ErrorRegister(pub u8);

impl ErrorRegister {
    const NAMES: [(u8, &'static str); 7] = [
        (0, "generic"),
        (1, "current"),
        (2, "voltage"),
        (3, "temperature"),
        (4, "communication"),
        (5, "device profile"),
        (7, "manufacturer"),
    ];

    /// Names of the sorts that are there, in the order of their bits.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.0 >> bit & 1 != 0).map(|(_, name)| name)
    }
}

/// Class of an emergency's code.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum EmergencyClass {
    /// 0x00xx: error reset or no error.
    Reset,
    /// 0x10xx: generic.
    Generic,
    /// 0x2xxx: current.
    Current,
    /// 0x3xxx: voltage.
    Voltage,
    /// 0x4xxx: temperature.
    Temperature,
    /// 0x5xxx: hardware of the device.
    Hardware,
    /// 0x6xxx: software of the device.
    Software,
    /// 0x7xxx: additional modules.
    Modules,
    /// 0x81xx: communication.
    Communication,
    /// The rest of 0x8xxx: monitoring.
    Monitoring,
    /// 0x90xx: external error.
    External,
    /// 0xA0xx: a change of the EtherCAT state failed.
    StateMachine,
    /// 0xF0xx: additional functions.
    AdditionalFunctions,
    /// 0xFFxx: specific to the device.
    DeviceSpecific,
    /// Another code.
    Unknown,
}

impl EmergencyClass {
    /// The class of this code.
    #[must_use]
    pub const fn of(code: u16) -> Self {
        match code {
            0x0000..=0x00FF => Self::Reset,
            0x1000..=0x10FF => Self::Generic,
            0x2000..=0x2FFF => Self::Current,
            0x3000..=0x3FFF => Self::Voltage,
            0x4000..=0x4FFF => Self::Temperature,
            0x5000..=0x5FFF => Self::Hardware,
            0x6000..=0x6FFF => Self::Software,
            0x7000..=0x7FFF => Self::Modules,
            0x8100..=0x81FF => Self::Communication,
            0x8000..=0x8FFF => Self::Monitoring,
            0x9000..=0x90FF => Self::External,
            0xA000..=0xA0FF => Self::StateMachine,
            0xF000..=0xF0FF => Self::AdditionalFunctions,
            0xFF00..=0xFFFF => Self::DeviceSpecific,
            _ => Self::Unknown,
        }
    }

    /// What it means, for people.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Reset => "error reset or no error",
            Self::Generic => "generic error",
            Self::Current => "current",
            Self::Voltage => "voltage",
            Self::Temperature => "temperature",
            Self::Hardware => "device hardware",
            Self::Software => "device software",
            Self::Modules => "additional modules",
            Self::Communication => "communication",
            Self::Monitoring => "monitoring",
            Self::External => "external error",
            Self::StateMachine => "change of the EtherCAT state failed",
            Self::AdditionalFunctions => "additional functions",
            Self::DeviceSpecific => "device specific",
            Self::Unknown => "unknown class",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_fall_into_their_classes() {
        for (code, class) in [
            (0x0000, EmergencyClass::Reset),
            (0x1000, EmergencyClass::Generic),
            (0x2310, EmergencyClass::Current),
            (0x4210, EmergencyClass::Temperature),
            (0x8130, EmergencyClass::Communication),
            (0x8611, EmergencyClass::Monitoring),
            (0xA000, EmergencyClass::StateMachine),
            (0xFF01, EmergencyClass::DeviceSpecific),
            (0xB000, EmergencyClass::Unknown),
        ] {
            assert_eq!(EmergencyClass::of(code), class, "0x{code:04X}");
        }
    }

    #[test]
    fn the_error_register_names_its_bits() {
        let names: Vec<&str> = ErrorRegister(0x91).names().collect();
        assert_eq!(names, ["generic", "communication", "manufacturer"]);
    }
}
