//! Against the clock: from the begin to OP, then cycles until the time is over.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use ethercrab::std::{ethercat_now, tx_rx_task};
use ethercrab::{MainDevice, MainDeviceConfig, PduStorage, Timeouts};

const FRAMES_MAX: usize = 32;
const DATA_MAX: usize = PduStorage::element_size(1486);
const SUBDEVICES_MAX: usize = 256;
const IMAGE_MAX: usize = 1024;

static STORAGE: PduStorage<FRAMES_MAX, DATA_MAX> = PduStorage::new();

pub(crate) async fn run(interface: &str, seconds: Duration, cycle: Duration) -> Result<()> {
    let begun = Instant::now();
    let (transmit, receive, pdus) =
        STORAGE.try_split().map_err(|()| anyhow!("the storage is split already"))?;
    let timeouts = Timeouts {
        // The host may be busy: what is measured is the line, not how patient a MainDevice is.
        pdu: Duration::from_millis(200),
        eeprom: Duration::from_secs(8),
        state_transition: Duration::from_secs(10),
        ..Timeouts::default()
    };
    let maindevice = MainDevice::new(pdus, timeouts, MainDeviceConfig::default());
    smol::spawn(tx_rx_task(interface, transmit, receive).context(interface.to_owned())?).detach();
    let group = maindevice
        .init_single_group::<SUBDEVICES_MAX, IMAGE_MAX>(ethercat_now)
        .await
        .map_err(|error| anyhow!("scan: {error:?}"))?;
    let identities: Vec<[u32; 2]> = (group.iter(&maindevice))
        .map(|one| [one.identity().vendor_id, one.identity().product_id])
        .collect();
    let group = group.into_safe_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    let group = group.request_into_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    while !group.tx_rx(&maindevice).await.is_ok_and(|answer| answer.all_op()) {
        if begun.elapsed() > Duration::from_secs(60) {
            return Err(anyhow!("OP is not reached"));
        }
    }
    let reached = begun.elapsed();
    let (mut cycles, mut due) = (0_u64, Instant::now());
    while begun.elapsed() < seconds {
        let _ = group.tx_rx(&maindevice).await;
        cycles += 1;
        due += cycle;
        smol::Timer::at(due).await;
    }
    let op_ms = reached.as_secs_f64() * 1e3;
    println!("{}", serde_json::json!({ "identities": identities, "op_ms": op_ms, "cycles": cycles }));
    let group = group.into_safe_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    let group = group.into_pre_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    group.into_init(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    Ok(())
}
