//! Findings of the diagnosis as they open and close, in a loop of one's own that takes the cycles one by one.
//!
//! `cargo run --example findings`, on a virtual segment whose cable is cut and mended.

use linesman::prelude::*;
use linesman::{FaultEntry, FaultName};

// region: findings
/// Runs for 5,000 cycles and tells what changes.
pub fn watch(
    segment: &mut Segment,
    mut tell: impl FnMut(String),
) -> Result<RunReport, linesman::Error> {
    let plan = segment.scan()?.plan()?;
    let mut run = segment.start(plan, RunOptions::us(1_000).diagnosed())?;
    let mut cycle = 0;
    while run.cycle().is_some() && cycle < 5_000 {
        cycle += 1;
        for event in run.findings() {
            let finding = &event.finding;
            tell(format!("{:?} {} {}: {}", event.kind, finding.code, finding.name, finding.cause));
            tell(format!("  at {}", finding.place));
            finding.evidence.iter().for_each(|reading| tell(format!("  {}", reading.text)));
        }
    }
    run.stop()
}
// endregion

/// Watches a virtual segment whose cable is cut and mended.
pub fn main() -> Result<(), linesman::Error> {
    let devices = [("K1", "EK1100"), ("In", "EL1008"), ("Out", "EL2008"), ("In2", "EL1008")];
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?;
    let cut = FaultEntry::new(FaultName::LinkOpen).at("In.B-Out.A").from_to(1_000.0, Some(3_000.0));
    segment.inject(&cut)?;
    let report = watch(&mut segment, |line| println!("{line}"))?;
    let verdict = report.diagnosis.map(|diagnosis| diagnosis.verdict);
    println!("verdict: {verdict:?}");
    Ok(())
}
