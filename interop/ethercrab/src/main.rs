//! ethercrab as a foreign MainDevice; what a peer does and prints is said in `interop/peer.py`.

mod clocks;
mod loss;
mod objects;
mod rounds;
mod services;
mod speed;

use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use ethercrab::std::{ethercat_now, tx_rx_task};
use ethercrab::subdevice_group::PreOp;
use ethercrab::{DefaultLock, MainDevice, MainDeviceConfig, PduStorage, SubDeviceGroup, Timeouts};

const FRAMES_MAX: usize = 16;
const DATA_MAX: usize = PduStorage::element_size(1100);
const SUBDEVICES_MAX: usize = 64;
const IMAGE_MAX: usize = 512;

static STORAGE: PduStorage<FRAMES_MAX, DATA_MAX> = PduStorage::new();

/// All SubDevices, in a state.
type Group<S = PreOp, DC = ethercrab::subdevice_group::NoDc> =
    SubDeviceGroup<SUBDEVICES_MAX, IMAGE_MAX, DefaultLock, S, DC>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        [interface, "services"] => smol::block_on(services::run(interface)),
        [interface, "objects"] => smol::block_on(objects::run(interface)),
        [interface, "loss", cycle_us] => smol::block_on(loss::run(interface, micros(cycle_us)?)),
        [interface, "speed", seconds, cycle_us] => {
            let lasts = Duration::from_secs(seconds.parse()?);
            smol::block_on(speed::run(interface, lasts, micros(cycle_us)?))
        }
        [interface, cycles, cycle_us, file, options @ ..] => {
            let rounds = serde_json::from_str(&std::fs::read_to_string(file)?)?;
            let asked = rounds::Asked { cycles: cycles.parse()?, cycle: micros(cycle_us)?, rounds };
            match options.first().and_then(|option| option.strip_prefix("sync0=")) {
                Some(period) => {
                    let period = Duration::from_nanos(period.parse()?);
                    smol::block_on(clocks::run(interface, &asked, period))
                }
                None => smol::block_on(rounds::run(interface, &asked)),
            }
        }
        _ => bail!(
            "usage: ethercrab-peer INTERFACE CYCLES CYCLE_US ROUNDS.json [sync0=NS], or \
             INTERFACE services, or INTERFACE objects, or INTERFACE loss CYCLE_US, \
             or INTERFACE speed SECONDS CYCLE_US"
        ),
    }
}

fn micros(text: &str) -> Result<Duration> {
    Ok(Duration::from_micros(text.parse()?))
}

/// A MainDevice on an interface, whose frames a task of its own sends and receives.
fn open(interface: &str) -> Result<MainDevice<'static>> {
    let (transmit, receive, pdus) =
        STORAGE.try_split().map_err(|()| anyhow!("the storage is split already"))?;
    // The host is no real-time system, and may be busy: what is tried is the line, not the host. Frames are never sent
    // again: of two copies that come back the second one would end the task that receives.
    let timeouts = Timeouts {
        pdu: Duration::from_secs(3),
        eeprom: Duration::from_secs(8),
        mailbox_echo: Duration::from_secs(8),
        mailbox_response: Duration::from_secs(8),
        state_transition: Duration::from_secs(10),
        ..Timeouts::default()
    };
    let maindevice = MainDevice::new(pdus, timeouts, MainDeviceConfig::default());
    smol::spawn(tx_rx_task(interface, transmit, receive).context(interface.to_owned())?).detach();
    Ok(maindevice)
}

/// Finds all SubDevices and takes them to PREOP.
async fn scan(maindevice: &MainDevice<'_>) -> Result<Group> {
    maindevice.init_single_group(ethercat_now).await.map_err(failed("scan"))
}

/// What did not work.
fn failed(what: &'static str) -> impl Fn(ethercrab::error::Error) -> anyhow::Error {
    move |error| anyhow!("{what}: {error:?}")
}
