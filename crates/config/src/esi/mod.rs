//! Device descriptions of makers: EtherCAT SubDevice Information (ESI), XML files.
//!
//! Read first: ETG.2000. [`Esi::parse`] reads a file, [`find`] picks a device, [`image`] makes the SII
//! image that the maker programs into it. A file holds hundreds of devices, and one that cannot be
//! understood is no cause to refuse the others: each is a result of its own.

pub mod assignment;
pub mod clock;
pub mod device;
pub mod dictionary;
pub mod eeprom;
pub mod error;
pub mod find;
pub mod header;
pub mod image;
pub mod mailbox;
pub mod module;
pub mod pdo;
pub mod sync_manager;
pub mod write;

pub(crate) mod encoding;
pub(crate) mod setting;
pub(crate) mod value;
pub(crate) mod xml;

pub use assignment::Assigned;
pub use clock::{EsiModePdo, EsiModeSyncManager, EsiOpMode};
pub use device::EsiDevice;
pub use dictionary::{EsiObject, EsiObjectEntry};
pub use eeprom::EsiEeprom;
pub use error::EsiError;
pub use find::{FindError, Selection};
pub use mailbox::EsiMailbox;
pub use module::{EsiModule, EsiSlots};
pub use pdo::{EsiEntry, EsiOversampling, EsiPdo};
pub use sync_manager::{EsiFmmu, EsiSyncManager};

use self::xml::Element;

/// Number of the English language.
const ENGLISH: &str = "1033";
/// Elements that hold a file's devices and modules.
const CONTAINERS: [&str; 4] = ["Descriptions", "Groups", "Devices", "Modules"];

/// A file of device descriptions.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Esi {
    /// Its outermost element: `EtherCATInfo`; `EtherCATModule` has modules only.
    pub root: String,
    /// Number of the vendor.
    pub vendor_id: u32,
    /// Name of the vendor.
    pub vendor: String,
    /// Groups of devices: type and name.
    pub groups: Vec<(String, String)>,
    /// Its devices, or what is wrong with them.
    pub devices: Vec<Result<EsiDevice, EsiError>>,
    /// Its modules, or what is wrong with them.
    pub modules: Vec<Result<EsiModule, EsiError>>,
    /// Objects of a file that is a dictionary and nothing else.
    pub objects: Vec<EsiObject>,
}

impl Esi {
    /// Reads a file.
    ///
    /// # Errors
    /// [`EsiError`] for what is no XML, or no device description.
    pub fn parse(bytes: &[u8]) -> Result<Self, EsiError> {
        Self::read(bytes, None)
    }

    /// Reads a file, of its devices only those at these places ([`EsiHeader::at`](header::EsiHeader::at)):
    /// the files of large makers have thousands.
    ///
    /// # Errors
    /// [`EsiError`] for what is no XML, or no device description.
    pub fn parse_only(bytes: &[u8], devices: &[usize]) -> Result<Self, EsiError> {
        Self::read(bytes, Some(devices))
    }

    fn read(bytes: &[u8], only: Option<&[usize]>) -> Result<Self, EsiError> {
        let text = encoding::decode(bytes)?;
        let mut esi = Self::default();
        let containers = |path: &[String]| match path {
            [root] => matches!(root.as_str(), "EtherCATInfo" | "EtherCATModule"),
            [_, inner @ ..] => inner.iter().all(|name| CONTAINERS.contains(&name.as_str())),
            [] => false,
        };
        let others = |path: &[String], range: std::ops::Range<usize>| {
            let wanted = || only.is_none_or(|only| only.iter().any(|at| range.contains(at)));
            matches!(path, [.., devices, device] if devices == "Devices" && device == "Device")
                && !wanted()
        };
        let skip: Option<&xml::Skip<'_>> = only.is_some().then_some(&others);
        xml::walk_some(&text, &containers, skip, &mut |path, element| esi.take(path, &element))?;
        if esi.root.is_empty() {
            return Err(EsiError::new(1, "XML", "there is no element in it"));
        }
        Ok(esi)
    }

    fn take(&mut self, path: &[String], element: &Element) -> Result<(), EsiError> {
        let Some(root) = path.first() else {
            if element.name == "EtherCATDict" {
                self.root.clone_from(&element.name);
                let dictionary = element.child("Dictionary").or_else(|| {
                    element.children.iter().find_map(|child| child.child("Dictionary"))
                });
                self.objects = dictionary
                    .map_or_else(Vec::new, |one| dictionary::objects(one, &mut Vec::new()));
                return Ok(());
            }
            return Err(element.error(
                "no device description: expected the outermost element EtherCATInfo (ETG.2000)",
            ));
        };
        self.root.clone_from(root);
        match (path.last().map_or("", String::as_str), element.name.as_str()) {
            (_, "Vendor") if path.len() == 1 => {
                let id = element.child("Id").map(|id| id.number::<u32>());
                self.vendor_id = id.transpose()?.unwrap_or(0);
                self.vendor = element.in_language("Name", ENGLISH).to_owned();
            }
            ("Groups", "Group") => {
                let name = element.in_language("Name", ENGLISH).to_owned();
                self.groups.push((element.child_text("Type").to_owned(), name));
            }
            ("Devices", "Device") => self.devices.push(device::device(element)),
            ("Modules", "Module") => self.modules.push(module::module(element)),
            _ => {}
        }
        Ok(())
    }

    /// The name of a group; its type where it has none.
    #[must_use]
    pub fn group<'a>(&'a self, kind: &'a str) -> &'a str {
        let found = self.groups.iter().find(|(known, _)| known == kind);
        found.map_or(kind, |(_, name)| name)
    }

    /// All devices that can be used.
    pub fn usable(&self) -> impl Iterator<Item = &EsiDevice> {
        self.devices.iter().filter_map(|device| device.as_ref().ok())
    }

    /// The module with this ident.
    #[must_use]
    pub fn module(&self, ident: u32) -> Option<&EsiModule> {
        self.modules.iter().flatten().find(|module| module.ident == ident)
    }
}

#[cfg(test)]
mod tests;
