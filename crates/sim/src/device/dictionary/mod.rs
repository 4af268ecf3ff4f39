//! The object dictionary of a SubDevice: what can be read and written through CoE, and the place
//! where process data and settings live.
//!
//! Read first: ETG.1000.6, object dictionary. An object is one value (subindex 0), or a list of
//! entries whose subindex 0 says how many there are. `access` is what SDO transfers may do with it.

mod access;
mod bits;
pub mod special;

use linesman_proto::mailbox::coe::information::{Access, ListKind, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex};

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

    /// What subindex 0 says.
    fn count(&self) -> u64 {
        self.entry(0).map_or(0, Entry::as_number)
    }

    fn place(&self, subindex: u8) -> Option<usize> {
        self.entries.binary_search_by_key(&subindex, |entry| entry.subindex).ok()
    }

    /// The entry with this subindex.
    #[must_use]
    pub fn entry(&self, subindex: u8) -> Option<&Entry> {
        self.place(subindex).map(|at| &self.entries[at])
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
    /// Whole objects can be had at once.
    complete_access: bool,
    /// What a MainDevice wrote last, until the device has looked.
    written: Option<ObjectAddress>,
}

/// Largest object that is taken by download, in bytes: more no device of the library has.
pub const LARGEST: usize = 4_096;

impl Dictionary {
    /// These objects, with or without complete access. Of two with the same index the later one
    /// counts.
    #[must_use]
    pub fn new(objects: Vec<Object>, complete_access: bool) -> Self {
        let mut dictionary = Self { objects: Vec::new(), complete_access, written: None };
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

    /// Whether there are no objects at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty()
    }

    /// What a MainDevice wrote since the last call: the entry, or subindex 0 or 1 for a whole object.
    pub fn take_written(&mut self) -> Option<ObjectAddress> {
        self.written.take()
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

    /// Puts another object in the place of one with the same index; nothing where there is none.
    pub fn replace(&mut self, object: Object) {
        if let Ok(at) = self.place(object.index) {
            self.objects[at] = object;
        }
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

    /// Sets the bytes of a value from the device's side: a text, or a string of bytes. Nothing for an
    /// entry that is not there.
    pub fn set_bytes(&mut self, address: ObjectAddress, value: Vec<u8>) {
        let place = self.place(address.index).ok().map(|at| &mut self.objects[at]);
        if let Some(object) = place
            && let Some(at) = object.place(address.subindex)
        {
            object.entries[at].value = value;
        }
    }

    /// All settings that are kept are again as in `fresh`, a dictionary of the same objects.
    pub fn restore(&mut self, fresh: &Self) {
        let entries = self.objects.iter_mut().flat_map(|object| &mut object.entries);
        for (entry, fresh) in entries.zip(fresh.objects.iter().flat_map(|object| &object.entries)) {
            if entry.access.has(Access::BACKUP) {
                entry.value.clone_from(&fresh.value);
            }
        }
    }

    /// The device starts anew: every value is again as in `fresh`, a dictionary of the same objects,
    /// but for settings that are kept for a replacement. Those were stored when they were written.
    pub fn restart(&mut self, fresh: &Self) {
        let entries = self.objects.iter_mut().flat_map(|object| &mut object.entries);
        for (entry, fresh) in entries.zip(fresh.objects.iter().flat_map(|object| &object.entries)) {
            if !entry.access.has(Access::BACKUP) {
                entry.value.clone_from(&fresh.value);
            }
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
}

#[cfg(test)]
mod tests;
