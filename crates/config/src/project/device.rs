//! A SubDevice of a project: `[[device]]`.

use std::fmt::Write as _;

use linesman_proto::address::StationAddress;
use linesman_proto::ads::AmsNetId;
use linesman_proto::mailbox::soe::Idn;
use linesman_proto::port::Port;
use linesman_proto::sii::Identity;
use linesman_proto::state::AlState;
use serde::{Deserialize, Serialize};

use super::{
    ClockChoice, Description, IdentificationChoice, Mapping, ProjectError, StartUpEntry,
    SyncLeader, TimeStampForm, WatchdogChoice, inline, quoted,
};
use crate::attachment::Attachment;
use crate::compare::Wanted;
use crate::esi::value;
use crate::identity::RevisionRule;
use crate::plan::{AddressingChoice, OnWrongCounter, ProcessAccess};
use crate::profile::SyncTimes;
use crate::start_up::Transition;

/// A SubDevice of a project.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProjectDevice {
    /// Unique name.
    pub name: String,
    /// Order designation, such as `EL2004`; for people.
    #[serde(default, rename = "type")]
    pub type_name: String,
    /// Vendor; with `product_code`, what is compared.
    #[serde(default)]
    pub vendor_id: Option<u32>,
    /// Product code.
    #[serde(default)]
    pub product_code: Option<u32>,
    /// Revision number.
    #[serde(default)]
    pub revision: Option<u32>,
    /// How the revision is compared; as its maker says (ESI `CheckRevisionNo`), else `equal`, unless said.
    #[serde(default)]
    pub revision_rule: Option<RevisionRule>,
    /// Serial number; not compared when absent.
    #[serde(default)]
    pub serial: Option<u32>,
    /// Station alias, as its EEPROM holds it: tells twins apart. Not compared when absent.
    #[serde(default)]
    pub alias: Option<u16>,
    /// The number by which it is told apart from its equals; not compared when absent.
    #[serde(default)]
    pub identification: Option<IdentificationChoice>,
    /// Whose port it hangs on: `maindevice` or a device's name and port.
    pub on: Attachment,
    /// The port by which it is entered, `A` unless said.
    #[serde(default = "port_a")]
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^[A-D]$")))]
    pub entry: String,
    /// Station address; 0x1001 and up by position in the order of frames unless said.
    #[serde(default)]
    pub station: Option<u16>,
    /// How far it is driven: `OP` unless said, `SAFEOP`, `PREOP`, `INIT` or `BOOT`.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^(INIT|PREOP|SAFEOP|OP|BOOT)$")))]
    pub state: Option<String>,
    /// The task that exchanges its process data; the first unless said.
    #[serde(default)]
    pub task: Option<String>,
    /// The sync unit within that task.
    #[serde(default)]
    pub sync_unit: Option<String>,
    /// Commands for its process data; those of the network unless said.
    #[serde(default)]
    pub access: Option<ProcessAccess>,
    /// Its frame may be sent twice in a cycle; as its maker says (ESI `FrameRepeatSupport`) unless said.
    #[serde(default)]
    pub frame_repeat: Option<bool>,
    /// How it may be addressed: by its position until it has its station address (`auto`), never by its
    /// position but by its `alias`, wherever it is plugged in (`alias`), or by its position only, without
    /// a station address (`position`).
    #[serde(default)]
    pub addressing: AddressingChoice,
    /// What becomes of its inputs when a working counter is wrong; as in the network unless said.
    #[serde(default)]
    pub on_wrong_counter: Option<OnWrongCounter>,
    /// It is brought back when it left its state; as in the network unless said.
    #[serde(default)]
    pub restore_state: Option<bool>,
    /// It is set up anew when it was lost and answers again; as in the network unless said.
    #[serde(default)]
    pub reinitialise: Option<bool>,
    /// Its error counters are cleared before they stop at 255; as in the network unless said.
    #[serde(default)]
    pub clear_counters: Option<bool>,
    /// Its Ethernet frames are passed on by the virtual switch of a run, where it speaks EoE; as in the network unless
    /// said.
    #[serde(default)]
    pub eoe: Option<bool>,
    /// Its watchdogs.
    #[serde(default)]
    pub watchdog: WatchdogChoice,
    /// Its distributed clock; it runs free unless said.
    #[serde(default)]
    pub clock: Option<ClockChoice>,
    /// What it needs for its work in a cycle (objects 0x1C32 and 0x1C33), for `plan --timing`; what is not said
    /// is that of its description.
    #[serde(default)]
    pub sync_times: SyncTimes,
    /// The form of the time stamps that it exchanges, where it is a bridge or a terminal for IEEE 1588; it selects the
    /// PDO. As its description has it unless said, and 64 bits where the network takes its time from it.
    #[serde(default)]
    pub time_stamps: Option<TimeStampForm>,
    /// Of a bridge: the side whose network leads. Written to 0x10F5:01.
    #[serde(default)]
    pub sync_leader: Option<SyncLeader>,
    /// PDOs to be assigned, by index, instead of those of its description.
    #[serde(default)]
    pub pdos: Option<Vec<u16>>,
    /// Other entries for PDOs.
    #[serde(default, rename = "mapping")]
    pub mappings: Vec<Mapping>,
    /// Commands at start-up, behind those of its description.
    #[serde(default)]
    pub start_up: Vec<StartUpEntry>,
    /// Modules in its slots, from the first on: type, name or ident; empty for an empty slot.
    #[serde(default)]
    pub modules: Vec<String>,
    /// What it is, where no description of its maker is at hand.
    #[serde(default)]
    pub description: Option<Description>,
}

fn port_a() -> String {
    "A".to_owned()
}

impl ProjectDevice {
    /// A device with this name at this place and nothing special.
    #[must_use]
    pub fn at(name: &str, on: Attachment) -> Self {
        Self {
            name: name.to_owned(),
            type_name: String::new(),
            vendor_id: None,
            product_code: None,
            revision: None,
            revision_rule: None,
            serial: None,
            alias: None,
            identification: None,
            on,
            entry: port_a(),
            station: None,
            state: None,
            task: None,
            sync_unit: None,
            access: None,
            frame_repeat: None,
            addressing: AddressingChoice::Auto,
            on_wrong_counter: None,
            restore_state: None,
            reinitialise: None,
            clear_counters: None,
            eoe: None,
            watchdog: WatchdogChoice::default(),
            clock: None,
            sync_times: SyncTimes::default(),
            time_stamps: None,
            sync_leader: None,
            pdos: None,
            mappings: Vec::new(),
            start_up: Vec::new(),
            modules: Vec::new(),
            description: None,
        }
    }

    /// Who it must be; `None` when the project does not say.
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        Some(Identity {
            vendor_id: self.vendor_id?,
            product_code: self.product_code?,
            revision: self.revision.unwrap_or(0),
            serial_number: self.serial.unwrap_or(0),
        })
    }

    /// How its revision is compared: not at all when none was given.
    #[must_use]
    pub fn rule(&self) -> RevisionRule {
        match self.revision {
            Some(_) => self.revision_rule.unwrap_or_default(),
            None => RevisionRule::Any,
        }
    }

    /// What is compared with what is found.
    #[must_use]
    pub fn wanted(&self) -> Wanted {
        Wanted { identity: self.identity(), rule: self.rule(), alias: self.alias }
    }

    /// The station address it is to have: its own, or the one that its position in the order of frames gives it, from
    /// 0x1001 on.
    #[must_use]
    pub fn station_at(&self, position: usize) -> StationAddress {
        StationAddress(self.station.unwrap_or(0x1001_u16.wrapping_add(position as u16)))
    }

    pub(super) fn entry_port(&self) -> Result<Port, ProjectError> {
        let mut letters = self.entry.chars();
        match (letters.next().and_then(Port::from_letter), letters.next()) {
            (Some(port), None) => Ok(port),
            (Some(_) | None, _) => {
                Err(ProjectError::NoPort { device: self.name.clone(), entry: self.entry.clone() })
            }
        }
    }

    pub(super) fn write(&self, text: &mut String) {
        let mut line = |key: &str, value: String| {
            let _ = writeln!(text, "{key} = {value}");
        };
        line("\n[[device]]\nname", quoted(&self.name));
        line("type", quoted(&self.type_name));
        let hex = |value: u32| format!("0x{value:08X}");
        if let Some(vendor_id) = self.vendor_id {
            line("vendor_id", hex(vendor_id));
        }
        if let Some(product_code) = self.product_code {
            line("product_code", hex(product_code));
        }
        if let Some(revision) = self.revision {
            line("revision", hex(revision));
        }
        if let Some(rule) = &self.revision_rule {
            line("revision_rule", inline(rule));
        }
        if let Some(serial) = self.serial {
            line("serial", serial.to_string());
        }
        if let Some(alias) = self.alias {
            line("alias", alias.to_string());
        }
        line("on", quoted(&self.on.to_string()));
        if self.entry != "A" {
            line("entry", quoted(&self.entry));
        }
        if let Some(station) = self.station {
            line("station", format!("0x{station:04X}"));
        }
        let mut choice = |key: &str, value: Option<String>| {
            if let Some(value) = value {
                let _ = writeln!(text, "{key} = {value}");
            }
        };
        choice("identification", self.identification.as_ref().map(inline));
        choice("state", self.state.as_ref().map(inline));
        choice("task", self.task.as_ref().map(inline));
        choice("sync_unit", self.sync_unit.as_ref().map(inline));
        choice("access", self.access.as_ref().map(inline));
        choice("frame_repeat", self.frame_repeat.as_ref().map(inline));
        let addressing = &self.addressing;
        choice("addressing", (*addressing != AddressingChoice::Auto).then(|| inline(addressing)));
        choice("on_wrong_counter", self.on_wrong_counter.as_ref().map(inline));
        choice("restore_state", self.restore_state.as_ref().map(inline));
        choice("reinitialise", self.reinitialise.as_ref().map(inline));
        choice("clear_counters", self.clear_counters.as_ref().map(inline));
        choice("eoe", self.eoe.as_ref().map(inline));
        let watchdog = &self.watchdog;
        choice("watchdog", (*watchdog != WatchdogChoice::default()).then(|| inline(watchdog)));
        choice("clock", self.clock.as_ref().map(inline));
        choice("sync_times", (!self.sync_times.is_unknown()).then(|| inline(&self.sync_times)));
        choice("time_stamps", self.time_stamps.as_ref().map(inline));
        choice("sync_leader", self.sync_leader.as_ref().map(inline));
        choice("pdos", self.pdos.as_ref().map(inline));
        choice("modules", (!self.modules.is_empty()).then(|| inline(&self.modules)));
        for mapping in &self.mappings {
            let _ = writeln!(text, "[[device.mapping]]\n{}", inline_lines(mapping));
        }
        for command in &self.start_up {
            let _ = writeln!(text, "[[device.start_up]]\n{}", inline_lines(command));
        }
        if let Some(description) = &self.description {
            let _ = writeln!(text, "[device.description]\n{}", inline_lines(description));
        }
    }
}

/// The keys of a table, each on one line with all that is in it.
pub(super) fn inline_lines<T: Serialize>(value: &T) -> String {
    let Ok(toml::Value::Table(table)) = toml::Value::try_from(value) else { return String::new() };
    let lines: Vec<String> = table.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    lines.join("\n")
}

impl ProjectDevice {
    /// Whether its values make sense by themselves.
    pub(super) fn check(&self) -> Result<(), ProjectError> {
        let wrong = |reason: String| {
            Err(ProjectError::Value { whose: format!("device `{}`", self.name), reason })
        };
        if let Some(state) = &self.state
            && self.target().is_none()
        {
            return wrong(format!("state `{state}`, expected INIT, PREOP, SAFEOP, OP or BOOT"));
        }
        if self.addressing == AddressingChoice::Alias && self.alias.is_none_or(|alias| alias == 0) {
            return wrong(
                "addressing = \"alias\" needs its second address: expected `alias`, 1 to 65535"
                    .to_owned(),
            );
        }
        for command in &self.start_up {
            if Transition::from_letters(&command.transition).is_none() {
                let given = &command.transition;
                return wrong(format!(
                    "start_up: transition `{given}`, expected two of the letters I, P, S, O, B"
                ));
            }
            let what = [
                command.index.is_some(),
                command.register.is_some(),
                command.idn.is_some(),
                command.eoe.is_some(),
                command.net_id.is_some(),
            ];
            if what.iter().filter(|there| **there).count() != 1 {
                let reason =
                    "start_up: expected one of `index`, `register`, `idn`, `eoe` and `net_id`";
                return wrong(reason.to_owned());
            }
            match &command.eoe {
                Some(choice) => {
                    if choice.port > 15 {
                        return wrong(format!(
                            "start_up: eoe: port {}, expected 0 to 15",
                            choice.port
                        ));
                    }
                    if let Err(reason) = choice.parameters() {
                        return wrong(format!("start_up: {reason}"));
                    }
                }
                None if let Some(net_id) = &command.net_id => {
                    if let Err(error) = net_id.parse::<AmsNetId>() {
                        return wrong(format!("start_up: net_id `{net_id}`: {error}"));
                    }
                }
                None if command.data.trim().is_empty() => {
                    return wrong(
                        "start_up: there is no `data`, expected bytes such as \"08 00\"".to_owned(),
                    );
                }
                None => {}
            }
            if let Some(idn) = &command.idn
                && (Idn::from_text(idn).is_none() || command.drive > 7)
            {
                return wrong(format!(
                    "start_up: idn `{idn}` of drive {}, expected one such as S-0-0032 of drive 0 to 7",
                    command.drive
                ));
            }
            if let Err(reason) = value::bytes(&command.data) {
                return wrong(format!("start_up: data: {reason}"));
            }
        }
        Ok(())
    }

    /// Whether it says more than who it is and where.
    #[must_use]
    pub fn chooses(&self) -> bool {
        let plain = Self {
            type_name: self.type_name.clone(),
            vendor_id: self.vendor_id,
            product_code: self.product_code,
            revision: self.revision,
            revision_rule: self.revision_rule,
            serial: self.serial,
            alias: self.alias,
            entry: self.entry.clone(),
            station: self.station,
            description: self.description.clone(),
            ..Self::at(&self.name, self.on.clone())
        };
        *self != plain
    }

    /// How far it is driven; `None` for a state that does not exist.
    #[must_use]
    pub fn target(&self) -> Option<AlState> {
        match self.state.as_deref() {
            None | Some("OP") => Some(AlState::Op),
            Some("SAFEOP") => Some(AlState::SafeOp),
            Some("PREOP") => Some(AlState::PreOp),
            Some("INIT") => Some(AlState::Init),
            Some("BOOT") => Some(AlState::Boot),
            Some(_) => None,
        }
    }
}
