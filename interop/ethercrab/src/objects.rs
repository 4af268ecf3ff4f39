//! Objects of every length as ethercrab reads and writes them; `interop/objects.py` says what is told.

use anyhow::{Result, anyhow};
use serde_json::json;

use crate::failed;
use crate::rounds::hex;

/// The device of `interop/store.xml`.
const STORE: u32 = 0x5702;
const NUMBER: u16 = 0x2000;
const LABEL: u16 = 0x2001;
const PAGE: u16 = 0x2002;
/// What is written into the number.
const WRITTEN: u32 = 0xCAFE_0042;

/// Reads all, writes what this stack can write, and tells.
pub(crate) async fn run(interface: &str) -> Result<()> {
    let maindevice = &crate::open(interface)?;
    let group = crate::scan(maindevice).await?;
    let store = group
        .iter(maindevice)
        .find(|one| one.identity().product_id == STORE)
        .ok_or_else(|| anyhow!("the store was not found"))?;
    let number = store.sdo_read::<u32>(NUMBER, 0).await.map_err(failed("expedited upload"))?;
    store.sdo_write(NUMBER, 0, WRITTEN).await.map_err(failed("expedited download"))?;
    let written = store.sdo_read::<u32>(NUMBER, 0).await.map_err(failed("expedited upload"))?;
    let label = store.sdo_read::<[u8; 20]>(LABEL, 0).await.map_err(failed("normal upload"))?;
    let page = store.sdo_read::<[u8; 600]>(PAGE, 0).await;
    let told = json!({
        "number": number,
        "written": written,
        "label": hex(&label),
        "page": page.map_or_else(|error| format!("{error:?}"), |page| hex(&page)),
    });
    println!("{told}");
    Ok(())
}
