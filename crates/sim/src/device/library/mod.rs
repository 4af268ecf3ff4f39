//! The device library: what can be put into a segment, as tables.
//!
//! Read first: ETG.2010 (SII). Every type is a `Spec` in one of the family files; everything a
//! device needs is made from it: hardware, SII image and firmware. Identities, ports, currents and
//! default process data are those of the products that the types are named after.

mod analog;
mod box_module;
pub(super) mod chip;
mod coupler;
mod digital;
mod file;
mod image;
pub(super) mod object;
mod smart;
mod spec;

pub use self::chip::controllers;
use linesman_proto::port::{Port, PortMap};

use self::object::Individual;
use self::spec::{Behind, Function, ProcessorSpec, Spec, Switching};
use super::application::Channel;
use super::application::analog::{AnalogInput, AnalogOutput};
use super::application::digital::DigitalOutput;
use super::application::stepper::Stepper;
pub use super::application_layer::Refusal;
use super::dictionary::Dictionary;
use super::emulated::{DigitalArea, Emulated, WordArea};
use super::firmware::Firmware;
use super::processor::{Description, ProcessBuffer, Processor};
use super::signal::{SignalId, Signals};
use crate::hardware::{Hardware, PortKind};

/// One controller of a device, ready to be powered.
#[derive(Debug)]
pub struct Built {
    /// What it is made of.
    pub hardware: Hardware,
    /// The content of its EEPROM.
    pub sii: Vec<u8>,
    /// What is behind it.
    pub firmware: Box<dyn Firmware>,
    /// Signals it drives, channel by channel.
    pub outputs: Vec<SignalId>,
    /// Signals it takes, channel by channel. Nothing drives them yet.
    pub inputs: Vec<SignalId>,
}

/// A connection between two controllers within one housing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InnerLink {
    /// The controller nearer to the MainDevice, counted from 0, and its port.
    pub from: (usize, Port),
    /// The other one.
    pub to: (usize, Port),
}

/// A type of device.
#[derive(Debug)]
pub struct LibraryType {
    controllers: &'static [Spec],
    inner_links: &'static [InnerLink],
}

impl LibraryType {
    /// Order designation, such as "EL2004".
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.controllers.first().map_or("", |spec| spec.name)
    }

    /// Its name in full.
    #[must_use]
    pub fn title(&self) -> &'static str {
        self.controllers.first().map_or("", |spec| spec.title)
    }

    /// The group it is sold under, such as "DigOut".
    #[must_use]
    pub fn group(&self) -> &'static str {
        self.controllers.first().map_or("", |spec| spec.group)
    }

    /// The ports of each of its controllers.
    pub fn ports(&self) -> impl Iterator<Item = PortMap<PortKind>> {
        self.controllers.iter().map(|spec| PortMap(spec.ports))
    }

    /// How its controllers hang together; nothing for the usual device with one.
    #[must_use]
    pub fn inner_links(&self) -> &'static [InnerLink] {
        self.inner_links
    }

    /// Current from the E-bus in mA; negative is supplied, 0 for devices with a supply of their own.
    #[must_use]
    pub fn ebus_current_ma(&self) -> i16 {
        self.controllers.iter().map(|spec| spec.ebus_current_ma).sum()
    }

    /// Whether it has a processor, and with it a mailbox.
    #[must_use]
    pub fn has_mailbox(&self) -> bool {
        self.controllers.iter().any(|spec| spec.mailbox().is_present())
    }

    /// Makes a device: one [`Built`] for each of its controllers, in the order in which frames reach
    /// them. Its channels become new signals. `revision` stands in identity and dictionary.
    #[must_use]
    pub fn build(&self, revision: Option<u32>, serial: u32, signals: &mut Signals) -> Vec<Built> {
        let build = |spec: &Spec| {
            let revision = revision.unwrap_or(spec.revision);
            build_one(spec, Individual { revision, serial }, signals)
        };
        self.controllers.iter().map(build).collect()
    }

    /// How many channels it has: outputs, inputs.
    #[must_use]
    pub fn channels(&self) -> (usize, usize) {
        let of = |count: fn(&Spec) -> usize| self.controllers.iter().map(count).sum();
        (of(Spec::output_channels), of(Spec::input_channels))
    }
}

/// There is no such type in the library.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("device type \"{name}\" is not in the library{}", closest(.name))]
pub struct UnknownType {
    /// The name that was asked for.
    pub name: String,
}

/// The types that begin most like `name`, for the message.
fn closest(name: &str) -> String {
    let family = name.get(..2).unwrap_or(name).to_ascii_uppercase();
    let of_family = |known: &&str| !family.is_empty() && known.starts_with(&family);
    let mut names: Vec<&str> = types().map(LibraryType::name).filter(of_family).collect();
    if names.is_empty() {
        names = types().map(LibraryType::name).collect();
    }
    format!("; it has {}", names.join(", "))
}

/// All types, couplers first.
pub fn types() -> impl Iterator<Item = &'static LibraryType> {
    [coupler::TYPES, digital::TYPES, analog::TYPES, smart::TYPES, box_module::TYPES]
        .into_iter()
        .flatten()
}

/// The type with this name, in any case; the variant may be left out ("EP1008" is an EP1008-0001).
#[must_use]
pub fn find(type_name: &str) -> Option<&'static LibraryType> {
    let without_variant = |known: &&LibraryType| {
        let base = known.name().split('-').next();
        base.is_some_and(|base| base.eq_ignore_ascii_case(type_name))
    };
    types()
        .find(|known| known.name().eq_ignore_ascii_case(type_name))
        .or_else(|| types().find(without_variant))
}

/// Makes a device: one [`Built`] for each of its controllers, in the order in which frames reach
/// them. Its channels become new signals.
///
/// # Errors
/// [`UnknownType`] when the library does not have it.
pub fn build(
    type_name: &str,
    serial: u32,
    signals: &mut Signals,
) -> Result<Vec<Built>, UnknownType> {
    build_revision(type_name, None, serial, signals)
}

/// The same with another revision than the newest one, in identity and dictionary.
///
/// # Errors
/// [`UnknownType`] when the library does not have it.
pub fn build_revision(
    type_name: &str,
    revision: Option<u32>,
    serial: u32,
    signals: &mut Signals,
) -> Result<Vec<Built>, UnknownType> {
    let found = find(type_name).ok_or_else(|| UnknownType { name: type_name.to_owned() })?;
    Ok(found.build(revision, serial, signals))
}

fn build_one(spec: &Spec, individual: Individual, signals: &mut Signals) -> Built {
    let mut add = |count: usize| (0..count).map(|_| signals.add()).collect::<Vec<_>>();
    let outputs = add(spec.output_channels());
    let inputs = add(spec.input_channels());
    let firmware = match spec.behind {
        Behind::Plain | Behind::CodingSwitch(_) => emulated(spec, &outputs, &inputs),
        Behind::Processor(processor) => {
            with_processor(spec, processor, individual, &outputs, &inputs)
        }
    };
    let sii = image::build(spec, individual);
    Built { hardware: spec.hardware(), sii, firmware, outputs, inputs }
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
        mailbox: spec.mailbox(),
        bootstrap: Some(image::bootstrap(spec)),
        times: processor.times,
    };
    Box::new(Processor::new(description).with_files(file::files(spec)))
}

fn channels(
    function: Function,
    dictionary: &Dictionary,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Vec<Box<dyn Channel>> {
    let outputs = || (0u8..).zip(outputs.iter().copied());
    let inputs = || (0u8..).zip(inputs.iter().copied());
    match function {
        Function::None => Vec::new(),
        Function::DigitalOutputs { .. } => outputs()
            .map(|(channel, signal)| {
                let index = 0x7000 + 0x10 * u16::from(channel);
                Box::new(DigitalOutput::new(dictionary, index, 1, signal)) as Box<dyn Channel>
            })
            .collect(),
        Function::AnalogInputs { range, .. } => inputs()
            .map(|(channel, signal)| {
                Box::new(AnalogInput::new(dictionary, channel, range, signal)) as Box<dyn Channel>
            })
            .collect(),
        Function::AnalogOutputs { subindex, range, .. } => outputs()
            .map(|(channel, signal)| {
                let output = AnalogOutput::new(dictionary, channel, subindex, range, signal);
                Box::new(output) as Box<dyn Channel>
            })
            .collect(),
        Function::Stepper => {
            let position = outputs().map(|(_, signal)| signal).next();
            let mut switches = inputs().map(|(_, signal)| signal);
            match (position, switches.next(), switches.next()) {
                (Some(position), Some(first), Some(second)) => {
                    vec![Box::new(Stepper::new(dictionary, position, [first, second]))]
                }
                _ => Vec::new(),
            }
        }
    }
}

/// A device whose controller drives its channels itself.
fn emulated(spec: &Spec, outputs: &[SignalId], inputs: &[SignalId]) -> Box<dyn Firmware> {
    let areas = |channels: &[SignalId], switching: Option<&Switching>| {
        let Some(switching) = switching else { return Vec::new() };
        let area = DigitalArea {
            sync_manager: switching.sync_manager,
            at: switching.at,
            signals: channels.to_vec(),
        };
        vec![area]
    };
    let words = spec.coding_switch().into_iter().zip(inputs).map(|(at, signal)| WordArea {
        sync_manager: 0,
        at,
        signal: *signal,
    });
    let emulated = Emulated::new(
        areas(outputs, spec.switching_outputs().as_ref()),
        areas(inputs, spec.switching_inputs().as_ref()),
    );
    Box::new(emulated.with_words(words.collect()))
}

#[cfg(test)]
mod tests;
