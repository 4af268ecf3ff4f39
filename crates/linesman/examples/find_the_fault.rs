//! A cable that is cut while a line runs, and the finding that tells where.

use linesman::prelude::*;
use linesman::{FaultEntry, FaultName, SegmentFile};

fn main() -> Result<(), linesman::Error> {
    let devices = [("K1", "EK1100"), ("In", "EL1008"), ("Out", "EL2008"), ("In2", "EL1008")];
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?;
    let plan = segment.scan()?.plan()?;
    let cut = FaultEntry::new(FaultName::LinkOpen).at("In.B-Out.A").from_to(1_000.0, None);
    segment.inject(&cut)?;
    let mut cycles = 0;
    let count = |_: &mut Io<'_>| {
        cycles += 1;
        if cycles < 5_000 { Next::Continue } else { Next::Stop }
    };
    segment.run_diagnosed(plan, RunOptions::us(1_000), count, |event| {
        let finding = &event.finding;
        println!(
            "{:?} {} {}: {} at {}",
            event.kind, finding.code, finding.name, finding.cause, finding.place
        );
    })?;
    Ok(())
}
