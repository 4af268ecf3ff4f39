//! SYNC0 and SYNC1 of one SubDevice: cycle, shift, start.
//!
//! The signals are switched off, set, and switched on so that the first SYNC0 falls on a multiple of
//! its cycle, plus its shift: all SubDevices then beat together, however late each was set up.
//! Reference: S2 2.15.4; ETG.2000 `OpMode`.

use linesman_config::plan::ClockSettings;
use linesman_proto::address::StationAddress;
use linesman_proto::register;
use linesman_proto::time::Span;

use super::clock;
use super::set_up::write_all;
use crate::exchange::{ExchangeError, Target};
use crate::executor::Wire;

/// From setting up to the first SYNC0 at least.
const LEAD: Span = Span::ms(20);
/// How often a start that came too late is set anew.
const ATTEMPTS: u32 = 5;

/// Sets the SyncSignals of a SubDevice; all off when its settings want none. SYNC0 falls `shift_ns` after
/// the begin of a cycle.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub(crate) async fn set(
    wire: &Wire,
    station: StationAddress,
    settings: &ClockSettings,
    shift_ns: i64,
) -> Result<(), ExchangeError> {
    let target = Target::Station(station);
    let [control, activation] = settings.assign_activate.to_le_bytes();
    let off = (register::SYNC_ACTIVATION.address, vec![0]);
    write_all(wire, target, vec![off]).await?;
    if activation == 0 {
        return Ok(());
    }
    let cycle = settings.sync0_cycle.as_nanos().max(1);
    let mut lead = LEAD.as_nanos();
    for _ in 0..ATTEMPTS {
        let now = clock::time(wire, station, &register::SYSTEM_TIME).await?;
        let first = first_after(now.wrapping_add(lead), cycle, shift_ns);
        let long = |span: Span| u32::try_from(span.as_nanos()).unwrap_or(u32::MAX);
        let writes = vec![
            (register::CYCLIC_UNIT_CONTROL.address, vec![control]),
            (register::START_TIME.address, first.to_le_bytes().to_vec()),
            (register::SYNC0_CYCLE_TIME.address, long(settings.sync0_cycle).to_le_bytes().to_vec()),
            (register::SYNC1_CYCLE_TIME.address, long(settings.sync1_cycle).to_le_bytes().to_vec()),
        ];
        write_all(wire, target, writes).await?;
        write_all(wire, target, vec![(register::SYNC_ACTIVATION.address, vec![activation])])
            .await?;
        let now = clock::time(wire, station, &register::SYSTEM_TIME).await?;
        // A start in the past comes when the clock has gone round: never.
        if now < first {
            return Ok(());
        }
        write_all(wire, target, vec![(register::SYNC_ACTIVATION.address, vec![0])]).await?;
        lead *= 4;
    }
    Ok(())
}

/// The first time from `from` on that is `shift_ns` after a multiple of `cycle`.
fn first_after(from: u64, cycle: u64, shift_ns: i64) -> u64 {
    let shift = shift_ns.rem_euclid(i64::try_from(cycle).unwrap_or(i64::MAX)).unsigned_abs();
    let base = from.saturating_sub(shift).div_ceil(cycle).saturating_mul(cycle);
    base.saturating_add(shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_start_is_on_the_grid_of_the_cycle() {
        assert_eq!(first_after(0, 1_000, 0), 0);
        assert_eq!(first_after(1, 1_000, 0), 1_000);
        assert_eq!(first_after(1_001, 1_000, 300), 1_300);
        assert_eq!(first_after(1_301, 1_000, 300), 2_300);
        // A shift before the cycle's begin is one within the cycle before.
        assert_eq!(first_after(5_000, 1_000, -200), 5_800);
        assert_eq!(first_after(5_000, 1_000, 12_300), 5_300);
    }
}
