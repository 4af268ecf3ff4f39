//! Types of devices as a segment file names them: in the library, or in a file of their own.
//!
//! A core reads no files. Whoever reads the segment file hands in what reads the others
//! ([`DescriptionFiles`]); what they say is kept with the segment file, so that everything that is
//! made of it is made of the same data.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{SegmentFile, SegmentFileError, Value};
use crate::device::DeviceKind;
use crate::device::described::{DescribedError, DescribedType};
use crate::device::library::{self, UnknownType};

/// A type that is an SII image: `sii:FILE`.
const SII: &str = "sii:";

/// Reads the files that a segment file names.
pub trait DescriptionFiles {
    /// The content of a file. `name` is as it stands in the segment file, relative to where that is.
    ///
    /// # Errors
    /// The reason, in words, and what to do.
    fn read(&self, name: &str) -> Result<Vec<u8>, String>;
}

/// There are no files here: only types of the library can be used.
#[derive(Clone, Copy, Default, Debug)]
pub struct NoFiles;

impl DescriptionFiles for NoFiles {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Err("no files can be read here; use a type of the library".to_owned())
    }
}

/// The types that a segment file takes from files, by what it calls them.
#[derive(Clone, PartialEq, Default, Debug)]
pub struct DescribedTypes(BTreeMap<String, Arc<DescribedType>>);

/// A type that cannot be had.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum TypeError {
    /// The library does not have it.
    #[error("{0}; a type from a file is written `sii:FILE`")]
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
        source: DescribedError,
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
        for device in &self.devices {
            types.read(&device.type_name, files).map_err(|source| SegmentFileError::Type {
                device: device.name.clone(),
                source: Box::new(source),
            })?;
        }
        // What is to sit in another's place.
        for fault in &self.faults {
            if let Some(Value::Text(type_name)) = fault.parameters.get("type") {
                types.read(type_name, files).map_err(|source| SegmentFileError::Type {
                    device: fault.device.clone().unwrap_or_default(),
                    source: Box::new(source),
                })?;
            }
        }
        self.types = types;
        Ok(())
    }

    /// What a type is.
    pub(crate) fn kind(&self, type_name: &str) -> Result<DeviceKind, TypeError> {
        if !is_in_file(type_name) {
            let unknown = || UnknownType { name: type_name.to_owned() };
            return Ok(DeviceKind::Library(library::find(type_name).ok_or_else(unknown)?));
        }
        let found = self.types.0.get(type_name).cloned();
        found.map(DeviceKind::Described).ok_or_else(|| TypeError::NotRead(type_name.to_owned()))
    }
}

fn is_in_file(type_name: &str) -> bool {
    type_name.starts_with(SII)
}

impl DescribedTypes {
    fn read(&mut self, type_name: &str, files: &dyn DescriptionFiles) -> Result<(), TypeError> {
        let Some(name) = type_name.strip_prefix(SII) else { return Ok(()) };
        if self.0.contains_key(type_name) {
            return Ok(());
        }
        let file_error = |reason| TypeError::File { name: name.to_owned(), reason };
        let bytes = files.read(name).map_err(file_error)?;
        let described = DescribedType::from_sii(&bytes)
            .map_err(|source| TypeError::Described { name: name.to_owned(), source })?;
        self.0.insert(type_name.to_owned(), Arc::new(described));
        Ok(())
    }
}
