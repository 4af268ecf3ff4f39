//! A bridge whose two sides are SubDevices of two segments: one device in two networks.
//!
//! It takes the times of both at the same moment, tells each side how far the other one's is ahead, and passes on user data.
//! The one setting that an EL6692 takes on its primary side, who leads (0x10F5:01), the secondary side fetches.
//! Reference: S0 L842-907.

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use super::Segment;
use crate::device::SignalId;

/// Object of the choice which side sets the pace.
const SYNC_SETTING: ObjectAddress = ObjectAddress { index: ObjectIndex(0x10F5), subindex: 1 };

/// The two sides of a bridge, each a SubDevice of its segment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BridgedSides {
    /// The primary side, on an E-bus.
    pub primary: DeviceId,
    /// The secondary side, on a cable.
    pub secondary: DeviceId,
    /// The direction is set on the primary side alone (EL6692).
    pub fetches_direction: bool,
}

impl BridgedSides {
    /// Exchanges times and user data at one moment: both segments have to have advanced to the same one.
    pub fn exchange(&self, primary: &mut Segment, secondary: &mut Segment) {
        let now = primary.now;
        let time = |segment: &Segment, side: DeviceId| {
            let side = segment.controller(side).filter(|side| side.is_powered());
            side.map(|side| side.system_time(now))
        };
        let times = [time(primary, self.primary), time(secondary, self.secondary)];
        let ahead = match times {
            [Some(here), Some(there)] => Some(there.wrapping_sub(here) as i64),
            _ => None,
        };
        tell(primary, self.primary, ahead);
        tell(secondary, self.secondary, ahead.map(i64::wrapping_neg));
        pass_on(primary, self.primary, secondary, self.secondary);
        pass_on(secondary, self.secondary, primary, self.primary);
        if self.fetches_direction
            && let Some(side) = primary.controller(self.primary)
            && let Some(setting) = side.object_number(SYNC_SETTING)
            && let Some(node) = secondary.node(self.secondary)
        {
            secondary.world.nodes[node].controller.set_object_number(SYNC_SETTING, setting);
        }
    }
}

/// The signal behind those of user data says how far the time of the other side is ahead, in ns. What is beyond its 32 bits no
/// side can tell.
fn tell(segment: &mut Segment, side: DeviceId, ahead: Option<i64>) {
    let Some(signal) = segment.inputs(side).last().copied() else { return };
    match ahead.and_then(|ahead| i32::try_from(ahead).ok()) {
        Some(ahead) => segment.signals_mut().set(signal, ahead),
        None => segment.signals_mut().release(signal),
    }
}

/// User data.
fn pass_on(from: &Segment, side: DeviceId, to: &mut Segment, other: DeviceId) {
    let outputs = from.outputs(side).iter().map(|signal| from.signals().driven(*signal));
    let taken: Vec<(SignalId, Option<i32>)> =
        to.inputs(other).iter().copied().zip(outputs).collect();
    for (signal, value) in taken {
        match value {
            Some(value) => to.signals_mut().set(signal, value),
            None => to.signals_mut().release(signal),
        }
    }
}
