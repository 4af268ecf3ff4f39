//! Rounds: AL status of all SubDevices by one broadcast read, and their error counters, at intervals.
//!
//! Most MainDevices watch a line so: only when the states together are not as they should be, or fewer answer than
//! there are, they read each SubDevice, which the supervisors do here.

use std::sync::atomic::Ordering;

use linesman_config::plan::DevicePlan;
use linesman_proto::register::{self, ErrorCounters};
use linesman_proto::state::AlState;

use super::Context;
use crate::event::Event;
use crate::exchange::{Reply, Target};
use crate::executor::lock;
use crate::options::{CounterPoll, Rounds};

/// Length of the counters of the ports in bytes, 0x0300 to 0x0307.
const OF_PORTS: u16 = 8;

/// State and error bit of AL status, in its first byte.
const STATE_AND_ERROR: u8 = 0x1F;

/// Makes rounds; never ends.
pub(super) async fn make(context: Context, rounds: Rounds) {
    let mut known = vec![None; context.plan.devices.len()];
    loop {
        context.wire.sleep(context.options.watch_interval).await;
        let status = register::AL_STATUS;
        let read = context.wire.read(Target::All, status.address, status.len).await;
        let wanted = lock(&context.device_table).all_expected();
        if !read.is_ok_and(|reply| is_as_wanted(&reply, &wanted)) {
            context.bad_rounds.fetch_add(1, Ordering::Relaxed);
            lock(&context.device_table).alert();
        }
        match rounds.counters {
            CounterPoll::None => {}
            CounterPoll::Read => counters(&context, ErrorCounters::LEN as u16, &mut known).await,
            CounterPoll::ReadAndCleared => {
                counters(&context, OF_PORTS, &mut known).await;
                let zeros = [0; OF_PORTS as usize];
                // Whether it was taken, the next round tells.
                let _ = context.wire.write(Target::All, ErrorCounters::START, &zeros).await;
            }
        }
    }
}

/// Whether all have answered, and are together in the states that are wanted of them, without error.
fn is_as_wanted(reply: &Reply, wanted: &[AlState]) -> bool {
    let [status] = reply.bytes(0);
    let states = wanted.iter().fold(0, |bits, state| bits | state.bits());
    usize::from(reply.wkc.0) == wanted.len() && status & STATE_AND_ERROR == states
}

/// Reads error counters of all that are there, and tells those that have changed.
async fn counters(context: &Context, len: u16, known: &mut [Option<ErrorCounters>]) {
    let is_there = |device: &&DevicePlan| lock(&context.device_table).is_there(device.id);
    let there = context.plan.devices.iter().filter(is_there);
    let read = |device: &DevicePlan| {
        let target = Target::Station(device.station);
        (device.id, context.wire.read(target, ErrorCounters::START, len))
    };
    let reading: Vec<_> = there.map(read).collect();
    for (id, reply) in reading {
        let Some(reply) = reply.await.ok().filter(Reply::answered) else { continue };
        let counters = ErrorCounters::from_bytes(&reply.data, ErrorCounters::START);
        let Some(before) = known.get_mut(id.index()) else { continue };
        if before.replace(counters) != Some(counters) {
            context.wire.emit(Event::Counters { id, counters });
        }
    }
}
