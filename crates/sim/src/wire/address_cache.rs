//! Cache of address lookups, valid as long as no controller changes its addresses.

use linesman_proto::address::{LogicalAddress, Path};

/// As many answers are kept.
const SLOTS: usize = 1_024;

/// What a datagram asks for: who is meant, on the way from a card.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct AddressQuery(u64);

/// The two kinds of questions.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum AddressKind {
    /// Who has this station address or alias?
    Station(u16),
    /// Who maps any of so many logical bytes?
    Logical(LogicalAddress, usize),
}

impl AddressQuery {
    const STATION: u64 = 1 << 63;

    pub(super) fn station(card: Path, address: u16) -> Self {
        Self(Self::STATION | (card.index() as u64) << 62 | u64::from(address))
    }

    pub(super) fn logical(card: Path, start: LogicalAddress, len: usize) -> Self {
        Self((card.index() as u64) << 62 | (len as u64) << 32 | u64::from(start.0))
    }

    /// What is asked.
    pub(super) fn asked(self) -> AddressKind {
        if self.0 & Self::STATION != 0 {
            AddressKind::Station(self.0 as u16)
        } else {
            AddressKind::Logical(LogicalAddress(self.0 as u32), (self.0 >> 32) as usize & 0x7FF)
        }
    }

    fn slot(self) -> usize {
        // Neighbours fall into different slots, and so do bytes that lie 2^n apart.
        (self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 54) as usize % SLOTS
    }
}

/// Places on the way of a frame that answer a question.
#[derive(Clone, Default, Debug)]
struct CachedPlaces {
    query: AddressQuery,
    /// Of which book it is; 0 for none yet.
    edition: u64,
    places: Vec<u32>,
}

/// The answers.
#[derive(Default, Debug)]
pub(super) struct AddressCache(Vec<CachedPlaces>);

impl AddressCache {
    /// Takes an answer out; to be given back. `Err` has an empty one, whose memory is kept.
    #[inline]
    pub(super) fn take(&mut self, query: AddressQuery, edition: u64) -> Result<Vec<u32>, Vec<u32>> {
        if self.0.is_empty() {
            self.0.resize(SLOTS, CachedPlaces::default());
        }
        let answer = &mut self.0[query.slot()];
        let mut places = std::mem::take(&mut answer.places);
        if answer.query == query && answer.edition == edition {
            return Ok(places);
        }
        places.clear();
        Err(places)
    }

    /// Gives an answer back.
    #[inline]
    pub(super) fn keep(&mut self, query: AddressQuery, edition: u64, places: Vec<u32>) {
        let answer = &mut self.0[query.slot()];
        (answer.query, answer.edition, answer.places) = (query, edition, places);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_holds_for_one_question_and_one_edition() {
        let mut address_cache = AddressCache::default();
        let station = AddressQuery::station(Path::A, 0x1001);
        assert_eq!(address_cache.take(station, 1), Err(vec![]));
        address_cache.keep(station, 1, vec![4, 7]);
        assert_eq!(address_cache.take(station, 1), Ok(vec![4, 7]));
        address_cache.keep(station, 1, vec![4, 7]);
        assert_eq!(address_cache.take(station, 2), Err(vec![]), "somebody has changed its name");
        for other in [
            AddressQuery::station(Path::B, 0x1001),
            AddressQuery::station(Path::A, 0x1002),
            AddressQuery::logical(Path::A, LogicalAddress(0x1001), 1),
        ] {
            address_cache.keep(station, 3, vec![1]);
            assert_eq!(address_cache.take(other, 3).unwrap_or_default(), [0u32; 0], "{other:?}");
        }
    }
}
