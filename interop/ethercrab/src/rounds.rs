//! Process data, round by round; `interop/peer.py` says what is printed.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::{Result, anyhow, bail};
use ethercrab::error::Error;
use ethercrab::subdevice_group::Op;
use ethercrab::{MainDevice, TxRxResponse};
use serde_json::{Value, json};

use crate::{Group, SUBDEVICES_MAX, failed};

/// The output bytes of a round, in hexadecimal, by position.
pub(crate) type Round = BTreeMap<String, String>;

/// What is to be exchanged.
pub(crate) struct Asked {
    pub(crate) cycles: u64,
    pub(crate) cycle: Duration,
    pub(crate) rounds: Vec<Round>,
}

/// To OP without clocks, the rounds, and orderly back.
pub(crate) async fn run(interface: &str, asked: &Asked) -> Result<()> {
    let maindevice = &crate::open(interface)?;
    let group = crate::scan(maindevice).await?;
    let found = found(&group, maindevice);
    be_patient(&group, maindevice).await?;
    let group = group.into_safe_op(maindevice).await.map_err(failed("on the way to SAFEOP"))?;
    // SubDevices with outputs want process data before they go to OP, so it is not waited for here.
    let group = group.request_into_op(maindevice).await.map_err(failed("on the way to OP"))?;
    let exchange = async || group.tx_rx(maindevice).await.map(Seen::from);
    until_op(asked, &exchange).await?;
    let told = rounds(&group, maindevice, asked, &exchange).await?;
    println!("{}", joined([found, told]));

    // Further down would need an acknowledgement where a watchdog was quicker; this stack has none.
    group.into_safe_op(maindevice).await.map_err(failed("back to SAFEOP"))?;
    Ok(())
}

/// The watchdog of outputs waits three seconds: the host may be busy with other things.
pub(crate) async fn be_patient(group: &Group, maindevice: &MainDevice<'_>) -> Result<()> {
    for subdevice in group.iter(maindevice) {
        subdevice.register_write(0x0420_u16, 30_000_u16).await.map_err(failed("watchdog"))?;
    }
    Ok(())
}

/// What one exchange brought.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) wkc: u16,
    pub(crate) all_op: bool,
}

impl<T> From<TxRxResponse<SUBDEVICES_MAX, T>> for Seen {
    fn from(response: TxRxResponse<SUBDEVICES_MAX, T>) -> Self {
        Self { wkc: response.working_counter, all_op: response.all_op() }
    }
}

/// Who was found, by identity and name.
pub(crate) fn found(group: &Group, maindevice: &MainDevice<'_>) -> Value {
    let (mut devices, mut names) = (Vec::new(), Vec::new());
    for subdevice in group.iter(maindevice) {
        let identity = subdevice.identity();
        devices.push([identity.vendor_id, identity.product_id, identity.revision]);
        names.push(subdevice.name().to_owned());
    }
    json!({ "devices": devices, "names": names })
}

/// Exchanges until all are in OP.
pub(crate) async fn until_op(
    asked: &Asked,
    exchange: &impl AsyncFn() -> Result<Seen, Error>,
) -> Result<()> {
    for _ in 0..2_000 {
        if exchange().await.is_ok_and(|seen| seen.all_op) {
            return Ok(());
        }
        smol::Timer::after(asked.cycle).await;
    }
    Err(anyhow!("OP is not reached after 2000 exchanges"))
}

/// Writes what each round says, exchanges, and tells the inputs at its end.
pub(crate) async fn rounds<DC>(
    group: &Group<Op, DC>,
    maindevice: &MainDevice<'_>,
    asked: &Asked,
    exchange: &impl AsyncFn() -> Result<Seen, Error>,
) -> Result<Value> {
    let (mut wkc, mut complete, mut all_op) = (0, 0_u64, false);
    let mut inputs: Vec<Vec<String>> = Vec::new();
    for round in &asked.rounds {
        for (position, subdevice) in group.iter(maindevice).enumerate() {
            let Some(wanted) = round.get(&position.to_string()) else { continue };
            let wanted = bytes(wanted)?;
            let mut outputs = subdevice.outputs_raw_mut();
            if wanted.len() != outputs.len() {
                let (no, has, expected) = (position + 1, outputs.len(), wanted.len());
                bail!("SubDevice {no} has {has} output bytes, expected {expected}");
            }
            outputs.copy_from_slice(&wanted);
        }
        for _ in 0..asked.cycles / asked.rounds.len() as u64 {
            if let Ok(seen) = exchange().await {
                // This stack expects no number by itself: the highest one seen must be seen always.
                if seen.wkc > wkc {
                    (wkc, complete) = (seen.wkc, 0);
                }
                complete += u64::from(seen.wkc == wkc);
                all_op = seen.all_op;
            }
            smol::Timer::after(asked.cycle).await;
        }
        inputs.push(group.iter(maindevice).map(|one| hex(&one.inputs_raw())).collect());
    }
    Ok(json!({
        "state": if all_op { "OP" } else { "other" },
        "wkc": wkc,
        "cycles": asked.cycles,
        "complete": complete,
        "rounds": inputs,
    }))
}

/// One object with the fields of all.
pub(crate) fn joined(parts: impl IntoIterator<Item = Value>) -> Value {
    let fields = parts.into_iter().filter_map(|part| match part {
        Value::Object(fields) => Some(fields),
        _ => None,
    });
    Value::Object(fields.flatten().collect())
}

fn bytes(hex: &str) -> Result<Vec<u8>> {
    let digits = (0..hex.len()).step_by(2);
    digits.map(|at| Ok(u8::from_str_radix(hex.get(at..at + 2).unwrap_or("?"), 16)?)).collect()
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
