//! Lamp that blinks while a button is not pressed. The program does not act on inputs that are old, and stops when
//! the line is not good for longer than ten cycles.
//!
//! `cargo run --example blink -- eth0`, or without a place for a virtual segment.

use linesman::prelude::*;

// region: blink
/// Blinks until 5,000 good cycles are over, or ten in a row were bad.
pub fn blink(segment: &mut Segment) -> Result<RunReport, linesman::Error> {
    let plan = segment.scan()?.plan()?;
    let lamp: Output<bool> = plan.output("EL2008/1")?;
    let button: Input<bool> = plan.input("EL1008/1")?;
    let buttons = plan.device("EL1008")?;
    let (mut cycle, mut bad) = (0, 0);
    segment.run(plan, RunOptions::us(1_000), |io| {
        if cycle == 0 && !io.is_settled() {
            return Next::Continue; // not up yet; later, a SubDevice that is lost shows in its data
        }
        cycle += 1;
        bad = if io.quality(buttons).valid { 0 } else { bad + 1 };
        io.set(lamp, cycle / 250 % 2 == 0 && !io.get(button));
        if bad <= 10 && cycle < 5_000 { Next::Continue } else { Next::Stop }
    })
}
// endregion

/// Blinks on the place that is given, or on a virtual segment.
pub fn main() -> Result<(), linesman::Error> {
    let mut segment = match std::env::args().nth(1) {
        Some(place) => linesman::open(&place)?,
        None => {
            let devices = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];
            Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?
        }
    };
    let counts = blink(&mut segment)?.counts;
    println!(
        "{} cycles, {} left out, {} with a wrong working counter",
        counts.cycles, counts.cycles_missed, counts.working_counter_errors
    );
    Ok(())
}
