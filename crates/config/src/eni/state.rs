//! Meaning of the register commands of a SubDevice: what every MainDevice does by itself is taken
//! out of them as settings, what is left are start-up commands.

use std::ops::Range;

use linesman_proto::address::StationAlias;
use linesman_proto::command::Command;
use linesman_proto::register::{FmmuConfig, SyncManagerConfig};
use linesman_proto::time::Span;

use super::command::RegisterCommand;
use crate::esi::EsiError;
use crate::identity::RevisionRule;
use crate::plan::{AddressingChoice, ClockSettings, DevicePlan};
use crate::start_up::{StartUpAction, StartUpCommand, Transition};

const STATION: Range<u16> = 0x0010..0x0012;
const AL_CONTROL: Range<u16> = 0x0120..0x0122;
const SII: Range<u16> = 0x0500..0x0510;
const SII_CONTROL: u16 = 0x0502;
const SII_DATA: u16 = 0x0508;
const FMMUS: Range<u16> = 0x0600..0x0700;
const SYNC_MANAGERS: Range<u16> = 0x0800..0x0880;
const CLOCK: Range<u16> = 0x0900..0x09B0;
const ACTIVATION: u16 = 0x0980;
const SYNC_CYCLES: u16 = 0x09A0;
const WATCHDOG_DIVIDER: u16 = 0x0400;
const WATCHDOG_PDI: u16 = 0x0410;
const WATCHDOG_PROCESS_DATA: u16 = 0x0420;
/// The AL control bit that acknowledges an error: a device that only mirrors AL control must not see it.
const ACKNOWLEDGE: u8 = 0x10;
/// Words of the SII that hold the identity.
const REVISION_WORD: u32 = 0x000C;
const SERIAL_WORD: u32 = 0x000E;

/// What the commands tell.
#[derive(Default)]
pub(super) struct Meaning {
    pub(super) fmmus: Vec<(u8, FmmuConfig)>,
    pub(super) sync_managers: Vec<(u8, SyncManagerConfig)>,
    pub(super) checks_serial: bool,
    emulated: Option<bool>,
    clock: (Option<u16>, Option<[u32; 2]>),
    sii_word: u32,
    /// It is given a station address.
    named: bool,
    /// It is asked for SAFEOP by its position.
    by_position: bool,
}

impl Meaning {
    /// Reads one command after the other; `device` takes over what they set.
    pub(super) fn read(
        &mut self,
        command: &RegisterCommand,
        device: &mut DevicePlan,
    ) -> Result<(), EsiError> {
        let address = command.address.0;
        if !command.writes() {
            self.check(command, device);
            return Ok(());
        }
        let word = |at: usize| {
            let bytes = command.data.get(at..at + 2)?;
            Some(u16::from_le_bytes([bytes[0], bytes[1]]))
        };
        let up = command.transitions.iter().any(|transition| {
            matches!(transition.letters().as_str(), "IP" | "PS" | "SO" | "PO" | "IS")
        });
        match address {
            SII_CONTROL => {
                let bytes = command.data.get(2..6).and_then(|bytes| bytes.try_into().ok());
                self.sii_word = bytes.map_or(0, u32::from_le_bytes);
            }
            _ if AL_CONTROL.contains(&address) => {
                // The first step up says whether errors are acknowledged.
                if command.at(Transition::INIT_TO_PRE_OP) && self.emulated.is_none() {
                    let acknowledges =
                        command.data.first().is_some_and(|low| low & ACKNOWLEDGE != 0);
                    self.emulated = Some(!acknowledges);
                }
                self.by_position |=
                    command.command == Command::Apwr && command.at(Transition::PRE_OP_TO_SAFE_OP);
            }
            _ if STATION.contains(&address) => {
                if let Some(station) = word(0).filter(|station| *station != device.station.0) {
                    let reason = format!(
                        "it sets the station address {station}, PhysAddr says {}",
                        device.station.0
                    );
                    return Err(wrong(command, reason));
                }
                self.named = true;
                // Who is given its address by another one is found by that: its second address.
                if command.command == Command::Fpwr && command.adp != device.station.0 {
                    device.settings.addressing = AddressingChoice::Alias;
                    device.settings.alias = Some(StationAlias(command.adp));
                }
            }
            _ if SII.contains(&address) => {}
            _ if FMMUS.contains(&address) && up => self.fmmus(command)?,
            _ if SYNC_MANAGERS.contains(&address) && up => self.sync_managers(command)?,
            _ if FMMUS.contains(&address) || SYNC_MANAGERS.contains(&address) => {}
            ACTIVATION if command.at(Transition::PRE_OP_TO_SAFE_OP) => self.clock.0 = word(0),
            SYNC_CYCLES => {
                let long = |at: usize| {
                    let bytes = command.data.get(at..at + 4)?;
                    Some(u32::from_le_bytes(bytes.try_into().ok()?))
                };
                self.clock.1 = long(0).map(|sync0| [sync0, long(4).unwrap_or(0)]);
            }
            _ if CLOCK.contains(&address) => {}
            WATCHDOG_DIVIDER if up => device.settings.watchdog.divider = word(0),
            WATCHDOG_PDI if up => device.settings.watchdog.pdi = word(0),
            WATCHDOG_PROCESS_DATA if up => device.settings.watchdog.process_data = word(0),
            _ => {
                for transition in &command.transitions {
                    device.start_up.push(StartUpCommand {
                        transition: *transition,
                        action: StartUpAction::RegisterWrite {
                            address: command.address,
                            data: command.data.clone(),
                        },
                        comment: command.comment.clone(),
                    });
                }
            }
        }
        Ok(())
    }

    /// A read that is validated: which parts of the identity are compared.
    fn check(&mut self, command: &RegisterCommand, device: &mut DevicePlan) {
        let Some((_, mask)) = &command.validate else { return };
        if command.address.0 != SII_DATA {
            return;
        }
        let mask = mask.get(..4).and_then(|bytes| bytes.try_into().ok());
        match self.sii_word {
            REVISION_WORD => {
                device.revision_rule = match mask.map(u32::from_le_bytes) {
                    Some(0x0000_FFFF) => RevisionRule::LowWordEqual,
                    Some(0xFFFF_0000) => RevisionRule::HighWordEqual,
                    Some(_) | None => RevisionRule::Equal,
                };
            }
            SERIAL_WORD => self.checks_serial = true,
            _ => {}
        }
    }

    fn fmmus(&mut self, command: &RegisterCommand) -> Result<(), EsiError> {
        let first = command.address.0 - FMMUS.start;
        let aligned = usize::from(first).is_multiple_of(FmmuConfig::LEN)
            && command.data.len().is_multiple_of(FmmuConfig::LEN);
        if !aligned {
            return Err(wrong(command, "an FMMU is 16 bytes at 0x0600, 0x0610, and so on"));
        }
        let indices = (first / FmmuConfig::LEN as u16)..;
        for (bytes, index) in command.data.chunks_exact(FmmuConfig::LEN).zip(indices) {
            let Ok(bytes) = <[u8; FmmuConfig::LEN]>::try_from(bytes) else { continue };
            let fmmu = FmmuConfig::from_bytes(bytes);
            if fmmu.active && fmmu.length > 0 {
                put(&mut self.fmmus, index as u8, fmmu);
            }
        }
        Ok(())
    }

    fn sync_managers(&mut self, command: &RegisterCommand) -> Result<(), EsiError> {
        let first = command.address.0 - SYNC_MANAGERS.start;
        let aligned = usize::from(first).is_multiple_of(SyncManagerConfig::LEN)
            && command.data.len().is_multiple_of(SyncManagerConfig::LEN);
        if !aligned {
            return Err(wrong(command, "a SyncManager is 8 bytes at 0x0800, 0x0808, and so on"));
        }
        let indices = (first / SyncManagerConfig::LEN as u16)..;
        for (bytes, index) in command.data.chunks_exact(SyncManagerConfig::LEN).zip(indices) {
            let Ok(bytes) = <[u8; SyncManagerConfig::LEN]>::try_from(bytes) else { continue };
            let manager = SyncManagerConfig::from_bytes(bytes);
            if manager.activate.0 & 1 != 0 {
                put(&mut self.sync_managers, index as u8, manager);
            }
        }
        Ok(())
    }

    /// What is known once all commands have been read.
    pub(super) fn finish(&self, device: &mut DevicePlan, clock: Option<ClockSettings>) {
        device.device_emulation = self.emulated.unwrap_or(false);
        if self.by_position && !self.named {
            device.settings.addressing = AddressingChoice::Position;
        }
        let (activation, cycles) = self.clock;
        let mut clock = clock.unwrap_or_default();
        clock.assign_activate = activation.unwrap_or(0);
        if let Some([sync0, sync1]) = cycles {
            clock.sync0_cycle = Span::ns(u64::from(sync0));
            clock.sync1_cycle = Span::ns(u64::from(sync1));
        }
        device.settings.clock = (clock.assign_activate != 0).then_some(clock);
    }
}

fn put<T>(list: &mut Vec<(u8, T)>, index: u8, value: T) {
    list.retain(|(known, _)| *known != index);
    list.push((index, value));
    list.sort_by_key(|(index, _)| *index);
}

fn wrong(command: &RegisterCommand, reason: impl Into<String>) -> EsiError {
    let element = format!("InitCmd 0x{:04X} \"{}\"", command.address.0, command.comment);
    EsiError::new(command.line, &element, reason)
}
