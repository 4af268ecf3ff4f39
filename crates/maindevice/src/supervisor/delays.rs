//! Propagation delays of a line, measured again when frames may travel otherwise than before: a group came or went in the
//! midst of it, a cable was exchanged, a ring is whole again.
//!
//! Only the delays (0x0928) are written: the clocks themselves show the right time, and would be led away from it by a
//! delay that is no longer theirs. So nobody is given the time until they are measured.
//!
//! In an open ring each half is measured for itself. What has changed in the half of the reference is not known to the other one:
//! there the clock that was set first keeps its delay, and what is wrong with that is in the number that frames of the second card add
//! ([`super::open_ring`]). When the ring is whole again all are measured from the reference.

use std::collections::BTreeMap;

use linesman_proto::address::{Path, StationAddress, WorkingCounter};
use linesman_proto::register;
use linesman_proto::time::Span;

use super::{Context, clocks};
use crate::exchange::{ExchangeError, Target};
use crate::executor::lock;
use crate::procedure::clock::ClockError;

/// Time from one look to the next whether the line still changes.
const LOOK: Span = Span::ms(2);
/// Frames that are lost one by one make the number of answers dip for no longer than this.
const DIP: Span = Span::ms(4);
/// It is measured when nothing has changed for so long.
const SETTLED: Span = Span::ms(10);
/// Something that changes all the time is measured after so long all the same.
const UNSETTLED: Span = Span::ms(200);
/// When it is measured again what could not be measured, and how often it is tried.
const AGAIN: Span = Span::ms(50);
const ATTEMPTS: u32 = 5;
/// Number of measurements that are averaged: clocks are read in steps of 10 ns, and each hop is off by a few of them.
const MEASUREMENTS: u32 = 4;
/// Measurements of one line are no further apart, in ns.
const MIXED: i64 = 200;
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
        // A frame that was lost, and the next one counts as many as before: everybody is where he was.
        context.wire.sleep(DIP).await;
        let mut is_due = take_ring_mended(&context);
        if !is_due && answering(&context) == measured {
            continue;
        }
        for _ in 0..ATTEMPTS {
            let now = settled(&context).await;
            is_due |= take_ring_mended(&context) || now != measured;
            measured = now;
            if !is_due || measure(&context, measured).await.is_ok() {
                break;
            }
            context.wire.sleep(AGAIN).await;
        }
    }
}

/// True if the ring has become whole since this was asked.
fn take_ring_mended(context: &Context) -> bool {
    std::mem::take(&mut lock(&context.device_table).ring_mended)
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

/// Measures the delays of all clocks that show the time, and tells them to those that have another one, if the line is still the one
/// that was `settled`.
async fn measure(context: &Context, settled: Answering) -> Result<(), ClockError> {
    // By place: who comes first in processing order comes first.
    let mut sums: Vec<Sum> = Vec::new();
    for latch in clocks::latch(context, MEASUREMENTS).await? {
        for clock in latch.clocks {
            let Some(delay) = clock.delay else { continue };
            let known = sums.iter().position(|sum| sum.station == clock.station);
            let at = known.unwrap_or_else(|| {
                sums.push(Sum::new(clock.station, clock.card));
                sums.len() - 1
            });
            sums[at].add(delay.as_nanos() as i64);
        }
    }
    if answering(context) != settled || sums.iter().any(Sum::is_mixed) {
        return Err(ClockError::LineChanged);
    }
    let (reference, with_time) = {
        let device_table = lock(&context.device_table);
        (device_table.reference_clock(), device_table.with_time_by_age())
    };
    let by_age: BTreeMap<StationAddress, usize> =
        with_time.into_iter().enumerate().map(|(age, station)| (station, age)).collect();
    let is_of_use = |sum: &&Sum| sum.times == MEASUREMENTS && by_age.contains_key(&sum.station);
    let Some(reference) = reference else { return Ok(()) };
    for card in Path::ALL {
        let half: Vec<&Sum> =
            sums.iter().filter(is_of_use).filter(|sum| sum.card == card).collect();
        let base = half.iter().find(|sum| sum.station == reference);
        let oldest = || half.iter().min_by_key(|sum| by_age.get(&sum.station));
        let base = base.or_else(oldest);
        if let Some(base) = base {
            tell(context, reference, base, &half).await?;
        }
    }
    Ok(())
}

/// Delays of one clock added up.
struct Sum {
    station: StationAddress,
    card: Path,
    ns: i64,
    times: u32,
    least: i64,
    most: i64,
}

impl Sum {
    const fn new(station: StationAddress, card: Path) -> Self {
        Self { station, card, ns: 0, times: 0, least: i64::MAX, most: i64::MIN }
    }

    fn add(&mut self, ns: i64) {
        self.ns += ns;
        self.times += 1;
        (self.least, self.most) = (self.least.min(ns), self.most.max(ns));
    }

    /// True if it is of before and after a change.
    const fn is_mixed(&self) -> bool {
        self.times == MEASUREMENTS && self.most - self.least > MIXED
    }

    const fn mean(&self) -> i64 {
        self.ns / MEASUREMENTS as i64
    }
}

/// Tells the clocks of a line, or of half an open ring, their delays; that of `base` stays.
async fn tell(
    context: &Context,
    reference: StationAddress,
    base: &Sum,
    half: &[&Sum],
) -> Result<(), ExchangeError> {
    let wire = &context.wire;
    let register = register::SYSTEM_TIME_DELAY;
    let asked: Vec<_> = (half.iter())
        .map(|sum| {
            let target = Target::Station(sum.station);
            (*sum, wire.read(target, register.address, register.len))
        })
        .collect();
    let mut told = Vec::with_capacity(asked.len());
    for (sum, reply) in asked {
        let reply = reply.await?;
        if reply.answered() {
            told.push((sum, u32::from_le_bytes(reply.bytes(0))));
        }
    }
    let of_base = told.iter().find(|(sum, _)| sum.station == base.station);
    let zero = match of_base {
        _ if base.station == reference => 0,
        Some((_, delay)) => i64::from(*delay),
        None => return Ok(()),
    };
    let mut is_other = false;
    for (sum, before) in told {
        // Who comes before the reference never sees its time.
        let Ok(delay) = u32::try_from(zero + sum.mean() - base.mean()) else { continue };
        if u64::from(before.abs_diff(delay)) >= NOISE.as_nanos() {
            // Who does not answer is found out by its supervisor.
            let target = Target::Station(sum.station);
            let _ = wire.write_one(target, register.address, &delay.to_le_bytes()).await;
            is_other = true;
        }
    }
    if is_other {
        let mut device_table = lock(&context.device_table);
        device_table.delays_told += 1;
        if base.station != reference {
            // What frames of the second card add is measured at this clock from now on.
            device_table.far_base = Some(base.station);
        }
    }
    Ok(())
}
