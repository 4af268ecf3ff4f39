//! A folder of device descriptions (ESI): indexed by a look at the headers of its files, which is kept
//! from run to run; of a file only the devices are read that are asked for.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use linesman_config::attachment::Attachment;
use linesman_config::esi::Esi;
use linesman_config::esi::header::{EsiHeader, headers};
use linesman_config::profile::MappedPdo;
use linesman_config::project::{Described, ProjectDevice};
use linesman_proto::address;

use super::index::Index;

/// Longest description that is read, in bytes; the largest of vendors have 50 MB.
const MAX_LEN: u64 = 128 * 1024 * 1024;
/// How deep folders may lie in folders.
const DEPTH: usize = 4;

/// Device descriptions.
#[derive(Default, Debug)]
pub struct Library {
    files: Vec<PathBuf>,
    /// Headers with the file they are in.
    index: Vec<(EsiHeader, usize)>,
    /// What was read of files, and of which of their devices.
    read: BTreeMap<usize, (Vec<usize>, Esi)>,
    notes: Vec<String>,
}

impl Library {
    /// Indexes a folder with its folders, or a file.
    ///
    /// # Errors
    /// What cannot be read. A file that is no device description is passed over.
    pub fn add(&mut self, place: &Path) -> std::io::Result<()> {
        let mut files = Vec::new();
        collect(place, DEPTH, &mut files)?;
        files.sort();
        let mut index = Index::of(place);
        for path in &files {
            let about = std::fs::metadata(path)?;
            let at = self.files.len();
            match index.known(path, &about) {
                Some(known) => self.index.extend(known.iter().map(|header| (header.clone(), at))),
                None => {
                    let found = headers(&std::fs::read(path)?);
                    index.learn(path, &about, &found);
                    self.index.extend(found.into_iter().map(|header| (header, at)));
                }
            }
            self.files.push(path.clone());
        }
        index.save(&files);
        Ok(())
    }

    /// How many devices it knows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// Whether it knows none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.index.is_empty()
    }

    /// What was odd since the last time.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// The type of a product by its description: of its revision, else of the newest one.
    #[must_use]
    pub fn type_of(
        &self,
        vendor_id: u32,
        product_code: u32,
        revision: Option<u32>,
    ) -> Option<&str> {
        let headers = self.index.iter().map(|(header, _)| header);
        let fitting =
            headers.filter(|one| (one.vendor_id, one.product_code) == (vendor_id, product_code));
        let best = fitting.max_by_key(|one| (Some(one.revision) == revision, one.revision));
        best.map(|one| one.type_name.as_str())
    }

    /// The PDOs that a product assigns by default, by its description: of its revision, else of a near one. None where no
    /// description fits.
    ///
    /// # Errors
    /// Why the description cannot be used, in words.
    pub fn pdos_of(
        &mut self,
        vendor_id: u32,
        product_code: u32,
        revision: Option<u32>,
    ) -> Result<Vec<MappedPdo>, String> {
        let wanted = ProjectDevice {
            vendor_id: Some(vendor_id),
            product_code: Some(product_code),
            revision,
            ..ProjectDevice::at("", Attachment::MainDevice(address::Path::A))
        };
        Ok(self.find(&wanted)?.map_or_else(Vec::new, |described| described.profile.pdos))
    }

    /// What is known of a device of a project; nothing when no description fits.
    ///
    /// # Errors
    /// Why a description cannot be used, in words.
    pub fn find(&mut self, device: &ProjectDevice) -> Result<Option<Described>, String> {
        let Some((header, file)) = self.header(device) else {
            if self.index.is_empty() {
                return Ok(None);
            }
            let product = device.product_code.map(|code| format!(", product 0x{code:08X}"));
            return Err(format!(
                "none of {} device descriptions is of type `{}`{}. Do: put the description of its maker into \
                 the folder, or write [device.description]",
                self.index.len(),
                device.type_name,
                product.unwrap_or_default()
            ));
        };
        let header = header.clone();
        if let Some(wanted) = device.revision.filter(|wanted| *wanted != header.revision) {
            self.notes.push(format!(
                "{}: no description of revision 0x{wanted:08X}, that of 0x{:08X} is taken",
                device.name, header.revision
            ));
        }
        let esi = self.esi(file, header.at)?;
        let found = esi.usable().find(|one| {
            (one.product_code, one.revision) == (header.product_code, header.revision)
                && one.type_name == header.type_name
        });
        match found {
            Some(found) => {
                let described = Described::from_esi(esi, found, device)?;
                self.notes.extend(described.notes.iter().cloned());
                Ok(Some(described))
            }
            None => {
                let broken = esi.devices.iter().filter_map(|one| one.as_ref().err());
                let reason = broken.take(1).map(ToString::to_string).next();
                let reason = reason.unwrap_or_else(|| {
                    let name = &header.type_name;
                    format!(
                        "there is no usable element Device for `{name}`; was it changed just now?"
                    )
                });
                let path = self.files[file].display();
                Err(format!("{path}: its description cannot be used: {reason}"))
            }
        }
    }

    /// The header that fits best: the same product, or else the same type; of these the same revision,
    /// else the newest before it, else the newest.
    fn header(&self, device: &ProjectDevice) -> Option<(&EsiHeader, usize)> {
        let fits = |header: &EsiHeader| {
            let vendor = device.vendor_id.is_none_or(|vendor| vendor == header.vendor_id);
            let same = match device.product_code {
                Some(code) => code == header.product_code,
                None => header.type_name.eq_ignore_ascii_case(&device.type_name),
            };
            vendor && same
        };
        let rank = |header: &EsiHeader| match device.revision {
            Some(wanted) if header.revision == wanted => (2, header.revision),
            Some(wanted) if header.revision < wanted => (1, header.revision),
            Some(_) | None => (0, header.revision),
        };
        let fitting = self.index.iter().filter(|(header, _)| fits(header));
        let best = fitting.max_by_key(|(header, _)| rank(header));
        best.map(|(header, file)| (header, *file))
    }

    /// A file, with the device at this place and those that were asked for before.
    fn esi(&mut self, file: usize, device: usize) -> Result<&Esi, String> {
        let mut devices = self.read.get(&file).map_or(Vec::new(), |(devices, _)| devices.clone());
        if !devices.contains(&device) {
            devices.push(device);
            let path = &self.files[file];
            let wrong = |error: String| format!("{}: {error}", path.display());
            let bytes = std::fs::read(path).map_err(|error| wrong(error.to_string()))?;
            let esi = Esi::parse_only(&bytes, &devices);
            self.read.insert(file, (devices, esi.map_err(|error| wrong(error.to_string()))?));
        }
        self.read
            .get(&file)
            .map(|(_, esi)| esi)
            .ok_or_else(|| "the description went away".to_owned())
    }
}

/// XML files of a place.
fn collect(place: &Path, depth: usize, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let about = std::fs::metadata(place)?;
    if about.is_file() {
        if about.len() <= MAX_LEN {
            files.push(place.to_owned());
        }
        return Ok(());
    }
    for entry in std::fs::read_dir(place)? {
        let path = entry?.path();
        let is_xml = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("xml"));
        if path.is_dir() {
            if depth > 0 {
                collect(&path, depth - 1, files)?;
            }
        } else if is_xml {
            collect(&path, 0, files)?;
        }
    }
    Ok(())
}
