//! Values in the process image: little endian, from any bit on (ETG.1000.6, 5.6.7.3).

mod sealed {
    pub trait Sealed {}
}

/// A type that a variable of the process image can have.
pub trait Value: Copy + Send + sealed::Sealed + 'static {
    /// Its name in messages.
    const NAME: &'static str;

    /// Whether a variable of so many bits can be seen as this type.
    #[must_use]
    fn fits(bits: usize) -> bool;

    /// The value of `bits` bits from bit `at` on; zeros where the image ends.
    #[must_use]
    fn read(image: &[u8], at: usize, bits: usize) -> Self;

    /// Writes it there; what does not fit into the image is left out.
    fn write(self, image: &mut [u8], at: usize, bits: usize);
}

/// Bits from `at` on, the first one lowest.
fn read_bits(image: &[u8], at: usize, bits: usize) -> u64 {
    if at.is_multiple_of(8) && bits.is_multiple_of(8) {
        let bytes = image.get(at / 8..).unwrap_or_default().iter().take(bits / 8);
        return bytes.enumerate().fold(0, |sum, (n, byte)| sum | u64::from(*byte) << (8 * n));
    }
    let bit =
        |n: usize| image.get((at + n) / 8).is_some_and(|byte| byte >> ((at + n) % 8) & 1 == 1);
    (0..bits).fold(0, |sum, n| sum | u64::from(bit(n)) << n)
}

fn write_bits(image: &mut [u8], at: usize, bits: usize, value: u64) {
    if at.is_multiple_of(8) && bits.is_multiple_of(8) {
        let bytes = image.get_mut(at / 8..).unwrap_or_default().iter_mut().take(bits / 8);
        for (byte, new) in bytes.zip(value.to_le_bytes()) {
            *byte = new;
        }
        return;
    }
    for n in 0..bits {
        if let Some(byte) = image.get_mut((at + n) / 8) {
            let mask = 1 << ((at + n) % 8);
            *byte = if value >> n & 1 == 1 { *byte | mask } else { *byte & !mask };
        }
    }
}

impl sealed::Sealed for bool {}

impl Value for bool {
    const NAME: &'static str = "bool";

    fn fits(bits: usize) -> bool {
        bits == 1
    }

    fn read(image: &[u8], at: usize, bits: usize) -> Self {
        read_bits(image, at, bits) != 0
    }

    fn write(self, image: &mut [u8], at: usize, bits: usize) {
        write_bits(image, at, bits, u64::from(self));
    }
}

macro_rules! integers {
    ($($type:ty, $wide:ty),+ $(,)?) => {$(
        impl sealed::Sealed for $type {}

        impl Value for $type {
            const NAME: &'static str = stringify!($type);

            fn fits(bits: usize) -> bool {
                // A shorter variable is widened; one bit is a bool.
                bits > 1 && bits <= <$type>::BITS as usize
            }

            fn read(image: &[u8], at: usize, bits: usize) -> Self {
                let unused = 64_usize.saturating_sub(bits.max(1)) as u32;
                // Up to the top, so that the way down extends the sign where there is one.
                let high = read_bits(image, at, bits.min(64)) << unused;
                (high as $wide >> unused) as $type
            }

            fn write(self, image: &mut [u8], at: usize, bits: usize) {
                write_bits(image, at, bits.min(64), self as u64);
            }
        }
    )+};
}

integers!(u8, u64, u16, u64, u32, u64, u64, u64, i8, i64, i16, i64, i32, i64, i64, i64);

macro_rules! floats {
    ($($type:ty, $bits:ty),+ $(,)?) => {$(
        impl sealed::Sealed for $type {}

        impl Value for $type {
            const NAME: &'static str = stringify!($type);

            fn fits(bits: usize) -> bool {
                bits == <$bits>::BITS as usize
            }

            fn read(image: &[u8], at: usize, bits: usize) -> Self {
                <$type>::from_bits(read_bits(image, at, bits) as $bits)
            }

            fn write(self, image: &mut [u8], at: usize, bits: usize) {
                write_bits(image, at, bits, u64::from(self.to_bits()));
            }
        }
    )+};
}

floats!(f32, u32, f64, u64);

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn signs_are_extended_and_neighbours_left_alone() {
        let mut image = [0xFF; 4];
        (-3_i16).write(&mut image, 4, 12);
        assert_eq!(image, [0xDF, 0xFF, 0xFF, 0xFF]);
        assert_eq!(i16::read(&image, 4, 12), -3);
        assert_eq!(u16::read(&image, 4, 12), 0x0FFD);
        false.write(&mut image, 31, 1);
        assert_eq!(image[3], 0x7F);
        1.5_f32.write(&mut image, 0, 32);
        assert_eq!(f32::read(&image, 0, 32), 1.5);
        assert_eq!(u32::read(&image, 24, 32), u32::from(image[3]), "zeros behind the end");
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(
            value: i64, at in 0_usize..70, bits in 2_usize..=64, fill: u8
        ) {
            let mut image = [fill; 18];
            let before = image;
            value.write(&mut image, at, bits);
            let unused = 64 - bits as u32;
            prop_assert_eq!(i64::read(&image, at, bits), value << unused >> unused);
            for bit in (0..144).filter(|bit| !(at..at + bits).contains(bit)) {
                let of = |image: &[u8]| image[bit / 8] >> (bit % 8) & 1;
                prop_assert_eq!(of(&image), of(&before), "bit {}", bit);
            }
        }
    }
}
