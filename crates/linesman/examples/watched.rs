//! The least that a control program should watch: of every SubDevice whether its working counter was wrong,
//! and its state. The first tells within the cycle that data are missing, the second who is to blame.
//!
//! `cargo run --example watched -- sim:line.toml`, or `eth0`.

use linesman::DeviceState;
use linesman::prelude::*;

/// Watches the line that is named.
pub fn main() -> Result<(), linesman::Error> {
    let Some(place) = std::env::args().nth(1) else { return Ok(()) };
    watch(&mut linesman::open(&place)?, |line| println!("{line}"))
}

/// Runs a line for five seconds and tells what changes.
pub fn watch(segment: &mut Segment, mut tell: impl FnMut(String)) -> Result<(), linesman::Error> {
    let plan = segment.scan()?.plan()?;
    let devices: Vec<(DeviceHandle, String)> =
        plan.devices().map(|(device, name)| (device, name.to_owned())).collect();
    let mut told = vec![(false, DeviceState::OP); devices.len()];
    let mut cycle = 0;
    segment.run(plan, RunOptions::us(1_000), |io| {
        if !io.is_settled() && cycle == 0 {
            return Next::Continue;
        }
        cycle += 1;
        for ((device, name), told) in devices.iter().zip(&mut told) {
            let now = (io.wc_state(*device), io.state(*device));
            if std::mem::replace(told, now) != now {
                let data = if now.0 { "data missing" } else { "data good" };
                tell(format!("{name}: {data}, {}", now.1));
            }
        }
        if cycle < 5_000 { Next::Continue } else { Next::Stop }
    })?;
    Ok(())
}
