//! Objects of a SubDevice that are read and written while the line runs: from the application, which must not wait,
//! and from another thread, which may.
//!
//! `cargo run --example sdo_beside`, on a virtual segment.

use std::thread;
use std::time::Duration;

use linesman::RequestError;
use linesman::prelude::*;

/// Identity object, its product code; the name that the maker gave the SubDevice.
const IDENTITY: u16 = 0x1018;
const PRODUCT_CODE: u8 = 2;
const DEVICE_NAME: u16 = 0x1008;

// region: sdo
/// Reads the product code and the name of a sensor.
pub fn ask(segment: &mut Segment) -> Result<(u32, String), linesman::Error> {
    let plan = segment.scan()?.plan()?;
    let sensor = plan.device("EL3104")?;
    let (services, beside) = (segment.services(), segment.services());

    // Another thread may wait.
    let reader = thread::spawn(move || -> Result<String, RequestError> {
        beside.sdo_read(sensor, DEVICE_NAME, 0).wait(Duration::from_secs(10))
    });

    // The application asks once, and looks for the answer in later cycles.
    let (mut pending, mut product) = (None, None);
    segment.run(plan, RunOptions::us(1_000), |io| {
        if io.is_settled() && pending.is_none() {
            pending = Some(services.sdo_read::<u32>(sensor, IDENTITY, PRODUCT_CODE));
        }
        if let Some(answer) = pending.as_mut().and_then(|pending| pending.poll()) {
            product.get_or_insert(answer);
        }
        if product.is_some() && reader.is_finished() { Next::Stop } else { Next::Continue }
    })?;
    let name = reader.join().unwrap_or(Err(RequestError::Ended))?;
    Ok((product.unwrap_or(Err(RequestError::Ended))?, name))
}
// endregion

/// Reads both from a virtual segment.
pub fn main() -> Result<(), linesman::Error> {
    let devices = [("K1", "EK1100"), ("Sensor", "EL3104")];
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?;
    let (product, name) = ask(&mut segment)?;
    println!("{name}: product code {product:#010x}");
    Ok(())
}
