//! ethercrab as a foreign MainDevice; what a peer does and prints is said in `interop/peer.py`.

mod clocks;
mod services;

use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use ethercrab::std::{ethercat_now, tx_rx_task};
use ethercrab::{MainDevice, MainDeviceConfig, PduStorage, Timeouts};

const FRAMES_MAX: usize = 16;
const DATA_MAX: usize = PduStorage::element_size(1100);
const SUBDEVICES_MAX: usize = 64;
const IMAGE_MAX: usize = 512;

static STORAGE: PduStorage<FRAMES_MAX, DATA_MAX> = PduStorage::new();

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, interface, word] = arguments.as_slice()
        && word == "services"
    {
        return smol::block_on(services::run(interface));
    }
    if let [_, interface, word, cycles, cycle_us, sync0_ns] = arguments.as_slice()
        && word == "clocks"
    {
        let (cycles, cycle) = (cycles.parse()?, Duration::from_micros(cycle_us.parse()?));
        let sync0 = Duration::from_nanos(sync0_ns.parse()?);
        return smol::block_on(clocks::run(interface, cycles, cycle, sync0));
    }
    let [_, interface, cycles, cycle_us, rounds] = arguments.as_slice() else {
        return Err(anyhow!(
            "usage: ethercrab-peer INTERFACE CYCLES CYCLE_US ROUNDS.json, or INTERFACE services, \
             or INTERFACE clocks CYCLES CYCLE_US SYNC0_NS"
        ));
    };
    let cycle = Duration::from_micros(cycle_us.parse()?);
    let rounds: Vec<Round> = serde_json::from_str(&std::fs::read_to_string(rounds)?)?;
    smol::block_on(run(interface, cycles.parse()?, cycle, &rounds))
}

/// The output bytes of a round, in hexadecimal, by position.
type Round = std::collections::BTreeMap<String, String>;

/// A MainDevice on an interface, whose frames a task of its own sends and receives.
fn open(interface: &str) -> Result<MainDevice<'static>> {
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
    Ok(maindevice)
}

async fn run(interface: &str, cycles: u64, cycle: Duration, rounds: &[Round]) -> Result<()> {
    let maindevice = open(interface)?;
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
    let mut inputs: Vec<Vec<String>> = Vec::new();
    for round in rounds {
        for _ in 0..cycles / rounds.len() as u64 {
            for (position, subdevice) in group.iter(&maindevice).enumerate() {
                let mut outputs = subdevice.outputs_raw_mut();
                let Some(wanted) = round.get(&position.to_string()) else { continue };
                let wanted = bytes(wanted)?;
                if wanted.len() != outputs.len() {
                    let (no, has) = (position + 1, outputs.len());
                    let expected = wanted.len();
                    return Err(anyhow!("SubDevice {no} has {has} output bytes, expected {expected}"));
                }
                outputs.copy_from_slice(&wanted);
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
        inputs.push(group.iter(&maindevice).map(|one| hex(&one.inputs_raw())).collect());
    }
    let result = serde_json::json!({
        "devices": devices,
        "names": names,
        "state": "OP",
        "wkc": wkc,
        "cycles": cycles,
        "complete": complete,
        "rounds": inputs,
    });
    println!("{result}");

    let group = group.into_safe_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    let group = group.into_pre_op(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    group.into_init(&maindevice).await.map_err(|error| anyhow!("{error:?}"))?;
    Ok(())
}

fn bytes(hex: &str) -> Result<Vec<u8>> {
    let digits = (0..hex.len()).step_by(2);
    digits.map(|at| Ok(u8::from_str_radix(hex.get(at..at + 2).unwrap_or("?"), 16)?)).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
