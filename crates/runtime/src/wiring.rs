//! Outputs of a virtual segment wired to its inputs, so that what a MainDevice writes comes back;
//! and inputs that are held at a value from outside.

use std::collections::BTreeMap;

use linesman_config::project::Project;
use linesman_sim::device::library;
use linesman_sim::device::{SignalId, Signals};
use linesman_sim::segment::Segment;

/// Groups of the library whose channels fit together: outputs, inputs.
const PAIRS: [(&str, &str); 2] = [("DigOut", "DigIn"), ("AnaOut", "AnaIn")];

/// Wires from outputs to inputs: the first output channel of the plant to the first input channel
/// of the same kind, the second to the second, as far as there are both.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Wiring {
    /// From, to.
    wires: Vec<(SignalId, SignalId)>,
    /// Inputs that are held: no wire reaches them.
    held: BTreeMap<SignalId, i32>,
}

impl Wiring {
    /// Wires a segment; `project` says which types its devices are.
    #[must_use]
    pub fn of(segment: &Segment, project: &Project) -> Self {
        // A device that is made from a file may be called as one of the library, but has other
        // channels.
        let group = |type_name: &str, channels: (usize, usize)| {
            let named = library::types().find(|one| one.name() == type_name);
            named.filter(|one| one.channels() == channels).map_or("", |one| one.group())
        };
        let mut wires = Vec::new();
        for (from, to) in PAIRS {
            let mut outputs = Vec::new();
            let mut inputs = Vec::new();
            for device in segment.devices() {
                let Some(planned) = project.devices.get(device.index()) else { continue };
                let channels = (segment.outputs(device).len(), segment.inputs(device).len());
                match group(&planned.type_name, channels) {
                    kind if kind == from => outputs.extend_from_slice(segment.outputs(device)),
                    kind if kind == to => inputs.extend_from_slice(segment.inputs(device)),
                    _ => {}
                }
            }
            wires.extend(outputs.into_iter().zip(inputs));
        }
        Self { wires, held: BTreeMap::new() }
    }

    /// How many wires there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.wires.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.wires.is_empty()
    }

    /// The output that an input is wired to.
    #[must_use]
    pub fn source(&self, input: SignalId) -> Option<SignalId> {
        self.wires.iter().find(|(_, to)| *to == input).map(|(from, _)| *from)
    }

    /// Whether an input is held at a value from outside.
    #[must_use]
    pub fn is_held(&self, input: SignalId) -> bool {
        self.held.contains_key(&input)
    }

    /// Holds an input at a value, whatever it is wired to.
    pub fn hold(&mut self, input: SignalId, value: i32) {
        self.held.insert(input, value);
    }

    /// Gives an input back to its wire, or to nobody.
    pub fn release(&mut self, input: SignalId, signals: &mut Signals) {
        if self.held.remove(&input).is_some() {
            signals.release(input);
        }
    }

    /// Inputs that are held.
    pub fn held(&self) -> impl Iterator<Item = SignalId> {
        self.held.keys().copied()
    }

    /// Brings the outputs' values to the inputs.
    pub fn carry(&self, signals: &mut Signals) {
        for (from, to) in &self.wires {
            let value = signals.value(*from);
            signals.set(*to, value);
        }
        for (input, value) in &self.held {
            signals.set(*input, *value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_input_is_deaf_until_it_is_released() {
        let mut signals = Signals::new(3);
        let [output, input, open] = [0, 1, 2].map(SignalId);
        let mut wiring = Wiring { wires: vec![(output, input)], held: BTreeMap::new() };
        wiring.carry(&mut signals);
        assert_eq!(signals.driven(input), Some(0), "a wired input is not open");
        signals.set(output, 7);
        wiring.carry(&mut signals);
        assert_eq!(signals.value(input), 7);
        wiring.hold(input, -1);
        wiring.hold(open, 5);
        wiring.carry(&mut signals);
        assert_eq!((signals.value(input), signals.value(open)), (-1, 5));
        assert_eq!(wiring.source(input), Some(output));
        for one in [input, open] {
            wiring.release(one, &mut signals);
        }
        wiring.carry(&mut signals);
        assert_eq!((signals.value(input), signals.driven(open)), (7, None));
    }
}
