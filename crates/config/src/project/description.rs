//! Description of a type of device in the project itself, where no description of its maker is at
//! hand: `[device.description]`. A saved scan writes what stands in the SII.

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::PortMap;
use linesman_proto::register::{AL_STATUS_CODE, SmControl};
use linesman_proto::sii::{Direction, FmmuUsage, Identification, MailboxPair, PortKind, Protocols};
use serde::{Deserialize, Serialize};

use crate::esi::device::{letters, physics};
use crate::profile::{DeviceProfile, Mailbox, MappedEntry, MappedPdo, ProcessSyncManager};

/// A type of device.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Description {
    /// Current from the E-bus in mA; negative supplies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ebus_current_ma: Option<i16>,
    /// What its ports are, from A on: `Y` Ethernet, `K` E-bus, `H` fast hot connect, `-` none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ports: Option<String>,
    /// Its mailbox.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mailbox: Option<DescribedMailbox>,
    /// It must not be addressed by LRW.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub no_lrw: bool,
    /// Its AL status mirrors AL control: it has no firmware.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub emulation: bool,
    /// Where the number of its selector is read: 0x0134 through AL control, else a word of memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identification_register: Option<u16>,
    /// Bits of outputs, where no SyncManagers are listed.
    #[serde(skip_serializing_if = "is_zero")]
    pub outputs_bits: u16,
    /// Bits of inputs, where no SyncManagers are listed.
    #[serde(skip_serializing_if = "is_zero")]
    pub inputs_bits: u16,
    /// What its FMMUs are meant for, in their order: `outputs`, `inputs`, `mailbox-state`, `unused`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fmmus: Vec<FmmuWord>,
    /// SyncManagers for process data.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sync_managers: Vec<DescribedSyncManager>,
    /// PDOs; those with a SyncManager are assigned to it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pdos: Vec<DescribedPdo>,
}

fn is_zero(number: &u16) -> bool {
    *number == 0
}

/// A mailbox.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DescribedMailbox {
    /// Address and length of what the device receives.
    pub receive: [u16; 2],
    /// Address and length of what it sends.
    pub send: [u16; 2],
    /// The same four numbers in BOOT.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<[u16; 4]>,
    /// What it speaks: `AoE`, `EoE`, `CoE`, `FoE`, `SoE`, `VoE`.
    #[serde(default)]
    pub protocols: Vec<String>,
    /// It takes whole objects in one transfer.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub complete_access: bool,
}

/// A SyncManager for process data.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DescribedSyncManager {
    /// Its number.
    pub index: u8,
    /// Which way the data flow.
    pub direction: Way,
    /// Where the buffer begins.
    pub start: u16,
    /// Control byte.
    pub control: u8,
    /// Bytes, where no PDOs tell.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub len: u16,
    /// FMMUs lead to the address without a SyncManager.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_virtual: bool,
}

/// A PDO.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DescribedPdo {
    /// Index of its mapping object.
    pub index: u16,
    /// Which way it flows.
    pub direction: Way,
    /// The SyncManager it is assigned to; none is assigned only when the device chooses it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sync_manager: Option<u8>,
    /// Its name.
    #[serde(default)]
    pub name: String,
    /// What it consists of.
    #[serde(default)]
    pub entries: Vec<DescribedEntry>,
}

/// A piece of a PDO.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DescribedEntry {
    /// Index of its object; 0 is padding.
    #[serde(default)]
    pub index: u16,
    /// Its subindex.
    #[serde(default)]
    pub subindex: u8,
    /// Its bits.
    pub bits: u16,
    /// Its name.
    #[serde(default)]
    pub name: String,
    /// Its type, such as `INT`.
    #[serde(default, rename = "type")]
    pub data_type: String,
}

/// Which way process data flow.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// To the device.
    Outputs,
    /// From the device.
    Inputs,
}

/// What an FMMU is meant for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum FmmuWord {
    /// Outputs.
    Outputs,
    /// Inputs.
    Inputs,
    /// The full bit of the mailbox.
    MailboxState,
    /// Nothing, or whatever the MainDevice likes.
    Unused,
}

impl From<Way> for Direction {
    fn from(way: Way) -> Self {
        match way {
            Way::Outputs => Self::Outputs,
            Way::Inputs => Self::Inputs,
        }
    }
}

impl From<Direction> for Way {
    fn from(direction: Direction) -> Self {
        match direction {
            Direction::Outputs => Self::Outputs,
            Direction::Inputs => Self::Inputs,
        }
    }
}

impl From<&DescribedEntry> for MappedEntry {
    fn from(entry: &DescribedEntry) -> Self {
        Self {
            index: entry.index,
            subindex: entry.subindex,
            bits: entry.bits,
            name: entry.name.clone(),
            data_type: entry.data_type.clone(),
        }
    }
}

impl Description {
    /// What a device needs, as a description.
    #[must_use]
    pub fn of(profile: &DeviceProfile) -> Self {
        let word = |usage: &FmmuUsage| match usage {
            FmmuUsage::Outputs => FmmuWord::Outputs,
            FmmuUsage::Inputs => FmmuWord::Inputs,
            FmmuUsage::MailboxState => FmmuWord::MailboxState,
            FmmuUsage::Unused | FmmuUsage::Unspecified | FmmuUsage::Other(_) => FmmuWord::Unused,
        };
        let pdos = profile.pdos.iter().map(|pdo| (pdo, Some(pdo.sync_manager)));
        let spare = profile.spare_pdos.iter().map(|pdo| (pdo, None));
        Self {
            ebus_current_ma: profile.ebus_current_ma,
            ports: profile.ports.as_ref().map(letters),
            mailbox: profile.mailbox.map(|mailbox| {
                let [a, b, c, d] = mailbox.areas.to_words();
                DescribedMailbox {
                    receive: [a, b],
                    send: [c, d],
                    bootstrap: mailbox.bootstrap.map(MailboxPair::to_words),
                    protocols: mailbox.protocols.names().map(str::to_owned).collect(),
                    complete_access: mailbox.complete_access,
                }
            }),
            no_lrw: profile.no_lrw,
            emulation: profile.device_emulation,
            identification_register: match profile.identification {
                Identification::None => None,
                Identification::AlStatus => Some(AL_STATUS_CODE.address.0),
                Identification::Memory(at) => Some(at.0),
            },
            outputs_bits: 0,
            inputs_bits: 0,
            fmmus: profile.fmmus.iter().map(word).collect(),
            sync_managers: profile
                .process
                .iter()
                .map(|manager| DescribedSyncManager {
                    index: manager.index,
                    direction: manager.direction.into(),
                    start: manager.start.0,
                    control: manager.control.0,
                    len: manager.len,
                    is_virtual: manager.is_virtual,
                })
                .collect(),
            pdos: pdos
                .chain(spare)
                .map(|(pdo, sync_manager)| DescribedPdo {
                    index: pdo.index,
                    direction: pdo.direction.into(),
                    sync_manager,
                    name: pdo.name.clone(),
                    entries: pdo
                        .entries
                        .iter()
                        .map(|entry| DescribedEntry {
                            index: entry.index,
                            subindex: entry.subindex,
                            bits: entry.bits,
                            name: entry.name.clone(),
                            data_type: entry.data_type.clone(),
                        })
                        .collect(),
                })
                .collect(),
        }
    }

    /// What a device of this type needs.
    ///
    /// # Errors
    /// A port or protocol that does not exist, in words.
    pub fn profile(&self, type_name: &str) -> Result<DeviceProfile, String> {
        self.check_ranges()?;
        let mut profile = DeviceProfile {
            type_name: type_name.to_owned(),
            mailbox: self.mailbox.as_ref().map(DescribedMailbox::mailbox).transpose()?,
            no_lrw: self.no_lrw,
            device_emulation: self.emulation,
            identification: match self.identification_register {
                None => Identification::None,
                Some(at) if at == AL_STATUS_CODE.address.0 => Identification::AlStatus,
                Some(at) => Identification::Memory(RegisterAddress(at)),
            },
            ebus_current_ma: self.ebus_current_ma,
            ports: self.ports.as_deref().map(ports).transpose()?,
            fmmus: self.usages(),
            process: self.process(),
            ..DeviceProfile::default()
        };
        for pdo in &self.pdos {
            let direction = pdo.direction.into();
            let mapped = MappedPdo {
                sync_manager: pdo.sync_manager.unwrap_or(0),
                direction,
                index: pdo.index,
                name: pdo.name.clone(),
                entries: pdo.entries.iter().map(MappedEntry::from).collect(),
            };
            match pdo.sync_manager {
                Some(_) => profile.pdos.push(mapped),
                None => profile.spare_pdos.push(mapped),
            }
        }
        profile.measure();
        Ok(profile)
    }

    /// Whether what it names is within a controller: 16 SyncManagers and FMMUs, 64 kB.
    fn check_ranges(&self) -> Result<(), String> {
        const MOST: usize = 16;
        let beyond = |start: u16, len: u16| u32::from(start) + u32::from(len) > 0x1_0000;
        for DescribedSyncManager { index, start, len, .. } in &self.sync_managers {
            if usize::from(*index) >= MOST {
                return Err(format!("description: sync_managers: index {index}, expected 0 to 15"));
            }
            if beyond(*start, *len) {
                return Err(format!(
                    "description: sync_managers: {len} bytes from 0x{start:04X} on end beyond 0xFFFF"
                ));
            }
        }
        if self.fmmus.len() > MOST {
            return Err(format!("description: {} fmmus, expected at most 16", self.fmmus.len()));
        }
        let Some(mailbox) = &self.mailbox else { return Ok(()) };
        let [a, b] = [mailbox.receive, mailbox.send];
        let bootstrap = mailbox.bootstrap.map_or([[0; 2]; 2], |[c, d, e, f]| [[c, d], [e, f]]);
        for [start, len] in [a, b].into_iter().chain(bootstrap) {
            if beyond(start, len) {
                return Err(format!(
                    "description: mailbox: {len} bytes from 0x{start:04X} on end beyond 0xFFFF"
                ));
            }
        }
        Ok(())
    }

    fn usages(&self) -> Vec<FmmuUsage> {
        if self.fmmus.is_empty() && self.mailbox.is_some() {
            return vec![FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxState];
        }
        let usage = |word: &FmmuWord| match word {
            FmmuWord::Outputs => FmmuUsage::Outputs,
            FmmuWord::Inputs => FmmuUsage::Inputs,
            FmmuWord::MailboxState => FmmuUsage::MailboxState,
            FmmuWord::Unused => FmmuUsage::Unused,
        };
        self.fmmus.iter().map(usage).collect()
    }

    fn process(&self) -> Vec<ProcessSyncManager> {
        let listed = self.sync_managers.iter().map(|manager| ProcessSyncManager {
            index: manager.index,
            direction: manager.direction.into(),
            start: RegisterAddress(manager.start),
            len: manager.len,
            control: SmControl(manager.control),
            is_virtual: manager.is_virtual,
            bits: 0,
        });
        let mut process: Vec<_> = listed.collect();
        if process.is_empty() {
            process.extend(self.usual(Direction::Outputs, self.outputs_bits));
            process.extend(self.usual(Direction::Inputs, self.inputs_bits));
        }
        process
    }

    /// Where process data usually lie: with a mailbox SyncManagers 2 and 3 behind it; without one the
    /// first ones, few outputs in the register of digital outputs.
    fn usual(&self, direction: Direction, bits: u16) -> Option<ProcessSyncManager> {
        let few = bits <= 32;
        let (index, start, control) = match (self.mailbox.is_some(), direction) {
            (true, Direction::Outputs) => (2, 0x2000, SmControl::OUTPUTS),
            (true, Direction::Inputs) => (3, 0x3000, SmControl::INPUTS),
            (false, Direction::Outputs) if few => (0, 0x0F00, SmControl::OUTPUTS_WITHOUT_EVENT),
            (false, Direction::Outputs) => (0, 0x2000, SmControl::OUTPUTS_WITHOUT_EVENT),
            (false, Direction::Inputs) => (1, 0x3000, SmControl::INPUTS_WITHOUT_EVENT),
        };
        (bits > 0).then_some(ProcessSyncManager {
            index,
            direction,
            start: RegisterAddress(start),
            len: bits.div_ceil(8),
            control,
            is_virtual: false,
            bits,
        })
    }
}

fn ports(letters: &str) -> Result<PortMap<PortKind>, String> {
    physics(letters).map_err(|reason| format!("description: ports: {reason}"))
}

impl DescribedMailbox {
    fn mailbox(&self) -> Result<Mailbox, String> {
        let ([a, b], [c, d]) = (self.receive, self.send);
        let mut protocols = 0;
        for name in &self.protocols {
            protocols |= Protocols::bit_of(name).ok_or_else(|| {
                format!(
                    "description: mailbox: protocol `{name}`, expected AoE, EoE, CoE, FoE, SoE or VoE"
                )
            })?;
        }
        Ok(Mailbox {
            areas: MailboxPair::from_words([a, b, c, d]),
            bootstrap: self.bootstrap.map(MailboxPair::from_words),
            protocols: Protocols(protocols),
            complete_access: self.complete_access,
        })
    }
}
