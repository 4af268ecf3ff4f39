//! Frames that wait to be fetched, oldest first: a ring of slot numbers that never grows.

use super::SLOTS;

/// Each slot is in it once at most, so it has room for all of them.
#[derive(Debug)]
pub(super) struct Outgoing {
    ring: Box<[u8; SLOTS]>,
    first: u8,
    count: u16,
}

impl Outgoing {
    pub(super) fn new() -> Self {
        Self { ring: Box::new([0; SLOTS]), first: 0, count: 0 }
    }

    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.count == 0
    }

    #[inline]
    pub(super) fn push(&mut self, slot: u8) {
        let [offset, _] = self.count.to_le_bytes();
        self.ring[usize::from(self.first.wrapping_add(offset))] = slot;
        self.count += 1;
    }

    /// The oldest.
    #[inline]
    pub(super) fn first(&self) -> Option<u8> {
        if self.is_empty() { None } else { Some(self.ring[usize::from(self.first)]) }
    }

    /// Takes out the oldest.
    #[inline]
    pub(super) fn pop(&mut self) {
        self.first = self.first.wrapping_add(1);
        self.count -= 1;
    }

    /// Takes out one wherever it is; the others keep their order.
    pub(super) fn remove(&mut self, slot: u8) {
        for _ in 0..self.count {
            let Some(first) = self.first() else { return };
            self.pop();
            if first != slot {
                self.push(first);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_in_first_out_and_full_with_all_slots() {
        let mut outgoing = Outgoing::new();
        for turn in 0..3_u8 {
            (0..=255).for_each(|slot| outgoing.push(slot));
            outgoing.remove(7 + turn);
            for slot in (0..=255).filter(|slot| *slot != 7 + turn) {
                assert_eq!(outgoing.first(), Some(slot));
                outgoing.pop();
            }
            assert!(outgoing.is_empty() && outgoing.first().is_none());
            outgoing.push(turn);
            outgoing.pop();
        }
    }
}
