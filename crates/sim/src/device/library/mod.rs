//! The device library: what can be put into a segment, as tables.
//!
//! Read first: ETG.2010 (SII). Every type is a `Spec` in one of the family files; everything a
//! device needs is made from it: hardware, SII image and firmware. Identities, ports, currents and
//! default process data are those of the products that the types are named after.

mod analog;
mod assemble;
mod box_module;
pub(super) mod chip;
mod communication;
mod coupler;
mod digital;
pub(super) mod drive;
mod feed;
mod file;
mod generic;
mod image;
mod junction;
pub(super) mod object;
mod oversampling;
mod passive;
mod smart;
mod spec;
pub(in crate::device) mod synchronisation;

pub use self::chip::controllers;
use linesman_proto::port::{Port, PortMap};

use self::assemble::build_one;
use self::object::Individual;
pub use self::passive::{Passive, passive, passives};
use self::spec::Spec;
pub use super::application_layer::Refusal;
use super::firmware::Firmware;
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

    /// Whether its cables have Fast Hot Connect: such a port fits another such port only.
    #[must_use]
    pub fn fast_hot_connect(&self) -> bool {
        self.controllers.iter().any(|spec| spec.chip.fast_hot_connect())
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
    [
        coupler::TYPES,
        junction::TYPES,
        digital::TYPES,
        analog::TYPES,
        oversampling::TYPES,
        smart::TYPES,
        communication::TYPES,
        feed::TYPES,
        box_module::TYPES,
        drive::TYPES,
        generic::TYPES,
    ]
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

#[cfg(test)]
mod tests;
