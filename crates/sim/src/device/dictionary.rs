//! The object dictionary of a SubDevice: what can be read and written through CoE, and the place
//! where process data and settings live.
//!
//! Read first: ETG.1000.6, object dictionary. An object is one value (subindex 0), or a list of
//! entries whose subindex 0 says how many there are.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::information::{Access, ListKind, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex};
use linesman_proto::state::AlState;

/// Access of what can always be read.
pub const READ_ONLY: Access = Access(Access::READ_PRE_OP | Access::READ_SAFE_OP | Access::READ_OP);
/// Access of what can always be read and written.
pub const READ_WRITE: Access =
    Access(READ_ONLY.0 | Access::WRITE_PRE_OP | Access::WRITE_SAFE_OP | Access::WRITE_OP);

/// One value.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Entry {
    /// Its subindex.
    pub subindex: u8,
    /// Its name.
    pub name: String,
    /// Its type.
    pub data_type: DataType,
    /// Its length in bits; of a text the longest one.
    pub bits: u16,
    /// Who may do what in which state.
    pub access: Access,
    /// The bytes of its value, lowest first; a text may be shorter than `bits` allows.
    pub value: Vec<u8>,
    /// The greatest value that is taken, for numbers of up to 32 bits.
    pub maximum: Option<u32>,
}

impl Entry {
    /// A number.
    #[must_use]
    pub fn number(
        subindex: u8,
        name: &str,
        data_type: DataType,
        bits: u16,
        access: Access,
        value: u64,
    ) -> Self {
        let len = usize::from(bits).div_ceil(8).min(8);
        let value = value.to_le_bytes()[..len].to_vec();
        Self { subindex, name: name.to_owned(), data_type, bits, access, value, maximum: None }
    }

    /// A text that cannot be changed.
    #[must_use]
    pub fn text(name: &str, value: &str) -> Self {
        let bits = u16::try_from(value.len() * 8).unwrap_or(u16::MAX);
        Self {
            subindex: 0,
            name: name.to_owned(),
            data_type: DataType::STRING,
            bits,
            access: READ_ONLY,
            value: value.as_bytes().to_vec(),
            maximum: None,
        }
    }

    /// The value as a number; of longer ones the lowest eight bytes.
    #[must_use]
    pub fn as_number(&self) -> u64 {
        let mut bytes = [0; 8];
        let len = self.value.len().min(8);
        bytes[..len].copy_from_slice(&self.value[..len]);
        u64::from_le_bytes(bytes)
    }

    fn set_number(&mut self, value: u64) {
        let bytes = value.to_le_bytes();
        let len = self.value.len().min(8);
        self.value[..len].copy_from_slice(&bytes[..len]);
        self.mask();
    }

    /// Bits beyond the length are 0.
    fn mask(&mut self) {
        let used = self.bits % 8;
        if used != 0
            && let Some(last) = self.value.last_mut()
        {
            *last &= (1 << used) - 1;
        }
    }
}

/// An object.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Object {
    /// Its index.
    pub index: ObjectIndex,
    /// Its name.
    pub name: String,
    /// Variable, array, record.
    pub code: ObjectCode,
    /// Its type; for arrays that of an entry.
    pub data_type: DataType,
    /// Its entries in order of their subindices; a variable has subindex 0 alone.
    pub entries: Vec<Entry>,
}

impl Object {
    /// A variable.
    #[must_use]
    pub fn variable(index: ObjectIndex, entry: Entry) -> Self {
        let (name, data_type) = (entry.name.clone(), entry.data_type);
        Self { index, name, code: ObjectCode::Variable, data_type, entries: vec![entry] }
    }

    /// An object of several entries. Subindex 0 is put before them: the highest subindex.
    #[must_use]
    pub fn list(
        index: ObjectIndex,
        name: &str,
        code: ObjectCode,
        data_type: DataType,
        entries: Vec<Entry>,
    ) -> Self {
        let last = entries.last().map_or(0, |entry| entry.subindex);
        let count =
            Entry::number(0, "SubIndex 000", DataType::USINT, 8, READ_ONLY, u64::from(last));
        let entries = std::iter::once(count).chain(entries).collect();
        Self { index, name: name.to_owned(), code, data_type, entries }
    }

    fn place(&self, subindex: u8) -> Option<usize> {
        self.entries.binary_search_by_key(&subindex, |entry| entry.subindex).ok()
    }

    /// The entry with this subindex.
    #[must_use]
    pub fn entry(&self, subindex: u8) -> Option<&Entry> {
        self.place(subindex).map(|at| &self.entries[at])
    }

    /// Whether a MainDevice assigns or lists PDOs here: entries can be written only while subindex
    /// 0 is 0, and that is written last.
    #[must_use]
    pub fn is_assignment(&self) -> bool {
        (0x1C10..=0x1C2F).contains(&self.index.0)
    }
}

/// The place of an entry in a [`Dictionary`], for those who look often.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EntryRef {
    object: usize,
    entry: usize,
}

/// All objects of a SubDevice.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Dictionary {
    objects: Vec<Object>,
}

/// Largest object that is taken by download, in bytes: more no device of the library has.
pub const LARGEST: usize = 4_096;

impl Dictionary {
    /// These objects. Of two with the same index the later one counts.
    #[must_use]
    pub fn new(objects: Vec<Object>) -> Self {
        let mut dictionary = Self::default();
        for object in objects {
            match dictionary.place(object.index) {
                Ok(at) => dictionary.objects[at] = object,
                Err(at) => dictionary.objects.insert(at, object),
            }
        }
        dictionary
    }

    fn place(&self, index: ObjectIndex) -> Result<usize, usize> {
        self.objects.binary_search_by_key(&index, |object| object.index)
    }

    /// All objects in order of their indices.
    pub fn objects(&self) -> impl Iterator<Item = &Object> {
        self.objects.iter()
    }

    /// The object with this index.
    #[must_use]
    pub fn object(&self, index: ObjectIndex) -> Option<&Object> {
        self.place(index).ok().map(|at| &self.objects[at])
    }

    /// Where an entry is.
    #[must_use]
    pub fn find(&self, address: ObjectAddress) -> Option<EntryRef> {
        let object = self.place(address.index).ok()?;
        let entry = self.objects[object].place(address.subindex)?;
        Some(EntryRef { object, entry })
    }

    /// The entry at this place; `None` for a place of another dictionary.
    #[must_use]
    pub fn entry(&self, at: EntryRef) -> Option<&Entry> {
        self.objects.get(at.object)?.entries.get(at.entry)
    }

    /// The value at this place as a number; 0 for a place of another dictionary.
    #[must_use]
    pub fn number(&self, at: EntryRef) -> u64 {
        self.entry(at).map_or(0, Entry::as_number)
    }

    /// The value of an entry as a number; 0 for one that is not there.
    #[must_use]
    pub fn number_at(&self, address: ObjectAddress) -> u64 {
        self.find(address).map_or(0, |at| self.number(at))
    }

    /// Sets a value from the device's side, cut to its length.
    pub fn set_number(&mut self, at: EntryRef, value: u64) {
        let object = self.objects.get_mut(at.object);
        if let Some(entry) = object.and_then(|object| object.entries.get_mut(at.entry)) {
            entry.set_number(value);
        }
    }

    /// The indices of a list of SDO information.
    pub fn list(&self, kind: ListKind) -> impl Iterator<Item = ObjectIndex> {
        let wanted = match kind {
            ListKind::All => Some(0),
            ListKind::RxPdoMappable => Some(Access::RX_PDO),
            ListKind::TxPdoMappable => Some(Access::TX_PDO),
            ListKind::Backup => Some(Access::BACKUP),
            ListKind::Settings => Some(Access::SETTING),
            ListKind::Counts | ListKind::Other(_) => None,
        };
        let belongs = move |object: &&Object| {
            wanted.is_some_and(|bits| object.entries.iter().any(|entry| entry.access.has(bits)))
        };
        self.objects.iter().filter(belongs).map(|object| object.index)
    }

    // ---- SDO ----

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
                subindex if object.is_assignment() && u64::from(subindex) > count(object) => break,
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
        let mut bits = BitReader { bytes: data, at: 0 };
        let mut values = Vec::new();
        for (at, entry) in object.entries.iter().enumerate() {
            if entry.subindex == 0 {
                if address.subindex == 0 {
                    bits.take(16).ok_or(SdoAbortCode::TOO_SHORT)?;
                }
                continue;
            }
            if bits.is_empty() {
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
        if object.code == ObjectCode::Variable {
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
        let outputs = object.index.0 % 2 == 0;
        if subindex > 0 {
            if count(object) != 0 {
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

/// What subindex 0 says.
fn count(object: &Object) -> u64 {
    object.entry(0).map_or(0, Entry::as_number)
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

/// Puts values bit behind bit; whole bytes begin at a byte.
#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    at: usize,
}

impl BitWriter {
    fn put(&mut self, value: &[u8], bits: u16) {
        if bits % 8 == 0 {
            self.at = self.at.next_multiple_of(8);
        }
        let end = self.at + usize::from(bits);
        self.bytes.resize(end.div_ceil(8), 0);
        for bit in 0..usize::from(bits) {
            let high = value.get(bit / 8).is_some_and(|byte| byte >> (bit % 8) & 1 != 0);
            let to = self.at + bit;
            self.bytes[to / 8] |= u8::from(high) << (to % 8);
        }
        self.at = end;
    }
}

/// Takes them out again.
struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl BitReader<'_> {
    /// Whether no whole byte is left to begin.
    fn is_empty(&self) -> bool {
        self.at.div_ceil(8) >= self.bytes.len()
    }

    fn take(&mut self, bits: u16) -> Option<Vec<u8>> {
        if bits % 8 == 0 {
            self.at = self.at.next_multiple_of(8);
        }
        let end = self.at + usize::from(bits);
        if end > self.bytes.len() * 8 {
            return None;
        }
        let mut value = vec![0; usize::from(bits).div_ceil(8)];
        for bit in 0..usize::from(bits) {
            let from = self.at + bit;
            value[bit / 8] |= (self.bytes[from / 8] >> (from % 8) & 1) << (bit % 8);
        }
        self.at = end;
        Some(value)
    }
}

#[cfg(test)]
mod tests;
