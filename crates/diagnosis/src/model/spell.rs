//! Things that come again and again, and since when they do: the latest of them are kept one by one, of those
//! before it is known how many there were and when they began.
//!
//! What lasts for long is more than can be kept. Whoever asks what it has done must know when it began, not when the
//! oldest that is kept came.

use std::collections::VecDeque;

use linesman_proto::time::{Instant, Span};

/// What lies closer together belongs together.
pub const TOGETHER: Span = Span::s(10);
/// How many are kept one by one.
const KEPT: usize = 64;

/// Something that was off by some time at a time.
pub trait SpellEntry: Copy {
    /// When it was.
    fn at(&self) -> Instant;
    /// By how much it was off.
    fn by(&self) -> Span;
}

/// The latest of them, and what is known of those before.
#[derive(Clone, Debug)]
pub struct Spell<T> {
    latest: VecDeque<T>,
    earlier: Option<Earlier<T>>,
}

/// Those of a spell that are not kept one by one any more.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Earlier<T> {
    /// The first one.
    pub first: T,
    /// The last one.
    pub last: T,
    /// How many there were.
    pub count: u64,
    /// By how much they were off at most.
    pub worst: Span,
}

impl<T> Default for Spell<T> {
    fn default() -> Self {
        Self { latest: VecDeque::new(), earlier: None }
    }
}

impl<T: SpellEntry> Spell<T> {
    /// The latest ones, oldest first, at most 64.
    #[must_use]
    pub const fn latest(&self) -> &VecDeque<T> {
        &self.latest
    }

    /// Those before the oldest that is kept, where they belong to it.
    #[must_use]
    pub fn earlier(&self) -> Option<&Earlier<T>> {
        let oldest = self.latest.front()?;
        self.earlier.as_ref().filter(|earlier| oldest.at().since(earlier.last.at()) <= TOGETHER)
    }

    /// Takes the next one.
    pub fn push(&mut self, one: T) {
        self.latest.push_back(one);
        if self.latest.len() <= KEPT {
            return;
        }
        let Some(gone) = self.latest.pop_front() else { return };
        match &mut self.earlier {
            Some(earlier) if gone.at().since(earlier.last.at()) <= TOGETHER => {
                earlier.last = gone;
                earlier.count += 1;
                earlier.worst = earlier.worst.max(gone.by());
            }
            _ => {
                self.earlier =
                    Some(Earlier { first: gone, last: gone, count: 1, worst: gone.by() });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl SpellEntry for (u64, u64) {
        fn at(&self) -> Instant {
            Instant::from_nanos(self.0 * 1_000_000)
        }

        fn by(&self) -> Span {
            Span::us(self.1)
        }
    }

    fn spell(all: impl IntoIterator<Item = (u64, u64)>) -> Spell<(u64, u64)> {
        let mut spell = Spell::default();
        all.into_iter().for_each(|one| spell.push(one));
        spell
    }

    #[test]
    fn what_is_not_kept_one_by_one_is_known_by_begin_number_and_worst() {
        assert_eq!(spell((0..64).map(|ms| (ms, 5))).earlier(), None);
        let long = spell((0..200).map(|ms| (ms, if ms == 7 { 90 } else { 5 })));
        assert_eq!(long.latest().len(), 64);
        let earlier = long.earlier().unwrap();
        assert_eq!((earlier.first.0, earlier.last.0, earlier.count), (0, 135, 136));
        assert_eq!(earlier.worst, Span::us(90));
    }

    #[test]
    fn what_lies_apart_is_another_spell() {
        let apart = spell((0..80).map(|ms| (ms, 5)).chain((90_000..90_064).map(|ms| (ms, 5))));
        assert_eq!(apart.earlier(), None, "a minute and a half between them");
        let again = spell((0..80).chain(90_000..90_100).map(|ms| (ms, 5)));
        assert_eq!(again.earlier().unwrap().first.0, 90_000);
    }
}
