//! An EtherCAT MainDevice for programs: open a line, make a plan, run it, and hear where a fault is.
//!
//! ```
//! use linesman::prelude::*;
//!
//! # fn first_lines() -> Result<(), linesman::Error> {
//! let devices = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];
//! let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?;
//! // or linesman::open("eth0")?, "eth0+eth1" (a ring), "sim:line.toml"
//! let plan = segment.scan()?.plan()?; // or segment.load("machine.toml")?
//! let lamp: Output<bool> = plan.output("EL2008/1")?; // found and type-checked once
//! let button: Input<bool> = plan.input("EL1008/1")?;
//! let mut cycles = 0;
//! let report = segment.run(plan, RunOptions::us(1_000), |io| {
//!     io.set(lamp, !io.get(button));
//!     cycles += 1;
//!     if cycles < 500 { Next::Continue } else { Next::Stop }
//! })?;
//! assert_eq!(report.counts.working_counter_errors, 0);
//! # Ok(())
//! # }
//! # first_lines().unwrap();
//! ```
//!
//! # Tour
//!
//! | step | what does it |
//! |---|---|
//! | open a line | [`open`]: a card, a ring, a virtual segment; [`Segment::simulated`]: a segment made in memory |
//! | plan it | [`Segment::scan`] and [`Scan::plan`] for what is there; [`Segment::load`] for a project or an ENI file |
//! | name things | [`Plan::input`], [`Plan::output`], [`Plan::device`]; [`inputs!`] and [`outputs!`] for a struct of them |
//! | run it | [`Segment::run`] with a closure, [`Segment::run_application`] with a struct |
//! | run it in a loop of one's own | [`Segment::start`] and [`SteppedRun::cycle`] |
//! | see whether data are good | [`Io::quality`], [`Io::state`], [`Io::network_state`] |
//! | ask beside the cycle | [`Segment::services`]: objects (SDO), files (FoE), EEPROM (SII), registers, states |
//! | ask without a run | [`Segment::serve`]: the same services on a line that is only scanned |
//! | hear what is wrong | [`Segment::run_diagnosed`], or [`RunOptions::diagnosed`] and [`SteppedRun::findings`] |
//! | test against faults | [`Segment::simulation`]: [`Simulation::inject`], [`Simulation::heal`] |
//! | drive a segment with another MainDevice | [`VirtualWire`] |
//!
//! The pages of the guide `docs/guide/coming-from.md` set programs of SOEM, pysoem and ethercrab beside these.
//!
//! # Cycle
//!
//! The application is called once a cycle, with inputs that have just come back; outputs leave with the next frames
//! ([`RunOptions::exchange_at_end`] turns that round). It must not wait, allocate or print: while it runs, no frame is
//! sent. When it is late more often than [`RunOptions::allow_misses`] says, outputs are withheld, so that the watchdogs
//! of SubDevices do their work. At the end outputs go to zero and every SubDevice back to INIT.
//!
//! For axes, [`RunOptions::dc`] puts the cycle in step with the distributed clocks (`examples/drive.rs`):
//!
//! ```
#![doc = include_str!("../examples/drive.rs")]
//! ```
//!
//! # Findings
//!
//! The diagnosis sees every frame of the run, on cards in a thread of its own. It says place, cause and evidence of what is
//! wrong, as it opens and closes (`examples/findings.rs`):
//!
//! ```
#![doc = include_str!("../examples/findings.rs")]
//! ```
//!
//! # Services
//!
//! Nothing that is asked of a single SubDevice delays the cycle (`examples/sdo_beside.rs`):
//!
//! ```
#![doc = include_str!("../examples/sdo_beside.rs")]
//! ```
//!
//! # Features
//!
//! None is on unless asked for. `event-log` keeps events in an SQLite file, `journald` writes to the journal of systemd,
//! `packed-input` reads captures that are packed.
//!
//! Below this crate are `linesman_maindevice::MainDevice`, an engine without clock and sockets, and
//! `linesman_runtime::drive::Driver`, which runs one on a card, for programs that need more.

mod application;
mod error;
mod handle;
mod io;
mod options;
mod plan;
mod record;
mod segment;
mod served_line;
mod services;
mod simulation;
mod stepped_run;
mod virtual_wire;

pub use error::Error;
pub use handle::{DeviceHandle, Input, Output, PlanId};
pub use io::{Application, Io, Next, StartTime};
pub use linesman_config::fault::{Class, FaultName};
pub use linesman_config::inventory::{self, Inventory};
pub use linesman_config::plan::Plan as PlanData;
pub use linesman_diagnosis::report;
pub use linesman_diagnosis::report::{
    AlternativeReport, EndReport, EvidenceKind, EvidenceReport, FindingReport, FindingState,
    PlaceReport, Severity, Verdict,
};
pub use linesman_diagnosis::{Diagnosis, Event as FindingEvent, EventKind as FindingChange};
pub use linesman_link::error::LinkError;
pub use linesman_maindevice::service::{RefusalKind, ServiceAnswer, ServiceFailure};
pub use linesman_maindevice::{FrameStatus, OutsideTime, Quality, Statistics, TaskTimes};
pub use linesman_proto::address::{DeviceId, RegisterAddress};
pub use linesman_proto::register::{self, AlStatus};
pub use linesman_proto::state::{AlState, AlStatusCode, DeviceState, NetworkState, StateValue};
pub use linesman_proto::time::{DcTime, Instant, Span};
pub use linesman_runtime::part::PartFailure;
pub use linesman_runtime::run::RunError;
pub use linesman_runtime::run::report::{self as run_report, RunReport};
pub use linesman_runtime::selector::SelectorError;
pub use linesman_runtime::stop::Stop;
pub use linesman_session::image::{Value, VariableError};
pub use linesman_sim::segment_file::{self, FaultEntry, SegmentFile, SegmentFileError};
pub use linesman_sim::truth::FaultId;
pub use options::RunOptions;
pub use plan::{Plan, Scan};
pub use record::{InputRecord, InputsOf, OutputRecord, OutputsOf};
pub use segment::{Segment, open};
pub use served_line::ServedLine;
pub use services::{ObjectValue, PendingAnswer, ReadState, RegisterValue, RequestError, Services};
pub use simulation::Simulation;
pub use stepped_run::SteppedRun;
pub use virtual_wire::VirtualWire;

/// Names that nearly every program needs.
pub mod prelude {
    pub use crate::{
        Application, DeviceHandle, Input, Io, Next, Output, Plan, RunOptions, RunReport, Segment,
        SegmentFile,
    };
}
