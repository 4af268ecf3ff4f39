//! List of waiters, each under a number that is never given twice. Places are used again, so that a
//! list which has reached its size allocates nothing any more.

use slab::Slab;

/// Bits of a number that tell the place; the others count, so that numbers grow.
const PLACE_BITS: u32 = 24;

/// The list.
#[derive(Debug)]
pub(crate) struct Waitlist<T> {
    places: Slab<(u64, T)>,
    given: u64,
}

impl<T> Default for Waitlist<T> {
    fn default() -> Self {
        Self { places: Slab::new(), given: 0 }
    }
}

const fn place(number: u64) -> usize {
    (number & ((1 << PLACE_BITS) - 1)) as usize
}

impl<T> Waitlist<T> {
    /// The number of one more; later ones have higher numbers.
    pub(crate) fn insert(&mut self, value: T) -> u64 {
        let vacant = self.places.vacant_entry();
        let number = self.given << PLACE_BITS | vacant.key() as u64;
        self.given += 1;
        vacant.insert((number, value));
        number
    }

    pub(crate) fn get_mut(&mut self, number: u64) -> Option<&mut T> {
        let (own, value) = self.places.get_mut(place(number))?;
        (*own == number).then_some(value)
    }

    pub(crate) fn contains(&self, number: u64) -> bool {
        self.places.get(place(number)).is_some_and(|(own, _)| *own == number)
    }

    pub(crate) fn remove(&mut self, number: u64) -> Option<T> {
        self.contains(number).then(|| self.places.remove(place(number)).1)
    }

    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Takes out all of them, in the order in which they came.
    pub(crate) fn take_all(&mut self) -> impl Iterator<Item = T> {
        let mut all: Vec<(u64, T)> = self.places.drain().collect();
        all.sort_unstable_by_key(|(number, _)| *number);
        all.into_iter().map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_used_again_but_never_its_number() {
        let mut list = Waitlist::default();
        let numbers: Vec<u64> = ["a", "b", "c"].map(|name| list.insert(name)).into();
        assert_eq!(list.remove(numbers[1]), Some("b"));
        let last = list.insert("d");
        assert!(last > numbers[2] && place(last) == place(numbers[1]));
        assert_eq!((list.remove(numbers[1]), list.get_mut(numbers[1])), (None, None));
        assert_eq!(list.get_mut(last), Some(&mut "d"));
        assert_eq!(list.take_all().collect::<Vec<_>>(), ["a", "c", "d"]);
        assert_eq!(list.len(), 0);
    }
}
