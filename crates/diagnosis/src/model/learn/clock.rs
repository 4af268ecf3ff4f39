//! The time of the reference clock, as frames hand it round (ARMW or FRMW at 0x0910, S1 9.1.3).

use linesman_proto::address::DeviceId;

use super::Answer;
use crate::model::clock::ReferenceReading;
use crate::model::{NetworkModel, Reference, Seen};

const SYSTEM_TIME: u16 = 0x0910;
/// Reference clocks that are followed.
const MOST: usize = 4;

/// A datagram came back that reads from one SubDevice and writes what it read to all behind it.
pub(super) fn handed_round(model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
    let (Some(request), Some(sent)) = (answer.request, answer.sent_at) else { return };
    let data = answer.reply.data();
    let is_read = answer.ado.0 == SYSTEM_TIME && answer.own > 0;
    // Where the reference is not on this way round, the others were given what was sent.
    if !is_read || data == request.data() {
        return;
    }
    let (time, is_short) = match data.len() {
        8.. => (data.first_chunk().map(|bytes| u64::from_le_bytes(*bytes)), false),
        4..8 => {
            let low = data.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
            (low.map(u64::from), true)
        }
        0..4 => (None, true),
    };
    let Some(time) = time else { return };
    let seen = Seen::new(ReferenceReading { sent, time, is_short }, answer.at, Some(answer.frame));
    let known = model.references.iter_mut().find(|reference| reference.device == id);
    let is_news = match known {
        Some(reference) => reference.record(seen),
        None => {
            if model.references.len() < MOST {
                model.references.push(Reference::new(id, seen));
            }
            false
        }
    };
    if is_news {
        model.touch();
    }
}
