//! Ring that breaks while its line runs: process data go on, a finding says where, and another that it is whole again.
//!
//! `cargo run --example ring`, on a virtual segment whose last SubDevice is wired to a second card.

use std::sync::Mutex;

use linesman::prelude::*;
use linesman::{FaultEntry, FaultName};

/// A ring of three couplers, closed by a second card.
pub const RING: &str = r#"
name = "ring"
device = [
    { name = "K1", type = "EK1100", on = "maindevice" },
    { name = "K2", type = "EK1100", on = "K1.C" },
    { name = "K3", type = "EK1100", on = "K2.C" },
    { name = "Lamps", type = "EL2008", on = "K3.B" },
]
ring = { closes_at = "K3.C" }
"#;

// region: ring
/// Gives what was found, and in how many cycles the lamps had no good data.
pub fn break_and_mend(segment: &mut Segment) -> Result<(Vec<String>, u32), linesman::Error> {
    let plan = segment.scan()?.plan()?;
    let lamps = plan.device("EL2008")?;
    let simulation = segment.simulation()?;
    let cut = FaultEntry::new(FaultName::LinkOpen).at("K1.C-K2.A");
    let (mut cycle, mut bad, mut fault) = (0, 0, None);
    let found = Mutex::new(Vec::new());
    segment.run_diagnosed(
        plan,
        RunOptions::us(1_000),
        |io: &mut Io<'_>| {
            cycle += u32::from(cycle > 0 || io.is_settled());
            match cycle {
                1_000 => fault = fault.or_else(|| simulation.inject(&cut).ok()),
                3_000 => fault.take().into_iter().for_each(|cut| simulation.heal(cut)),
                _ => {}
            }
            bad += u32::from(cycle > 0 && !io.quality(lamps).valid);
            if cycle < 5_000 { Next::Continue } else { Next::Stop }
        },
        |event| {
            let finding = &event.finding;
            let text = format!("{:?} {} at {}", event.kind, finding.name, finding.place);
            found.lock().unwrap_or_else(|lock| lock.into_inner()).push(text);
        },
    )?;
    Ok((found.into_inner().unwrap_or_else(|lock| lock.into_inner()), bad))
}
// endregion

/// Breaks and mends a virtual ring.
pub fn main() -> Result<(), linesman::Error> {
    let mut segment = Segment::simulated(&SegmentFile::parse(RING)?)?;
    let (found, bad) = break_and_mend(&mut segment)?;
    found.iter().for_each(|line| println!("{line}"));
    println!("the lamps had no good data in {bad} cycles");
    Ok(())
}
