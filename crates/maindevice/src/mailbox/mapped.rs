//! Mailboxes that hold a message, as the cycle reads it: a bit each, mapped by an FMMU on the full
//! bit of the SyncManager of the mailbox in (0x080D bit 3).
//!
//! Where that is planned nobody has to ask each SubDevice again and again: whoever serves a mailbox
//! sleeps until its bit is seen set.

use linesman_config::plan::{Plan, Role};
use linesman_proto::address::DeviceId;
use linesman_proto::frame::builder::DatagramAddress;

use super::MailboxQueues;

/// Where the bit of one mailbox is.
#[derive(Clone, Copy, Debug)]
struct StatusBit {
    id: DeviceId,
    /// The cyclic frame, counted through all tasks, and the datagram in it.
    frame: usize,
    datagram: usize,
    /// The byte in its data, and the bit in that.
    byte: usize,
    mask: u8,
}

/// The bits of all mailboxes of a plan.
#[derive(Debug, Default)]
pub(crate) struct MailboxBits {
    places: Vec<StatusBit>,
    queues: MailboxQueues,
    /// Some bit was set the last time.
    any: bool,
}

impl MailboxBits {
    /// Those that a plan maps. Whoever serves such a mailbox listens for its bit from now on.
    pub(crate) fn new(plan: &Plan, queues: MailboxQueues) -> Self {
        let mut places = Vec::new();
        let frames = plan.tasks.iter().flat_map(|task| &task.frames).enumerate();
        for (frame, planned) in frames {
            for (datagram, one) in planned.datagrams.iter().enumerate() {
                let DatagramAddress::Logical(start) = one.address else { continue };
                if one.role != Role::MailboxStates {
                    continue;
                }
                let place = |device: &linesman_config::plan::DevicePlan| {
                    let (_, fmmu) = device.mailbox_state.as_ref()?;
                    let byte = fmmu.logical_start.0.checked_sub(start.0)? as usize;
                    let mask = 1_u8.checked_shl(fmmu.logical_start_bit.into())?;
                    let place = StatusBit { id: device.id, frame, datagram, byte, mask };
                    (byte < one.len && device.mailbox.is_some()).then_some(place)
                };
                places.extend(plan.devices.iter().filter_map(place));
            }
        }
        queues.listen(places.iter().map(|place| place.id));
        Self { places, queues, any: false }
    }

    /// What a datagram has brought: `bits` is its data.
    #[inline]
    pub(crate) fn take(&mut self, frame: usize, datagram: usize, bits: &[u8]) {
        let any = bits.iter().any(|byte| *byte != 0);
        // While all mailboxes are empty that is all there is to do.
        if any || self.any {
            self.any = any;
            self.tell(frame, datagram, bits);
        }
    }

    #[inline(never)]
    fn tell(&self, frame: usize, datagram: usize, bits: &[u8]) {
        let mine = self.places.iter().filter(|one| (one.frame, one.datagram) == (frame, datagram));
        let full =
            |place: &StatusBit| bits.get(place.byte).is_some_and(|byte| byte & place.mask != 0);
        self.queues.see(mine.map(|place| (place.id, full(place))));
    }
}
