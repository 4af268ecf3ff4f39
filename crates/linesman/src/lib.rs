//! An EtherCAT MainDevice for programs: open a line, make a plan, run it.
//!
//! ```
//! use linesman::prelude::*;
//!
//! # let line = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n[[device]]\nname = \"In\"\ntype = \"EL1008\"\non = \"K1.B\"\n[[device]]\nname = \"Out\"\ntype = \"EL2008\"\non = \"In.B\"\n";
//! # let folder = std::env::temp_dir().join(format!("linesman-doc-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder).unwrap();
//! # let file = folder.join("line.toml");
//! # std::fs::write(&file, line).unwrap();
//! # let place = format!("sim:{}", file.display());
//! # fn first_lines(place: &str) -> Result<(), linesman::Error> {
//! let mut segment = linesman::open(place)?; // "eth0", "eth0+eth1", "sim:line.toml"
//! let plan = segment.scan()?.plan()?; // or segment.load("machine.toml")
//! let lamp: Output<bool> = plan.output("EL2008/1")?; // found and type-checked once
//! let button: Input<bool> = plan.input("EL1008/1")?;
//! let mut cycles = 0;
//! let report = segment.run(plan, RunOptions::us(1000), |io| {
//!     io.set(lamp, !io.get(button));
//!     cycles += 1;
//!     if cycles < 500 { Next::Continue } else { Next::Stop }
//! })?;
//! assert_eq!(report.counts.working_counter_errors, 0);
//! # Ok(())
//! # }
//! # first_lines(&place).unwrap();
//! # std::fs::remove_dir_all(&folder).unwrap();
//! ```
//!
//! For axes, [`RunOptions::dc`] puts the cycle in step with the distributed clocks; `examples/axis.rs` drives one:
//!
//! ```
#![doc = include_str!("../examples/axis.rs")]
//! ```
//!
//! The diagnosis runs beside the cycle, and a virtual segment breaks on order, so that an application can be tested
//! against faults:
//!
//! ```
#![doc = include_str!("../examples/find_the_fault.rs")]
//! ```
//!
//! The closure is called once a cycle, with inputs that have just come back; outputs leave with the
//! next frames ([`RunOptions::exchange_at_end`] turns that round). When it is late more often than [`RunOptions::allow_misses`] says, outputs are withheld, so
//! that the watchdogs of SubDevices do their work. At the end outputs go to zero and every SubDevice
//! back to INIT.
//!
//! Whoever needs more uses `linesman_maindevice::MainDevice`, an engine without clock and sockets, and
//! `linesman_runtime::drive::Driver`, which runs one on a card.

mod error;
mod plan;
mod segment;

pub use error::Error;
pub use linesman_config::fault::FaultName;
pub use linesman_diagnosis::report::{FindingReport, PlaceReport, Verdict};
pub use linesman_diagnosis::{Diagnosis, Event as FindingEvent, EventKind as FindingChange};
pub use linesman_proto::address::DeviceId;
pub use linesman_proto::state::{AlState, DeviceState, NetworkState};
pub use linesman_proto::time::{Instant, Span};
pub use linesman_runtime::run::report::RunReport;
pub use linesman_runtime::run::{Application, Io, Next, RunError};
pub use linesman_session::image::{Input, Output, Value, VariableError};
pub use linesman_sim::segment_file::{FaultEntry, SegmentFile};
pub use linesman_sim::truth::FaultId;
pub use plan::{Plan, Scan};
pub use segment::{RunOptions, Segment, open};

/// What nearly every program needs.
pub mod prelude {
    pub use crate::{Input, Io, Next, Output, Plan, RunOptions, Segment};
}
