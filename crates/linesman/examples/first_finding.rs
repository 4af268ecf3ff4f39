//! First program: a virtual segment, a cable that is cut, and the finding that says where.
//!
//! `cargo run --example first_finding`, in a folder with a segment file `line.toml`.

// region: first
use linesman::prelude::*;
use linesman::{FaultEntry, FaultName};

fn main() -> Result<(), linesman::Error> {
    let mut segment = linesman::open("sim:line.toml")?;
    let plan = segment.scan()?.plan()?;
    let cut = FaultEntry::new(FaultName::LinkOpen).at("In.B-Out.A").from_to(1_000.0, None);
    segment.inject(&cut)?;
    let mut run = segment.start(plan, RunOptions::us(1_000).diagnosed())?;
    for _ in 0..3_000 {
        run.cycle();
    }
    for finding in run.stop()?.diagnosis.iter().flat_map(|diagnosis| &diagnosis.findings) {
        println!("{} {}: {} at {}", finding.code, finding.name, finding.cause, finding.place);
    }
    Ok(())
}
// endregion
