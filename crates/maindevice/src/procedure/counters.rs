//! Error counters read and cleared in one go, so that no count is lost.
//!
//! Reference: S2 2.9, 0x0300 to 0x0313: a write of any value to one of a group clears the group. A
//! datagram that reads and writes brings what stood there at the moment of the clear; a read and a write
//! apart would lose what happens between them.

use linesman_proto::address::WorkingCounter;
use linesman_proto::register::ErrorCounters;

use crate::exchange::{ExchangeError, Request, Target};
use crate::executor::Wire;

/// What a read and a write of one SubDevice add to the working counter (ETG.1000.4).
const READ_AND_WRITTEN: WorkingCounter = WorkingCounter(3);

/// Reads all error counters of a SubDevice and clears them; gives what stood there.
///
/// # Errors
/// When it does not answer. It is not asked again: if only the answer got lost, what stood there is lost
/// with it, and whoever reads the counters next sees that they were cleared.
pub async fn read_and_clear(wire: &Wire, target: Target) -> Result<ErrorCounters, ExchangeError> {
    let request = Request::exchange(target, ErrorCounters::START, &[0; ErrorCounters::LEN]);
    let access = request.access();
    let reply = wire.submit(request).await?;
    if reply.wkc != READ_AND_WRITTEN {
        let (expected, received) = (READ_AND_WRITTEN, reply.wkc);
        return Err(ExchangeError::WorkingCounter { access, expected, received, frames: 1 });
    }
    Ok(ErrorCounters::from_bytes(&reply.data, ErrorCounters::START))
}
