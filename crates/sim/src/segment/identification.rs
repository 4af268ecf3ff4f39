//! Explicit identification: the number that somebody sets at a device, told in one of three ways.
//!
//! Read first: ETG.1020, explicit device identification; SII category General, flags. A device tells
//! it when AL control asks (bit 5, then 0x0134), or it stands in memory where a switch is wired, or it
//! is the configured station alias (0x0012), which the controller loads from the SII at power-on.

use linesman_proto::address::RegisterAddress;
use linesman_proto::sii::{General, Identification, Image, checksum, word};

use crate::controller::Controller;
use crate::device::Signals;
use crate::device::library::Built;

/// What is still to be done once there is a controller.
pub(super) struct PendingNumber(Option<(RegisterAddress, u16)>);

/// Sets the number of a device that is built. A device that answers through AL control answers 0 when
/// no number is given.
pub(super) fn set(built: &mut Built, id: Option<u16>, signals: &mut Signals) -> PendingNumber {
    if id.is_none() && !built.firmware.has_processor() {
        return PendingNumber(None);
    }
    let way = Image::parse(&built.sii)
        .ok()
        .and_then(|image| image.general().map(General::identification))
        .unwrap_or(Identification::None);
    if way == Identification::AlStatus && built.firmware.identify(id.unwrap_or(0), signals) {
        return PendingNumber(None);
    }
    let Some(id) = id else { return PendingNumber(None) };
    match way {
        Identification::Memory(at) => {
            let taken = built.firmware.identify(id, signals);
            PendingNumber((!taken).then_some((at, id)))
        }
        Identification::AlStatus | Identification::None => {
            set_alias(&mut built.sii, id);
            PendingNumber(None)
        }
    }
}

impl PendingNumber {
    /// Does it.
    pub(super) fn finish(self, controller: &mut Controller) {
        if let Some((at, id)) = self.0 {
            controller.set_coding_switch(at, id);
        }
    }
}

/// Writes the alias into an SII image, and with it the checksum.
pub(super) fn set_alias(sii: &mut [u8], alias: u16) {
    let (at, sum) = (word::STATION_ALIAS.byte(), word::CHECKSUM.byte());
    if sii.len() < sum + 2 {
        return;
    }
    sii[at..at + 2].copy_from_slice(&alias.to_le_bytes());
    if let Some(guarded) = sii.first_chunk::<14>() {
        sii[sum] = checksum(guarded);
    }
}
