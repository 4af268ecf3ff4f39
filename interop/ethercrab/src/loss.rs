//! A SubDevice that loses its power while ethercrab runs: what each exchange brings is told whenever it changes.

use std::time::Duration;

use anyhow::Result;
use ethercrab::SubDeviceState;
use serde_json::json;

use crate::failed;

/// To OP, then on and on until somebody ends the program.
pub(crate) async fn run(interface: &str, cycle: Duration) -> Result<()> {
    let maindevice = &crate::open(interface)?;
    let group = crate::scan(maindevice).await?;
    let group = group.into_safe_op(maindevice).await.map_err(failed("on the way to SAFEOP"))?;
    let group = group.request_into_op(maindevice).await.map_err(failed("on the way to OP"))?;
    let mut last = None;
    loop {
        let now = match group.tx_rx(maindevice).await {
            Ok(seen) => {
                let in_op = |state: &&SubDeviceState| **state == SubDeviceState::Op;
                let in_op = seen.subdevice_states.iter().filter(in_op).count();
                json!({ "wkc": seen.working_counter, "in_op": in_op })
            }
            Err(error) => json!({ "error": format!("{error:?}") }),
        };
        if last.as_ref() != Some(&now) {
            println!("{now}");
            last = Some(now);
        }
        smol::Timer::after(cycle).await;
    }
}
