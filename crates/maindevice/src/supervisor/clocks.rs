//! The clocks of a network: who is the reference, when they are set, whether they follow.

use std::sync::{Arc, Mutex};

use linesman_config::plan::{ClockSettings, Plan, Role};
use linesman_proto::address::{DeviceId, Position, StationAddress};
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::Port;
use linesman_proto::register::{self, DlControl, LoopMode};
use linesman_proto::time::Span;

use super::times::Phase;
use super::{Context, DeviceTable};
use crate::event::Event;
use crate::exchange::Target;
use crate::executor::{Wire, lock};
use crate::procedure::clock::{self, ClockError, Latch, SeenClock};
use crate::procedure::state::StepError;

/// A ring that is opened for a measurement is closed again by then, at the latest.
const OPENED: Span = Span::s(1);
/// And frames have shown by then that it is.
const SEEN: Span = Span::ms(20);
/// How often it is looked whether another one has done with latching.
const LATCH_LOOK: Span = Span::us(500);
/// How often a clock that settles is looked at.
const LOOK: Span = Span::ms(2);

/// Whether the plan makes use of clocks at all.
pub(super) fn wanted(plan: &Plan) -> bool {
    reference_in_frames(plan).is_some()
        || plan.devices.iter().any(|device| device.settings.clock.is_some())
}

/// The SubDevice whose time the cyclic frames distribute.
fn reference_in_frames(plan: &Plan) -> Option<DeviceId> {
    let (.., datagram) = plan.datagrams().find(|(.., one)| one.role == Role::ReferenceClock)?;
    let DatagramAddress::Physical(adp, _) = datagram.address else { return None };
    let at = match datagram.command.increments_position() {
        true => usize::from(Position::from_auto_increment(adp).0),
        false => plan.devices.iter().position(|device| device.station.0 == adp)?,
    };
    plan.devices.get(at).map(|device| device.id)
}

/// Who is to be the reference clock: whom the cyclic frames name, else whom the user chose, else the
/// first that has a clock.
fn choose(plan: &Plan, clocks: &[SeenClock]) -> Result<StationAddress, ClockError> {
    let chosen = |settings: &Option<ClockSettings>| settings.is_some_and(|it| it.reference);
    let by_user = || plan.devices.iter().find(|device| chosen(&device.settings.clock));
    let named = reference_in_frames(plan).and_then(|id| plan.device(id)).or_else(by_user);
    let is_there = |station| clocks.iter().any(|it| it.has_clock && it.station == station);
    match named {
        Some(device) if is_there(device.station) => Ok(device.station),
        Some(_) => Err(ClockError::NoReference(
            "the SubDevice chosen for it has no clock, or does not answer; choose another one",
        )),
        None => {
            let first = clocks.iter().find(|clock| clock.has_clock).map(|clock| clock.station);
            first.ok_or(ClockError::NoReference("no SubDevice has distributed clocks"))
        }
    }
}

/// Sets the clocks of all that are there, and compensates their drift.
pub(super) async fn set_all(context: &Context) {
    let began = context.wire.now();
    let outcome = set(context, None).await;
    tell(context, &outcome);
    if let Ok(reference) = outcome {
        let frames = context.options.drift_frames;
        let is_led = context.is_led_at_once();
        clock::compensate(&context.wire, reference, frames, is_led, || context.epoch()).await;
    }
    context.note(Phase::Clocks, began);
    lock(&context.device_table).set_clocks_ready();
}

/// Waits until the clocks of the network have been set for the first time.
pub(super) async fn ready(context: &Context) {
    loop {
        let seen = context.alerts();
        if lock(&context.device_table).are_clocks_ready() {
            return;
        }
        context.sleep_until_alert(seen, LOOK).await;
    }
}

fn tell(context: &Context, outcome: &Result<StationAddress, ClockError>) {
    context.wire.emit(match outcome {
        Ok(reference) => Event::ClocksSet { reference: *reference },
        Err(error) => Event::ClocksNotSet { error: error.clone() },
    });
}

/// The right to latch receive times, as long as it is kept.
pub(super) struct LatchRight(Arc<Mutex<DeviceTable>>);

impl Drop for LatchRight {
    fn drop(&mut self) {
        lock(&self.0).is_latching = false;
    }
}

/// Waits until nobody else latches receive times: what one has latched, another one would latch anew before it is read.
pub(super) async fn latch_alone(context: &Context) -> LatchRight {
    while std::mem::replace(&mut lock(&context.device_table).is_latching, true) {
        context.wire.sleep(LATCH_LOOK).await;
    }
    LatchRight(Arc::clone(&context.device_table))
}

/// Latches receive times `times` times, while nobody else does. A whole ring whose ports do not keep the times of both copies of a
/// frame is open for as long as that takes.
///
/// # Errors
/// [`ClockError`] of the first that failed; the ring is closed again then, too.
pub(super) async fn latch(context: &Context, times: u32) -> Result<Vec<Latch>, ClockError> {
    let wire = &context.wire;
    let _alone = latch_alone(context).await;
    let first = clock::latch(wire, context.network).await;
    let needs_open = matches!(first, Err(ClockError::OneWay { .. } | ClockError::Delay(_)));
    let opened = if needs_open { open_ring(context).await? } else { None };
    let mut latches = Vec::new();
    let outcome = match (first, opened) {
        (Err(error), None) => Err(error),
        (first, _) => {
            latches.extend(first);
            latch_until(context, &mut latches, times).await
        }
    };
    if let Some((station, control)) = opened {
        let bytes = control.to_bytes();
        let _ = wire.write_one(station, register::DL_CONTROL.address, &bytes).await;
        lock(&context.device_table).opened_until = wire.now() + SEEN;
    }
    outcome.map(|()| latches)
}

/// Latches until there are so many.
async fn latch_until(
    context: &Context,
    latches: &mut Vec<Latch>,
    times: u32,
) -> Result<(), ClockError> {
    while latches.len() < times as usize {
        latches.push(clock::latch(&context.wire, context.network).await?);
    }
    Ok(())
}

/// Sets the clocks of all, or of one that came back later.
async fn set(context: &Context, one: Option<DeviceId>) -> Result<StationAddress, ClockError> {
    let wire = &context.wire;
    let latched = latch(context, 1).await?.pop();
    let Some(Latch { at, clocks }) = latched else { return Err(ClockError::LineChanged) };
    for clock in clocks.iter().filter(|clock| !clock.has_clock) {
        let planned = context.plan.devices.iter().find(|device| device.station == clock.station);
        if let Some(device) = planned {
            lock(&context.device_table).note_lacks_clock(device.id);
        }
    }
    let epoch = context.epoch();
    let reference = choose(&context.plan, &clocks)?;
    let found = |clock: &&SeenClock| clock.station == reference;
    let of_reference = clocks.iter().find(found).cloned();
    let of_reference = of_reference.ok_or(ClockError::NoReference("it does not answer"))?;
    let newcomer = one.and_then(|id| Some((id, context.plan.device(id)?.station)));
    let newcomer = newcomer.and_then(|(id, station)| {
        let clock = clocks.iter().find(|clock| clock.has_clock && clock.station == station)?;
        (clock.card != of_reference.card).then_some((id, clock))
    });
    if let Some((id, clock)) = newcomer {
        let by_host = epoch.0.wrapping_add(at.as_nanos());
        set_beside(context, id, clock, &clocks, by_host).await?;
        return Ok(reference);
    }
    let zero = of_reference.delay.unwrap_or_default();
    // Who comes before the reference never sees its time.
    let behind = |clock: &SeenClock| {
        clock.delay.filter(|delay| *delay >= zero).map(|delay| delay.saturating_sub(zero))
    };
    // The reference shows the MainDevice's time, unless it runs already, or others have run on without it.
    let is_set = |clock: &&SeenClock| {
        let planned = context.plan.devices.iter().find(|device| device.station == clock.station);
        clock.has_clock
            && planned.is_some_and(|device| lock(&context.device_table).has_clock_set(device.id))
    };
    let source = match one {
        None => None,
        Some(_) if is_set(&&of_reference) => Some((&of_reference, Span::default())),
        Some(_) => (clocks.iter().filter(is_set)).find_map(|clock| Some((clock, behind(clock)?))),
    };
    let by_host = epoch.0.wrapping_add(at.as_nanos());
    let time = match source {
        None => by_host,
        Some((clock, behind)) => {
            time_at_latch(wire, clock, by_host).await?.wrapping_sub(behind.as_nanos())
        }
    };
    let setting: Vec<_> = (context.plan.devices.iter())
        .filter(|device| one.is_none_or(|one| one == device.id))
        .filter(|device| lock(&context.device_table).is_there(device.id))
        .filter_map(|device| {
            let station = device.station;
            let clock = clocks.iter().find(|clock| clock.has_clock && clock.station == station)?;
            let delay = behind(clock)?;
            let offset = time.wrapping_add(delay.as_nanos()).wrapping_sub(clock.latched);
            let (wire, id) = (wire.clone(), device.id);
            let setting = async move { clock::set(&wire, station, offset, delay).await };
            Some((id, clock.is_wide, context.wire.spawn(setting)))
        })
        .collect();
    for (id, is_wide, set) in setting {
        // Who does not answer is found out by its supervisor.
        if set.await.is_ok() {
            lock(&context.device_table).set_clock(id, is_wide);
            wire.emit(Event::ClockSet { id, is_wide });
        }
    }
    // The cycle follows from now on. It begins anew with the reference alone: who else comes back follows that.
    let planned = context.plan.devices.iter().find(|device| device.station == reference);
    let id = planned.map(|device| device.id);
    let mut device_table = lock(&context.device_table);
    let is_new = device_table.reference_clock() != Some(reference);
    device_table.set_reference_clock(reference, id);
    if is_new || one.is_none() || one == id {
        device_table.set_clock_epoch(epoch);
    }
    drop(device_table);
    Ok(reference)
}

/// The time that a clock which is set showed when it was latched; `by_host` is nearly the same time.
async fn time_at_latch(wire: &Wire, clock: &SeenClock, by_host: u64) -> Result<u64, ClockError> {
    let offset = clock::time(wire, clock.station, &register::SYSTEM_TIME_OFFSET).await?;
    let time = offset.wrapping_add(clock.latched);
    // Some clocks have the low half only; the other one is that of the time nearby.
    let off = time.wrapping_sub(by_host) as u32 as i32;
    Ok(by_host.wrapping_add_signed(off.into()))
}

/// Sets the clock of one that came back behind the place where the ring is open, where the reference is not. Frames pass
/// the processing units there in the same order as in the whole ring: time and delay follow from those of another
/// SubDevice of that half.
async fn set_beside(
    context: &Context,
    id: DeviceId,
    clock: &SeenClock,
    clocks: &[SeenClock],
    by_host: u64,
) -> Result<(), ClockError> {
    let wire = &context.wire;
    let with_time: Vec<StationAddress> = lock(&context.device_table).with_time().collect();
    let is_beside = |other: &&SeenClock| {
        other.card == clock.card
            && other.station != clock.station
            && with_time.contains(&other.station)
    };
    let beside = clocks.iter().filter(is_beside);
    let beside = beside.clone().find_map(|other| Some((other, other.delay?)));
    let nobody = ClockError::NoReference("nobody in its half of the open ring shows the time");
    let ((other, delay), own_delay) = beside.zip(clock.delay).ok_or(nobody)?;
    let later = (own_delay.as_nanos() as i64).wrapping_sub(delay.as_nanos() as i64);
    let time = time_at_latch(wire, other, by_host).await?.wrapping_add_signed(later);
    let offset = time.wrapping_sub(clock.latched);
    let told = register::SYSTEM_TIME_DELAY;
    let reply = wire.read_one(Target::Station(other.station), told.address, told.len).await?;
    let told = i64::from(u32::from_le_bytes(reply.bytes(0)));
    let delay = Span::ns(told.saturating_add(later).max(0).unsigned_abs());
    clock::set(wire, clock.station, offset, delay).await?;
    lock(&context.device_table).set_clock(id, clock.is_wide);
    wire.emit(Event::ClockSet { id, is_wide: clock.is_wide });
    Ok(())
}

/// Opens a whole ring whose ports do not keep the times of both copies of a frame: the last port is closed for as long as the
/// measurement takes, so that frames come back to the ports they left by. Gives who it was and how its ports were.
async fn open_ring(context: &Context) -> Result<Option<(Target, DlControl)>, ClockError> {
    let wire = &context.wire;
    if wire.ring_intact() != Some(true) {
        return Ok(None);
    }
    let closes_at: Option<(usize, Port)> = context.plan.tree.closes_at();
    let Some((node, port)) = closes_at else { return Ok(None) };
    let Some(device) = context.plan.devices.get(node) else { return Ok(None) };
    let target = Target::Station(device.station);
    let control = register::DL_CONTROL;
    let reply = wire.read_one(target, control.address, control.len).await?;
    let before = DlControl::from_bytes(reply.bytes(0));
    let closed = before.with_loop_mode(port, LoopMode::Closed).to_bytes();
    lock(&context.device_table).opened_until = wire.now() + OPENED;
    wire.write_one(target, control.address, &closed).await?;
    Ok(Some((target, before)))
}

/// Sets the clock of one SubDevice that came back without it.
pub(super) async fn set_one(context: &Context, id: DeviceId) {
    let is_done = {
        let device_table = lock(&context.device_table);
        device_table.has_clock_set(id) || device_table.lacks_clock(id)
    };
    if is_done || !wanted(&context.plan) {
        return;
    }
    let outcome = set(context, Some(id)).await;
    if outcome.is_err() {
        tell(context, &outcome);
    }
}

/// Waits until the clock of a SubDevice follows the reference.
///
/// # Errors
/// [`StepError::ClockOff`] when it does not in time.
pub(super) async fn settle(context: &Context, id: DeviceId) -> Result<(), StepError> {
    let Some(device) = context.plan.device(id) else { return Ok(()) };
    if device.settings.clock.is_none_or(|clock| clock.assign_activate == 0) {
        return Ok(());
    }
    let (most, patience) = (context.options.clock_limit, context.options.clock_patience);
    // Whoever is out of the window in OP is told of: it does not begin there.
    let limit = context.plan.sync_window.map_or(most, |window| window.min(most));
    let until = context.wire.now() + patience;
    loop {
        let difference = clock::difference(&context.wire, device.station).await?;
        if difference <= limit {
            return Ok(());
        }
        if context.wire.now() >= until {
            return Err(StepError::ClockOff { difference, limit, patience });
        }
        context.wire.sleep(LOOK).await;
    }
}
