//! Descriptions of an object and its entries.
//!
//! Reference: ETG.1000.6, SDO information: object description, entry description. Names run to the
//! end of the answer, without a terminating zero.

use std::borrow::Cow;

use super::super::data_type::DataType;
use super::super::message::CoeError;
use super::super::object::{ObjectAddress, ObjectIndex};
use crate::mailbox::header::BufferTooSmall;

/// Description of an object: the bytes of all fragments of the answer.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ObjectDescription<'a> {
    /// The object.
    pub index: ObjectIndex,
    /// Its data type; for arrays that of an entry.
    pub data_type: DataType,
    /// Highest subindex.
    pub max_subindex: u8,
    /// Variable, array, record, ...
    pub object_code: ObjectCode,
    /// Its name as bytes; [`ObjectDescription::name_text`] reads them.
    pub name: &'a [u8],
}

impl<'a> ObjectDescription<'a> {
    const FIXED_LEN: usize = 6;

    /// Reads the collected fragments.
    ///
    /// # Errors
    /// [`CoeError::CutOff`] when they end before the name.
    pub fn parse(answer: &'a [u8]) -> Result<Self, CoeError> {
        let what = "SDO information: object description";
        let (&[low, high, type_low, type_high, max_subindex, code], name) =
            CoeError::first(answer, what)?;
        Ok(Self {
            index: ObjectIndex(u16::from_le_bytes([low, high])),
            data_type: DataType(u16::from_le_bytes([type_low, type_high])),
            max_subindex,
            object_code: ObjectCode::from_code(code),
            name,
        })
    }

    /// Writes an answer and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let len = Self::FIXED_LEN + self.name.len();
        let buffer = BufferTooSmall::check(buffer, len)?;
        let (fixed, name) = buffer.split_at_mut(Self::FIXED_LEN);
        let [low, high] = self.index.value().to_le_bytes();
        let [type_low, type_high] = self.data_type.0.to_le_bytes();
        let code = self.object_code.code();
        fixed.copy_from_slice(&[low, high, type_low, type_high, self.max_subindex, code]);
        name.copy_from_slice(self.name);
        Ok(len)
    }

    /// Its name; bytes that are no UTF-8 are replaced, zeros at the end left out.
    #[must_use]
    pub fn name_text(&self) -> Cow<'a, str> {
        text(self.name)
    }
}

/// Description of an entry: the bytes of all fragments of the answer.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct EntryDescription<'a> {
    /// The entry.
    pub object: ObjectAddress,
    /// Which values the answer tells. Unit, default, minimum and maximum are there exactly when it
    /// says so; [`EntryDescription::write`] looks at the fields and the other bits.
    pub values: ValueInfo,
    /// Its data type.
    pub data_type: DataType,
    /// Its length in bits.
    pub bits: u16,
    /// Who may read and write it in which state, and whether it can be mapped.
    pub access: Access,
    /// Its unit.
    pub unit: Option<u32>,
    /// Its default value.
    pub default: Option<&'a [u8]>,
    /// The least value.
    pub minimum: Option<&'a [u8]>,
    /// The greatest value.
    pub maximum: Option<&'a [u8]>,
    /// Its name as bytes; [`EntryDescription::name_text`] reads them.
    pub name: &'a [u8],
}

impl<'a> EntryDescription<'a> {
    const FIXED_LEN: usize = 10;

    /// Reads the collected fragments. A value takes as many bytes as its bits need.
    ///
    /// # Errors
    /// [`CoeError::CutOff`] when they end before the name.
    pub fn parse(answer: &'a [u8]) -> Result<Self, CoeError> {
        let what = "SDO information: entry description";
        let (&[low, high, subindex, values, t_low, t_high, b_low, b_high, a_low, a_high], rest) =
            CoeError::first(answer, what)?;
        let values = ValueInfo(values);
        let bits = u16::from_le_bytes([b_low, b_high]);
        let bytes = usize::from(bits).div_ceil(8);
        let mut rest = rest;
        let mut take = |asked: bool, needed: usize| {
            if !asked {
                return Ok(None);
            }
            let Some((value, behind)) = rest.split_at_checked(needed) else {
                let what = "SDO information: value of an entry description";
                return Err(CoeError::CutOff { what, needed, len: rest.len() });
            };
            rest = behind;
            Ok(Some(value))
        };
        let unit = take(values.has(ValueInfo::UNIT), 4)?;
        let default = take(values.has(ValueInfo::DEFAULT), bytes)?;
        let minimum = take(values.has(ValueInfo::MINIMUM), bytes)?;
        let maximum = take(values.has(ValueInfo::MAXIMUM), bytes)?;
        Ok(Self {
            object: ObjectAddress::from_bytes([low, high, subindex]),
            values,
            data_type: DataType(u16::from_le_bytes([t_low, t_high])),
            bits,
            access: Access(u16::from_le_bytes([a_low, a_high])),
            unit: unit.and_then(<[u8]>::first_chunk).map(|unit| u32::from_le_bytes(*unit)),
            default,
            minimum,
            maximum,
            name: rest,
        })
    }

    /// Writes an answer and tells how many bytes that were. Values are to be as long as their bits
    /// need, else nobody can read the answer.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let unit = self.unit.map(u32::to_le_bytes);
        let unit = unit.as_ref().map(<[u8; 4]>::as_slice);
        let values = [unit, self.default, self.minimum, self.maximum];
        let parts = values.into_iter().flatten().chain([self.name]);
        let len = Self::FIXED_LEN + parts.clone().map(<[u8]>::len).sum::<usize>();
        let (fixed, mut rest) = BufferTooSmall::check(buffer, len)?.split_at_mut(Self::FIXED_LEN);
        fixed[..3].copy_from_slice(&self.object.to_bytes());
        fixed[3] = self.told().0;
        fixed[4..6].copy_from_slice(&self.data_type.0.to_le_bytes());
        fixed[6..8].copy_from_slice(&self.bits.to_le_bytes());
        fixed[8..].copy_from_slice(&self.access.0.to_le_bytes());
        for part in parts {
            let (slot, behind) = rest.split_at_mut(part.len());
            slot.copy_from_slice(part);
            rest = behind;
        }
        Ok(len)
    }

    /// The values that are there, and the other bits as they are.
    const fn told(&self) -> ValueInfo {
        let mut bits = self.values.0 & !ValueInfo::VALUES;
        if self.unit.is_some() {
            bits |= ValueInfo::UNIT;
        }
        if self.default.is_some() {
            bits |= ValueInfo::DEFAULT;
        }
        if self.minimum.is_some() {
            bits |= ValueInfo::MINIMUM;
        }
        if self.maximum.is_some() {
            bits |= ValueInfo::MAXIMUM;
        }
        ValueInfo(bits)
    }

    /// Its name; bytes that are no UTF-8 are replaced, zeros at the end left out.
    #[must_use]
    pub fn name_text(&self) -> Cow<'a, str> {
        text(self.name)
    }
}

fn text(name: &[u8]) -> Cow<'_, str> {
    let len = name.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    String::from_utf8_lossy(&name[..len])
}

/// Which values an entry description is to tell, or tells.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct ValueInfo(pub u8);

impl ValueInfo {
    /// Access rights; told in any case.
    pub const ACCESS: u8 = 0x01;
    /// Category of the object; told in any case.
    pub const CATEGORY: u8 = 0x02;
    /// Whether it can be mapped; told in any case.
    pub const MAPPABLE: u8 = 0x04;
    /// Unit.
    pub const UNIT: u8 = 0x08;
    /// Default value.
    pub const DEFAULT: u8 = 0x10;
    /// Least value.
    pub const MINIMUM: u8 = 0x20;
    /// Greatest value.
    pub const MAXIMUM: u8 = 0x40;

    const VALUES: u8 = Self::UNIT | Self::DEFAULT | Self::MINIMUM | Self::MAXIMUM;

    /// Whether all these bits are set.
    #[must_use]
    pub const fn has(self, bits: u8) -> bool {
        self.0 & bits == bits
    }
}

/// Who may read and write an entry in which state, and what it is for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Access(pub u16);

impl Access {
    /// Readable in PRE-OP.
    pub const READ_PRE_OP: u16 = 0x0001;
    /// Readable in SAFE-OP.
    pub const READ_SAFE_OP: u16 = 0x0002;
    /// Readable in OP.
    pub const READ_OP: u16 = 0x0004;
    /// Writable in PRE-OP.
    pub const WRITE_PRE_OP: u16 = 0x0008;
    /// Writable in SAFE-OP.
    pub const WRITE_SAFE_OP: u16 = 0x0010;
    /// Writable in OP.
    pub const WRITE_OP: u16 = 0x0020;
    /// Can be mapped into an RxPDO.
    pub const RX_PDO: u16 = 0x0040;
    /// Can be mapped into a TxPDO.
    pub const TX_PDO: u16 = 0x0080;
    /// To be kept for a replacement of the device.
    pub const BACKUP: u16 = 0x0100;
    /// A setting for start-up.
    pub const SETTING: u16 = 0x0200;
    /// Safe inputs.
    pub const SAFE_INPUTS: u16 = 0x0400;
    /// Safe outputs.
    pub const SAFE_OUTPUTS: u16 = 0x0800;
    /// Safe parameter.
    pub const SAFE_PARAMETER: u16 = 0x1000;

    /// Whether all these bits are set.
    #[must_use]
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

/// What sort of object it is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ObjectCode {
    /// 2: a block of data of any length.
    Domain,
    /// 5: a data type.
    DataType,
    /// 6: a structured data type.
    Structure,
    /// 7: one value.
    Variable,
    /// 8: values of one type.
    Array,
    /// 9: values of several types.
    Record,
    /// Another code.
    Other(u8),
}

impl ObjectCode {
    /// The sort with this code.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code {
            2 => Self::Domain,
            5 => Self::DataType,
            6 => Self::Structure,
            7 => Self::Variable,
            8 => Self::Array,
            9 => Self::Record,
            other => Self::Other(other),
        }
    }

    /// Its code.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Domain => 2,
            Self::DataType => 5,
            Self::Structure => 6,
            Self::Variable => 7,
            Self::Array => 8,
            Self::Record => 9,
            Self::Other(code) => code,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_described() {
        let description = ObjectDescription {
            index: ObjectIndex::IDENTITY,
            data_type: DataType(0x0023),
            max_subindex: 4,
            object_code: ObjectCode::Record,
            name: b"Identity",
        };
        let mut buffer = [0; 14];
        assert_eq!(description.write(&mut buffer), Ok(14));
        assert_eq!(buffer[..6], [0x18, 0x10, 0x23, 0x00, 4, 9]);
        assert_eq!(ObjectDescription::parse(&buffer), Ok(description));
        assert_eq!(description.name_text(), "Identity");
        assert!(ObjectDescription::parse(&buffer[..5]).is_err());
        assert!(description.write(&mut [0; 13]).is_err());
    }

    #[test]
    fn an_entry_tells_the_values_it_has() {
        let entry = EntryDescription {
            object: ObjectAddress::new(0x8000, 0x11),
            values: ValueInfo(ValueInfo::UNIT | ValueInfo::MINIMUM | ValueInfo::MAXIMUM),
            data_type: DataType::INT,
            bits: 16,
            access: Access(0x003F),
            unit: Some(0xFD01_0000),
            default: None,
            minimum: Some(&[0x00, 0x80]),
            maximum: Some(&[0xFF, 0x7F]),
            name: b"Offset\0\0",
        };
        let mut buffer = [0; 64];
        let len = entry.write(&mut buffer).unwrap();
        assert_eq!(len, 10 + 4 + 2 + 2 + 8);
        assert_eq!(EntryDescription::parse(&buffer[..len]), Ok(entry));
        assert_eq!(entry.name_text(), "Offset");
        assert!(entry.access.has(Access::READ_OP | Access::WRITE_OP));
        // Every cut within the values is noticed.
        for cut in 0..18 {
            assert!(EntryDescription::parse(&buffer[..cut]).is_err(), "{cut} bytes");
        }
    }

    #[test]
    fn a_single_bit_takes_a_byte() {
        let answer = [0x00, 0x60, 1, ValueInfo::DEFAULT, 1, 0, 1, 0, 0x87, 0, 1, b'I', b'n'];
        let entry = EntryDescription::parse(&answer).unwrap();
        assert_eq!(entry.default, Some([1].as_slice()));
        assert_eq!(entry.name_text(), "In");
    }
}
