//! Picking a device out of a file: by type or product code, and by revision.

use std::fmt;

use super::device::EsiDevice;
use super::error::EsiError;
use super::{Esi, value};

/// How many similar types a message names.
const NEAR: usize = 6;
/// How similar a type has to be for that, from 0 to 1.
const SIMILAR: f64 = 0.8;

/// Which device of a file is meant: `EL3004`, `EL3004@0x00160000`, `0x0BBC3052@22`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Selection {
    what: SearchTerm,
    revision: Option<u32>,
}

#[derive(Clone, PartialEq, Eq, Debug)]
enum SearchTerm {
    /// The only device of the file.
    Any,
    Type(String),
    Product(u32),
}

/// No device can be picked.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FindError {
    /// The revision is no number.
    #[error("revision \"{0}\", expected a number, decimal or 0x…")]
    Number(String),
    /// The file is about something else.
    #[error("an {root} file: it has {holds}, but no devices; name the file of the device")]
    NoDevices {
        /// Its outermost element.
        root: String,
        /// What it has.
        holds: String,
    },
    /// Nothing is said of which device is meant, and there are several.
    #[error("it has {count} devices: say which, as `FILE#TYPE`; it has {has}")]
    Which {
        /// How many there are.
        count: usize,
        /// Some of them.
        has: String,
    },
    /// There is no such device.
    #[error("it has no device \"{wanted}\"; {has}")]
    Unknown {
        /// What was asked for.
        wanted: String,
        /// What is like it.
        has: String,
    },
    /// It is there, with other revisions.
    #[error("it has no revision {wanted} of \"{device}\"; it has {has}")]
    Revision {
        /// Whose.
        device: String,
        /// What was asked for.
        wanted: String,
        /// What is there.
        has: String,
    },
    /// It is there, but cannot be understood.
    #[error("{0}")]
    Broken(EsiError),
}

impl Selection {
    /// From what is written behind the `#`. Nothing means the only device of the file.
    ///
    /// # Errors
    /// [`FindError::Number`].
    pub fn parse(text: &str) -> Result<Self, FindError> {
        let (what, revision) = match text.rsplit_once('@') {
            Some((what, revision)) => {
                let number = value::number(revision);
                (what, Some(number.map_err(|_| FindError::Number(revision.to_owned()))?))
            }
            None => (text, None),
        };
        let product = what.strip_prefix("0x").and_then(|hex| u32::from_str_radix(hex, 16).ok());
        let what = match product {
            Some(product) => SearchTerm::Product(product),
            None if what.is_empty() => SearchTerm::Any,
            None => SearchTerm::Type(what.to_owned()),
        };
        Ok(Self { what, revision })
    }

    fn fits(&self, device: &EsiDevice) -> bool {
        match &self.what {
            SearchTerm::Any => true,
            SearchTerm::Type(name) => device.type_name.eq_ignore_ascii_case(name),
            SearchTerm::Product(code) => device.product_code == *code,
        }
    }
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.what {
            SearchTerm::Any => f.write_str("any"),
            SearchTerm::Type(name) => f.write_str(name),
            SearchTerm::Product(code) => write!(f, "0x{code:08X}"),
        }
    }
}

impl Esi {
    /// The device that is meant; without a revision its newest.
    ///
    /// # Errors
    /// [`FindError`], which names what is like it.
    pub fn find(&self, selection: &Selection) -> Result<&EsiDevice, FindError> {
        if self.devices.is_empty() {
            let holds = match (self.modules.len(), self.objects.len()) {
                (0, 0) => "nothing".to_owned(),
                (0, objects) => format!("{objects} objects"),
                (modules, _) => format!("{modules} modules"),
            };
            return Err(FindError::NoDevices { root: self.root.clone(), holds });
        }
        let fitting: Vec<&EsiDevice> = self.usable().filter(|one| selection.fits(one)).collect();
        let Some(newest) = fitting.iter().max_by_key(|one| one.revision) else {
            return Err(self.unknown(selection));
        };
        if selection.what == SearchTerm::Any
            && fitting.iter().any(|one| one.type_name != newest.type_name)
        {
            let has = self.near("");
            return Err(FindError::Which { count: self.devices.len(), has });
        }
        let Some(wanted) = selection.revision else { return Ok(newest) };
        fitting.iter().find(|one| one.revision == wanted).copied().ok_or_else(|| {
            let revisions = fitting.iter().map(|one| format!("0x{:08X}", one.revision));
            let mut has = revisions.collect::<Vec<_>>().join(", ");
            if let Some(heir) = fitting.iter().find(|one| one.hides.contains(&wanted)) {
                has.push_str(&format!("; 0x{:08X} stands for it", heir.revision));
            }
            let (device, wanted) = (newest.type_name.clone(), format!("0x{wanted:08X}"));
            FindError::Revision { device, wanted, has }
        })
    }

    fn unknown(&self, selection: &Selection) -> FindError {
        let wanted = selection.to_string();
        let named = format!("Device {wanted}");
        let broken = self.devices.iter().filter_map(|device| device.as_ref().err());
        let this = |error: &&EsiError| error.element.split('/').next() == Some(named.as_str());
        if let Some(error) = broken.clone().find(this) {
            return FindError::Broken(error.clone());
        }
        let mut has = format!("it has {}", self.near(&wanted));
        let broken = broken.count();
        if broken > 0 {
            has.push_str(&format!(", and {broken} that cannot be understood"));
        }
        FindError::Unknown { wanted, has }
    }

    /// Types that are like this one; the first ones where none is.
    fn near(&self, wanted: &str) -> String {
        let wanted = wanted.to_ascii_uppercase();
        let mut names: Vec<(f64, String)> = Vec::new();
        for device in self.usable() {
            let name = match &device.type_name {
                name if name.is_empty() => format!("0x{:08X}", device.product_code),
                name => name.clone(),
            };
            if !names.iter().any(|(_, known)| *known == name) {
                names.push((strsim::jaro_winkler(&wanted, &name.to_ascii_uppercase()), name));
            }
        }
        let all = names.len();
        if names.iter().any(|(similar, _)| *similar >= SIMILAR) {
            names.retain(|(similar, _)| *similar >= SIMILAR);
            names.sort_by(|one, other| other.0.total_cmp(&one.0));
        }
        names.truncate(NEAR);
        let shown = names.len();
        let mut text = names.into_iter().map(|(_, name)| name).collect::<Vec<_>>().join(", ");
        if all > shown {
            text.push_str(&format!(" and {} more", all - shown));
        }
        text
    }
}
