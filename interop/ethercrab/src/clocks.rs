//! Clocks aligned and SubDevices in step with SYNC0, by ethercrab; `interop/soem_clocks.py` says what is printed.

use std::time::Duration;

use anyhow::{Result, anyhow};
use ethercrab::subdevice_group::DcConfiguration;
use ethercrab::std::ethercat_now;
use ethercrab::DcSync;
use serde_json::json;

use crate::{IMAGE_MAX, SUBDEVICES_MAX};

/// How often the reference's time is sent before SYNC0 is switched on.
const ALIGNING: usize = 15_000;
/// Registers: delay, difference, speed counter difference.
const DELAY: u16 = 0x0928;
const DIFFERENCE: u16 = 0x092C;
const SPEED: u16 = 0x0932;
/// Modes that a SubDevice with inputs knows; bit 2 is SYNC0.
const MODES: (u16, u8) = (0x1C33, 4);

/// Aligns, goes to OP in step, tells how far the clocks are off.
pub(crate) async fn run(
    interface: &str,
    cycles: u64,
    cycle: Duration,
    sync0_period: Duration,
) -> Result<()> {
    let failed = |what: &'static str| move |error| anyhow!("{what}: {error:?}");
    let maindevice = crate::open(interface)?;
    let mut group = maindevice
        .init_single_group::<SUBDEVICES_MAX, IMAGE_MAX>(ethercat_now)
        .await
        .map_err(failed("scan"))?;
    for mut subdevice in group.iter_mut(&maindevice) {
        let modes = subdevice.sdo_read::<u16>(MODES.0, MODES.1).await.unwrap_or(0);
        subdevice.set_dc_sync(if modes & 0x04 != 0 { DcSync::Sync0 } else { DcSync::Disabled });
    }
    let group = group.into_pre_op_pdi(&maindevice).await.map_err(failed("process data"))?;
    for _ in 0..ALIGNING {
        group.tx_rx_sync_system_time(&maindevice).await.map_err(failed("aligning"))?;
    }
    // A quarter of a cycle ahead of SYNC0.
    let start_delay = Duration::from_millis(200);
    let configuration = DcConfiguration { start_delay, sync0_period, sync0_shift: sync0_period / 4 };
    let group = group
        .configure_dc_sync(&maindevice, configuration)
        .await
        .map_err(failed("switching SYNC0 on"))?;
    let group = group.into_safe_op(&maindevice).await.map_err(failed("on the way to SAFEOP"))?;
    let group = group.request_into_op(&maindevice).await.map_err(failed("on the way to OP"))?;
    let mut tries = 0;
    while !group.tx_rx_dc(&maindevice).await.is_ok_and(|answer| answer.all_op()) {
        tries += 1;
        if tries > 1_000 {
            return Err(anyhow!("OP is not reached after {tries} exchanges"));
        }
        smol::Timer::after(cycle).await;
    }
    let (mut wkc, mut complete) = (0, 0_u64);
    let mut all_op = false;
    for _ in 0..cycles {
        if let Ok(answer) = group.tx_rx_dc(&maindevice).await {
            if answer.working_counter > wkc {
                (wkc, complete) = (answer.working_counter, 0);
            }
            complete += u64::from(answer.working_counter == wkc);
            all_op = answer.all_op();
        }
        smol::Timer::after(cycle).await;
    }
    let (mut clocked, mut after) = (Vec::new(), Vec::new());
    let (mut delays, mut speeds) = (Vec::new(), Vec::new());
    for (position, subdevice) in group.iter(&maindevice).enumerate() {
        let Ok(difference) = subdevice.register_read::<u32>(DIFFERENCE).await else { continue };
        if !clocked.is_empty() {
            after.push(difference & 0x7FFF_FFFF);
        }
        clocked.push(position);
        delays.push(subdevice.register_read::<u32>(DELAY).await.map_err(failed("delay"))?);
        speeds.push(subdevice.register_read::<u16>(SPEED).await.map_err(failed("speed"))?);
    }
    let result = json!({
        "clocked": clocked,
        "after": after,
        "delays": delays,
        "speeds": speeds,
        "state": if all_op { "OP" } else { "other" },
        "cycles": cycles,
        "complete": complete,
    });
    println!("{result}");
    Ok(())
}
