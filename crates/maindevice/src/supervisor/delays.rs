//! Propagation delays of a line, measured again when frames may travel otherwise than before: a group came or went in the
//! midst of it, a cable was exchanged.
//!
//! Only the delays (0x0928) are written: the clocks themselves show the right time, and would be led away from it by a
//! delay that is no longer theirs. So nobody is given the time until they are measured. In a ring they are not: to measure
//! there its end has to be opened.

use std::collections::BTreeMap;

use linesman_proto::address::{StationAddress, WorkingCounter};
use linesman_proto::register;
use linesman_proto::time::Span;

use super::{Context, clocks};
use crate::exchange::Target;
use crate::executor::lock;
use crate::procedure::clock::{self, ClockError};

/// Time from one look to the next whether the line still changes.
const LOOK: Span = Span::ms(2);
/// It is measured when nothing has changed for so long.
const SETTLED: Span = Span::ms(10);
/// Something that changes all the time is measured after so long all the same.
const UNSETTLED: Span = Span::ms(200);
/// When it is measured again what could not be measured, and how often it is tried.
const AGAIN: Span = Span::ms(50);
const ATTEMPTS: u32 = 5;
/// Number of measurements that are averaged: clocks are read in steps of 10 ns, and each hop is off by a few of them.
const MEASUREMENTS: u32 = 4;
/// A smaller difference is noise of the measurement.
const NOISE: Span = Span::ns(30);

/// Signs that frames may travel otherwise: how many answer, and how often groups have left.
type Answering = (Option<WorkingCounter>, u32);

/// Measures the delays again after each change, for as long as the network runs.
pub(super) async fn keep_measured(context: Context) {
    clocks::ready(&context).await;
    let mut measured = answering(&context);
    loop {
        lock(&context.device_table).set_delays_known(true);
        loop {
            let seen = context.alerts();
            // Somebody may have gone and come between two looks.
            let is_doubtful = lock(&context.device_table).delays_known == Some(false);
            if is_doubtful || answering(&context) != measured {
                break;
            }
            context.sleep_until_alert(seen, Span::s(1)).await;
        }
        lock(&context.device_table).set_delays_known(false);
        for _ in 0..ATTEMPTS {
            measured = settled(&context).await;
            if measure(&context).await.is_ok() {
                break;
            }
            context.wire.sleep(AGAIN).await;
        }
    }
}

fn answering(context: &Context) -> Answering {
    let device_table = lock(&context.device_table);
    (device_table.responding(), device_table.groups.losses())
}

/// Waits until nothing has changed for a while.
async fn settled(context: &Context) -> Answering {
    let mut seen = answering(context);
    let mut since = context.wire.now();
    let until = since + UNSETTLED;
    while context.wire.now().since(since) < SETTLED && context.wire.now() < until {
        context.wire.sleep(LOOK).await;
        let now = answering(context);
        if now != seen {
            (seen, since) = (now, context.wire.now());
        }
    }
    seen
}

/// Measures the delays of all clocks that show the time, and tells them to those that have another one.
async fn measure(context: &Context) -> Result<(), ClockError> {
    let wire = &context.wire;
    let alone = clocks::latch_alone(context).await;
    let mut sums: BTreeMap<StationAddress, (i64, u32)> = BTreeMap::new();
    for _ in 0..MEASUREMENTS {
        for clock in clock::latch(wire, context.network).await?.clocks {
            if let Some(delay) = clock.delay {
                let (sum, times) = sums.entry(clock.station).or_default();
                *sum += delay.as_nanos() as i64;
                *times += 1;
            }
        }
    }
    drop(alone);
    let mean = |station: &StationAddress| {
        let (sum, times) = sums.get(station)?;
        (*times == MEASUREMENTS).then(|| sum / i64::from(MEASUREMENTS))
    };
    let (reference, with_time) = {
        let device_table = lock(&context.device_table);
        (device_table.reference_clock(), device_table.with_time().collect::<Vec<_>>())
    };
    // Without the reference nothing is known but differences.
    let Some(zero) = reference.as_ref().and_then(mean) else { return Ok(()) };
    let register = register::SYSTEM_TIME_DELAY;
    let asked: Vec<_> = (with_time.into_iter())
        .filter_map(|station| {
            let delay = u32::try_from(mean(&station)? - zero).ok()?;
            let told = wire.read(Target::Station(station), register.address, register.len);
            Some((station, delay, told))
        })
        .collect();
    for (station, delay, told) in asked {
        let told = told.await?;
        let is_other =
            u64::from(u32::from_le_bytes(told.bytes(0)).abs_diff(delay)) >= NOISE.as_nanos();
        if told.answered() && is_other {
            // Who does not answer is found out by its supervisor.
            let target = Target::Station(station);
            let _ = wire.write_one(target, register.address, &delay.to_le_bytes()).await;
        }
    }
    Ok(())
}
