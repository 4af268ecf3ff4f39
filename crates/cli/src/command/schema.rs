//! `linesman schema`: the JSON schema of each file and output.

use linesman_capture::CaptureReport;
use linesman_capture::comparison::ComparisonReport;
use linesman_capture::timing::timeline::TimelineReport;
use linesman_config::project::Project;
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::report::Diagnosis;
use linesman_lab::score::ScoreReport;
use linesman_runtime::bundle::{Manifest, ObservationLine};
use linesman_runtime::control::message::{Faults, Request, SignalTable};
use linesman_runtime::online::report::OnlineReport;
use linesman_runtime::run::report::RunReport;
use linesman_runtime::serve::report::Status as SimStatus;
use linesman_runtime::truth_writer::TruthEvent;
use linesman_sim::segment_file::SegmentFile;
use schemars::{Schema, schema_for};

use super::diagnose::follow::EventReport;
use super::diagnose::several::Diagnoses;
use super::interfaces;
use super::lab::replay::ReplayReport;
use super::log::LogReport;
use super::plan::report::PlanReport;
use super::run::several::RunReports;
use super::scan::report::Scan;
use super::sdo::report::{ListReport, ReadReport};
use super::{
    aoe, capture, counters, explain, foe, history, host, id, probe, reg, ring, service, sii, soe,
    state,
};
use crate::exit::Status;
use crate::failure::{ErrorReport, Failure};
use crate::output::Output;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The file or output
    #[arg(value_enum)]
    name: Name,
}

/// What has a schema.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
pub(crate) enum Name {
    /// A virtual segment (TOML)
    Segment,
    /// What was planned (TOML)
    Project,
    /// What was read with another tool (TOML), for `diagnose`
    Observations,
    /// `plan --json`
    Plan,
    /// `scan --json`
    Scan,
    /// `diagnose --json`
    Diagnosis,
    /// `capture info --json`
    Capture,
    /// `capture timeline --json`
    CaptureTimeline,
    /// `capture compare --json`
    CaptureComparison,
    /// `manifest.json` of a bundle, and `bundle info --json`
    Bundle,
    /// A line of `observations.jsonl` of a bundle
    BundleObservation,
    /// `diagnose --json` of several files
    Diagnoses,
    /// A line of `diagnose --follow --json`
    Event,
    /// A line of `capture list --json`
    CaptureRow,
    /// `capture filter --json`
    CaptureFilter,
    /// `lab replay --json`
    Replay,
    /// `lab score --json`
    Score,
    /// `fault … inject|heal|list --json`
    Faults,
    /// `fault … signals|set|release --json`
    Signals,
    /// `fault … status --json`, and a line of `sim --json`
    Sim,
    /// A line of `fault … events --json`, and of `sim --log`
    Truth,
    /// A line that the control socket of `sim` takes
    Control,
    /// `log --json`
    Log,
    /// `run --json`
    Run,
    /// `run --json` of several networks
    Runs,
    /// `online --json`, and a line of `online --live --json`
    Online,
    /// A line that the control socket of `run` takes
    ServiceRequest,
    /// What it answers
    Service,
    /// `interfaces --json`
    Interfaces,
    /// `host --json`
    Host,
    /// `explain --json`
    Explain,
    /// `ring --json`
    Ring,
    /// `id --json`
    Numbers,
    /// `state --json`
    States,
    /// `sdo … read|write --json`
    Sdo,
    /// `sdo … list|info --json`
    Objects,
    /// `history --json`
    History,
    /// `foe --json`
    File,
    /// `aoe --json`
    Ads,
    /// `soe --json`
    Soe,
    /// `sii --json`
    Sii,
    /// `counters --json`
    Counters,
    /// `probe --json`
    Probe,
    /// `reg --json`
    Registers,
    /// What services print with --json when the SubDevice refuses
    Refusal,
    /// What every command with --json prints when nothing could be judged
    Error,
}

/// Prints the schema.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    output.json(&schema(arguments.name));
    Ok(Status::Good)
}

fn schema(name: Name) -> Schema {
    match name {
        Name::Segment => schema_for!(SegmentFile),
        Name::Project => schema_for!(Project),
        Name::Observations => schema_for!(ObservationFile),
        Name::Plan => schema_for!(PlanReport),
        Name::Scan => schema_for!(Scan),
        Name::Diagnosis => schema_for!(Diagnosis),
        Name::Capture => schema_for!(CaptureReport),
        Name::CaptureTimeline => schema_for!(TimelineReport),
        Name::CaptureComparison => schema_for!(ComparisonReport),
        Name::Bundle => schema_for!(Manifest),
        Name::BundleObservation => schema_for!(ObservationLine),
        Name::Diagnoses => schema_for!(Diagnoses),
        Name::Event => schema_for!(EventReport<'_>),
        Name::CaptureRow => schema_for!(capture::list::RowReport),
        Name::CaptureFilter => schema_for!(capture::filter::FilterReport),
        Name::Replay => schema_for!(ReplayReport),
        Name::Score => schema_for!(ScoreReport),
        Name::Faults => schema_for!(Faults),
        Name::Signals => schema_for!(SignalTable),
        Name::Sim => schema_for!(SimStatus),
        Name::Truth => schema_for!(TruthEvent),
        Name::Control => schema_for!(Request),
        Name::Log => schema_for!(LogReport),
        Name::Run => schema_for!(RunReport),
        Name::Runs => schema_for!(RunReports),
        Name::Online => schema_for!(OnlineReport),
        Name::ServiceRequest => schema_for!(linesman_runtime::service::message::Request),
        Name::Service => schema_for!(linesman_runtime::service::message::Answer),
        Name::Interfaces => schema_for!(interfaces::Report),
        Name::Host => schema_for!(host::Report),
        Name::Explain => schema_for!(explain::Report),
        Name::Ring => schema_for!(ring::report::Report),
        Name::Numbers => schema_for!(id::Report),
        Name::States => schema_for!(state::Report),
        Name::Sdo => schema_for!(ReadReport),
        Name::Objects => schema_for!(ListReport),
        Name::History => schema_for!(history::Report),
        Name::File => schema_for!(foe::Report),
        Name::Ads => schema_for!(aoe::Report),
        Name::Soe => schema_for!(soe::report::Report),
        Name::Sii => schema_for!(sii::Report),
        Name::Counters => schema_for!(counters::Report),
        Name::Probe => schema_for!(probe::Report),
        Name::Registers => schema_for!(reg::Report),
        Name::Refusal => schema_for!(service::RefusalReport),
        Name::Error => schema_for!(ErrorReport),
    }
}
