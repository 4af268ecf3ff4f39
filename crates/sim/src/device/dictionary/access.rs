//! SDO access to a dictionary: who may read and write what, and in which layout.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex};
use linesman_proto::state::AlState;

use super::bits::{BitReader, BitWriter};
use super::{Dictionary, Entry, Object, READ_ONLY, READ_WRITE};

impl Dictionary {
    /// The value of an entry, as an SDO upload brings it.
    ///
    /// # Errors
    /// The abort code: no such object, no such subindex, not readable in this state.
    pub fn upload(&self, address: ObjectAddress, state: AlState) -> Result<Vec<u8>, SdoAbortCode> {
        let object = self.object(address.index).ok_or(SdoAbortCode::NO_OBJECT)?;
        let entry = object.entry(address.subindex).ok_or(SdoAbortCode::NO_SUBINDEX)?;
        may_read(entry, state)?;
        Ok(entry.value.clone())
    }

    /// All entries from subindex 0 or 1 on, as an SDO upload with complete access brings them:
    /// subindex 0 as two bytes, then the entries bit behind bit, those of whole bytes at whole
    /// bytes. Subindices that do not exist take no room.
    ///
    /// # Errors
    /// The abort code: no such object, a variable, another first subindex, not readable.
    pub fn upload_all(
        &self,
        address: ObjectAddress,
        state: AlState,
    ) -> Result<Vec<u8>, SdoAbortCode> {
        let object = self.whole(address)?;
        let mut bits = BitWriter::default();
        for entry in &object.entries {
            match entry.subindex {
                0 if address.subindex == 0 => {
                    may_read(entry, state)?;
                    bits.put(&[entry.as_number() as u8, 0], 16);
                }
                0 => {}
                // A list that can be made shorter ends where subindex 0 says.
                subindex if object.is_assignment() && u64::from(subindex) > object.count() => break,
                _ => {
                    may_read(entry, state)?;
                    bits.put(&entry.value, entry.bits);
                }
            }
        }
        Ok(bits.bytes)
    }

    /// Takes the value of an entry.
    ///
    /// # Errors
    /// The abort code: no such object or subindex, not writable (in this state), another length, out
    /// of range; for assignments: a PDO that is not there, or a list that is in use.
    pub fn download(
        &mut self,
        address: ObjectAddress,
        data: &[u8],
        state: AlState,
    ) -> Result<(), SdoAbortCode> {
        let object = self.object(address.index).ok_or(SdoAbortCode::NO_OBJECT)?;
        let at = object.place(address.subindex).ok_or(SdoAbortCode::NO_SUBINDEX)?;
        let value = self.checked(object, &object.entries[at], data, state)?;
        if object.is_assignment() {
            self.check_assignment(object, address.subindex, data)?;
        }
        if let Ok(object) = self.place(address.index) {
            self.objects[object].entries[at].value = value;
        }
        Ok(())
    }

    /// Takes all entries at once; the layout is that of [`Dictionary::upload_all`]. Either all are
    /// taken or none.
    ///
    /// # Errors
    /// As for [`Dictionary::download`]; data that end within an entry are too short.
    pub fn download_all(
        &mut self,
        address: ObjectAddress,
        data: &[u8],
        state: AlState,
    ) -> Result<(), SdoAbortCode> {
        let object = self.whole(address)?;
        if object.is_assignment() {
            return self.assign_all(address, data, state);
        }
        let mut bits = BitReader::new(data);
        let mut values = Vec::new();
        for (at, entry) in object.entries.iter().enumerate() {
            if entry.subindex == 0 {
                if address.subindex == 0 {
                    bits.take(16).ok_or(SdoAbortCode::TOO_SHORT)?;
                }
                continue;
            }
            if bits.ends_before(entry.bits) {
                break;
            }
            let data = bits.take(entry.bits).ok_or(SdoAbortCode::TOO_SHORT)?;
            values.push((at, self.checked(object, entry, &data, state)?));
        }
        if !bits.is_empty() {
            return Err(SdoAbortCode::TOO_LONG);
        }
        if let Ok(object) = self.place(address.index) {
            for (at, value) in values {
                self.objects[object].entries[at].value = value;
            }
        }
        Ok(())
    }

    /// A whole list of PDOs at once: as if it had been emptied, filled and closed one by one.
    fn assign_all(
        &mut self,
        address: ObjectAddress,
        data: &[u8],
        state: AlState,
    ) -> Result<(), SdoAbortCode> {
        if address.subindex != 0 {
            return Err(SdoAbortCode::UNSUPPORTED_ACCESS);
        }
        let (count, rest) = data.split_first_chunk::<2>().ok_or(SdoAbortCode::TOO_SHORT)?;
        let (words, odd) = rest.as_chunks::<2>();
        let count = usize::from(u16::from_le_bytes(*count));
        if !odd.is_empty() || words.len() != count {
            return Err(SdoAbortCode::LENGTH_MISMATCH);
        }
        let before = self.clone();
        let mut steps = || {
            let entry = |subindex| ObjectAddress { subindex, ..address };
            self.download(entry(0), &[0], state)?;
            for (word, subindex) in words.iter().zip(1..=u8::MAX) {
                self.download(entry(subindex), word, state)?;
            }
            let count = u8::try_from(count).map_err(|_| SdoAbortCode::VALUE_TOO_HIGH)?;
            self.download(entry(0), &[count], state)
        };
        let result = steps();
        if result.is_err() {
            *self = before;
        }
        result
    }

    /// The object that complete access is to, if it can be had whole.
    fn whole(&self, address: ObjectAddress) -> Result<&Object, SdoAbortCode> {
        let object = self.object(address.index).ok_or(SdoAbortCode::NO_OBJECT)?;
        if object.code == ObjectCode::Variable || !self.complete_access {
            return Err(SdoAbortCode::COMPLETE_ACCESS);
        }
        if address.subindex > 1 {
            return Err(SdoAbortCode::UNSUPPORTED_ACCESS);
        }
        Ok(object)
    }

    /// The value to store, when `data` can be taken.
    fn checked(
        &self,
        object: &Object,
        entry: &Entry,
        data: &[u8],
        state: AlState,
    ) -> Result<Vec<u8>, SdoAbortCode> {
        may_write(entry, state)?;
        let len = usize::from(entry.bits).div_ceil(8);
        let fixed = entry.data_type != DataType::STRING;
        if data.len() > len {
            return Err(SdoAbortCode::TOO_LONG);
        }
        if fixed && data.len() < len {
            return Err(SdoAbortCode::TOO_SHORT);
        }
        let mut taken = Entry { value: data.to_vec(), ..entry.clone() };
        let number = taken.as_number();
        taken.mask();
        let out_of_bits = fixed && taken.as_number() != number;
        if out_of_bits || entry.maximum.is_some_and(|maximum| number > u64::from(maximum)) {
            return Err(SdoAbortCode::VALUE_TOO_HIGH);
        }
        if object.is_assignment() && entry.subindex == 0 && number >= object.entries.len() as u64 {
            return Err(SdoAbortCode::VALUE_TOO_HIGH);
        }
        Ok(taken.value)
    }

    /// Whether a list of PDOs may be changed like this.
    fn check_assignment(
        &self,
        object: &Object,
        subindex: u8,
        data: &[u8],
    ) -> Result<(), SdoAbortCode> {
        let outputs = object.index.0.is_multiple_of(2);
        if subindex > 0 {
            if object.count() != 0 {
                return Err(SdoAbortCode::SUBINDEX_0_NOT_ZERO);
            }
            let number = data.first_chunk().map_or(0, |word| u16::from_le_bytes(*word));
            return self.check_pdo(number, outputs);
        }
        let wanted = usize::from(data.first().copied().unwrap_or(0));
        for entry in object.entries.iter().skip(1).take(wanted) {
            self.check_pdo(entry.as_number() as u16, outputs)?;
        }
        Ok(())
    }

    /// Whether there is such a PDO in this direction.
    fn check_pdo(&self, number: u16, outputs: bool) -> Result<(), SdoAbortCode> {
        let range = if outputs { 0x1600..=0x17FF } else { 0x1A00..=0x1BFF };
        if range.contains(&number) && self.object(ObjectIndex(number)).is_some() {
            Ok(())
        } else {
            Err(SdoAbortCode::NOT_MAPPABLE)
        }
    }
}

fn may_read(entry: &Entry, state: AlState) -> Result<(), SdoAbortCode> {
    let here = match state {
        AlState::Init | AlState::Boot => 0,
        AlState::PreOp => Access::READ_PRE_OP,
        AlState::SafeOp => Access::READ_SAFE_OP,
        AlState::Op => Access::READ_OP,
    };
    match entry.access.0 & READ_ONLY.0 {
        0 => Err(SdoAbortCode::WRITE_ONLY),
        rights if rights & here != 0 => Ok(()),
        _ => Err(SdoAbortCode::DEVICE_STATE),
    }
}

fn may_write(entry: &Entry, state: AlState) -> Result<(), SdoAbortCode> {
    let here = match state {
        AlState::Init | AlState::Boot => 0,
        AlState::PreOp => Access::WRITE_PRE_OP,
        AlState::SafeOp => Access::WRITE_SAFE_OP,
        AlState::Op => Access::WRITE_OP,
    };
    match entry.access.0 & (READ_WRITE.0 & !READ_ONLY.0) {
        0 => Err(SdoAbortCode::READ_ONLY),
        rights if rights & here != 0 => Ok(()),
        _ => Err(SdoAbortCode::DEVICE_STATE),
    }
}
