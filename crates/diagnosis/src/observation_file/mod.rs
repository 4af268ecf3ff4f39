//! Observation files: what was read of a line with another tool, typed in or exported.
//!
//! ```toml
//! [[device]]
//! name = "K1"
//! on = "maindevice"
//! state = "OP"
//! ports.B = { rx = "0x0012" }
//!
//! [[device]]
//! name = "E2"
//! on = "K1.B"
//! state = "OP"
//! ports.A = { rx = "0x0412", lost_link = 0, before = { rx = "0x0400" } }
//! ```
//!
//! Values with earlier ones (`before`, or an earlier `[[reading]]`) are judged by their change, others as
//! they stand. Unknown keys are errors.

mod device;
mod event;
mod fill;
mod main_device;
mod place;
mod reading;
mod value;
mod working_counter;

use linesman_config::identity::RevisionRule;
use linesman_config::project::{Project, ProjectDevice, ProjectError, Ring};
use serde::Deserialize;

pub use device::{ControllerName, EarlierDevice, EarlierPort, ObservedDevice, ObservedPort, Ports};
pub use event::{ExchangedPart, ObservedAbort, ObservedEmergency, ObservedExchange};
pub use main_device::ObservedMainDevice;
pub use reading::{ReadDevice, ReadPort, Reading};
pub use value::{Address, Count, Date, Word};
pub use working_counter::{LogicalCommand, ObservedWorkingCounter};

use crate::engine::{Engine, Setup};
use crate::main_device::MainDeviceKind;
use crate::model::reported::WiringBasis;
use crate::report::Diagnosis;
use place::Lines;

/// An observation file.
#[derive(Clone, PartialEq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservationFile {
    /// What it is about.
    #[serde(default)]
    pub name: String,
    /// Whether a tool adds the counters up, so that 255 is not their end. One that exceeds 255 is always taken
    /// for such.
    #[serde(default)]
    pub totals: bool,
    /// When the values were read that stand outside of readings, by the clock on the wall; after all readings
    /// unless said.
    #[serde(default)]
    pub at: Option<Date>,
    /// The same in seconds since any beginning.
    #[serde(default)]
    pub at_s: Option<f64>,
    /// The SubDevices, in the order of their numbers unless `no` says otherwise.
    #[serde(default, rename = "device")]
    pub devices: Vec<ObservedDevice>,
    /// Where a second card closes a ring, if it does.
    #[serde(default)]
    pub ring: Option<Ring>,
    /// Whether times were made up to keep the order: a file tells them.
    #[serde(skip)]
    pub times_are_assumed: bool,
    /// The MainDevice whose tools have printed the values; a file does not tell it.
    #[serde(skip)]
    pub kind: MainDeviceKind,
    /// How the wiring is known; a file tells it.
    #[serde(skip)]
    pub wiring: WiringBasis,
    /// What the MainDevice counted.
    #[serde(default)]
    pub maindevice: Option<ObservedMainDevice>,
    /// Working counters of process data.
    #[serde(default, rename = "working_counter")]
    pub working_counters: Vec<ObservedWorkingCounter>,
    /// Further readings, in order of time.
    #[serde(default, rename = "reading")]
    pub readings: Vec<Reading>,
    /// Emergencies of SubDevices.
    #[serde(default, rename = "emergency")]
    pub emergencies: Vec<ObservedEmergency>,
    /// Requests to object dictionaries that were refused.
    #[serde(default, rename = "abort")]
    pub aborts: Vec<ObservedAbort>,
    /// Parts that were exchanged to find a fault.
    #[serde(default, rename = "exchange")]
    pub exchanges: Vec<ObservedExchange>,
}

/// An observation file that cannot be used.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ObservationError {
    /// Not TOML, or not of this form.
    #[error("{0}")]
    Form(String),
    /// There is nothing to judge.
    #[error("the observation file has no [[device]]: add one for each SubDevice, with `on`")]
    Empty,
    /// Numbers do not run from 1 without gap.
    #[error(
        "the {len} devices must bear the numbers 1 to {len}, each once, but {wrong} is {what}: leave \
         `no` out to number them in order"
    )]
    Numbers {
        /// How many devices there are.
        len: usize,
        /// The number in question.
        wrong: u32,
        /// `missing` or `given twice`.
        what: &'static str,
    },
    /// Names, ports or places contradict each other.
    #[error("{0}")]
    Wiring(ProjectError),
    /// A value that does not fit.
    #[error("{place}: {what}")]
    Value {
        /// Of what, with its line.
        place: String,
        /// What is wrong.
        what: String,
    },
}

impl ObservationFile {
    /// Reads an observation file and checks that it fits together.
    ///
    /// # Errors
    /// [`ObservationError`]: line and column for what is not TOML or not expected, else line and part.
    pub fn parse(text: &str) -> Result<Self, ObservationError> {
        let mut file: Self =
            toml::from_str(text).map_err(|error| ObservationError::Form(error.to_string()))?;
        let lines = Lines::of(text);
        for (index, device) in file.devices.iter().enumerate() {
            let place = || lines.place("device", index, &device.label());
            device.check().map_err(|what| ObservationError::Value { place: place(), what })?;
        }
        let names: Vec<Option<String>> =
            file.devices.iter().map(|device| device.name.clone()).collect();
        file.number()?;
        if let Err(error) = file.project().tree() {
            return Err(lines.wiring(&names, error));
        }
        file.check(&lines)?;
        Ok(file)
    }

    /// The tree and the names as a project; identities were read, not planned, and are not in it.
    #[must_use]
    pub fn project(&self) -> Project {
        let devices = self.devices.iter().map(|device| ProjectDevice {
            type_name: device.type_name.clone(),
            revision_rule: Some(RevisionRule::Any),
            entry: device.entry.clone(),
            station: device.station,
            ..ProjectDevice::at(&device.label(), device.on.clone())
        });
        Project { ring: self.ring.clone(), ..Project::of(&self.name, devices.collect()) }
    }

    /// What is wrong with the line, as far as the values tell. A project in `setup` says what was
    /// planned; without one the tree of the file is the plan.
    #[must_use]
    pub fn diagnosis(&self, setup: Setup) -> Diagnosis {
        self.judged(setup).diagnosis()
    }

    /// The same with the line behind it: an engine that has come to its end.
    #[must_use]
    pub fn judged(&self, setup: Setup) -> Engine {
        let model = self.model(setup.project.as_ref());
        let at = model.now;
        let mut engine = Engine::with_line(setup, model);
        engine.finish(at, true);
        engine
    }

    /// The SubDevice that somebody calls by its name or number.
    #[must_use]
    pub fn find(&self, called: &str) -> Option<usize> {
        let called = called.trim();
        let by_name = self.devices.iter().position(|device| device.label() == called);
        by_name.or_else(|| {
            let no: u32 = called.parse().ok()?;
            self.devices.iter().position(|device| device.no == Some(no))
        })
    }

    /// Gives each device its number and its place in the list.
    pub(crate) fn number(&mut self) -> Result<(), ObservationError> {
        let len = self.devices.len();
        let tells_of_main =
            self.maindevice.is_some() || self.readings.iter().any(Reading::tells_of_main);
        if len == 0 && !tells_of_main {
            return Err(ObservationError::Empty);
        }
        for (index, device) in self.devices.iter_mut().enumerate() {
            device.no.get_or_insert(index as u32 + 1);
        }
        self.devices.sort_by_key(|device| device.no);
        for (expected, device) in (1..).zip(&self.devices) {
            match device.no {
                Some(no) if no > expected => {
                    return Err(ObservationError::Numbers {
                        len,
                        wrong: expected,
                        what: "missing",
                    });
                }
                Some(no) if no < expected => {
                    return Err(ObservationError::Numbers {
                        len,
                        wrong: no,
                        what: if no == 0 { "no number" } else { "given twice" },
                    });
                }
                Some(_) | None => {}
            }
        }
        Ok(())
    }
}
