//! Electrical signals between devices: outputs of one terminal wired to inputs of another.

use std::collections::{BTreeMap, BTreeSet};

use linesman_proto::time::Instant;

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
#[derive(Clone, Default, Debug)]
pub struct Signals {
    values: Vec<Option<i32>>,
    /// Inputs that hang on an output: source and sink, in the order of sources.
    wires: BTreeMap<SignalId, Vec<SignalId>>,
    /// Inputs that hang on an output.
    wired: BTreeSet<SignalId>,
    /// When each changed last.
    changed: Vec<Instant>,
    /// When what happens now happens.
    now: Instant,
    /// Signals that changed since they were last asked for, each once.
    fresh: Vec<SignalId>,
    /// Whether a signal is among them.
    is_fresh: Vec<bool>,
}

/// Who was told of a change already is no property of a signal.
impl PartialEq for Signals {
    fn eq(&self, other: &Self) -> bool {
        (&self.values, &self.changed, self.now) == (&other.values, &other.changed, other.now)
    }
}

impl Eq for Signals {}

impl Signals {
    /// `count` signals, all 0 and driven by nothing.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self {
            values: vec![None; count],
            wires: BTreeMap::new(),
            wired: BTreeSet::new(),
            changed: vec![Instant::ZERO; count],
            now: Instant::ZERO,
            fresh: Vec::new(),
            is_fresh: vec![false; count],
        }
    }

    /// One more signal, 0 at first and driven by nothing.
    pub fn add(&mut self) -> SignalId {
        self.values.push(None);
        self.changed.push(Instant::ZERO);
        self.is_fresh.push(false);
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

    /// Lays a wire: from now on `input` carries what drives `output`. False when it has one already.
    pub fn wire(&mut self, output: SignalId, input: SignalId) -> bool {
        if output == input || !self.wired.insert(input) {
            return false;
        }
        self.wires.entry(output).or_default().push(input);
        if let Some(value) = self.driven(output) {
            self.put(input, Some(value));
        }
        true
    }

    /// Drives it, and what is wired to it. A signal that does not exist goes nowhere.
    pub fn set(&mut self, signal: SignalId, value: i32) {
        self.drive(signal, Some(value));
    }

    /// Lets go of it: nothing drives it any more.
    pub fn release(&mut self, signal: SignalId) {
        self.drive(signal, None);
    }

    fn drive(&mut self, signal: SignalId, value: Option<i32>) {
        if !self.put(signal, value) {
            return;
        }
        // An input drives nothing: one step is enough.
        let mut at = 0;
        while let Some(input) = self.wires.get(&signal).and_then(|inputs| inputs.get(at)).copied() {
            self.put(input, value);
            at += 1;
        }
    }

    /// Whether that changed it.
    fn put(&mut self, signal: SignalId, value: Option<i32>) -> bool {
        let Some(slot) = self.values.get_mut(signal.0 as usize).filter(|slot| **slot != value)
        else {
            return false;
        };
        *slot = value;
        self.note_change(signal);
        true
    }

    /// What is driven from here on is driven at this instant.
    pub fn at(&mut self, now: Instant) -> &mut Self {
        self.now = now;
        self
    }

    /// When a signal changed last; the start of the run for one that never did.
    #[must_use]
    pub fn changed_at(&self, signal: SignalId) -> Instant {
        self.changed.get(signal.0 as usize).copied().unwrap_or(Instant::ZERO)
    }

    fn note_change(&mut self, signal: SignalId) {
        if let Some(changed) = self.changed.get_mut(signal.0 as usize) {
            *changed = self.now;
        }
        if let Some(is_fresh) = self.is_fresh.get_mut(signal.0 as usize)
            && !std::mem::replace(is_fresh, true)
        {
            self.fresh.push(signal);
        }
    }

    /// Whether a signal has changed that was not told of.
    #[inline]
    pub(crate) fn has_fresh(&self) -> bool {
        !self.fresh.is_empty()
    }

    /// A signal that has changed since it was last told of; each is told once.
    #[inline]
    pub(crate) fn take_fresh(&mut self) -> Option<SignalId> {
        let signal = self.fresh.pop()?;
        if let Some(is_fresh) = self.is_fresh.get_mut(signal.0 as usize) {
            *is_fresh = false;
        }
        Some(signal)
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
        let later = Instant::from_nanos(70);
        signals.at(later).set(added, -7);
        assert_eq!(signals.changed_at(added), Instant::ZERO, "the same value is no change");
        signals.at(later).release(added);
        assert_eq!((signals.driven(added), signals.changed_at(added)), (None, later));
        assert_eq!((signals.take_fresh(), signals.take_fresh()), (Some(added), None));
        signals.set(SignalId(9), 1);
        signals.release(SignalId(9));
        assert_eq!(signals.take_fresh(), None);
        assert_eq!(signals.value(SignalId(9)), 0, "a signal that leads nowhere reads low");
    }

    #[test]
    fn an_input_carries_what_its_output_drives() {
        let mut signals = Signals::new(4);
        let [output, one, two, other] = [0, 1, 2, 3].map(SignalId);
        signals.set(output, 5);
        assert!(signals.wire(output, one) && signals.wire(output, two));
        assert!(!signals.wire(other, one), "it has a wire");
        assert!(!signals.wire(other, other));
        assert_eq!((signals.value(one), signals.value(two)), (5, 5));
        signals.set(output, -1);
        assert_eq!((signals.value(one), signals.value(two)), (-1, -1));
        signals.release(output);
        assert_eq!((signals.driven(one), signals.driven(two)), (None, None));
    }
}
