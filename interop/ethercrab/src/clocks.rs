//! Clocks aligned and SubDevices in step with SYNC0; `interop/soem_clocks.py` says what is told of them.

use std::time::Duration;

use anyhow::{Result, anyhow};
use ethercrab::subdevice_group::{DcConfiguration, HasDc, Op};
use ethercrab::{DcSync, MainDevice};
use serde_json::{Value, json};

use crate::rounds::{self, Asked, Seen};
use crate::{Group, failed};

/// How often the reference's time is sent before SYNC0 is switched on.
const ALIGNING: usize = 8_000;
/// Registers: delay, difference, speed counter difference.
const DELAY: u16 = 0x0928;
const DIFFERENCE: u16 = 0x092C;
const SPEED: u16 = 0x0932;
/// Modes that a SubDevice with inputs knows; bit 2 is SYNC0. And the one in force.
const MODES: (u16, u8) = (0x1C33, 4);

/// Aligns, goes to OP in step, exchanges the rounds, tells how far the clocks are off.
pub(crate) async fn run(interface: &str, asked: &Asked, sync0_period: Duration) -> Result<()> {
    let maindevice = &crate::open(interface)?;
    let mut group = crate::scan(maindevice).await?;
    let found = rounds::found(&group, maindevice);
    rounds::be_patient(&group, maindevice).await?;
    let mut in_step = Vec::new();
    for (position, mut subdevice) in group.iter_mut(maindevice).enumerate() {
        let modes = subdevice.sdo_read::<u16>(MODES.0, MODES.1).await.unwrap_or(0);
        let knows_sync0 = modes & 0x04 != 0;
        subdevice.set_dc_sync(if knows_sync0 { DcSync::Sync0 } else { DcSync::Disabled });
        in_step.extend(knows_sync0.then_some(position));
    }
    let group = group.into_pre_op_pdi(maindevice).await.map_err(failed("process data"))?;
    for _ in 0..ALIGNING {
        // One that is lost on a busy host is no matter.
        let _ = group.tx_rx_sync_system_time(maindevice).await;
    }
    // A quarter of a cycle ahead of SYNC0.
    let start_delay = Duration::from_millis(200);
    let configuration =
        DcConfiguration { start_delay, sync0_period, sync0_shift: sync0_period / 4 };
    let group = group
        .configure_dc_sync(maindevice, configuration)
        .await
        .map_err(failed("switching SYNC0 on"))?;
    let group = group.into_safe_op(maindevice).await.map_err(failed("on the way to SAFEOP"))?;
    let group = group.request_into_op(maindevice).await.map_err(failed("on the way to OP"))?;
    let exchange = async || group.tx_rx_dc(maindevice).await.map(Seen::from);
    rounds::until_op(asked, &exchange).await?;
    let told = rounds::rounds(&group, maindevice, asked, &exchange).await?;
    let clocks = clocks(&group, maindevice, &in_step).await?;
    println!("{}", rounds::joined([found, told, json!({ "clocks": clocks })]));
    Ok(())
}

async fn clocks(
    group: &Group<Op, HasDc>,
    maindevice: &MainDevice<'_>,
    in_step: &[usize],
) -> Result<Value> {
    let (mut clocked, mut after) = (Vec::new(), Vec::new());
    let (mut delays, mut speeds) = (Vec::new(), Vec::new());
    for (position, subdevice) in group.iter(maindevice).enumerate() {
        let Ok(difference) = subdevice.register_read::<u32>(DIFFERENCE).await else { continue };
        if !clocked.is_empty() {
            after.push(difference & 0x7FFF_FFFF);
        }
        clocked.push(position);
        delays.push(subdevice.register_read::<u32>(DELAY).await.map_err(failed("delay"))?);
        speeds.push(subdevice.register_read::<u16>(SPEED).await.map_err(failed("speed"))?);
    }
    let mut modes = Vec::new();
    for position in in_step {
        let subdevice = group.subdevice(maindevice, *position).map_err(failed("SubDevice"))?;
        let mode = subdevice.sdo_read::<u16>(MODES.0, 1).await;
        modes.push(mode.map_err(|error| anyhow!("mode of {position}: {error:?}"))?);
    }
    Ok(json!({
        "clocked": clocked,
        "in_step": in_step,
        "after": after,
        "delays": delays,
        "speeds": speeds,
        "modes": modes,
    }))
}
