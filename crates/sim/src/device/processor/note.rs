//! Entries that a processor makes in its diagnosis history, and sends to the MainDevice unasked.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::diagnosis::{DiagnosisMessage, Parameter, Severity};
use linesman_proto::mailbox::coe::{
    DataType, Emergency, ErrorRegister, ObjectAddress, ObjectIndex,
};
use linesman_proto::register as r;
use linesman_proto::state::{AlState, AlStatusCode};

use super::Processor;
use crate::controller::Pdi;
use crate::device::history::{self, FLAGS, HISTORY, Note, SENDS_EMERGENCIES, Stamp};

/// Text: communication is established (INIT to PREOP).
const COMMUNICATION: u16 = 0x0002;
/// Text: new firmware runs; parameter: its version.
const NEW_FIRMWARE: u16 = 0x1001;
/// Text: a state was refused or left; parameters: the state it is in, the AL status code.
const STATE_FAILED: u16 = 0x8001;
/// Text: an emergency was sent; parameters: code, error register.
const EMERGENCY_SENT: u16 = 0x8002;
/// Text: the firmware crashed and has started anew.
const CRASHED: u16 = 0x8003;
/// An emergency that carries a message of the history: specific to the device.
const DEVICE_SPECIFIC: u16 = 0xFF00;
/// Object: the time, in ns.
const TIME: ObjectIndex = ObjectIndex(0x10F8);

/// What time it is for a device: the system time where the MainDevice has set one, else the local
/// clock.
fn stamp(pdi: &Pdi<'_>) -> Stamp {
    let offset = r::SYSTEM_TIME_OFFSET.address.0;
    let set = (offset..offset + 8).any(|at| pdi.register(RegisterAddress(at)) != 0);
    let time_ns = if set { pdi.system_time() } else { pdi.local_time() };
    Stamp { time_ns, local: !set }
}

impl Processor {
    /// Keeps the object that tells the time.
    pub(super) fn tell_time(&mut self, pdi: &Pdi<'_>) {
        let time = ObjectAddress { index: TIME, subindex: 0 };
        if let Some(time) = self.dictionary.find(time) {
            self.dictionary.set_number(time, stamp(pdi).time_ns);
        }
    }

    pub(super) fn note_communication(&mut self, pdi: &Pdi<'_>) {
        self.note_own(Severity::Information, COMMUNICATION, &[], pdi);
    }

    pub(super) fn note_firmware(&mut self, version: &str, pdi: &Pdi<'_>) {
        let version = version.as_bytes();
        let version = version.get(..16).unwrap_or(version);
        self.note_own(Severity::Information, NEW_FIRMWARE, &[Parameter::Text(version)], pdi);
    }

    pub(super) fn note_crash(&mut self, pdi: &Pdi<'_>) {
        self.note_own(Severity::Error, CRASHED, &[], pdi);
    }

    pub(super) fn note_failure(&mut self, state: AlState, code: AlStatusCode, pdi: &Pdi<'_>) {
        let (state, code) = ([state.bits()], code.0.to_le_bytes());
        let parameters =
            [Parameter::Value(DataType::USINT, &state), Parameter::Value(DataType::UINT, &code)];
        self.note_own(Severity::Error, STATE_FAILED, &parameters, pdi);
    }

    /// Notes something of the vendor's own, and sends it as an emergency if the flags of the history
    /// say so.
    fn note_own(
        &mut self,
        severity: Severity,
        text: u16,
        parameters: &[Parameter<'_>],
        pdi: &Pdi<'_>,
    ) {
        let flags = self.dictionary.number_at(ObjectAddress { index: HISTORY, subindex: FLAGS });
        let kept = self.note(severity, text, parameters, pdi);
        if kept && flags & SENDS_EMERGENCIES != 0 {
            let [low, high] = text.to_le_bytes();
            let data = [severity.code(), low, high, 0, 0];
            let register = ErrorRegister(self.error_register());
            self.mailbox.report(Emergency { code: DEVICE_SPECIFIC, register, data });
        }
    }

    /// Notes something of the vendor's own; false when it is not kept.
    fn note(
        &mut self,
        severity: Severity,
        text: u16,
        parameters: &[Parameter<'_>],
        pdi: &Pdi<'_>,
    ) -> bool {
        let product = self.dictionary.number_at(ObjectAddress::new(0x1018, 2)) as u32;
        let code = product & 0xFFFF_0000 | u32::from(DiagnosisMessage::VENDOR);
        let note = Note { severity, code, text, parameters };
        self.history.note(note, stamp(pdi), &mut self.dictionary)
    }

    fn error_register(&self) -> u8 {
        let register = ObjectAddress { index: ObjectIndex::ERROR_REGISTER, subindex: 0 };
        self.dictionary.number_at(register) as u8
    }

    /// Hands over emergencies, notes them, and keeps the error register.
    pub(super) fn tell_emergencies(&mut self, pdi: &Pdi<'_>) {
        for emergency in std::mem::take(&mut self.emergencies) {
            let register = ObjectAddress { index: ObjectIndex::ERROR_REGISTER, subindex: 0 };
            if let Some(register) = self.dictionary.find(register) {
                self.dictionary.set_number(register, u64::from(emergency.register.0));
            }
            if emergency.code == DEVICE_SPECIFIC {
                // A message of the history that is sent as well: severity and text are in its data.
                let [severity, low, high, ..] = emergency.data;
                let text = u16::from_le_bytes([low, high]);
                self.note(Severity::from_code(severity), text, &[], pdi);
                self.mailbox.report(emergency);
                continue;
            }
            let (code, sorts) = (emergency.code.to_le_bytes(), [emergency.register.0]);
            let parameters = [
                Parameter::Value(DataType::UINT, &code),
                Parameter::Value(DataType::USINT, &sorts),
            ];
            let gone = emergency.code < 0x0100;
            let note = Note {
                severity: if gone { Severity::Information } else { Severity::Error },
                code: u32::from(emergency.code) << 16 | u32::from(DiagnosisMessage::EMERGENCY),
                text: EMERGENCY_SENT,
                parameters: &parameters,
            };
            self.history.note(note, stamp(pdi), &mut self.dictionary);
            self.mailbox.report(emergency);
        }
    }

    /// A MainDevice wrote an object that does something.
    pub(super) fn follow_up(&mut self) {
        use crate::device::dictionary::special::{RESTORE_SETTINGS, STORE_SETTINGS};
        let Some(written) = self.dictionary.take_written() else { return };
        let fresh = &self.description.dictionary;
        match (written.index, written.subindex) {
            (HISTORY, history::ACKNOWLEDGED) => self.history.acknowledged(&mut self.dictionary),
            (RESTORE_SETTINGS | STORE_SETTINGS, 1) => {
                // Settings that are kept are kept when they are written: there is nothing to store.
                if written.index == RESTORE_SETTINGS {
                    self.dictionary.restore(fresh);
                }
                let shown = fresh.number_at(written);
                if let Some(entry) = self.dictionary.find(written) {
                    self.dictionary.set_number(entry, shown);
                }
            }
            _ => {}
        }
    }
}
