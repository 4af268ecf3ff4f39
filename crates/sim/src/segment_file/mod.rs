//! The TOML description of a segment: what a commissioning engineer writes.
//!
//! ```toml
//! name = "plant"
//! seed = 7
//!
//! [[device]]
//! name = "K1"
//! type = "EK1100"
//! on = "maindevice"
//! cable_m = 5.0
//!
//! [[fault]]
//! kind = "link-open"
//! at = "maindevice-K1.A"
//! from_ms = 2000
//! ```
//!
//! Unknown keys are errors. The order of devices is the order of their numbers; a device with
//! several controllers counts several times, and those behind its first are called `J1/2`, `J1/3`.

mod clock;
mod ethernet;
mod expand;
mod passive;
mod plant;
mod row;
mod schedule;
mod signal_wire;
mod sii;
mod types;
mod value;
mod write;

use std::collections::BTreeMap;

use linesman_config::attachment::Attachment;
use linesman_config::project::Project;
use serde::{Deserialize, Serialize};

pub use clock::SegmentClock;
pub use ethernet::{SegmentEthernet, SegmentHost};
pub use expand::parse_counter;
pub(crate) use expand::{DEFAULT_CABLE_M, Planned, expand, wiring};
pub use plant::{PlantOptions, plant};
pub use schedule::{BurstTimes, RandomTimes, Schedule, Times};
pub use signal_wire::SignalWire;
pub use sii::SiiPlace;
pub use types::{DescribedTypes, DescriptionFiles, NoFiles, TypeError};
pub use value::{OneOrMany, Value};

use crate::wire::Medium;

/// A segment, as described.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentFile {
    /// What the segment is called.
    #[serde(default)]
    pub name: String,
    /// The seed of all chance in it; 0 unless said.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Its error counters show old errors and noise at power-on, instead of 0.
    #[serde(default)]
    pub old_counters: bool,
    /// `false`: no controller has counters of forwarded errors, as those of the first generation;
    /// each follows its type unless said.
    #[serde(default)]
    pub counts_forwarded: Option<bool>,
    /// Mean number of symbols that are destroyed on each line of a link when it comes up during the
    /// run: contacts bounce. None unless said.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1000.0)))]
    pub noise_at_link_up: Option<f64>,
    /// Power supplies that feed several devices, to fail together.
    #[serde(default, rename = "supply")]
    pub supplies: Vec<Supply>,
    /// Its devices, in the order of their numbers.
    #[serde(default, rename = "device")]
    pub devices: Vec<SegmentDevice>,
    /// Electrical wires from outputs to inputs, such as from an EL2008 to an EL1008, or between the
    /// two sides of a bridge.
    #[serde(default, rename = "wire")]
    pub wires: Vec<SignalWire>,
    /// Where a second card closes a ring, if it does.
    #[serde(default)]
    pub ring: Option<SegmentRing>,
    /// What goes wrong, and when.
    #[serde(default, rename = "fault")]
    pub faults: Vec<FaultEntry>,
    /// The types that it takes from files. They are not written into it.
    #[serde(skip)]
    pub types: DescribedTypes,
}

/// A device of a segment.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentDevice {
    /// Unique name.
    pub name: String,
    /// So many of them in a row, 1 to 65,535, called `NAME[1]`, `NAME[2]` and so on; each hangs on the
    /// one before, by the first port of the kind by which it is entered itself. What the other keys
    /// say holds for each; a serial number is counted up. What comes behind hangs on the last.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 65535)))]
    pub repeat: Option<u32>,
    /// Type in the library, such as `EL2004`, `esi:FILE#TYPE@REVISION` from a description
    /// of its maker, or `sii:FILE`: the device whose EEPROM that file holds.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Whose port it hangs on: `maindevice`, `maindevice.B`, or `K1.C`.
    pub on: Attachment,
    /// The port by which it is entered, `A` unless said.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^[A-D]$")))]
    pub entry: Option<String>,
    /// Length of the cable to it in metres, 0 to 2,000; 5 unless said. A terminal on the E-bus has
    /// none.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 2000.0)))]
    pub cable_m: Option<f64>,
    /// Time from the signal to the link on its cable in ms, 0 to 10,000: auto-negotiation of the two PHYs;
    /// as its type and that of its neighbour have it unless said. A terminal on the E-bus has none.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 10000.0)))]
    pub link_up_ms: Option<f64>,
    /// The hot connect group it belongs to; faults can name all of it as `group:NAME`.
    #[serde(default)]
    pub group: Option<String>,
    /// Serial number in its SII; its number unless said.
    #[serde(default)]
    pub serial: Option<u32>,
    /// Station alias in its SII; none unless said.
    #[serde(default)]
    pub alias: Option<u16>,
    /// Its identification, 0 to 65535: what its coding switch says, or what it answers when AL control
    /// asks for it, whichever its type has; else its station alias.
    #[serde(default)]
    pub id: Option<u16>,
    /// How much too fast its clock runs, in ppm, -200 to 200; by chance within 25 unless said.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = -200.0, max = 200.0)))]
    pub clock_ppm: Option<f64>,
    /// What its cable is made of: `direct` (copper, E-bus contacts), `fibre`, or `converters`, a pair
    /// of media converters; `direct` unless said.
    #[serde(default)]
    pub medium: Option<Medium>,
    /// Whether its controllers make a symbol error anew when they pass a bad frame on, as those in
    /// programmable logic do; as its type has it unless said.
    #[serde(default)]
    pub remakes_symbol_errors: Option<bool>,
    /// How else its clock is off: warming up, jitter, what it shows when the run begins.
    #[serde(default)]
    pub clock: Option<SegmentClock>,
    /// Whether its controllers have counters of forwarded errors; as the segment, or else its type,
    /// has it unless said.
    #[serde(default)]
    pub counts_forwarded: Option<bool>,
    /// The modules in the slots of a modular device, by type, name or ident; `""` leaves a slot empty.
    /// Those of its description unless said.
    #[serde(default)]
    pub slots: Option<Vec<String>>,
    /// What is at its Ethernet side, for a device that speaks EoE: its IP address, or computers at its ports.
    #[serde(default)]
    pub ethernet: Option<SegmentEthernet>,
    /// Where its SII lies: `eeprom`; `shared`, in an EEPROM that its software reads, too, and that the
    /// MainDevice has to leave to it on the way to PREOP; `emulated`, in the memory of its processor.
    /// `eeprom` unless said; the others need a processor.
    #[serde(default)]
    pub sii: Option<SiiPlace>,
    /// Error counters that are not 0 at the start: `A.frame`, `A.physical`, `A.forwarded`,
    /// `A.lost_link` (and B, C, D), `processing_unit`, `pdi`.
    #[serde(default)]
    pub counters: BTreeMap<String, u8>,
}

/// The far end of a ring.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentRing {
    /// The port that is wired to the second card, such as `B9.B`.
    pub closes_at: Attachment,
    /// Length of the cable in metres, 0 to 2,000; 5 unless said.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 2000.0)))]
    pub cable_m: Option<f64>,
    /// What it is made of, as for a device.
    #[serde(default)]
    pub medium: Option<Medium>,
}

/// A power supply and the devices that it feeds.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Supply {
    /// Unique name.
    pub name: String,
    /// Names of devices; a coupler feeds its terminals.
    pub devices: Vec<String>,
}

/// A fault of a segment: kind, place, times, and the parameters of its kind.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FaultEntry {
    /// A fault name, such as `emc-noise`.
    #[cfg_attr(feature = "schema", schemars(schema_with = "kinds_schema"))]
    pub kind: String,
    /// A link `K1.C-B3.A`, one direction of it `K1.C>B3.A`, or a list of those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<OneOrMany>,
    /// A device.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// Several devices that share the fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub devices: Option<Vec<String>>,
    /// A `[[supply]]`: all devices that it feeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub supply: Option<String>,
    /// When it begins, in ms since the start of the run; at once unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_ms: Option<f64>,
    /// When it ends; it lasts unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_ms: Option<f64>,
    /// How often it comes and how long it stays each time; once unless said.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Parameters of the kind, such as `hits_per_s`.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, Value>,
}

#[cfg(feature = "schema")]
fn kinds_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let names: Vec<&str> = crate::fault::KINDS.iter().map(|kind| kind.name.name()).collect();
    schemars::json_schema!({ "type": "string", "enum": names })
}

impl FaultEntry {
    /// A fault of a kind; place, times and parameters are still to come.
    #[must_use]
    pub fn new(kind: linesman_config::fault::FaultName) -> Self {
        Self { kind: kind.name().to_owned(), ..Self::default() }
    }

    /// At a link or one direction of it.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.at = Some(OneOrMany::One(place.into()));
        self
    }

    /// In a device.
    #[must_use]
    pub fn device(mut self, name: impl Into<String>) -> Self {
        self.device = Some(name.into());
        self
    }

    /// From one time to another, in ms since the start of the run.
    #[must_use]
    pub fn from_to(mut self, from_ms: f64, to_ms: Option<f64>) -> Self {
        (self.from_ms, self.to_ms) = (Some(from_ms), to_ms);
        self
    }

    /// With a parameter.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.parameters.insert(key.to_owned(), value.into());
        self
    }
}

/// A segment file that cannot be used.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SegmentFileError {
    /// Not TOML, or not of this form: with line and column.
    #[error("{0}")]
    Form(String),
    /// There is nothing in it.
    #[error("there is no `[[device]]` in it: a segment has at least one SubDevice")]
    Empty,
    /// A type that cannot be had.
    #[error("device `{device}`: {source}")]
    Type {
        /// Whose.
        device: String,
        /// Why not.
        source: Box<TypeError>,
    },
    /// Names, ports or places contradict each other.
    #[error("{0}")]
    Wiring(String),
    /// A device is wired to or entered by a port that it does not have.
    #[error("device `{device}` has no port {port}: a {type_name} has {has}")]
    NoPort {
        /// Whose.
        device: String,
        /// Its type.
        type_name: String,
        /// The port that was written.
        port: linesman_proto::port::Port,
        /// The ports it has.
        has: String,
    },
    /// A device that cannot be put in a row.
    #[error(
        "device `{device}` cannot be repeated: a {type_name} has no second port that is {kind}, for \
         the next one to hang on"
    )]
    NoRepeat {
        /// Which.
        device: String,
        /// Its type.
        type_name: String,
        /// What the port would have to be.
        kind: &'static str,
    },
    /// Two ports of different kinds are wired to each other.
    #[error("{from} is {from_kind}, but {to} is {to_kind}: no cable fits both{instead}")]
    Kinds {
        /// One end.
        from: String,
        /// What it is.
        from_kind: &'static str,
        /// The other.
        to: String,
        /// What it is.
        to_kind: &'static str,
        /// Which port would fit, if one would.
        instead: String,
    },
    /// Something that does not go where it is put.
    #[error("device `{device}`: {why}")]
    Misplaced {
        /// Whose.
        device: String,
        /// What is wrong, and what to do.
        why: String,
    },
    /// A number out of its range.
    #[error("device `{device}`: `{key}` is {given}, expected {allowed}")]
    Range {
        /// Whose.
        device: String,
        /// Which key.
        key: &'static str,
        /// What was given.
        given: String,
        /// What can be.
        allowed: &'static str,
    },
    /// A supply that feeds nobody, or somebody unknown.
    #[error("supply `{supply}`: {what}")]
    Supply {
        /// Which.
        supply: String,
        /// What is wrong with it.
        what: String,
    },
    /// A counter that no controller has.
    #[error("device `{device}`: no counter is called `{given}`; expected {allowed}")]
    Counter {
        /// Whose.
        device: String,
        /// What was given.
        given: String,
        /// What can be.
        allowed: &'static str,
    },
}

impl SegmentDevice {
    /// A device of which no more is said than it must.
    #[must_use]
    pub fn new(name: impl Into<String>, type_name: impl Into<String>, on: Attachment) -> Self {
        Self {
            name: name.into(),
            type_name: type_name.into(),
            on,
            repeat: None,
            entry: None,
            cable_m: None,
            link_up_ms: None,
            group: None,
            serial: None,
            alias: None,
            id: None,
            clock_ppm: None,
            medium: None,
            remakes_symbol_errors: None,
            clock: None,
            counts_forwarded: None,
            slots: None,
            ethernet: None,
            sii: None,
            counters: BTreeMap::new(),
        }
    }
}

impl SegmentFile {
    /// Reads a segment file and checks that its devices are known and its wiring fits together.
    /// Faults are checked where they are put into a [`Segment`](crate::segment::Segment).
    ///
    /// # Errors
    /// [`SegmentFileError`]: line and column for what is not TOML or not expected, else the device.
    pub fn parse(text: &str) -> Result<Self, SegmentFileError> {
        Self::parse_with(text, &NoFiles)
    }

    /// The same with types from files, which are read by `files`.
    ///
    /// # Errors
    /// As [`SegmentFile::parse`], and the file that cannot be read or describes no device.
    pub fn parse_with(text: &str, files: &dyn DescriptionFiles) -> Result<Self, SegmentFileError> {
        let mut file: Self =
            toml::from_str(text).map_err(|error| SegmentFileError::Form(error.to_string()))?;
        if file.devices.is_empty() {
            return Err(SegmentFileError::Empty);
        }
        file.read_types(files)?;
        file.check()?;
        Ok(file)
    }

    /// Checks devices and wiring.
    ///
    /// # Errors
    /// As [`SegmentFile::parse`].
    pub fn check(&self) -> Result<(), SegmentFileError> {
        expand::check(self, &expand(self)?)
    }

    /// What was planned: the project behind this segment, without anything that is wrong with it.
    ///
    /// # Errors
    /// As [`SegmentFile::parse`].
    pub fn project(&self) -> Result<Project, SegmentFileError> {
        expand::project(self, &expand(self)?)
    }

    /// The file that reads back as this segment.
    #[must_use]
    pub fn to_toml(&self) -> String {
        write::to_toml(self)
    }
}
#[cfg(test)]
mod tests;
