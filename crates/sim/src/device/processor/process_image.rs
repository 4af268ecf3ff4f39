//! Process data of a device with a dictionary: which bits of a buffer are which objects.
//!
//! Read first: ETG.1000.6, PDO mapping. The assignment object (0x1C12, 0x1C13) lists PDOs, the
//! mapping object of each PDO lists entries: index, subindex and bits in one number.

use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use crate::device::dictionary::{Dictionary, EntryRef};

/// The process data of one direction.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(super) struct ProcessImage {
    slots: Vec<ImageSlot>,
    bits: usize,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct ImageSlot {
    /// `None` for padding.
    entry: Option<EntryRef>,
    bits: usize,
}

/// An entry is mapped that does not exist.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct NotMappable;

impl ProcessImage {
    /// What this assignment object comes to. An assignment that does not exist is empty.
    pub(super) fn of(
        dictionary: &Dictionary,
        assignment: ObjectIndex,
    ) -> Result<Self, NotMappable> {
        let mut image = Self::default();
        for pdo in listed(dictionary, assignment) {
            let pdo = ObjectIndex(pdo as u16);
            dictionary.object(pdo).ok_or(NotMappable)?;
            for mapped in listed(dictionary, pdo) {
                image.add(dictionary, mapped as u32)?;
            }
        }
        Ok(image)
    }

    fn add(&mut self, dictionary: &Dictionary, mapped: u32) -> Result<(), NotMappable> {
        let [bits, subindex, low, high] = mapped.to_le_bytes();
        let index = u16::from_le_bytes([low, high]);
        let entry = match index {
            0 => None,
            _ => {
                let address = ObjectAddress::new(index, subindex);
                Some(dictionary.find(address).ok_or(NotMappable)?)
            }
        };
        let bits = usize::from(bits);
        self.slots.push(ImageSlot { entry, bits });
        self.bits += bits;
        Ok(())
    }

    /// Its length in bytes.
    pub(super) fn len(&self) -> usize {
        self.bits.div_ceil(8)
    }

    /// The values of its objects, bit behind bit.
    pub(super) fn pack(&self, dictionary: &Dictionary, buffer: &mut Vec<u8>) {
        buffer.clear();
        buffer.resize(self.len(), 0);
        let mut at = 0;
        for slot in &self.slots {
            if let Some(entry) = slot.entry {
                put_bits(buffer, at, slot.bits, dictionary.number(entry));
            }
            at += slot.bits;
        }
    }

    /// Takes the values of its objects out of a buffer; bits that the buffer lacks are 0.
    pub(super) fn unpack(&self, buffer: &[u8], dictionary: &mut Dictionary) {
        let mut at = 0;
        for slot in &self.slots {
            if let Some(entry) = slot.entry {
                dictionary.set_number(entry, take_bits(buffer, at, slot.bits));
            }
            at += slot.bits;
        }
    }
}

/// Whether two PDOs are assigned that exclude each other.
pub(super) fn excluded(
    dictionary: &Dictionary,
    assignment: ObjectIndex,
    excludes: &[(u16, u16)],
) -> bool {
    let assigned = |pdo: u16| listed(dictionary, assignment).any(|one| one == u64::from(pdo));
    excludes.iter().any(|(one, other)| assigned(*one) && assigned(*other))
}

/// The entries of a list, as many as its subindex 0 says.
fn listed(dictionary: &Dictionary, index: ObjectIndex) -> impl Iterator<Item = u64> {
    let entries = dictionary.object(index).map_or(&[][..], |object| &object.entries);
    let count = entries.first().map_or(0, |count| count.as_number() as usize);
    entries.iter().skip(1).take(count).map(|entry| entry.as_number())
}

/// Puts the lowest `bits` (up to 64) of a value into a buffer that has 0 there.
fn put_bits(buffer: &mut [u8], at: usize, bits: usize, value: u64) {
    let mut rest = u128::from(value & mask(bits)) << (at % 8);
    let bytes = (at % 8 + bits.min(64)).div_ceil(8);
    for byte in buffer.iter_mut().skip(at / 8).take(bytes) {
        *byte |= rest as u8;
        rest >>= 8;
    }
}

fn take_bits(buffer: &[u8], at: usize, bits: usize) -> u64 {
    let bytes = (at % 8 + bits.min(64)).div_ceil(8);
    let bytes = (0..).zip(buffer.iter().skip(at / 8).take(bytes));
    let value = bytes.fold(0, |value, (place, byte)| value | u128::from(*byte) << (8 * place));
    (value >> (at % 8)) as u64 & mask(bits)
}

/// The lowest `bits` set.
const fn mask(bits: usize) -> u64 {
    if bits >= 64 { u64::MAX } else { (1 << bits) - 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_keep_their_places() {
        let mut buffer = vec![0; 4];
        put_bits(&mut buffer, 3, 2, 0b11);
        put_bits(&mut buffer, 12, 16, 0xBEEF);
        assert_eq!(buffer, [0b0001_1000, 0xF0, 0xEE, 0x0B]);
        assert_eq!(take_bits(&buffer, 12, 16), 0xBEEF);
        assert_eq!(take_bits(&buffer, 2, 4), 0b0110);
        assert_eq!(take_bits(&buffer, 28, 16), 0, "behind the end");
        put_bits(&mut buffer, 30, 8, 0xFF);
        assert_eq!(buffer[3], 0xCB);
        let mut wide = vec![0; 9];
        put_bits(&mut wide, 5, 64, 0x8000_0000_0000_0001);
        assert_eq!(wide, [0x20, 0, 0, 0, 0, 0, 0, 0, 0x10]);
        assert_eq!(take_bits(&wide, 5, 64), 0x8000_0000_0000_0001);
    }
}
