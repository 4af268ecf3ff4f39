//! Attachment of a SubDevice, as people write it: `maindevice`, `maindevice.B`, `K1.C`.
//!
//! The notation is the same in segment files, projects and observation files (DESIGN 5).

use std::fmt;
use std::str::FromStr;

use linesman_proto::address::Path;
use linesman_proto::port::Port;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// One end of a link, with devices by name.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Attachment {
    /// A card of the MainDevice: `maindevice` is the main one, `maindevice.B` the second.
    MainDevice(Path),
    /// A port of a device: `K1.C`.
    Device {
        /// The device's name. It may contain dots; the last one parts it from the port.
        name: String,
        /// Its port.
        port: Port,
    },
}

/// The word for the MainDevice in files.
pub const MAIN_DEVICE: &str = "maindevice";

/// Not an end of a link.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "`{given}` is no place to hang a device on: expected `maindevice`, `maindevice.B`, or a \
     device's name and port such as `K1.C` (ports A, B, C, D)"
)]
pub struct NoAttachment {
    /// What was written.
    pub given: String,
}

impl FromStr for Attachment {
    type Err = NoAttachment;

    fn from_str(given: &str) -> Result<Self, NoAttachment> {
        let no_attachment = || NoAttachment { given: given.to_owned() };
        if given == MAIN_DEVICE {
            return Ok(Self::MainDevice(Path::A));
        }
        let (name, port) = given.rsplit_once('.').ok_or_else(no_attachment)?;
        let mut letters = port.chars();
        let port = match (letters.next().and_then(Port::from_letter), letters.next()) {
            (Some(port), None) => port,
            (Some(_) | None, _) => return Err(no_attachment()),
        };
        match (name, port) {
            ("", _) => Err(no_attachment()),
            (MAIN_DEVICE, Port::A) => Ok(Self::MainDevice(Path::A)),
            (MAIN_DEVICE, Port::B) => Ok(Self::MainDevice(Path::B)),
            (MAIN_DEVICE, Port::C | Port::D) => Err(no_attachment()),
            (name, port) => Ok(Self::Device { name: name.to_owned(), port }),
        }
    }
}

impl fmt::Display for Attachment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MainDevice(Path::A) => f.write_str(MAIN_DEVICE),
            Self::MainDevice(path @ Path::B) => write!(f, "{MAIN_DEVICE}.{path}"),
            Self::Device { name, port } => write!(f, "{name}.{port}"),
        }
    }
}

impl Serialize for Attachment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Attachment {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given = String::deserialize(deserializer)?;
        given.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for Attachment {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Attachment".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "pattern": r"^(maindevice(\.[AB])?|.+\.[A-Da-d])$",
            "description": "`maindevice`, `maindevice.B` (second card), or a device's name and \
                            port such as `K1.C`.",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_read_as_they_are_written() {
        let device = |name: &str, port| Attachment::Device { name: name.to_owned(), port };
        let table = [
            ("maindevice", Attachment::MainDevice(Path::A)),
            ("maindevice.B", Attachment::MainDevice(Path::B)),
            ("K1.C", device("K1", Port::C)),
            ("Term 2.1 (EL1008).B", device("Term 2.1 (EL1008)", Port::B)),
        ];
        for (text, end) in table {
            assert_eq!(text.parse(), Ok(end.clone()));
            assert_eq!(end.to_string(), text);
        }
        assert_eq!("K1.c".parse(), Ok(device("K1", Port::C)));
        for wrong in ["", "K1", ".C", "K1.E", "K1.", "K1.CC", "maindevice.C"] {
            let error = wrong.parse::<Attachment>().unwrap_err();
            assert!(error.to_string().contains("such as `K1.C`"), "{wrong}: {error}");
        }
    }
}
