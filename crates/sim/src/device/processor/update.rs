//! New firmware: when it starts, and what becomes of an update that broke off.
//!
//! Read first: ETG.1000.6, BOOT and FoE; AL status code 0x0007.

use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::state::{AlState, AlStatusCode};

use super::{Processor, StepOutcome};
use crate::controller::Pdi;
use crate::device::history::History;

impl Processor {
    /// On the way out of BOOT new firmware starts. An update that broke off leaves the old one.
    pub(super) fn leave_boot(&mut self, pdi: &mut Pdi<'_>) -> StepOutcome {
        if self.files.take_broken_update() {
            return StepOutcome::Failed(AlState::Init, AlStatusCode::FIRMWARE_UPDATE_FAILED);
        }
        self.start_new_firmware(pdi);
        StepOutcome::Entered
    }

    /// The processor starts, with new firmware if some waits.
    pub(super) fn start_new_firmware(&mut self, pdi: &Pdi<'_>) {
        let Some(version) = self.files.start_new_firmware() else { return };
        let shown = ObjectAddress { index: ObjectIndex::SOFTWARE_VERSION, subindex: 0 };
        self.description.dictionary.set_bytes(shown, version.clone().into_bytes());
        self.dictionary.restart(&self.description.dictionary);
        self.history = History::default();
        self.note_firmware(&version, pdi);
    }
}
