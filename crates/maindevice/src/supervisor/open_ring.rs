//! The clocks behind the place where a ring is open: what the time has to be that frames of the second card carry.
//!
//! The reference clock gives its time in the half that its card reaches. What the copy of the second card hands round
//! comes to SubDevices by another way than the one whose delay they were told: along the ring the other way round, to
//! the break and back. Within that half nothing has changed, for frames still pass the processing units in the same
//! order; so one number is right for all of them. It is measured as delays are, by a broadcast write to 0x0900, at which
//! every processing unit latches its clock (0x0918), while clocks still agree. Until it is there, which takes a few
//! cycles, nobody there is given a time.

use linesman_proto::address::{Path, StationAddress, WorkingCounter};
use linesman_proto::register;
use linesman_proto::time::Span;

use super::{Context, clocks};
use crate::exchange::{ExchangeError, Request, Target};
use crate::executor::lock;

/// How often the ring is looked at.
const LOOK: Span = Span::ms(1);
/// When it is measured again what could not be measured.
const AGAIN: Span = Span::ms(50);

/// So often it is measured: clocks are read in steps of 10 ns, and each is off by a few of them.
const MEASUREMENTS: i64 = 4;
/// Breaks at two sides of a SubDevice make a difference of at least this, twice its delay (SYN-17: 0.3 µs of a terminal).
const SAME_BREAK: Span = Span::ns(300);

/// Keeps the clocks of both halves of an open ring in step, for as long as the network runs.
pub(super) async fn keep_in_step(context: Context) {
    let wire = &context.wire;
    // Delays are measured with its end closed by order, for a moment.
    let is_open = || {
        wire.ring_intact() == Some(false) && wire.now() >= lock(&context.device_table).opened_until
    };
    let mut known = None;
    loop {
        while !is_open() {
            wire.sleep(LOOK).await;
        }
        let (responding, told) = {
            let device_table = lock(&context.device_table);
            (device_table.responding(), device_table.delays_told)
        };
        let measured_at = wire.now();
        let measured = mean(&context).await;
        // A group that came or went at the same break changes nothing but the noise of the measurement.
        let is_noise = |old: i64, new: i64| old.abs_diff(new) < SAME_BREAK.as_nanos();
        if known.zip(measured).is_none_or(|(old, new)| !is_noise(old, new)) {
            lock(&context.device_table).set_second_card_ns(measured);
            known = measured;
        }
        let is_same = || {
            // Another break, or one of two that is mended, leaves others behind it.
            let device_table = lock(&context.device_table);
            device_table.responding() == responding
                && device_table.delays_told == told
                && (measured.is_some() || wire.now().since(measured_at) < AGAIN)
        };
        while is_open() && is_same() {
            wire.sleep(LOOK).await;
        }
        if !is_open() {
            known = None;
            let mut device_table = lock(&context.device_table);
            device_table.set_second_card_ns(None);
            device_table.far_base = None;
        }
    }
}

/// The mean of several measurements; `None` if one of them does not come off.
async fn mean(context: &Context) -> Option<i64> {
    let mut sum = 0;
    for _ in 0..MEASUREMENTS {
        sum += measure(context).await.ok()??;
    }
    Some(sum / MEASUREMENTS)
}

/// How much later, by their own clocks less their delays, SubDevices of the second card meet a frame than the
/// reference does, in ns; 0 where the reference is one of them. `None` if the reference does not answer, or nobody
/// there has a clock that was set.
async fn measure(context: &Context) -> Result<Option<i64>, ExchangeError> {
    let wire = &context.wire;
    let (reference, others) = {
        let device_table = lock(&context.device_table);
        let Some(reference) = device_table.reference_clock() else { return Ok(None) };
        let mut others = device_table.with_time_by_age();
        // Those of the others may have been told anew, and are on their way to it.
        others.sort_by_key(|station| Some(*station) != device_table.far_base);
        (reference, others)
    };
    let alone = clocks::latch_alone(context).await;
    let latch = Request::write(Target::All, register::RECEIVE_TIME.address, &[0; 4]);
    wire.ask(latch.on_quiet_line()).await?;
    let latched = |station: StationAddress, card: Path| {
        let unit = register::RECEIVE_TIME_PROCESSING_UNIT;
        wire.ask(Request::read(Target::Station(station), unit.address, unit.len).by_card(card))
    };
    let of_reference = latched(reference, Path::A);
    let asked: Vec<_> =
        others.into_iter().map(|station| (station, latched(station, Path::B))).collect();
    let of_reference = of_reference.await?;
    let mut behind = None;
    for (station, reply) in asked {
        let reply = reply.await?;
        if reply.wkc == WorkingCounter(1) {
            if station == reference {
                return Ok(Some(0));
            }
            behind = behind.or(Some((station, reply)));
        }
    }
    drop(alone);
    let Some((station, reply)) = behind.filter(|_| of_reference.wkc == WorkingCounter(1)) else {
        return Ok(None);
    };
    let read = |station: StationAddress, register: &register::Register| {
        wire.read(Target::Station(station), register.address, register.len)
    };
    let (offset, delay) = (&register::SYSTEM_TIME_OFFSET, &register::SYSTEM_TIME_DELAY);
    let asked = [read(reference, offset), read(station, offset), read(station, delay)];
    let [reference_offset, offset, delay] = asked;
    let [reference_offset, offset, delay] = [reference_offset.await?, offset.await?, delay.await?];
    if [&reference_offset, &offset, &delay].iter().any(|reply| reply.wkc != WorkingCounter(1)) {
        return Ok(None);
    }
    let its = u64::from_le_bytes(reply.bytes(0))
        .wrapping_add(u64::from_le_bytes(offset.bytes(0)))
        .wrapping_sub(u32::from_le_bytes(delay.bytes(0)).into());
    let of_reference = u64::from_le_bytes(of_reference.bytes(0))
        .wrapping_add(u64::from_le_bytes(reference_offset.bytes(0)));
    // Some clocks have the low half only.
    Ok(Some((its.wrapping_sub(of_reference) as u32 as i32).into()))
}
