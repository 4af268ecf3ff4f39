//! Clearing error counters of a SubDevice while others read them.

use std::sync::Mutex;

use linesman_proto::address::DeviceId;
use linesman_proto::register::ErrorCounters;

use super::DeviceTable;
use crate::event::Event;
use crate::exchange::{ExchangeError, Target};
use crate::executor::{Wire, lock};
use crate::procedure;

/// Reads and clears the error counters of a SubDevice, and tells what stood there. A reading that is under way meanwhile
/// may be from before the clear: [`DeviceTable::clears`] tells.
pub(crate) async fn clear(
    wire: &Wire,
    device_table: &Mutex<DeviceTable>,
    id: DeviceId,
    target: Target,
) -> Result<ErrorCounters, ExchangeError> {
    lock(device_table).note_clear(id);
    let result = procedure::counters::read_and_clear(wire, target).await;
    lock(device_table).note_clear(id);
    let counters = result?;
    wire.emit(Event::CountersCleared { id, counters });
    Ok(counters)
}
