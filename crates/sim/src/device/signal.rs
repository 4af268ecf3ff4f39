//! Electrical signals between devices: outputs of one terminal wired to inputs of another.

/// A signal: a wire between terminals, by its number in [`Signals`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct SignalId(pub u32);

impl SignalId {
    /// A signal that does not exist: a bit without a channel.
    pub const NOWHERE: Self = Self(u32::MAX);
}

/// All signals of a segment with their present values.
///
/// A digital signal is 0 or 1; what the number of an analogue one means (digits, mV, …) is agreed
/// between the devices that share it.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Signals {
    values: Vec<Option<i32>>,
    /// Counts changes of values.
    edition: u64,
}

impl Signals {
    /// `count` signals, all 0 and driven by nothing.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { values: vec![None; count], edition: 0 }
    }

    /// One more signal, 0 at first and driven by nothing.
    pub fn add(&mut self) -> SignalId {
        self.values.push(None);
        SignalId((self.values.len() - 1) as u32)
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Its value; 0 for a signal that does not exist: an open input reads low.
    #[must_use]
    pub fn value(&self, signal: SignalId) -> i32 {
        self.driven(signal).unwrap_or(0)
    }

    /// Drives it. A signal that does not exist goes nowhere.
    pub fn set(&mut self, signal: SignalId, value: i32) {
        if let Some(slot) = self.values.get_mut(signal.0 as usize)
            && *slot != Some(value)
        {
            *slot = Some(value);
            self.edition += 1;
        }
    }

    /// Lets go of it: nothing drives it any more.
    pub fn release(&mut self, signal: SignalId) {
        if let Some(slot) = self.values.get_mut(signal.0 as usize)
            && slot.take().is_some()
        {
            self.edition += 1;
        }
    }

    /// A number that changes whenever any signal does.
    #[must_use]
    pub fn edition(&self) -> u64 {
        self.edition
    }

    /// Its value, if anything has driven it yet: a wire that nothing is connected to says nothing.
    #[must_use]
    pub fn driven(&self, signal: SignalId) -> Option<i32> {
        self.values.get(signal.0 as usize).copied().flatten()
    }

    /// Whether a digital signal is high.
    #[must_use]
    pub fn is_high(&self, signal: SignalId) -> bool {
        self.value(signal) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_keep_what_they_are_driven_to() {
        let mut signals = Signals::new(1);
        let added = signals.add();
        assert_eq!((added, signals.len()), (SignalId(1), 2));
        signals.set(added, -7);
        assert_eq!((signals.value(added), signals.is_high(added)), (-7, true));
        assert!(!signals.is_high(SignalId(0)));
        assert_eq!((signals.driven(SignalId(0)), signals.driven(added)), (None, Some(-7)));
        signals.release(added);
        assert_eq!(signals.driven(added), None);
        signals.set(SignalId(9), 1);
        signals.release(SignalId(9));
        assert_eq!(signals.value(SignalId(9)), 0, "a signal that leads nowhere reads low");
    }
}
