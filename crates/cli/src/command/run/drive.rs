//! Lines that are driven, each in a thread of its own, and what is told of them meanwhile and at the end.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

use linesman_diagnosis::report::Verdict;
use linesman_diagnosis::{Engine, Setup};
use linesman_link::error::LinkError;
use linesman_link::socket::WakeHandle;
use linesman_proto::time::Span;
use linesman_runtime::ads::AdsServer;
use linesman_runtime::bundle::{BundleReceiver, BundleRecorder, RecordedEngine};
use linesman_runtime::ethernet::VirtualEthernet;
use linesman_runtime::gateway::MailboxGateway;
use linesman_runtime::network_access::NetworkAccess;
use linesman_runtime::online::OnlineState;
use linesman_runtime::run::diagnosis_thread::DiagnosisObserver;
use linesman_runtime::run::report::RunReport;
use linesman_runtime::run::{
    self as running, Idle, NOTES, Note, PlanSource, RunControls, RunError, RunOutcome,
    SessionOptions, Shared,
};
use linesman_runtime::service::{ControlSocketWatch, ServiceSocket};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::Transport;

use super::Arguments;
use super::ads::AdsOptions;
use super::reporter::{self, RunReporter};
use super::several::RunReports;
use super::{ads, ethernet, gateway};
use crate::command::bundle::recording;
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

/// After so long without news, what was waited with is told.
const QUIET: Duration = Duration::from_millis(100);

/// Interval at which logs and socket are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Notes of a network that are told before those of the next one.
const NOTES_AT_ONCE: usize = 256;

/// The socket for services, if one is wanted.
fn socket(
    path: Option<&Path>,
    wake_handle: WakeHandle,
    online: OnlineState,
) -> Result<Option<ServiceSocket>, Failure> {
    let Some(path) = path else { return Ok(None) };
    let socket = ServiceSocket::open(path, wake_handle, online).map_err(|error| {
        let reason = format!("{}: opening the socket: {error}", path.display());
        Failure::new(reason, "name a path where nothing is, in a folder that you may write to")
    })?;
    Ok(Some(socket))
}

/// The diagnosis of the run, with a recorder of bundles beside it where one is wanted.
fn observer(setup: Setup, recorder: Option<BundleRecorder>) -> Box<dyn DiagnosisObserver> {
    let engine = Engine::new(setup);
    match recorder {
        Some(recorder) => Box::new(RecordedEngine::new(engine, recorder)),
        None => Box::new(engine),
    }
}

/// Services and recorders that run beside a line.
#[derive(Default)]
pub(super) struct Companions {
    socket: Option<ServiceSocket>,
    gateway: Option<MailboxGateway>,
    ads: Option<AdsServer>,
    ethernet: Option<VirtualEthernet>,
    bundles: Option<(BundleRecorder, BundleReceiver)>,
}

/// A network that is to be run, but for its line.
pub(super) struct NetworkRun {
    pub(super) wanted: PlanSource,
    pub(super) options: SessionOptions,
    pub(super) image: Option<PathBuf>,
    pub(super) control: Option<PathBuf>,
    pub(super) gateway_options: Option<NetworkAccess>,
    pub(super) ads_options: Option<AdsOptions>,
    pub(super) companions: Companions,
    pub(super) online: OnlineState,
    pub(super) said: String,
    pub(super) reporter: RunReporter,
}

impl NetworkRun {
    /// Opens what runs beside the line, which is woken by this handle.
    pub(super) fn open(
        &mut self,
        arguments: &Arguments,
        handle: WakeHandle,
        bundles: Option<(BundleRecorder, BundleReceiver)>,
        stop: &Stop,
    ) -> Result<(), Failure> {
        stop.wakes(&handle).map_err(line_access::no_wake_handle)?;
        let online = &self.online;
        let gateway = gateway::open(self.gateway_options.take(), handle.clone(), online.clone())?;
        let ads = ads::open(self.ads_options.take(), handle.clone(), online.clone())?;
        let ethernet = arguments.ethernet.open(handle.clone())?;
        online.set_ethernet(ethernet.watch());
        let socket = socket(self.control.as_deref(), handle, online.clone())?;
        self.companions = Companions { socket, gateway, ads, ethernet: Some(ethernet), bundles };
        Ok(())
    }
}

/// A network that runs: who tells of it, and what comes from it.
struct RunningNetwork {
    reporter: RunReporter,
    told: Receiver<Note>,
    news: Option<BundleReceiver>,
    socket_watch: Option<ControlSocketWatch>,
    /// Nothing more will come.
    is_over: bool,
}

impl RunningNetwork {
    /// Looks whether logs and socket still work, and for bundles.
    fn look(&mut self, output: &mut Output) {
        self.reporter.look_at_logs(output);
        if let Some(news) = &self.news {
            recording::tell(news, !self.reporter.is_json(), output);
        }
        if let Some(why) = self.socket_watch.as_ref().and_then(ControlSocketWatch::trouble) {
            self.reporter.complain(&why, output);
        }
    }

    /// Tells what has come, after at most so long.
    fn tell(&mut self, patience: Duration, output: &mut Output) {
        if self.is_over {
            return;
        }
        match self.told.recv_timeout(patience) {
            Ok(note) => {
                self.reporter.note(&note, output);
                // The others have something to tell, too.
                for note in self.told.try_iter().take(NOTES_AT_ONCE) {
                    self.reporter.note(&note, output);
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                self.reporter.flush(output);
                output.look_for_reader();
            }
            Err(RecvTimeoutError::Disconnected) => {
                self.is_over = true;
                self.reporter.flush(output);
            }
        }
    }
}

/// Runs each line in a thread of its own, and tells what happens meanwhile. When one fails, all are stopped;
/// where no time was given, when one ends.
pub(super) fn drive<L: Transport<Error = LinkError> + Send>(
    runs: Vec<(L, NetworkRun)>,
    stop: &Stop,
    json: bool,
    output: &mut Output,
) -> Result<Status, Failure> {
    let several = runs.len() > 1;
    let mut running = Vec::new();
    let ended: Vec<_> = std::thread::scope(|scope| {
        let mut threads = Vec::new();
        for (line, run) in runs {
            let NetworkRun { wanted, options, image, companions, said, reporter, .. } = run;
            let Companions { socket, gateway, ads, ethernet, bundles } = companions;
            reporter.line(&said, output);
            if let Some(gateway) = &gateway {
                reporter.line(&gateway::opened(gateway), output);
            }
            if let Some(ads) = &ads {
                reporter.line(&ads::opened(ads), output);
            }
            if let Some(text) = ethernet.as_ref().and_then(ethernet::opened) {
                reporter.line(&text, output);
            }
            let (notes, told) = mpsc::sync_channel(NOTES);
            let socket_watch = socket.as_ref().map(ServiceSocket::watch);
            let (recorder, news) = bundles.unzip();
            running.push(RunningNetwork { reporter, told, news, socket_watch, is_over: false });
            let beside = RunControls { stop, notes, socket, gateway, ads, ethernet };
            let judge = move |setup| observer(setup, recorder);
            threads.push(scope.spawn(move || {
                let ended = match image {
                    None => running::run_observed(line, wanted, Idle, &options, beside, judge),
                    Some(path) => {
                        let shared = Shared::at(path);
                        running::run_observed(line, wanted, shared, &options, beside, judge)
                    }
                };
                // Part of a machine does not run without the rest.
                let failed = ended.as_ref().map_or(true, |ended| ended.error.is_some());
                if several && (failed || options.lasts.is_none()) {
                    stop.set();
                }
                ended
            }));
        }
        tell_all(&mut running, stop, output);
        let joined = threads.into_iter().map(std::thread::ScopedJoinHandle::join);
        joined.map(|one| one.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    let mut status = Status::Good;
    let mut reports = Vec::new();
    let mut failure = None;
    for (mut network, ended) in running.into_iter().zip(ended) {
        network.look(output);
        let (report, ended) = finish(&mut network.reporter, ended, output);
        reports.extend(report);
        match ended {
            Ok(own) => status = worse(status, own),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    if json && !reports.is_empty() {
        match <[RunReport; 1]>::try_from(reports) {
            Ok([report]) => output.json(&report),
            Err(reports) => output.json(&RunReports::of(reports)),
        }
    }
    failure.map_or(Ok(status), Err)
}

/// Tells what happens until all have ended.
fn tell_all(running: &mut [RunningNetwork], stop: &Stop, output: &mut Output) {
    let mut looked = std::time::Instant::now();
    let patience = QUIET / running.len().max(1) as u32;
    while running.iter().any(|network| !network.is_over) {
        if looked.elapsed() >= LOOK_EVERY {
            looked = std::time::Instant::now();
            running.iter_mut().for_each(|network| network.look(output));
        }
        running.iter_mut().for_each(|network| network.tell(patience, output));
        // A connection that broke, without a terminal, leaves nothing but this behind.
        if output.is_closed() && !stop.is_set() {
            output.warn("nobody reads standard output any more: the line is stopped");
            stop.set();
        }
    }
}

/// The worse of two: findings, then what could not be judged, then what is inconclusive.
fn worse(one: Status, other: Status) -> Status {
    let order = [Status::Findings, Status::NotJudged, Status::Inconclusive];
    order.into_iter().find(|status| [one, other].contains(status)).unwrap_or(Status::Good)
}

/// Tells how a line was run.
fn finish(
    reporter: &mut RunReporter,
    ended: Result<RunOutcome, RunError>,
    output: &mut Output,
) -> (Option<RunReport>, Result<Status, Failure>) {
    let lasted = ended.as_ref().map_or(Span::ZERO, |ended| Span::ns(ended.report.time_ns));
    if let Some((lost, why)) = reporter.lost() {
        reporter
            .complain(&format!("{lost} entries are missing in the system's log: {why}"), output);
    }
    if let Some(log) = reporter.finish(lasted)
        && (log.dropped > 0 || log.failure.is_some())
    {
        let why = log.failure.unwrap_or_else(|| "too much at once".to_owned());
        reporter.complain(&why, output);
        let lost = format!("{} missing in the event log", count(log.dropped, "event"));
        reporter.complain(&lost, output);
    }
    let on = reporter.on().to_owned();
    let RunOutcome { mut report, error, failed } = match ended {
        Ok(ended) => ended,
        Err(error) => return (None, Err(line_access::nobody(&error).at(&on))),
    };
    if let Some(diagnosis) = &mut report.diagnosis {
        diagnosis.tool = version::tool();
    }
    if !reporter.is_json() {
        output.text(&reporter::summary(&report, output.paint()));
        if let Some(diagnosis) = &report.diagnosis {
            output.text(&reporter::findings(diagnosis, reporter.names(), output));
        }
    }
    if report.counts.untold > 0 {
        let lost = count(report.counts.untold, "event");
        reporter.complain(
            &format!("{lost} neither told nor logged. Do: end other programs on this computer"),
            output,
        );
    }
    if let Some(error) = error {
        return (Some(report), Err(line_access::nobody(&error).at(&on)));
    }
    if let Some(failure) = failed {
        // It was said when it happened.
        reporter.failed(&failure, output);
        return (Some(report), Ok(Status::NotJudged));
    }
    let faulty =
        report.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.verdict == Verdict::Faulty);
    let status = if faulty || report.reached_ns.is_none() || !report.not_taken.is_empty() {
        Status::Findings
    } else if report.counts.undiagnosed > 0 {
        Status::Inconclusive
    } else {
        Status::Good
    };
    (Some(report), Ok(status))
}
