//! The least that a control program should watch: of every SubDevice whether its working counter was wrong,
//! and its state. The first tells within the cycle that data are missing, the second who is to blame.
//!
//! `cargo run --example watched -- sim:line.toml`, or `eth0`.

use linesman::prelude::*;
use linesman::{DeviceId, DeviceState};

/// OP, and nothing wrong.
const GOOD: DeviceState = DeviceState(8);

fn main() -> Result<(), linesman::Error> {
    let place = std::env::args().nth(1).unwrap_or_else(|| "sim:line.toml".to_owned());
    watch(&place, |line| println!("{line}"))
}

/// Runs a line for five seconds and tells what changes.
pub fn watch(place: &str, mut tell: impl FnMut(String)) -> Result<(), linesman::Error> {
    let mut segment = linesman::open(place)?;
    let plan = segment.scan()?.plan()?;
    let names: Vec<(DeviceId, String)> =
        plan.as_plan().devices.iter().map(|device| (device.id, device.name.clone())).collect();
    let mut told: Vec<(bool, DeviceState)> = vec![(false, GOOD); names.len()];
    let mut cycle = 0;
    segment.run(plan, RunOptions::us(1000), |io| {
        if !io.is_settled() && cycle == 0 {
            return Next::Continue;
        }
        cycle += 1;
        for ((id, name), told) in names.iter().zip(&mut told) {
            let now = (io.wc_state(*id), io.state(*id));
            if std::mem::replace(told, now) != now {
                let data = if now.0 { "data missing" } else { "data good" };
                tell(format!("{name}: {data}, {}", now.1));
            }
        }
        if cycle < 5_000 { Next::Continue } else { Next::Stop }
    })?;
    Ok(())
}
