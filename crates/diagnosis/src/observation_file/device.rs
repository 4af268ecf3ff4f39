//! Readings of a SubDevice and its ports.

use linesman_config::attachment::Attachment;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::RxErrors;
use linesman_proto::state::DeviceState;
use serde::Deserialize;

use super::value::{Count, Word};
use crate::model::Counting;

/// A SubDevice as somebody read it.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedDevice {
    /// Its number, from 1; the place in the file unless said.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
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
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^[A-D]$")))]
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
    /// What its controller is: whether it counts frames again that were bad already.
    #[serde(default)]
    pub controller: Option<ControllerName>,
    /// Propagation delay from the reference clock, register 0x0928, in ns.
    #[serde(default)]
    pub delay_ns: Option<u32>,
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
    pub processing_unit: Option<Count>,
    /// Damaged frames of all ports together, where the tool says no more.
    #[serde(default)]
    pub crc: Option<Count>,
    /// How often it left its state without being asked, as a tool counts it.
    #[serde(default)]
    pub state_changes: Option<Count>,
    /// How often it was gone, as a tool counts it.
    #[serde(default)]
    pub absences: Option<Count>,
    /// Whether a tool says that its configuration failed (IgH: flag `E`; TwinCAT: `INIT_ERR`).
    #[serde(default)]
    pub configuration_failed: Option<bool>,
    /// Whether a tool says that its clock did not get in step (IgH: `did not sync`).
    #[serde(default)]
    pub clock_failed: Option<bool>,
    /// Earlier values.
    #[serde(default)]
    pub before: Option<EarlierDevice>,
}

/// A type of controller, by how it counts errors.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ControllerName {
    /// An ASIC of any type: counts frames apart that were bad already.
    #[serde(rename = "asic", alias = "ASIC")]
    Asic,
    /// ET1100.
    #[serde(rename = "ET1100", alias = "et1100")]
    Et1100,
    /// ET1150.
    #[serde(rename = "ET1150", alias = "et1150")]
    Et1150,
    /// ET1200.
    #[serde(rename = "ET1200", alias = "et1200")]
    Et1200,
    /// Programmable logic: counts frames again that were bad already, and makes symbol errors of them.
    #[serde(rename = "fpga", alias = "FPGA")]
    Fpga,
    /// IP core for programmable logic.
    #[serde(rename = "ip-core", alias = "IP core", alias = "ip core", alias = "IP-core")]
    IpCore,
    /// The first generation, without counters of forwarded errors.
    #[serde(rename = "ESC20", alias = "esc20")]
    Esc20,
}

impl ControllerName {
    /// How it counts. Reference: ESC data sheets, error counters; vendor note on terminals with programmable
    /// logic.
    #[must_use]
    pub const fn counting(self) -> Counting {
        let (forwarded_apart, remakes_symbol_errors) = match self {
            Self::Asic | Self::Et1100 | Self::Et1150 | Self::Et1200 => (true, false),
            Self::Fpga | Self::IpCore => (false, true),
            Self::Esc20 => (false, false),
        };
        Counting { forwarded_apart, remakes_symbol_errors }
    }
}

/// The four ports, as they are or as they were.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, rename_all = "UPPERCASE", bound = "T: Deserialize<'de>")]
#[cfg_attr(feature = "schema", schemars(rename = "{T}s"))]
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

impl<T> Ports<T> {
    /// One port, to be filled in.
    pub const fn port_mut(&mut self, port: Port) -> &mut Option<T> {
        match port {
            Port::A => &mut self.a,
            Port::B => &mut self.b,
            Port::C => &mut self.c,
            Port::D => &mut self.d,
        }
    }
}

impl<T: Clone> Ports<T> {
    /// By port.
    #[must_use]
    pub fn all(&self) -> PortMap<Option<T>> {
        PortMap([self.a.clone(), self.b.clone(), self.c.clone(), self.d.clone()])
    }
}

/// A port as somebody read it.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservedPort {
    /// Whether it has a link.
    #[serde(default)]
    pub link: Option<bool>,
    /// Whether its loop is open, so that frames pass; as the link unless said.
    #[serde(default)]
    pub open: Option<bool>,
    /// Whether it has communication, which a link alone does not prove; as the link unless said.
    #[serde(default)]
    pub communication: Option<bool>,
    /// RX error register: bad frames in the low byte, bad symbols in the high one, such as `"0x0412"`.
    #[serde(default)]
    pub rx: Option<Word>,
    /// Bad frames, instead of `rx`.
    #[serde(default)]
    pub frame: Option<Count>,
    /// Bad symbols, instead of `rx`.
    #[serde(default)]
    pub physical: Option<Count>,
    /// Frames that were marked as bad before.
    #[serde(default)]
    pub forwarded: Option<Count>,
    /// Lost links.
    #[serde(default)]
    pub lost_link: Option<Count>,
    /// Whether a tool adds these up, so that 255 is not their end.
    #[serde(default)]
    pub total: bool,
    /// Earlier values of the same counters.
    #[serde(default)]
    pub before: Option<EarlierPort>,
}

/// Earlier values of a SubDevice.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EarlierDevice {
    /// Of its ports.
    #[serde(default)]
    pub ports: Ports<EarlierPort>,
    /// Processing unit errors.
    #[serde(default)]
    pub processing_unit: Option<Count>,
    /// Damaged frames of all ports together.
    #[serde(default)]
    pub crc: Option<Count>,
}

/// Earlier values of a port's counters.
#[derive(Clone, PartialEq, Eq, Default, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EarlierPort {
    /// RX error register.
    #[serde(default)]
    pub rx: Option<Word>,
    /// Bad frames, instead of `rx`.
    #[serde(default)]
    pub frame: Option<Count>,
    /// Bad symbols, instead of `rx`.
    #[serde(default)]
    pub physical: Option<Count>,
    /// Frames that were marked as bad before.
    #[serde(default)]
    pub forwarded: Option<Count>,
    /// Lost links.
    #[serde(default)]
    pub lost_link: Option<Count>,
}

impl EarlierPort {
    /// Bad frames, bad symbols, forwarded, lost links.
    pub(super) fn counts(&self) -> [Option<u64>; 4] {
        let rx = self.rx.map(|Word(word)| RxErrors::from_word(word));
        let count = |count: Option<Count>| count.map(|Count(count)| count);
        [
            rx.map(|rx| rx.frames.into()).or(count(self.frame)),
            rx.map(|rx| rx.physical.into()).or(count(self.physical)),
            count(self.forwarded),
            count(self.lost_link),
        ]
    }
}

impl ObservedPort {
    /// Its counters alone.
    pub(super) const fn counters(&self) -> EarlierPort {
        EarlierPort {
            rx: self.rx,
            frame: self.frame,
            physical: self.physical,
            forwarded: self.forwarded,
            lost_link: self.lost_link,
        }
    }

    /// Whether it says anything of its link.
    pub(super) const fn tells_link(&self) -> bool {
        self.link.is_some() || self.open.is_some() || self.communication.is_some()
    }
}

fn port_a() -> String {
    "A".to_owned()
}

impl ObservedDevice {
    /// A SubDevice of which no more is known than its place.
    #[must_use]
    pub fn at(on: Attachment) -> Self {
        Self {
            no: None,
            name: None,
            type_name: String::new(),
            on,
            entry: port_a(),
            station: None,
            vendor_id: None,
            product_code: None,
            revision: None,
            serial: None,
            controller: None,
            delay_ns: None,
            state: None,
            al_code: None,
            ports: Ports::default(),
            processing_unit: None,
            crc: None,
            state_changes: None,
            absences: None,
            configuration_failed: None,
            clock_failed: None,
            before: None,
        }
    }

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

    /// What is wrong with its values.
    pub(super) fn check(&self) -> Result<(), String> {
        check_state(self.state.as_deref())?;
        let now = self.ports.all();
        let then = self.before.as_ref().map(|before| before.ports.all()).unwrap_or_default();
        for port in Port::ALL {
            let inner = now[port].as_ref().and_then(|port| port.before.as_ref());
            if inner.is_some() && then[port].is_some() {
                return Err(format!(
                    "port {port}: earlier values stand twice, in `ports.{port}.before` and in \
                     `before.ports.{port}`: keep one"
                ));
            }
            let present = now[port].as_ref().map(ObservedPort::counters);
            for counters in [present.as_ref(), inner, then[port].as_ref()].into_iter().flatten() {
                check_counters(port, counters)?;
            }
        }
        Ok(())
    }
}

pub(super) fn check_state(state: Option<&str>) -> Result<(), String> {
    match state.map(str::parse::<DeviceState>) {
        Some(Err(error)) => Err(format!("state: {error}")),
        Some(Ok(_)) | None => Ok(()),
    }
}

pub(super) fn check_counters(port: Port, counters: &EarlierPort) -> Result<(), String> {
    let is_twice =
        counters.rx.is_some() && (counters.frame.is_some() || counters.physical.is_some());
    match is_twice {
        true => Err(format!(
            "port {port}: `rx` holds both counters; give either it, or `frame` and `physical`"
        )),
        false => Ok(()),
    }
}
