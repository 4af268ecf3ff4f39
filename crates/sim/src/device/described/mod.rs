//! Devices that are made from data: an SII image, or a device description of its maker (ESI).
//!
//! Read first: ETG.2010 (SII), ETG.2000 (ESI). Both ways lead to one [`DescribedType`]: the image
//! that is programmed into its EEPROM, its process data with their names, and the objects of its
//! dictionary as far as the data tell. Nothing is invented that the data do not say, but for what
//! no data tell and every device has; [`hardware`], [`objects`] and [`pdo`] say what that is.

pub mod hardware;
pub mod objects;
pub mod pdo;

mod channel;
mod esi;
mod firmware;
mod modules;
mod signals;

use linesman_config::esi::image::ImageError;
use linesman_config::esi::{Esi, EsiDevice, EsiError, FindError};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::sii::{BuildError, Identity, Image, SiiError};

use self::pdo::DescribedPdo;
use super::dictionary::Object;
use super::library::{Built, InnerLink};
use super::signal::Signals;
use crate::hardware::{Hardware, PortKind};

/// A type of device, made from data.
#[derive(Clone, PartialEq, Debug)]
pub struct DescribedType {
    /// What its EEPROM holds, but for serial number and revision of the individual.
    pub image: Image,
    /// The image as it was given, where it was given as bytes: they are programmed as they are.
    pub programmed: Option<Vec<u8>>,
    /// Order designation, such as "EL2004".
    pub name: String,
    /// Name in full.
    pub title: String,
    /// The group it is sold under.
    pub group: String,
    /// What it is made of.
    pub hardware: Hardware,
    /// Its process data objects.
    pub pdos: Vec<DescribedPdo>,
    /// Objects that the data describe; those that are missing are made from the rest.
    pub objects: Vec<Object>,
    /// Further controllers in its housing, in the order in which frames reach them. Each hangs on the
    /// E-bus of the one before.
    pub further: Vec<DescribedType>,
}

/// Why data do not make a device.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum DescribedError {
    /// The image cannot be read.
    #[error(transparent)]
    Sii(#[from] SiiError),
    /// The image cannot be made.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The image has no room for it.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// No device of the file is meant.
    #[error(transparent)]
    Find(#[from] FindError),
    /// The file cannot be read.
    #[error(transparent)]
    Esi(#[from] EsiError),
    /// It is a thing without a controller, such as an end cap.
    #[error(
        "it has neither EEPROM nor SyncManagers: a passive part, which no frame ever sees; leave \
         it out"
    )]
    NoController,
    /// Its dictionary is in another file.
    #[error("its dictionary is in `{0}`, which is missing")]
    DictionaryFile(String),
    /// A controller of its housing is not described.
    #[error("it has a further controller, product code {0}, which is not in the file")]
    SubDevice(String),
    /// A module does not fit.
    #[error("slot {slot}: {reason}")]
    Slot {
        /// Which slot, from 1.
        slot: usize,
        /// Why not.
        reason: String,
    },
    /// No controller has what the data ask for.
    #[error("{what}: {found}, expected {expected}")]
    Beyond {
        /// What is asked for.
        what: String,
        /// How much of it.
        found: String,
        /// What can be.
        expected: String,
    },
}

impl DescribedType {
    /// The device that an SII image describes.
    ///
    /// # Errors
    /// [`DescribedError`] when the image cannot be read, or asks for what no controller has.
    pub fn from_sii(bytes: &[u8]) -> Result<Self, DescribedError> {
        let image = Image::parse(bytes)?;
        let hardware = hardware::of(&image)?;
        let text = |text: Option<&str>| text.unwrap_or_default().trim().to_owned();
        let name = match text(image.order()) {
            name if name.is_empty() => format!("0x{:08X}", image.identity.product_code),
            name => name,
        };
        Ok(Self {
            title: text(image.name()),
            group: text(image.group()),
            pdos: pdo::complete(&image, pdo::of_image(&image)),
            objects: Vec::new(),
            programmed: Some(bytes.to_vec()),
            further: Vec::new(),
            name,
            hardware,
            image,
        })
    }

    /// The device that a description of its maker is about. `slots` names the modules of a modular
    /// device; those that the description puts there unless said.
    ///
    /// # Errors
    /// [`DescribedError`] when it is a thing without a controller, when parts of its description are
    /// missing, or when it asks for what no controller has.
    pub fn from_esi(
        esi: &Esi,
        device: &EsiDevice,
        slots: Option<&[String]>,
    ) -> Result<Self, DescribedError> {
        esi::described(esi, device, slots)
    }

    /// Whether it is a drive of CiA 402: it has a controlword and a statusword.
    #[must_use]
    pub fn is_drive(&self) -> bool {
        let has = |index: u16| {
            self.objects.iter().any(|object| object.index.0 == index)
                || self.pdos.iter().flat_map(|pdo| &pdo.entries).any(|entry| entry.index == index)
        };
        has(objects::CONTROLWORD) && has(objects::STATUSWORD)
    }

    /// All its controllers, in the order in which frames reach them.
    pub fn controllers(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.further)
    }

    /// How its controllers hang together.
    #[must_use]
    pub fn inner_links(&self) -> Vec<InnerLink> {
        let controllers: Vec<&Self> = self.controllers().collect();
        let links = controllers.windows(2).enumerate().map(|(place, pair)| {
            let is_on = |port: &Port| pair[0].ports()[*port] == PortKind::Ebus;
            let from = [Port::D, Port::B, Port::C].into_iter().find(is_on).unwrap_or(Port::C);
            InnerLink { from: (place, from), to: (place + 1, Port::A) }
        });
        links.collect()
    }

    /// Who it is, but for its serial number.
    #[must_use]
    pub fn identity(&self) -> Identity {
        self.image.identity
    }

    /// What its ports are.
    #[must_use]
    pub fn ports(&self) -> PortMap<PortKind> {
        self.hardware.ports
    }

    /// Current from the E-bus in mA; negative is supplied.
    #[must_use]
    pub fn ebus_current_ma(&self) -> i16 {
        self.image.ebus_current_ma().unwrap_or(0)
    }

    /// How many signals it drives and takes.
    #[must_use]
    pub fn channels(&self) -> (usize, usize) {
        let layout = signals::Layout::of(self);
        (layout.outputs, layout.inputs)
    }

    /// Makes one: its channels become new signals. The serial number is put into its EEPROM, and the
    /// revision, if one is given.
    #[must_use]
    pub fn build(&self, revision: Option<u32>, serial: u32, signals: &mut Signals) -> Built {
        let identity = Identity {
            revision: revision.unwrap_or(self.image.identity.revision),
            serial_number: serial,
            ..self.image.identity
        };
        let layout = signals::Layout::of(self);
        let mut add = |count: usize| (0..count).map(|_| signals.add()).collect::<Vec<_>>();
        let outputs = add(layout.outputs);
        let inputs = add(layout.inputs);
        let firmware = firmware::build(self, identity, &layout, &outputs, &inputs);
        Built {
            hardware: self.hardware.clone(),
            sii: self.sii(identity),
            firmware,
            outputs,
            inputs,
        }
    }

    /// The bytes of the EEPROM of an individual.
    fn sii(&self, identity: Identity) -> Vec<u8> {
        match &self.programmed {
            Some(bytes) => {
                let mut bytes = bytes.clone();
                for (at, value) in [
                    (linesman_proto::sii::word::REVISION, identity.revision),
                    (linesman_proto::sii::word::SERIAL_NUMBER, identity.serial_number),
                ] {
                    if let Some(slot) = bytes.get_mut(at.byte()..at.byte() + 4) {
                        slot.copy_from_slice(&value.to_le_bytes());
                    }
                }
                bytes
            }
            // It was built once when the type was made, so it can be built again.
            None => Image { identity, ..self.image.clone() }.build().unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests;
