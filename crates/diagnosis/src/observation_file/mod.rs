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
//! Values with earlier ones (`before`) are judged by their change, others as they stand. Unknown keys
//! are errors.

mod fill;
mod value;

use linesman_config::attachment::Attachment;
use linesman_config::identity::RevisionRule;
use linesman_config::project::{Project, ProjectDevice, ProjectError, Ring};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::state::DeviceState;
use serde::Deserialize;

pub use value::Word;

use crate::engine::{Engine, Setup};
use crate::report::Diagnosis;

/// A line as somebody read it.
#[derive(Clone, PartialEq, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservationFile {
    /// What it is about.
    #[serde(default)]
    pub name: String,
    /// The SubDevices, in the order of their numbers unless `no` says otherwise.
    #[serde(default, rename = "device")]
    pub devices: Vec<ObservedDevice>,
    /// Where a second card closes a ring, if it does.
    #[serde(default)]
    pub ring: Option<Ring>,
    /// What the MainDevice counted.
    #[serde(default)]
    pub maindevice: Option<ObservedMainDevice>,
}

/// A SubDevice as somebody read it.
#[derive(Clone, PartialEq, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservedDevice {
    /// Its number, from 1; the place in the file unless said.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub no: Option<u32>,
    /// Unique name; its number unless said.
    #[serde(default)]
    pub name: Option<String>,
    /// Order designation, such as `EL2004`; for people.
    #[serde(default, rename = "type")]
    pub type_name: String,
    /// Whose port it hangs on: `maindevice` or a device's name and port.
    pub on: Attachment,
    /// The port by which it is entered, `A` unless said.
    #[serde(default = "port_a")]
    #[schemars(regex(pattern = "^[A-D]$"))]
    pub entry: String,
    /// Station address.
    #[serde(default)]
    pub station: Option<u16>,
    /// Vendor as read.
    #[serde(default)]
    pub vendor_id: Option<u32>,
    /// Product code as read.
    #[serde(default)]
    pub product_code: Option<u32>,
    /// Revision as read.
    #[serde(default)]
    pub revision: Option<u32>,
    /// Serial number as read.
    #[serde(default)]
    pub serial: Option<u32>,
    /// Its state, as an online list writes it: `OP`, `ERR SAFEOP`, `INIT NO_COMM`, `OP LNK_MIS B`.
    #[serde(default)]
    pub state: Option<String>,
    /// AL status code, register 0x0134: a number, or text such as `"0x001D"`.
    #[serde(default)]
    pub al_code: Option<Word>,
    /// What was read of its ports.
    #[serde(default)]
    pub ports: Ports<ObservedPort>,
    /// Processing unit errors, register 0x030C.
    #[serde(default)]
    pub processing_unit: Option<u8>,
    /// Earlier values.
    #[serde(default)]
    pub before: Option<EarlierDevice>,
}

/// The four ports, as they are or as they were.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "UPPERCASE", bound = "T: Deserialize<'de>")]
#[schemars(rename = "{T}s")]
pub struct Ports<T> {
    /// Port A, number 0.
    #[serde(default)]
    pub a: Option<T>,
    /// Port B, number 1.
    #[serde(default)]
    pub b: Option<T>,
    /// Port C, number 2.
    #[serde(default)]
    pub c: Option<T>,
    /// Port D, number 3.
    #[serde(default)]
    pub d: Option<T>,
}

// Derived, it would ask for a default of what a port is.
impl<T> Default for Ports<T> {
    fn default() -> Self {
        Self { a: None, b: None, c: None, d: None }
    }
}

/// A port as somebody read it.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservedPort {
    /// Whether it has a link.
    #[serde(default)]
    pub link: Option<bool>,
    /// Whether its loop is open, so that frames pass; as the link unless said.
    #[serde(default)]
    pub open: Option<bool>,
    /// RX error register: bad frames in the low byte, bad symbols in the high one, such as `"0x0412"`.
    #[serde(default)]
    pub rx: Option<Word>,
    /// Bad frames, instead of `rx`.
    #[serde(default)]
    pub frame: Option<u8>,
    /// Bad symbols, instead of `rx`.
    #[serde(default)]
    pub physical: Option<u8>,
    /// Frames that were marked as bad before.
    #[serde(default)]
    pub forwarded: Option<u8>,
    /// Lost links.
    #[serde(default)]
    pub lost_link: Option<u8>,
    /// Earlier values of the same counters.
    #[serde(default)]
    pub before: Option<EarlierPort>,
}

/// Earlier values of a SubDevice.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EarlierDevice {
    /// Of its ports.
    #[serde(default)]
    pub ports: Ports<EarlierPort>,
    /// Processing unit errors.
    #[serde(default)]
    pub processing_unit: Option<u8>,
}

/// Earlier values of a port's counters.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EarlierPort {
    /// RX error register.
    #[serde(default)]
    pub rx: Option<Word>,
    /// Bad frames, instead of `rx`.
    #[serde(default)]
    pub frame: Option<u8>,
    /// Bad symbols, instead of `rx`.
    #[serde(default)]
    pub physical: Option<u8>,
    /// Frames that were marked as bad before.
    #[serde(default)]
    pub forwarded: Option<u8>,
    /// Lost links.
    #[serde(default)]
    pub lost_link: Option<u8>,
}

/// What the MainDevice counted. Left out: not known.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservedMainDevice {
    /// Whether the card has a link.
    #[serde(default)]
    pub link: Option<bool>,
    /// Frames that did not come back, or came back damaged.
    #[serde(default)]
    pub lost: Option<u64>,
    /// Damaged frames that the card dropped.
    #[serde(default)]
    pub crc: Option<u64>,
}

fn port_a() -> String {
    "A".to_owned()
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
    #[error("device `{device}`: {what}")]
    Value {
        /// Whose.
        device: String,
        /// What is wrong.
        what: String,
    },
}

impl ObservationFile {
    /// Reads an observation file and checks that it fits together.
    ///
    /// # Errors
    /// [`ObservationError`]: line and column for what is not TOML or not expected, else the device.
    pub fn parse(text: &str) -> Result<Self, ObservationError> {
        let mut file: Self =
            toml::from_str(text).map_err(|error| ObservationError::Form(error.to_string()))?;
        file.number()?;
        file.project().tree().map_err(ObservationError::Wiring)?;
        for device in &file.devices {
            device.check()?;
        }
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
        let line = self.line(setup.project.as_ref());
        let at = line.now;
        let mut engine = Engine::with_line(setup, line);
        engine.finish(at, true);
        engine
    }

    /// Gives each device its number and its place in the list.
    fn number(&mut self) -> Result<(), ObservationError> {
        let len = self.devices.len();
        if len == 0 {
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

impl ObservedDevice {
    /// Its name, else its number.
    #[must_use]
    pub fn label(&self) -> String {
        match (&self.name, self.no) {
            (Some(name), _) => name.clone(),
            (None, Some(no)) => no.to_string(),
            (None, None) => String::new(),
        }
    }

    /// Its state, as far as the file says.
    #[must_use]
    pub fn device_state(&self) -> Option<DeviceState> {
        self.state.as_deref().and_then(|text| text.parse().ok())
    }

    fn check(&self) -> Result<(), ObservationError> {
        let fail = |what: String| Err(ObservationError::Value { device: self.label(), what });
        if let Some(text) = &self.state
            && let Err(error) = text.parse::<DeviceState>()
        {
            return fail(format!("state: {error}"));
        }
        let now = self.ports.all();
        let then = self.before.as_ref().map(|before| before.ports.all()).unwrap_or_default();
        for port in Port::ALL {
            let inner = now[port].as_ref().and_then(|port| port.before.as_ref());
            if inner.is_some() && then[port].is_some() {
                return fail(format!(
                    "port {port}: earlier values stand twice, in `ports.{port}.before` and in \
                     `before.ports.{port}`: keep one"
                ));
            }
            let doubled = |rx: bool, one: bool, other: bool| rx && (one || other);
            let twice = now[port].as_ref().is_some_and(|port| {
                doubled(port.rx.is_some(), port.frame.is_some(), port.physical.is_some())
            }) || [inner, then[port].as_ref()].into_iter().flatten().any(|port| {
                doubled(port.rx.is_some(), port.frame.is_some(), port.physical.is_some())
            });
            if twice {
                return fail(format!(
                    "port {port}: `rx` holds both counters; give either it, or `frame` and `physical`"
                ));
            }
        }
        Ok(())
    }
}

impl Ports<ObservedPort> {
    /// By port.
    #[must_use]
    pub fn all(&self) -> PortMap<Option<ObservedPort>> {
        PortMap([self.a.clone(), self.b.clone(), self.c.clone(), self.d.clone()])
    }
}

impl Ports<EarlierPort> {
    /// By port.
    #[must_use]
    pub fn all(&self) -> PortMap<Option<EarlierPort>> {
        PortMap([self.a.clone(), self.b.clone(), self.c.clone(), self.d.clone()])
    }
}
