//! The clock of one SubDevice while it runs: how far it is off the reference clock, or, of the reference
//! clock itself, how far it is off the host's (DC-09, DC-21).
//!
//! Reference: S2 2.15.2.4 (0x092C, the mean of what the loop has seen), 2.15.2.1 (0x0910).

use std::future::Future;

use linesman_config::plan::DevicePlan;
use linesman_proto::register::{self, SystemTimeDifference};
use linesman_proto::time::{DcTime, Instant, Span};

use super::Context;
use crate::event::Event;
use crate::exchange::{ExchangeError, Reply, Target};
use crate::executor::lock;

/// What has not changed is told no more often than this.
const TOLD_EVERY: Span = Span::s(1);

/// What was told of a clock last.
#[derive(Default)]
pub(super) struct WatchedClock {
    /// It has left the window, and is not well within it again.
    apart: bool,
    told_at: Option<Instant>,
}

/// What is being read of a clock.
pub(super) struct WatchedClockReading {
    is_reference: bool,
    asked_at: Instant,
}

impl WatchedClock {
    /// Queues a reading of the clock, where there is one that is in use.
    pub(super) fn look(
        &self,
        context: &Context,
        device: &DevicePlan,
    ) -> Option<
        impl Future<Output = (WatchedClockReading, Result<Reply, ExchangeError>)> + Send + 'static,
    > {
        let device_table = lock(&context.device_table);
        let is_reference = device_table.reference_clock()? == device.station;
        let is_set = device_table.has_clock_set(device.id);
        drop(device_table);
        let follows = device.settings.clock.is_some_and(|clock| clock.assign_activate != 0);
        if !is_set || !(is_reference || follows) {
            return None;
        }
        let register = match is_reference {
            true => register::SYSTEM_TIME,
            false => register::SYSTEM_TIME_DIFFERENCE,
        };
        let look = WatchedClockReading { is_reference, asked_at: context.wire.now() };
        let read =
            context.wire.read(Target::Station(device.station), register.address, register.len);
        Some(async move { (look, read.await) })
    }

    /// Tells what a reading brought, if it is news or was not told for a while.
    pub(super) fn tell(
        &mut self,
        context: &Context,
        device: &DevicePlan,
        (look, reply): (WatchedClockReading, Result<Reply, ExchangeError>),
    ) {
        let Some(reply) = reply.ok().filter(Reply::answered) else { return };
        let (wire, id) = (&context.wire, device.id);
        let now = wire.now();
        let is_due = self.told_at.is_none_or(|at| now >= at + TOLD_EVERY);
        if look.is_reference {
            if is_due {
                self.told_at = Some(now);
                // It was read somewhere between.
                let half = Span::ns(now.since(look.asked_at).as_nanos() / 2);
                let host =
                    context.options.clock_epoch.0.wrapping_add((look.asked_at + half).as_nanos());
                let network = DcTime(u64::from_le_bytes(reply.bytes(0)));
                let ahead_ns = match network.0 >> 32 {
                    // A clock of 32 bits; or one of the first four seconds, of which the same is true.
                    0 => i64::from(network.low().delta(DcTime(host).low())),
                    _ => network.0.wrapping_sub(host) as i64,
                };
                wire.emit(Event::NetworkTime { id, ahead_ns });
            }
            return;
        }
        let difference = SystemTimeDifference::from(reply.bytes(0)).magnitude();
        let window = context.plan.sync_window.unwrap_or(context.options.clock_limit);
        // At the edge of the window it is not told again and again.
        let limit = if self.apart { Span::ns(window.as_nanos() / 2) } else { window };
        let apart = difference > limit;
        if is_due || apart != self.apart {
            (self.apart, self.told_at) = (apart, Some(now));
            wire.emit(Event::ClockDifference { id, difference, window, apart });
        }
    }
}
