//! The shortest cycle that a SubDevice can bear, against the one that it is planned with.
//!
//! Reference: ETG.1020, objects 0x1C32 (outputs) and 0x1C33 (inputs), subindex 05; S0 L536-542. Only whoever
//! works in step with its SyncSignals has to finish within each cycle: others take the data of the next one.

use linesman_config::plan::DevicePlan;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::sii::Protocols;
use linesman_proto::time::Span;

use super::Context;
use crate::mailbox::MailboxRequest;
use crate::procedure::state::StepError;

/// The entry with the shortest cycle in ns.
const SHORTEST_CYCLE: u8 = 5;

/// Compares them. A SubDevice that does not say how short its cycle may be is believed to bear it; it will
/// refuse by itself, or show that it cannot.
///
/// # Errors
/// [`StepError::CycleTooShort`].
pub(super) async fn compare(context: &Context, device: &DevicePlan) -> Result<(), StepError> {
    let Some(clock) = device.settings.clock.filter(|clock| clock.sync0()) else { return Ok(()) };
    let speaks =
        |mailbox: &linesman_config::profile::Mailbox| mailbox.protocols.has(Protocols::COE);
    // Without a cycle it refuses, and says so better.
    if clock.sync0_cycle == Span::ZERO || !device.mailbox.as_ref().is_some_and(speaks) {
        return Ok(());
    }
    let has_outputs = !device.outputs.is_empty();
    let index = if has_outputs { ObjectIndex::OUTPUT_SYNC } else { ObjectIndex::INPUT_SYNC };
    let object = ObjectAddress::new(index.0, SHORTEST_CYCLE);
    let request = MailboxRequest::Upload { object, complete: false };
    let Ok(data) = context.mailboxes.ask(device.id, request).await else { return Ok(()) };
    guard(clock.sync0_cycle, object, &data)
}

/// Holds a cycle against the answer of the SubDevice to `object`; 0 is none.
fn guard(cycle: Span, object: ObjectAddress, data: &[u8]) -> Result<(), StepError> {
    let mut bytes = [0; 4];
    bytes.iter_mut().zip(data).for_each(|(byte, came)| *byte = *came);
    let shortest = Span::ns(u64::from(u32::from_le_bytes(bytes)));
    match cycle < shortest {
        true => Err(StepError::CycleTooShort { cycle, shortest, object }),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::DeviceId;
    use linesman_proto::register::AlStatus;
    use linesman_proto::state::AlState;

    use super::*;
    use crate::event::Event;

    const OBJECT: ObjectAddress =
        ObjectAddress { index: ObjectIndex::OUTPUT_SYNC, subindex: SHORTEST_CYCLE };

    // proves: SYN-25
    #[test]
    fn cycle_below_the_shortest_is_refused_with_a_slower_task_as_advice() {
        let shortest = 150_000u32.to_le_bytes();
        for cycle in [Span::us(150), Span::ms(10)] {
            assert!(guard(cycle, OBJECT, &shortest).is_ok(), "{cycle}");
        }
        // It does not know yet, or does not say.
        assert!(guard(Span::us(50), OBJECT, &[0; 4]).is_ok());
        assert!(guard(Span::us(50), OBJECT, &[]).is_ok());
        let refused = guard(Span::us(125), OBJECT, &shortest);
        let Err(StepError::CycleTooShort { cycle, shortest, object }) = refused else {
            panic!("{refused:?}")
        };
        assert_eq!((cycle, shortest), (Span::us(125), Span::us(150)));
        let status = AlStatus(2);
        let (id, to) = (DeviceId(0), AlState::SafeOp);
        let event = Event::CycleTooShort { id, to, status, cycle, shortest, object };
        let lines = event.state_lines(|_| "S".to_owned());
        for words in ["every 125 µs", "150 µs", "0x1C32:05", "cycle_us = 150"] {
            assert!(lines[1].contains(words), "{words}: {lines:?}");
        }
    }
}
