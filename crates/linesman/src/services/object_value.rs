//! Values of the object dictionary as types of Rust (ETG.1000.6, 5.6.2: data lowest byte first).

use super::RequestError;

mod sealed {
    pub trait SealedValue {}
}

/// A type in which an object is read and written: integers of 8 to 64 bits, `f32`, `f64`, `bool`, `String`
/// (VISIBLE_STRING) and `Vec<u8>` (the bytes as they are). The size must be that of the object.
pub trait ObjectValue: Sized + Send + sealed::SealedValue + 'static {
    /// Its name in messages.
    const NAME: &'static str;

    /// The value of these bytes.
    ///
    /// # Errors
    /// When they are not so many as the type has, or no text.
    fn from_bytes(bytes: &[u8]) -> Result<Self, RequestError>;

    /// The bytes of this value.
    #[must_use]
    fn to_bytes(&self) -> Vec<u8>;
}

/// A number in which a register is read and written.
pub trait RegisterValue: ObjectValue {
    /// Its length, in bytes.
    const LEN: u16;
}

macro_rules! numbers {
    ($($type:ty),+ $(,)?) => {$(
        impl sealed::SealedValue for $type {}

        impl ObjectValue for $type {
            const NAME: &'static str = stringify!($type);

            fn from_bytes(bytes: &[u8]) -> Result<Self, RequestError> {
                let expected = size_of::<Self>();
                let received = bytes.len();
                let size = RequestError::Size { wanted: Self::NAME, expected, received };
                bytes.try_into().map(Self::from_le_bytes).map_err(|_| size)
            }

            fn to_bytes(&self) -> Vec<u8> {
                self.to_le_bytes().to_vec()
            }
        }

        impl RegisterValue for $type {
            const LEN: u16 = size_of::<Self>() as u16;
        }
    )+};
}

numbers!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64);

impl sealed::SealedValue for bool {}

impl ObjectValue for bool {
    const NAME: &'static str = "bool";

    fn from_bytes(bytes: &[u8]) -> Result<Self, RequestError> {
        match bytes {
            [byte] => Ok(byte & 1 == 1),
            _ => {
                let received = bytes.len();
                Err(RequestError::Size { wanted: Self::NAME, expected: 1, received })
            }
        }
    }

    fn to_bytes(&self) -> Vec<u8> {
        vec![u8::from(*self)]
    }
}

impl sealed::SealedValue for String {}

impl ObjectValue for String {
    const NAME: &'static str = "String";

    /// The text up to its first zero byte.
    fn from_bytes(bytes: &[u8]) -> Result<Self, RequestError> {
        let text = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
        Self::from_utf8(text.to_vec()).map_err(|_| RequestError::NoText)
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.as_bytes().to_vec()
    }
}

impl sealed::SealedValue for Vec<u8> {}

impl ObjectValue for Vec<u8> {
    const NAME: &'static str = "bytes";

    fn from_bytes(bytes: &[u8]) -> Result<Self, RequestError> {
        Ok(bytes.to_vec())
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_each_type_survives_the_way_through_bytes() {
        fn both_ways<T: ObjectValue + PartialEq + std::fmt::Debug>(value: T, bytes: &[u8]) {
            assert_eq!(value.to_bytes(), bytes);
            assert_eq!(T::from_bytes(bytes).unwrap(), value);
        }
        both_ways(0x12_u8, &[0x12]);
        both_ways(0x1234_u16, &[0x34, 0x12]);
        both_ways(0x1234_5678_u32, &[0x78, 0x56, 0x34, 0x12]);
        both_ways(u64::MAX - 1, &[0xFE, 255, 255, 255, 255, 255, 255, 255]);
        both_ways(-2_i8, &[0xFE]);
        both_ways(-2_i16, &[0xFE, 0xFF]);
        both_ways(-2_i32, &[0xFE, 0xFF, 0xFF, 0xFF]);
        both_ways(-2_i64, &[0xFE, 255, 255, 255, 255, 255, 255, 255]);
        both_ways(1.0_f32, &[0, 0, 0x80, 0x3F]);
        both_ways(1.0_f64, &[0, 0, 0, 0, 0, 0, 0xF0, 0x3F]);
        both_ways(true, &[1]);
        both_ways("EL3204".to_owned(), b"EL3204");
        both_ways(vec![1, 2, 3], &[1, 2, 3]);
    }

    #[test]
    fn a_value_of_another_size_is_refused_with_both_sizes() {
        let error = u32::from_bytes(&[1, 2]).unwrap_err().to_string();
        assert_eq!(
            error,
            "expected 4 bytes for u32, received 2. Do: ask for a type of that size, or for Vec<u8>"
        );
    }

    #[test]
    fn a_text_ends_at_its_first_zero_byte() {
        assert_eq!(String::from_bytes(b"EL1008\0\0").unwrap(), "EL1008");
        assert!(matches!(String::from_bytes(&[0xFF, 0xFE]), Err(RequestError::NoText)));
    }
}
