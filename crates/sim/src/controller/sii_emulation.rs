//! The SII played by the SubDevice's processor: controllers without an EEPROM.
//!
//! Read first: S1 11.2.4, S2 2.11.3. Each command raises bit 5 of the AL event request; the processor
//! puts data into 0x0508 and writes the command back with its errors, which ends it. What the EEPROM
//! of others sets at power-on is built into such a controller; alias and link detection come with
//! the answer to a reload.

use linesman_proto::register::{self as r, AlEvents, SiiCommand};
use linesman_proto::time::Instant;

use super::core::Core;
use super::pdi::Pdi;
use super::sii;

/// What the MainDevice wants of an SII that the processor plays.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SiiRequest {
    /// Read, write or reload.
    pub command: SiiCommand,
    /// Which word.
    pub word: u32,
    /// The word to write.
    pub value: u16,
}

impl Core {
    /// A command was written: with emulation the processor hears of it.
    pub(super) fn ask_sii_emulation(&mut self, when: Instant) {
        if self.sii.emulated && sii::read(&self.memory).busy() && self.sii.done_at().is_none() {
            self.raise_al_events(AlEvents::EEPROM_EMULATION, when);
        }
    }
}

impl Pdi<'_> {
    /// What the MainDevice wants of the SII that this side plays; `None` when nothing.
    #[must_use]
    pub fn sii_request(&self) -> Option<SiiRequest> {
        if !self.core.al_events().contains(AlEvents::EEPROM_EMULATION) {
            return None;
        }
        let memory = &self.core.memory;
        Some(SiiRequest {
            command: sii::read(memory).command(),
            word: memory.u32(&r::SII_ADDRESS),
            value: memory.u64(&r::SII_DATA) as u16,
        })
    }

    /// Answers it: with data for a read (what is missing of the read size becomes 0), with words 4
    /// (alias) and 5 for a reload, or not at all, which shows as an acknowledge error.
    pub fn answer_sii(&mut self, answer: Option<&[u8]>) {
        let Some(request) = self.sii_request() else { return };
        let memory = &mut self.core.memory;
        let control = sii::read(memory).with_busy(false).with_command(SiiCommand::None);
        if let Some(data) = answer.filter(|_| request.command != SiiCommand::Write) {
            let mut bytes = [0; 8];
            let len = data.len().min(control.read_len());
            bytes[..len].copy_from_slice(&data[..len]);
            if request.command == SiiCommand::Reload {
                memory.set_u16(&r::STATION_ALIAS, u16::from_le_bytes([bytes[0], bytes[1]]));
            } else {
                memory.set_u64(&r::SII_DATA, u64::from_le_bytes(bytes));
            }
        }
        sii::put(control.with_acknowledge_error(answer.is_none()), memory);
        self.core.clear_al_events(AlEvents::EEPROM_EMULATION);
    }
}
