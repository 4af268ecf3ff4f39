//! Lists of objects.
//!
//! Reference: ETG.1000.6, SDO information: object list. The answer: kind of list (u16), then
//! indices (u16 each), or for kind 0 the lengths of the five lists.

use super::super::message::CoeError;
use super::super::object::ObjectIndex;
use crate::mailbox::header::BufferTooSmall;

/// Which objects a list names.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ListKind {
    /// 0: how long each of the five lists is.
    Counts,
    /// 1: all.
    All,
    /// 2: those that can be mapped into RxPDOs.
    RxPdoMappable,
    /// 3: those that can be mapped into TxPDOs.
    TxPdoMappable,
    /// 4: those to keep for a replacement of the device.
    Backup,
    /// 5: those that are settings for start-up.
    Settings,
    /// Another code.
    Other(u16),
}

impl ListKind {
    /// The kind with this code.
    #[must_use]
    pub const fn from_code(code: u16) -> Self {
        match code {
            0 => Self::Counts,
            1 => Self::All,
            2 => Self::RxPdoMappable,
            3 => Self::TxPdoMappable,
            4 => Self::Backup,
            5 => Self::Settings,
            other => Self::Other(other),
        }
    }

    /// Its code.
    #[must_use]
    pub const fn code(self) -> u16 {
        match self {
            Self::Counts => 0,
            Self::All => 1,
            Self::RxPdoMappable => 2,
            Self::TxPdoMappable => 3,
            Self::Backup => 4,
            Self::Settings => 5,
            Self::Other(code) => code,
        }
    }
}

/// A list of objects: the bytes of all fragments of the answer.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ObjectList<'a> {
    /// Which list it is.
    pub kind: ListKind,
    words: &'a [[u8; 2]],
}

impl<'a> ObjectList<'a> {
    /// Reads the collected fragments. Half a word at the end is not used.
    ///
    /// # Errors
    /// [`CoeError::CutOff`] when not even the kind of list is there.
    pub fn parse(answer: &'a [u8]) -> Result<Self, CoeError> {
        let (kind, rest) = CoeError::first(answer, "SDO information: object list")?;
        let kind = ListKind::from_code(u16::from_le_bytes(*kind));
        Ok(Self { kind, words: rest.as_chunks().0 })
    }

    /// The words of the list: indices, or for [`ListKind::Counts`] lengths of lists.
    fn words(&self) -> impl Iterator<Item = u16> + 'a {
        self.words.iter().map(|word| u16::from_le_bytes(*word))
    }

    /// The objects; none for [`ListKind::Counts`].
    pub fn indices(&self) -> impl Iterator<Item = ObjectIndex> + 'a {
        let counts = self.kind == ListKind::Counts;
        self.words().filter(move |_| !counts).map(ObjectIndex)
    }

    /// Lengths of the lists of kinds 1..=5, in this order, for [`ListKind::Counts`].
    #[must_use]
    pub fn counts(&self) -> Option<[u16; 5]> {
        let words = self.words.first_chunk::<5>()?;
        (self.kind == ListKind::Counts).then(|| words.map(u16::from_le_bytes))
    }

    /// Writes an answer of this kind and tells how many bytes that were: indices, or for
    /// [`ListKind::Counts`] five lengths of lists.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit; `needed` is what the first word too many needs.
    pub fn write(
        kind: ListKind,
        words: impl IntoIterator<Item = u16>,
        buffer: &mut [u8],
    ) -> Result<usize, BufferTooSmall> {
        let mut len = 0;
        for word in std::iter::once(kind.code()).chain(words) {
            BufferTooSmall::check(buffer, len + 2)?[len..].copy_from_slice(&word.to_le_bytes());
            len += 2;
        }
        Ok(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_go_back_as_they_came() {
        let mut buffer = [0; 8];
        let len = ObjectList::write(ListKind::All, [0x1000, 0x1018], &mut buffer).unwrap();
        assert_eq!(buffer[..len], [1, 0, 0x00, 0x10, 0x18, 0x10]);
        let list = ObjectList::parse(&buffer[..len]).unwrap();
        let indices: Vec<ObjectIndex> = list.indices().collect();
        assert_eq!(indices, [ObjectIndex::DEVICE_TYPE, ObjectIndex::IDENTITY]);
        assert_eq!(list.counts(), None);
        assert_eq!(
            ObjectList::write(ListKind::All, [1, 2, 3, 4], &mut buffer),
            Err(BufferTooSmall { needed: 10, available: 8 })
        );
    }

    #[test]
    fn counts_are_no_indices() {
        let mut buffer = [0; 12];
        let len = ObjectList::write(ListKind::Counts, [5, 4, 3, 2, 1], &mut buffer).unwrap();
        let list = ObjectList::parse(&buffer[..len]).unwrap();
        assert_eq!(list.counts(), Some([5, 4, 3, 2, 1]));
        assert_eq!(list.indices().count(), 0);
        assert!(ObjectList::parse(&[1]).is_err());
    }
}
