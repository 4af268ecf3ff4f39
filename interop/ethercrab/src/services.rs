//! Mailbox and SII services of each SubDevice, as ethercrab sees them; `interop/services.py` says what is expected.

use std::time::Duration;

use anyhow::{Result, anyhow};
use serde_json::json;

use crate::failed;
use crate::rounds::hex;

/// The analogue terminal whose objects are read and written, and the alias it gets.
const TERMINAL: u32 = 0x0C20_3052;
const ALIAS: u16 = 0x2A;
/// Identity: vendor.
const VENDOR: u16 = 0x1018;
/// Device name.
const NAME: u16 = 0x1008;
/// Settings of channel 1; subindex 0x13 is the first limit, 16 bits.
const SETTINGS: u16 = 0x8000;
const LIMIT: u8 = 0x13;

/// Goes to PREOP, tries everything once and tells.
pub(crate) async fn run(interface: &str) -> Result<()> {
    let maindevice = crate::open(interface)?;
    let mut group = crate::scan(&maindevice).await?;
    let mut told = None;
    for mut subdevice in group.iter_mut(&maindevice) {
        if subdevice.identity().product_id != TERMINAL || told.is_some() {
            continue;
        }
        let register: u16 =
            subdevice.register_read(0x0012_u16).await.map_err(failed("reading the alias"))?;
        let expedited: u32 =
            subdevice.sdo_read(VENDOR, 1).await.map_err(failed("expedited upload"))?;
        let normal: [u8; 6] = subdevice.sdo_read(NAME, 0).await.map_err(failed("normal upload"))?;
        let before: i16 =
            subdevice.sdo_read(SETTINGS, LIMIT).await.map_err(failed("reading a limit"))?;
        subdevice
            .sdo_write(SETTINGS, LIMIT, before.wrapping_add(77))
            .await
            .map_err(failed("expedited download"))?;
        let after: i16 =
            subdevice.sdo_read(SETTINGS, LIMIT).await.map_err(failed("reading a limit"))?;
        let missing = subdevice.sdo_read::<u32>(0x5FFF, 0).await;
        let mut start = [0; 16];
        subdevice
            .eeprom_read_raw(&maindevice, 0, &mut start)
            .await
            .map_err(failed("reading the SII"))?;
        if register == 0 {
            subdevice.set_alias_address(ALIAS).await.map_err(failed("writing the alias"))?;
        }
        // The EEPROM acknowledges nothing while it programs, and this stack takes that for data.
        smol::Timer::after(Duration::from_millis(20)).await;
        let alias: u16 = subdevice
            .eeprom_read(&maindevice, 4)
            .await
            .map_err(failed("reading the alias from the SII"))?;
        told = Some(json!({
            "alias_register": register,
            "alias_scanned": subdevice.alias_address(),
            "alias_stored": alias,
            "vendor": expedited,
            "name": String::from_utf8_lossy(&normal),
            "limit": [before, after],
            "abort": format!("{missing:?}"),
            "sii": hex(&start),
        }));
    }
    println!("{}", told.ok_or_else(|| anyhow!("the terminal was not found"))?);
    // Frames of an orderly end are no part of what is tried.
    smol::Timer::after(Duration::from_millis(1)).await;
    Ok(())
}
