//! Inputs and outputs of a running segment, seen and set from outside.

use std::collections::BTreeMap;

use linesman_proto::address::DeviceId;
use linesman_sim::device::SignalId;
use linesman_sim::segment::Segment;

use super::message::{SIGNALS_SCHEMA, SignalDirection, SignalState, SignalTable};
use crate::wiring::Wiring;

/// All of them, and why the request was refused if it was.
pub(super) fn table(error: Option<String>, segment: &Segment, wiring: &Wiring) -> SignalTable {
    let mut outputs = BTreeMap::new();
    for device in segment.devices() {
        for (channel, signal) in (1..).zip(segment.outputs(device)) {
            outputs.insert(*signal, format!("{}.{channel}", segment.name(device)));
        }
    }
    let mut signals = Vec::new();
    for device in segment.devices() {
        let state = |channel: usize, signal: SignalId, direction| SignalState {
            name: format!("{}.{channel}", segment.name(device)),
            direction,
            value: segment.signals().driven(signal),
            wired_to: wiring.source(signal).and_then(|from| outputs.get(&from).cloned()),
            held: wiring.is_held(signal),
        };
        for (channel, signal) in (1..).zip(segment.outputs(device)) {
            signals.push(state(channel, *signal, SignalDirection::Output));
        }
        for (channel, signal) in (1..).zip(segment.inputs(device)) {
            signals.push(state(channel, *signal, SignalDirection::Input));
        }
    }
    SignalTable { schema: SIGNALS_SCHEMA.to_owned(), error, signals }
}

/// Holds an input at a value.
pub(super) fn hold(
    input: &str,
    value: i32,
    segment: &mut Segment,
    wiring: &mut Wiring,
) -> Result<(), String> {
    let signal = find(input, segment)?;
    wiring.hold(signal, value);
    wiring.carry(segment.signals_mut());
    Ok(())
}

/// Gives an input back, or all of them.
pub(super) fn release(
    input: Option<&str>,
    segment: &mut Segment,
    wiring: &mut Wiring,
) -> Result<(), String> {
    let released: Vec<SignalId> = match input {
        Some(input) => vec![find(input, segment)?],
        None => wiring.held().collect(),
    };
    for signal in released {
        wiring.release(signal, segment.signals_mut());
    }
    wiring.carry(segment.signals_mut());
    Ok(())
}

/// An input by its name.
fn find(input: &str, segment: &Segment) -> Result<SignalId, String> {
    let form = || format!("`{input}`: expected a device and a channel from 1, such as `I1.3`");
    let (name, channel) = input.rsplit_once('.').ok_or_else(form)?;
    let channel: usize = channel.parse().map_err(|_| form())?;
    let device =
        segment.devices().find(|device| segment.name(*device) == name).ok_or_else(|| {
            format!(
                "`{input}`: there is no device `{name}`; with inputs there are {}",
                having(segment)
            )
        })?;
    let inputs = segment.inputs(device);
    channel.checked_sub(1).and_then(|index| inputs.get(index)).copied().ok_or_else(|| match inputs
        .len()
    {
        0 => {
            let others = having(segment);
            format!("`{input}`: {name} has no input; with inputs there are {others}")
        }
        count => format!("`{input}`: {name} has inputs 1 to {count}"),
    })
}

/// Devices with inputs.
fn having(segment: &Segment) -> String {
    let has = |device: &DeviceId| !segment.inputs(*device).is_empty();
    let names: Vec<&str> =
        segment.devices().filter(has).map(|device| segment.name(device)).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
