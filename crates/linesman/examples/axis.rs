//! One axis of a robot: a drive of CiA 402 that is enabled and follows a sine, in step with the distributed
//! clocks, and is stopped when its data are not to be trusted.
//!
//! `cargo run --example axis -- sim:line.toml`, or `eth0` with a drive of your own.

use linesman::prelude::*;
use linesman::{Application, DeviceId};

/// Statusword under its mask, and the controlword that leads on from there (CiA 402, 8.1).
const WAY: [(u16, u16, u16); 4] = [
    (0x4F, 0x40, 0x06), // switch on disabled: shutdown
    (0x6F, 0x21, 0x07), // ready to switch on: switch on
    (0x6F, 0x23, 0x0F), // switched on: enable operation
    (0x6F, 0x27, 0x0F), // operation enabled: stay
];
const FAULT_RESET: u16 = 0x80;
const VELOCITY_MODE: i8 = 3;

struct Axis {
    id: DeviceId,
    control: Output<u16>,
    mode: Output<i8>,
    speed: Output<i32>,
    status: Input<u16>,
    place: Input<i32>,
    cycles: u32,
    log: Vec<i32>,
}

impl Application for Axis {
    /// Runs on fresh inputs; what it sets leaves when the next cycle begins.
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        // Data that are not valid are not acted upon.
        let quality = io.quality(self.id);
        if io.is_settled() && !quality.valid && self.cycles > 0 {
            io.set(self.speed, 0);
            return Next::Stop;
        }
        if !io.is_settled() {
            return Next::Continue;
        }
        self.cycles += 1;
        let status = io.get(self.status);
        let next = WAY.iter().find(|(mask, state, _)| status & mask == *state);
        io.set(self.control, next.map_or(FAULT_RESET, |(.., control)| *control));
        io.set(self.mode, VELOCITY_MODE);
        let enabled = status & 0x6F == 0x27;
        let angle = f64::from(self.cycles) * 0.002;
        io.set(self.speed, if enabled { (angle.sin() * 10_000.0) as i32 } else { 0 });
        if self.cycles.is_multiple_of(100) && self.log.len() < self.log.capacity() {
            self.log.push(io.get(self.place));
        }
        if self.cycles < 3_000 { Next::Continue } else { Next::Stop }
    }
}

fn main() -> Result<(), linesman::Error> {
    let Some(place) = std::env::args().nth(1) else { return Ok(()) };
    let mut segment = linesman::open(&place)?;
    let plan = segment.scan()?.plan()?; // or segment.load("machine.toml")?
    let drive = plan.as_plan().devices.iter().find(|one| one.type_name == "CiA402-Drive");
    let axis = Axis {
        id: drive.map_or(DeviceId(0), |drive| drive.id),
        control: plan.output("CiA402-Drive/Drive outputs/Controlword")?,
        mode: plan.output("CiA402-Drive/Drive outputs/Modes of operation")?,
        speed: plan.output("CiA402-Drive/Drive outputs/Target velocity")?,
        status: plan.input("CiA402-Drive/Drive inputs/Statusword")?,
        place: plan.input("CiA402-Drive/Drive inputs/Position actual value")?,
        cycles: 0,
        log: Vec::with_capacity(1_000), // memory is got before the cycle begins, not in it
    };
    let cycle = RunOptions::us(1000).dc().allow_misses(3); // .on_cpu(3).priority(Some(80))
    let report = segment.run_application(plan, cycle, axis)?;
    println!("{} cycles, {} wrong", report.counts.cycles, report.counts.working_counter_errors);
    Ok(())
}
