//! Bits of process data that tell whether an answer lies in a mailbox: the status of SyncManager 1, where an FMMU maps it.
//!
//! A MainDevice that sees the bit asks for nothing until it is set, and fetches the answer when it has the time. The bit
//! tells when the SubDevice was done.

use linesman_proto::address::{DeviceId, LogicalAddress};
use linesman_proto::register::{FmmuConfig, SmStatus};

use super::Answer;
use super::registers::MAILBOX_IN_STATUS;
use crate::model::{Device, NetworkModel};

/// A mailbox whose answer is waited for, and the bit that will tell of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct AwaitedBit {
    device: DeviceId,
    at: LogicalAddress,
    bit: u8,
}

/// Notes that a SubDevice took a request, whose answer its bit will tell of, if there is one.
pub(super) fn expect(model: &mut NetworkModel, id: DeviceId) {
    let Some((at, bit)) = model.device(id).and_then(bit_of) else { return };
    model.awaited_bits.retain(|awaited| awaited.device != id);
    model.awaited_bits.push(AwaitedBit { device: id, at, bit });
}

/// Looks for the bits that are waited for in process data that came back.
pub(super) fn look(model: &mut NetworkModel, answer: &Answer<'_>) {
    if model.awaited_bits.is_empty() || !answer.effect.reads || answer.own == 0 {
        return;
    }
    let (start, data) = (answer.reply.logical(), answer.reply.data());
    let devices = &mut model.devices;
    model.awaited_bits.retain(|awaited| {
        let offset = awaited.at.0.checked_sub(start.0).and_then(|at| usize::try_from(at).ok());
        let is_set =
            offset.and_then(|at| data.get(at)).is_some_and(|byte| byte >> awaited.bit & 1 != 0);
        if is_set && let Some(device) = devices.get_mut(awaited.device.index()) {
            device.mailbox.looked(true, answer.at);
        }
        !is_set
    });
}

/// Place of the bit in process data, as FMMUs were seen set up.
fn bit_of(device: &Device) -> Option<(LogicalAddress, u8)> {
    let maps = |fmmu: &&FmmuConfig| {
        let first = fmmu.physical_start.0;
        let behind = u32::from(first) + u32::from(fmmu.length);
        fmmu.active
            && fmmu.reads
            && first <= MAILBOX_IN_STATUS
            && u32::from(MAILBOX_IN_STATUS) <= behind
    };
    device.fmmus.values().filter(maps).find_map(|fmmu| {
        let bits = (0..fmmu.length).flat_map(|byte| (0..8).map(move |bit| (byte, bit)));
        bits.map(|(byte, bit)| {
            (LogicalAddress(fmmu.logical_start.0.saturating_add(u32::from(byte))), bit)
        })
        .find(|(at, bit)| {
            fmmu.locate_bit(*at, *bit).is_some_and(|(register, bit)| {
                register.0 == MAILBOX_IN_STATUS && SmStatus(1 << bit).mailbox_full()
            })
        })
    })
}
