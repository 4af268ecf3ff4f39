//! SDO access to a dictionary: who may read and write what, and in which layout.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress};
use linesman_proto::state::AlState;

use super::bits::{BitReader, BitWriter};
use super::{Dictionary, Entry, Object, READ_ONLY, READ_WRITE};
use crate::device::history::HISTORY;

impl Dictionary {
    /// The value of an entry, as an SDO upload brings it.
    ///
    /// # Errors
    /// The abort code: no such object, no such subindex, not readable in this state.
    pub fn upload(&self, address: ObjectAddress, state: AlState) -> Result<Vec<u8>, SdoAbortCode> {
        let object = self.object(address.index).ok_or(SdoAbortCode::NO_OBJECT)?;
        let entry = object.entry(address.subindex).ok_or(SdoAbortCode::NO_SUBINDEX)?;
        may_read(entry, state)?;
        Self::check_presence(object, address.subindex)?;
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
                subindex if object.is_closed_list() && u64::from(subindex) > object.count() => {
                    break;
                }
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
        if let Ok(object) = self.place(address.index) {
            self.objects[object].entries[at].value = value;
        }
        self.written = Some(address);
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
        if object.is_closed_list() {
            return self.list_all(address, data, state);
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
        self.written = Some(address);
        Ok(())
    }

    /// A whole list at once: as if it had been emptied, filled and closed entry by entry.
    fn list_all(
        &mut self,
        address: ObjectAddress,
        data: &[u8],
        state: AlState,
    ) -> Result<(), SdoAbortCode> {
        if address.subindex != 0 {
            return Err(SdoAbortCode::UNSUPPORTED_ACCESS);
        }
        let (count, rest) = data.split_first_chunk::<2>().ok_or(SdoAbortCode::TOO_SHORT)?;
        let width = self.object(address.index).and_then(|list| list.entries.get(1));
        let width = width.map_or(1, |entry| usize::from(entry.bits / 8).max(1));
        let words = rest.chunks(width);
        let count = usize::from(u16::from_le_bytes(*count));
        if !rest.len().is_multiple_of(width) || words.len() != count {
            return Err(SdoAbortCode::LENGTH_MISMATCH);
        }
        let before = self.clone();
        let steps = || {
            let entry = |subindex| ObjectAddress { subindex, ..address };
            self.download(entry(0), &[0], state)?;
            for (word, subindex) in words.zip(1..=u8::MAX) {
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
        let single = object.code == ObjectCode::Variable || object.index == HISTORY;
        if single || !self.complete_access {
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
        self.check_number(object, entry, number)?;
        Ok(taken.value)
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
