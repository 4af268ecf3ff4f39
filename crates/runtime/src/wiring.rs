//! Outputs of a virtual segment wired to its inputs, so that what a MainDevice writes comes back.

use linesman_config::project::Project;
use linesman_sim::device::library;
use linesman_sim::device::{SignalId, Signals};
use linesman_sim::segment::Segment;

/// Groups of the library whose channels fit together: outputs, inputs.
const PAIRS: [(&str, &str); 2] = [("DigOut", "DigIn"), ("AnaOut", "AnaIn")];

/// Wires from outputs to inputs: the first output channel of the plant to the first input channel
/// of the same kind, the second to the second, as far as there are both.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Wiring(Vec<(SignalId, SignalId)>);

impl Wiring {
    /// Wires a segment; `project` says which types its devices are.
    #[must_use]
    pub fn of(segment: &Segment, project: &Project) -> Self {
        let group = |type_name: &str| {
            library::types().find(|one| one.name() == type_name).map_or("", |one| one.group())
        };
        let mut wires = Vec::new();
        for (from, to) in PAIRS {
            let mut outputs = Vec::new();
            let mut inputs = Vec::new();
            for device in segment.devices() {
                let Some(planned) = project.devices.get(device.index()) else { continue };
                match group(&planned.type_name) {
                    kind if kind == from => outputs.extend_from_slice(segment.outputs(device)),
                    kind if kind == to => inputs.extend_from_slice(segment.inputs(device)),
                    _ => {}
                }
            }
            wires.extend(outputs.into_iter().zip(inputs));
        }
        Self(wires)
    }

    /// How many wires there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Brings the outputs' values to the inputs.
    pub fn carry(&self, signals: &mut Signals) {
        for (from, to) in &self.0 {
            let value = signals.value(*from);
            signals.set(*to, value);
        }
    }
}
