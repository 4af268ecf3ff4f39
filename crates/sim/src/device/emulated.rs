//! A device without a processor: digital inputs and outputs that the controller drives itself.
//!
//! Read first: S1 and the ET1100 data sheet, section III, digital I/O interface. AL status follows
//! AL control (device emulation); outputs follow their bytes at the end of each frame while the
//! device is in OP and the process data watchdog has not expired; inputs are taken when a frame
//! begins.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{DIGITAL_OUTPUT, SyncManagerConfig};
use linesman_proto::state::{AlState, StateValue};
use linesman_proto::time::Instant;

use super::firmware::Firmware;
use super::signal::{SignalId, Signals};
use crate::controller::Pdi;

/// A run of digital channels: where their bits lie and which signals they are.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DigitalArea {
    /// The SyncManager that guards the bytes.
    pub sync_manager: u8,
    /// The first byte: 0x0F00 to 0x0F03 for output registers, or process-data RAM.
    pub at: RegisterAddress,
    /// The signal of each channel, from bit 0 of the first byte up.
    pub signals: Vec<SignalId>,
}

impl DigitalArea {
    fn len(&self) -> usize {
        self.signals.len().div_ceil(8)
    }
}

/// A device without a processor.
#[derive(Clone, Default, Debug)]
pub struct Emulated {
    outputs: Vec<DigitalArea>,
    inputs: Vec<DigitalArea>,
    /// The bytes of one area, kept for its memory.
    bytes: Vec<u8>,
}

impl Emulated {
    /// A device with these channels.
    #[must_use]
    pub fn new(outputs: Vec<DigitalArea>, inputs: Vec<DigitalArea>) -> Self {
        let longest = outputs.iter().chain(&inputs).map(DigitalArea::len).max().unwrap_or(0);
        Self { outputs, inputs, bytes: vec![0; longest] }
    }

    fn drive_outputs(&mut self, pdi: &mut Pdi<'_>) {
        let expired = pdi.watchdog_expired();
        let operational = pdi.al_status().state() == StateValue::Known(AlState::Op);
        for area in &self.outputs {
            let bytes = &mut self.bytes[..area.len()];
            let guard = pdi.sync_manager(area.sync_manager);
            let watched = guard.is_some_and(|guard| guard.control.watchdog());
            let driven = operational && !(watched && expired) && fetch(area, guard, bytes, pdi);
            for (channel, signal) in area.signals.iter().enumerate() {
                let high = driven && bytes[channel / 8] >> (channel % 8) & 1 != 0;
                pdi.signals_mut().set(*signal, i32::from(high));
            }
        }
    }
}

impl Firmware for Emulated {
    fn start(&mut self, _now: Instant, pdi: &mut Pdi<'_>) {
        self.drive_outputs(pdi);
    }

    fn run(&mut self, _now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        self.drive_outputs(pdi);
        None
    }

    fn samples(&self) -> bool {
        !self.inputs.is_empty()
    }

    fn sample(&mut self, _now: Instant, pdi: &mut Pdi<'_>) {
        for area in &self.inputs {
            let bytes = &mut self.bytes[..area.len()];
            bytes.fill(0);
            for (channel, signal) in area.signals.iter().enumerate() {
                bytes[channel / 8] |= u8::from(pdi.signals().is_high(*signal)) << (channel % 8);
            }
            let guard = pdi.sync_manager(area.sync_manager);
            if guard.is_some_and(|guard| is_buffered(&guard)) {
                // Less than a whole buffer is a set-up that does not fit the device.
                pdi.write_sync_manager(area.sync_manager, bytes);
            } else {
                let end = area.at.0.saturating_add(bytes.len() as u16);
                let ram = pdi.ram_mut(area.at.0..end);
                ram.copy_from_slice(&bytes[..ram.len()]);
            }
        }
    }

    fn stop(&mut self, signals: &mut Signals) {
        for signal in self.outputs.iter().flat_map(|area| &area.signals) {
            signals.set(*signal, 0);
        }
    }
}

/// Whether accesses go through buffers: not for a SyncManager that is off, or of one byte.
fn is_buffered(guard: &SyncManagerConfig) -> bool {
    guard.is_active() && guard.length > 1
}

/// Fetches the output bytes; false when none have come yet.
fn fetch(
    area: &DigitalArea,
    guard: Option<SyncManagerConfig>,
    bytes: &mut [u8],
    pdi: &mut Pdi<'_>,
) -> bool {
    if guard.is_some_and(|guard| is_buffered(&guard)) {
        return pdi.read_sync_manager(area.sync_manager, bytes).is_some();
    }
    if let Some(offset) = area.at.0.checked_sub(DIGITAL_OUTPUT.address.0)
        && offset < DIGITAL_OUTPUT.len
    {
        let outputs = pdi.digital_outputs().to_le_bytes();
        let outputs = &outputs[usize::from(offset)..];
        let len = bytes.len().min(outputs.len());
        bytes[..len].copy_from_slice(&outputs[..len]);
        return true;
    }
    let end = area.at.0.saturating_add(bytes.len() as u16);
    let ram = pdi.ram(area.at.0..end);
    bytes[..ram.len()].copy_from_slice(ram);
    true
}
