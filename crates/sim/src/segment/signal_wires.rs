//! Electrical wires between devices, laid when a segment is built.

use super::DeviceInfo;
use super::build::{BuildError, Placed};
use crate::device::{SignalId, Signals};
use crate::segment_file::{SegmentFile, SignalWire};

/// Lays all wires of a file. A device of several controllers has its channels at those. Where one of
/// the two is missing, the wire hangs in the air.
pub(super) fn lay(
    file: &SegmentFile,
    planned: &[String],
    placed: &[Placed],
    devices: &[DeviceInfo],
    signals: &mut Signals,
) -> Result<(), BuildError> {
    for (number, wire) in (1..).zip(&file.wires) {
        let failed = |why: String| BuildError::Wire {
            number,
            from: wire.from.clone(),
            to: wire.to.clone(),
            why,
        };
        let info = |name: &str| {
            if !planned.iter().any(|known| known == name) {
                return Err(failed(format!("there is no device `{name}`")));
            }
            let at = placed.iter().position(|one| one.planned.name == name);
            Ok(at.and_then(|at| devices.get(at)))
        };
        let (Some(from), Some(to)) = (info(&wire.from)?, info(&wire.to)?) else { continue };
        for (output, input) in pairs(wire, &from.outputs, &to.inputs).map_err(failed)? {
            if !signals.wire(output, input) {
                return Err(failed("that input has a wire already".to_owned()));
            }
        }
    }
    Ok(())
}

type SignalPairs = Vec<(SignalId, SignalId)>;

fn pairs(
    wire: &SignalWire,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Result<SignalPairs, String> {
    let outputs = from(&wire.from, "output", wire.output, outputs)?;
    let inputs = from(&wire.to, "input", wire.input, inputs)?;
    let count = if wire.output.is_some() { 1 } else { usize::MAX };
    Ok(outputs.iter().copied().zip(inputs.iter().copied()).take(count).collect())
}

/// The channels from the one that is named on.
fn from<'a>(
    device: &str,
    what: &str,
    number: Option<u32>,
    channels: &'a [SignalId],
) -> Result<&'a [SignalId], String> {
    let place = number.unwrap_or(1).checked_sub(1).map_or(usize::MAX, |place| place as usize);
    match channels.get(place..) {
        Some(rest) if !rest.is_empty() => Ok(rest),
        Some(_) | None => {
            let number = number.unwrap_or(1);
            let has = channels.len();
            Err(format!("`{device}` has no {what} {number}: it has {has} {what}s, from 1 up"))
        }
    }
}
