//! Assembly of a device from the table of its type: hardware, SII image and firmware.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::LATCH0_STATUS;
use linesman_proto::sii::Protocols;

use super::object::{self, Individual};
use super::spec::{ApplicationSpec, Function, ProcessorSpec, Spec, Use};
use super::{Built, file, image};
use crate::device::application::Channel;
use crate::device::application::analog::{AnalogInput, AnalogOutput, Range};
use crate::device::application::bridge::Bridge;
use crate::device::application::digital::DigitalOutput;
use crate::device::application::drive::Cia402;
use crate::device::application::oversampling::{Oversampling, SampleBuffer};
use crate::device::application::sercos::Sercos;
use crate::device::application::stepper::Stepper;
use crate::device::application::time_stamp::TimeStamps;
use crate::device::application::two_times::TwoTimes;
use crate::device::dictionary::Dictionary;
use crate::device::emulated::{DigitalArea, Emulated, WordArea};
use crate::device::ethernet::EthernetFunction;
use crate::device::firmware::Firmware;
use crate::device::processor::{BusAccess, Description, ProcessBuffer, Processor};
use crate::device::signal::{SignalId, Signals};

/// Makes one controller with what is behind it.
pub(super) fn build_one(spec: &Spec, individual: Individual, signals: &mut Signals) -> Built {
    let mut add = |count: usize| (0..count).map(|_| signals.add()).collect::<Vec<_>>();
    let outputs = add(spec.output_channels());
    let inputs = add(spec.input_channels());
    let firmware: Box<dyn Firmware> = match spec.application {
        ApplicationSpec::Plain => {
            let device = Emulated::new(
                areas(spec, Use::Outputs, &outputs),
                areas(spec, Use::Inputs, &inputs),
            );
            // Whose process data are the registers of the latch unit, has its inputs there.
            let latches = LATCH0_STATUS.address.0;
            let stamps = spec.sync_managers.iter().any(|manager| manager.start == latches);
            let stamped: &[SignalId] = if stamps { &inputs } else { &[] };
            Box::new(device.with_time_stamps(TimeStamps::new(stamped)))
        }
        ApplicationSpec::CodingSwitch(at) => {
            let word =
                inputs.iter().map(|signal| WordArea { sync_manager: 0, at, signal: *signal });
            let device = Emulated::default().with_words(word.collect());
            match inputs.first() {
                Some(switch) => Box::new(device.with_coding_switch(*switch)),
                None => Box::new(device),
            }
        }
        ApplicationSpec::Oversampling { .. } => {
            let buffers = (0..).zip(&outputs);
            let buffers =
                buffers.map(|(sync_manager, signal)| SampleBuffer::of_words(sync_manager, *signal));
            Box::new(Oversampling::new(buffers.collect(), Vec::new()))
        }
        ApplicationSpec::Processor(processor) => {
            with_processor(spec, processor, individual, &outputs, &inputs)
        }
    };
    let sii = image::build(spec, individual);
    Built { hardware: spec.hardware(), sii, firmware, outputs, inputs }
}

/// The bits that a controller switches or takes itself: one area for each SyncManager, in which the
/// entries of its PDOs lie bit behind bit.
fn areas(spec: &Spec, kind: Use, signals: &[SignalId]) -> Vec<DigitalArea> {
    let mut free = signals.iter().copied();
    let mine = (0..)
        .zip(spec.sync_managers)
        .filter(|(_, manager)| manager.kind == kind && !manager.is_virtual());
    mine.map(|(sync_manager, manager)| {
        let entries = spec
            .assigned(sync_manager)
            .flat_map(|pdo| (0..pdo.channels).flat_map(|_| pdo.entries.iter()));
        let mut bits = Vec::new();
        for entry in entries {
            let signal = if entry.index == 0 { None } else { free.next() };
            bits.push(signal.unwrap_or(SignalId::NOWHERE));
            bits.resize(bits.len() + usize::from(entry.bits.saturating_sub(1)), SignalId::NOWHERE);
        }
        DigitalArea { sync_manager, at: RegisterAddress(manager.start), signals: bits }
    })
    .collect()
}

/// A device with a processor.
fn with_processor(
    spec: &Spec,
    processor: &ProcessorSpec,
    individual: Individual,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Box<dyn Firmware> {
    let dictionary = object::dictionary(spec, processor, individual);
    let channels = channels(processor.function, &dictionary, outputs, inputs);
    let description = Description {
        dictionary,
        channels,
        buffers: ProcessBuffer::BEHIND_MAILBOX.to_vec(),
        excludes: Vec::new(),
        mailbox: spec.mailbox(),
        protocols: Protocols(spec.protocols),
        ethernet: match processor.function {
            Function::SwitchPorts { ports } => EthernetFunction::SwitchPorts(ports),
            Function::None
            | Function::DigitalOutputs { .. }
            | Function::AnalogInputs { .. }
            | Function::AnalogOutputs { .. }
            | Function::AnalogInputsOutputs { .. }
            | Function::Stepper
            | Function::Cia402
            | Function::Sercos
            | Function::TwoTimes
            | Function::Bridge { .. } => EthernetFunction::IpApplication,
        },
        bootstrap: Some(image::bootstrap(spec)),
        times: processor.times,
        bus: BusAccess::Words,
        unit_alone: false,
    };
    Box::new(Processor::new(description).with_files(file::files(spec)))
}

type Channels = Vec<Box<dyn Channel>>;

fn channels(
    function: Function,
    dictionary: &Dictionary,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Channels {
    match function {
        Function::None | Function::SwitchPorts { .. } => Vec::new(),
        Function::DigitalOutputs { .. } => (0u16..)
            .zip(outputs)
            .map(|(channel, signal)| {
                let output = DigitalOutput::new(dictionary, 0x7000 + 0x10 * channel, 1, *signal);
                Box::new(output) as Box<dyn Channel>
            })
            .collect(),
        Function::AnalogInputs { range, .. } => analog_inputs(dictionary, range, inputs),
        Function::AnalogOutputs { subindex, range, .. } => {
            analog_outputs(dictionary, 0, subindex, range, outputs)
        }
        Function::AnalogInputsOutputs { inputs: first, range, .. } => {
            let mut channels = analog_inputs(dictionary, range, inputs);
            channels.extend(analog_outputs(dictionary, first, 0x11, range, outputs));
            channels
        }
        Function::Stepper => match (outputs, inputs) {
            ([position], [first, second]) => {
                vec![Box::new(Stepper::new(dictionary, *position, [*first, *second]))]
            }
            _ => Vec::new(),
        },
        Function::Cia402 => match (outputs, inputs) {
            ([position], [home, negative, positive, blocked]) => {
                let inputs = [*home, *negative, *positive, *blocked];
                vec![Box::new(Cia402::new(dictionary, *position, inputs))]
            }
            _ => Vec::new(),
        },
        Function::Sercos => match (outputs, inputs) {
            ([position], [blocked]) => {
                vec![Box::new(Sercos::new(dictionary, *position, *blocked))]
            }
            _ => Vec::new(),
        },
        Function::Bridge { .. } => match inputs.split_last() {
            Some((ahead, inputs)) => {
                vec![Box::new(Bridge::new(dictionary, outputs, inputs, *ahead))]
            }
            None => Vec::new(),
        },
        Function::TwoTimes => inputs
            .iter()
            .map(|signal| Box::new(TwoTimes::new(dictionary, *signal)) as Box<dyn Channel>)
            .collect(),
    }
}

fn analog_inputs(dictionary: &Dictionary, range: Range, inputs: &[SignalId]) -> Channels {
    (0u8..)
        .zip(inputs)
        .map(|(channel, signal)| {
            Box::new(AnalogInput::new(dictionary, channel, range, *signal)) as Box<dyn Channel>
        })
        .collect()
}

/// Analogue outputs from the channel `first` on.
fn analog_outputs(
    dictionary: &Dictionary,
    first: u8,
    subindex: u8,
    range: Range,
    outputs: &[SignalId],
) -> Channels {
    (first..)
        .zip(outputs)
        .map(|(channel, signal)| {
            let output = AnalogOutput::new(dictionary, channel, subindex, range, *signal);
            Box::new(output) as Box<dyn Channel>
        })
        .collect()
}
