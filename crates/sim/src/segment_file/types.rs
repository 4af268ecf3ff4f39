//! Types of devices as a segment file names them: in the library, or in a file of their own.
//!
//! A core reads no files. Whoever reads the segment file hands in what reads the others
//! ([`DescriptionFiles`]); what they say is kept with the segment file, so that everything that is
//! made of it is made of the same data.

use std::collections::BTreeMap;
use std::sync::Arc;

use linesman_config::esi::{Esi, EsiDevice, Selection};

use super::{SegmentFile, SegmentFileError, Value};
use crate::device::DeviceKind;
use crate::device::described::{DescribedError, DescribedType};
use crate::device::library::{self, UnknownType};

/// A type that is an SII image: `sii:FILE`.
const SII: &str = "sii:";
/// A type that a device description is about: `esi:FILE#TYPE@REVISION`.
const ESI: &str = "esi:";

/// Reads the files that a segment file names.
pub trait DescriptionFiles {
    /// The content of a file. `name` is as it stands in the segment file, relative to where that is.
    ///
    /// # Errors
    /// The reason, in words, and what to do.
    fn read(&self, name: &str) -> Result<Vec<u8>, String>;

    /// The device descriptions of a file. Who has read it before need not read it again.
    ///
    /// # Errors
    /// What [`DescriptionFiles::read`] says, or what is wrong in the file.
    fn descriptions(&self, name: &str) -> Result<Arc<Esi>, TypeError> {
        let failed = |reason| TypeError::File { name: name.to_owned(), reason };
        let bytes = self.read(name).map_err(failed)?;
        Esi::parse(&bytes).map(Arc::new).map_err(|source| described(name, source))
    }
}

/// There are no files here: only types of the library can be used.
#[derive(Clone, Copy, Default, Debug)]
pub struct NoFiles;

impl DescriptionFiles for NoFiles {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Err("no files can be read here; use a type of the library".to_owned())
    }
}

/// The types that a segment file takes from files, by what it calls them and by what is in their
/// slots.
#[derive(Clone, PartialEq, Default, Debug)]
pub struct DescribedTypes(BTreeMap<(String, Option<Vec<String>>), Arc<DescribedType>>);

/// A type that cannot be had.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum TypeError {
    /// The library does not have it.
    #[error("{0}; a type from a file is written `esi:FILE#TYPE` or `sii:FILE`")]
    Unknown(#[from] UnknownType),
    /// Its file cannot be read.
    #[error("`{name}`: {reason}")]
    File {
        /// The file.
        name: String,
        /// Why not.
        reason: String,
    },
    /// Its file describes no device that can be made.
    #[error("`{name}`: {source}")]
    Described {
        /// The file.
        name: String,
        /// Why not.
        source: Box<DescribedError>,
    },
    /// The device is described, but cannot be made.
    #[error("`{name}`, line {line}, {device}: {source}")]
    Device {
        /// The file.
        name: String,
        /// Where the device begins, from 1.
        line: u32,
        /// Which device.
        device: String,
        /// Why not.
        source: Box<DescribedError>,
    },
    /// It is in a file that nobody has read.
    #[error("the file of the type `{0}` has not been read")]
    NotRead(String),
}

impl SegmentFile {
    /// Reads the files of all types that are not in the library.
    pub(super) fn read_types(
        &mut self,
        files: &dyn DescriptionFiles,
    ) -> Result<(), SegmentFileError> {
        let mut types = DescribedTypes::default();
        let mut reader = TypeReader { files, parsed: BTreeMap::new() };
        for device in &self.devices {
            types.read(&device.type_name, device.slots.as_deref(), &mut reader).map_err(
                |source| SegmentFileError::Type {
                    device: device.name.clone(),
                    source: Box::new(source),
                },
            )?;
        }
        // What is to sit in another's place.
        for fault in &self.faults {
            if let Some(Value::Text(type_name)) = fault.parameters.get("type") {
                types.read(type_name, None, &mut reader).map_err(|source| {
                    SegmentFileError::Type {
                        device: fault.device.clone().unwrap_or_default(),
                        source: Box::new(source),
                    }
                })?;
            }
        }
        self.types = types;
        Ok(())
    }

    /// What a type is.
    pub(crate) fn kind(
        &self,
        type_name: &str,
        slots: Option<&[String]>,
    ) -> Result<DeviceKind, TypeError> {
        if !is_in_file(type_name) {
            let unknown = || UnknownType { name: type_name.to_owned() };
            return Ok(DeviceKind::Library(library::find(type_name).ok_or_else(unknown)?));
        }
        let found =
            self.types.0.get(&(type_name.to_owned(), slots.map(<[String]>::to_vec))).cloned();
        found.map(DeviceKind::Described).ok_or_else(|| TypeError::NotRead(type_name.to_owned()))
    }
}

fn is_in_file(type_name: &str) -> bool {
    type_name.starts_with(SII) || type_name.starts_with(ESI)
}

/// Files, and the descriptions in those that have been read: one file has hundreds of them.
struct TypeReader<'a> {
    files: &'a dyn DescriptionFiles,
    parsed: BTreeMap<String, Arc<Esi>>,
}

impl TypeReader<'_> {
    fn bytes(&self, name: &str) -> Result<Vec<u8>, TypeError> {
        let failed = |reason| TypeError::File { name: name.to_owned(), reason };
        self.files.read(name).map_err(failed)
    }

    fn esi(&mut self, name: &str) -> Result<Arc<Esi>, TypeError> {
        if let Some(known) = self.parsed.get(name) {
            return Ok(Arc::clone(known));
        }
        let esi = self.files.descriptions(name)?;
        self.parsed.insert(name.to_owned(), Arc::clone(&esi));
        Ok(esi)
    }
}

fn described(name: &str, source: impl Into<DescribedError>) -> TypeError {
    TypeError::Described { name: name.to_owned(), source: Box::new(source.into()) }
}

impl DescribedTypes {
    fn read(
        &mut self,
        type_name: &str,
        slots: Option<&[String]>,
        reader: &mut TypeReader<'_>,
    ) -> Result<(), TypeError> {
        let key = (type_name.to_owned(), slots.map(<[String]>::to_vec));
        if self.0.contains_key(&key) {
            return Ok(());
        }
        let found = if let Some(name) = type_name.strip_prefix(SII) {
            let bytes = reader.bytes(name)?;
            DescribedType::from_sii(&bytes).map_err(|source| described(name, source))?
        } else if let Some(rest) = type_name.strip_prefix(ESI) {
            let (name, selection) = rest.split_once('#').unwrap_or((rest, ""));
            let selection = Selection::parse(selection).map_err(|why| described(name, why))?;
            let esi = reader.esi(name)?;
            let device = esi.find(&selection).map_err(|why| described(name, why))?;
            let within = |why: DescribedError| TypeError::Device {
                name: name.to_owned(),
                line: device.line,
                device: device.type_name.clone(),
                source: Box::new(why),
            };
            let whole = with_dictionary(name, device, reader.files)?;
            DescribedType::from_esi(&esi, &whole, slots).map_err(within)?
        } else {
            return Ok(());
        };
        self.0.insert(key, Arc::new(found));
        Ok(())
    }
}

/// The device with its dictionary, if that is in a file of its own, beside the description.
fn with_dictionary(
    name: &str,
    device: &EsiDevice,
    files: &dyn DescriptionFiles,
) -> Result<EsiDevice, TypeError> {
    let mut device = device.clone();
    if let Some(file) = device.dictionary_file.clone().filter(|_| device.objects.is_empty()) {
        let folder =
            name.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
        let name = format!("{folder}{file}");
        let bytes = files.read(&name).map_err(|reason| TypeError::File {
            reason: format!("the dictionary of \"{}\" is there: {reason}", device.type_name),
            name: name.clone(),
        })?;
        device.objects = Esi::parse(&bytes).map_err(|source| described(&name, source))?.objects;
        device.dictionary_file = None;
    }
    Ok(device)
}
