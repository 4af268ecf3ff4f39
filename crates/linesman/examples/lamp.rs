//! A lamp that blinks while a button is not pressed, and what a robot program does beside it: looks
//! whether its data are good, and stops when the line is not.
//!
//! `cargo run --example lamp -- sim:line.toml`, or `eth0` with the terminals of your own.

use linesman::DeviceId;
use linesman::prelude::*;

fn main() -> Result<(), linesman::Error> {
    let place = std::env::args().nth(1).unwrap_or_else(|| "sim:line.toml".to_owned());
    let mut segment = linesman::open(&place)?;
    let plan = segment.scan()?.plan()?;
    let lamp: Output<bool> = plan.output("EL2008/1")?;
    let button: Input<bool> = plan.input("EL1008/1")?;
    let sensor = plan.as_plan().devices.iter().find(|device| device.type_name == "EL1008");
    let sensor = sensor.map_or(DeviceId(0), |device| device.id);

    let (mut cycle, mut bad) = (0_u64, 0);
    let report = segment.run(plan, RunOptions::us(1000).allow_misses(3), |io| {
        if !io.is_settled() {
            return Next::Continue;
        }
        cycle += 1;
        // Inputs that did not come in this cycle are the last good ones: do not act on them for long.
        bad = if io.quality(sensor).valid { 0 } else { bad + 1 };
        if bad > 10 {
            return Next::Stop;
        }
        let blink = cycle / 250 % 2 == 0;
        io.set(lamp, blink && !io.get(button));
        if cycle < 5_000 { Next::Continue } else { Next::Stop }
    })?;
    println!(
        "{} cycles, {} left out, {} with a wrong working counter",
        report.counts.cycles, report.counts.cycles_missed, report.counts.working_counter_errors
    );
    Ok(())
}
