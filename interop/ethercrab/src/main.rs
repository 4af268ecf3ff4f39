//! ethercrab as a foreign MainDevice; what a peer does and prints is said in `interop/peer.py`.

use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use ethercrab::std::{ethercat_now, tx_rx_task};
use ethercrab::{MainDevice, MainDeviceConfig, PduStorage, Timeouts};

const FRAMES_MAX: usize = 16;
const DATA_MAX: usize = PduStorage::element_size(1100);
const SUBDEVICES_MAX: usize = 64;
const IMAGE_MAX: usize = 512;
const PATTERNS: [u8; 2] = [0xA5, 0x5A];

static STORAGE: PduStorage<FRAMES_MAX, DATA_MAX> = PduStorage::new();

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, interface, cycles, cycle_us] = arguments.as_slice() else {
        return Err(anyhow!("usage: ethercrab-peer INTERFACE CYCLES CYCLE_US"));
    };
    let cycle = Duration::from_micros(cycle_us.parse()?);
    smol::block_on(run(interface, cycles.parse()?, cycle))
}

async fn run(interface: &str, cycles: u64, cycle: Duration) -> Result<()> {
    let (transmit, receive, pdus) =
        STORAGE.try_split().map_err(|()| anyhow!("the storage is split already"))?;
    // The host is no real-time system, and may be busy: what is tried is the line, not the host.
    let timeouts = Timeouts {
        pdu: Duration::from_millis(200),
        eeprom: Duration::from_secs(1),
        mailbox_echo: Duration::from_secs(1),
        mailbox_response: Duration::from_secs(2),
        state_transition: Duration::from_secs(10),
        ..Timeouts::default()
    };
    let maindevice = MainDevice::new(pdus, timeouts, MainDeviceConfig::default());
    smol::spawn(tx_rx_task(interface, transmit, receive).context(interface.to_owned())?).detach();

    let group = maindevice
        .init_single_group::<SUBDEVICES_MAX, IMAGE_MAX>(ethercat_now)
        .await
        .map_err(|error| anyhow!("scan: {error:?}"))?;
    let mut devices = Vec::new();
    let mut names = Vec::new();
    for subdevice in group.iter(&maindevice) {
        let identity = subdevice.identity();
        devices.push([identity.vendor_id, identity.product_id, identity.revision]);
        names.push(subdevice.name().to_owned());
    }
    let group = group
        .into_safe_op(&maindevice)
        .await
        .map_err(|error| anyhow!("on the way to SAFEOP: {error:?}"))?;
    // SubDevices with outputs want process data before they go to OP, so it is not waited for here.
    let group = group
        .request_into_op(&maindevice)
        .await
        .map_err(|error| anyhow!("on the way to OP: {error:?}"))?;
    let mut tries = 0;
    loop {
        let answer = group.tx_rx(&maindevice).await;
        if answer.is_ok_and(|answer| answer.all_op()) {
            break;
        }
        tries += 1;
        if tries > 2000 {
            return Err(anyhow!("OP is not reached after {tries} exchanges"));
        }
        smol::Timer::after(cycle).await;
    }

    let mut wkc = 0;
    let mut complete = 0_u64;
    let mut inputs = serde_json::Map::new();
    for pattern in PATTERNS {
        for _ in 0..cycles / 2 {
            for subdevice in group.iter(&maindevice) {
                subdevice.outputs_raw_mut().fill(pattern);
            }
            if let Ok(response) = group.tx_rx(&maindevice).await {
                // This stack expects no number by itself: the highest one seen must be seen always.
                if response.working_counter > wkc {
                    (wkc, complete) = (response.working_counter, 0);
                }
                complete += u64::from(response.working_counter == wkc);
            }
            smol::Timer::after(cycle).await;
        }
        let read: Vec<String> = group.iter(&maindevice).map(|one| hex(&one.inputs_raw())).collect();
        inputs.insert(format!("{pattern:02X}"), read.into());
    }
    let result = serde_json::json!({
        "devices": devices,
        "names": names,
        "state": "OP",
        "expected_wkc": wkc,
        "cycles": cycles,
        "complete": complete,
        "inputs": inputs,
    });
    println!("{result}");

    let group = group.into_safe_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    let group = group.into_pre_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    group.into_init(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    Ok(())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
