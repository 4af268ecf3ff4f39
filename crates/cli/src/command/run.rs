//! `linesman run`: a line is driven: brought up, exchanging process data, watched, stopped.

pub(super) mod ethernet;
pub(super) mod gateway;
mod reporter;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use linesman_config::eni::Eni;
use linesman_config::plan::{Plan, PlannedExchange};
use linesman_config::project::Project;
use linesman_diagnosis::report::Verdict;
use linesman_diagnosis::{Engine, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::socket::WakeHandle;
use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::EntryKind;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_runtime::bundle::{BundleReceiver, BundleRecorder, RecordedEngine};
use linesman_runtime::ethernet::VirtualEthernet;
use linesman_runtime::event_log::{EventLog, EventLogWriter};
use linesman_runtime::gateway::MailboxGateway;
use linesman_runtime::online::OnlineState;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::diagnosis_thread::DiagnosisObserver;
use linesman_runtime::run::{
    self as running, Idle, NOTES, PlanChoices, PlanSource, RealTime, RunControls, RunOutcome,
    SessionOptions, Shared,
};
use linesman_runtime::selector::Selector;
use linesman_runtime::service::{ControlSocketWatch, ServiceSocket};
use linesman_runtime::stop::Stop;
use linesman_runtime::system_log::SystemLog;
use linesman_runtime::transport::{Cards, Pace, Transport};

use self::ethernet::EthernetArguments;
use self::gateway::GatewayArguments;
use self::reporter::{Logs, RunReporter};
use super::bundle::recording::{self, BundleArguments};
use super::line_access;
use crate::amount::{MICROSECOND, count as count_of, cycle, duration, lasting};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

/// After so long without news, what was waited with is told.
const QUIET: Duration = Duration::from_millis(100);

/// So often it is looked whether logs and socket still work.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Longest ENI file that is read, in bytes.
const MOST: u64 = 256 * 1024 * 1024;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "It drives every SubDevice to the target state, and at the end sets outputs to zero \
                  and takes every SubDevice to the state of --leave. Ctrl-C ends it so, and also a \
                  SIGTERM, a terminal or connection that is lost, and a reader of its output that \
                  goes away; a second Ctrl-C ends it at once. To leave it running, start it with \
                  nohup, as a service, or with its output in a file.\n\nWithout the rights for real time it runs all the same, as \
                  steadily as this host lets it, and says so."
)]
pub(crate) struct Arguments {
    /// The project (TOML), or a configuration of another tool (ENI); without one, what is there is run
    /// as it is
    #[arg(value_name = "PROJECT.toml|ENI.xml")]
    file: Option<PathBuf>,
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml
    #[arg(long, value_name = "WHERE")]
    pub(crate) on: String,
    /// End after so long (60, 10m); else Ctrl-C ends it
    #[arg(long, visible_alias = "for", value_name = "SECONDS", value_parser = lasting())]
    seconds: Option<Span>,
    /// The state that SubDevices are driven to: PREOP, SAFEOP or OP
    #[arg(long, value_name = "STATE", default_value = "OP", value_parser = state)]
    to: AlState,
    /// The state in which they are left at the end
    #[arg(long, value_name = "STATE", default_value = "INIT", value_parser = state)]
    leave: AlState,
    /// Cycle time (500, 1ms), instead of that of the project or ENI file, or where that has none
    #[arg(long, visible_alias = "cycle", value_name = "US", value_parser = cycle())]
    cycle_us: Option<Span>,
    /// Keep the cycle on this CPU
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Real-time priority, 1 to 99; 0 for none
    #[arg(long, value_name = "N", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Look again and again for so long before each cycle (20, 20us), instead of sleeping up to it
    #[arg(
        long,
        visible_alias = "spin",
        value_name = "US",
        default_value = "0",
        value_parser = duration(MICROSECOND, Span::ZERO, Span::s(1))
    )]
    spin_us: Span,
    /// Another program is the application: it sees the process image in this file, such as
    /// /dev/shm/machine
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// How many cycles in a row that program may give no outputs before they are withheld (10, 2k)
    #[arg(
        long,
        value_name = "COUNT",
        default_value = "10",
        requires = "image",
        value_parser = count_of(0, u32::MAX.into())
    )]
    misses: u64,
    /// Leave all SubDevices in PREOP until that program gives outputs for the first time
    #[arg(long, requires = "image")]
    wait_for_outputs: bool,
    /// Open a socket for service commands beside the run; it is there once the line is being driven
    #[arg(long, value_name = "SOCKET")]
    control: Option<PathBuf>,
    #[command(flatten)]
    gateway: GatewayArguments,
    #[command(flatten)]
    ethernet: EthernetArguments,
    #[command(flatten)]
    bundles: BundleArguments,
    /// Do not judge the line meanwhile
    #[arg(long, conflicts_with = "bundles")]
    no_diagnosis: bool,
    /// Keep what happens in an event log, for `linesman log`; runs are added to a file that is there
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Tell and log nothing of this kind (as in `linesman log --kind`): counter, link, state and others; may be
    /// given several times
    #[arg(long, value_name = "KIND", value_parser = super::log::kind)]
    log_without: Vec<EntryKind>,
    /// Tell the log of the system, too: `journalctl SYSLOG_IDENTIFIER=linesman`
    #[arg(long)]
    system_log: bool,
    /// At the end one JSON object, schema linesman.run/1, and nothing else
    #[arg(long)]
    pub(crate) json: bool,
}

fn state(word: &str) -> Result<AlState, String> {
    let known = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
    let same = |state: &&AlState| state.to_string().eq_ignore_ascii_case(word);
    let found = known.iter().find(same).copied();
    found.ok_or_else(|| "expected INIT, PREOP, SAFEOP or OP".to_owned())
}

/// Drives the line.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let selector: Selector = arguments.on.parse()?;
    let lasts = arguments.seconds;
    let source = match &arguments.file {
        Some(path) => Source::read(path, arguments.cycle_us, output)?,
        None => Source::AsFound,
    };
    let choices =
        PlanChoices { target: arguments.to, cycle: arguments.cycle_us, ..PlanChoices::default() };
    let title = match (&source, &arguments.file) {
        (Source::Project(project), Some(path)) => {
            format!("{} of {}", count(project.devices.len() as u64, "SubDevice"), path.display())
        }
        (Source::Planned(plan, _), Some(path)) => {
            format!("{} of {}", count(plan.devices.len() as u64, "SubDevice"), path.display())
        }
        _ => "what is there".to_owned(),
    };
    let wanted_gateway = arguments.gateway.wanted(&source)?;
    let setup = (!arguments.no_diagnosis).then(|| Setup {
        input: InputKind::Driven,
        project: match &source {
            Source::Project(project) => Some((**project).clone()),
            Source::Planned(_, project) => project.as_deref().cloned(),
            Source::AsFound => None,
        },
        exchange: match &source {
            Source::Planned(plan, _) => plan.exchange(),
            Source::AsFound | Source::Project(_) => PlannedExchange::default(),
        },
        source: arguments.on.clone(),
        probes: true,
        host_counters: true,
        ..Setup::default()
    });
    let options = SessionOptions {
        on: arguments.on.clone(),
        leave: arguments.leave,
        lasts,
        real_time: None,
        allowed_misses: arguments
            .image
            .is_some()
            .then_some(u32::try_from(arguments.misses).unwrap_or(u32::MAX)),
        hold: arguments.wait_for_outputs,
        diagnose: setup,
    };
    let wanted = match source {
        Source::Project(project) => choices.project(*project),
        Source::Planned(mut plan, _) => {
            for device in &mut plan.devices {
                device.target = device.target.min(arguments.to);
            }
            PlanSource::Plan(plan)
        }
        Source::AsFound => choices.as_found(),
    };
    let clock = HostClock::start();
    let began = clock.started_at();
    let log = match &arguments.log {
        Some(path) => {
            let project = arguments
                .file
                .as_deref()
                .map_or_else(String::new, |file| file.display().to_string());
            let log = EventLog::create(path)?;
            Some(EventLogWriter::start(log, began, &arguments.on, &project, &version::tool())?)
        }
        None => None,
    };
    let online = OnlineState::new(&arguments.on);
    let system_log = match arguments.system_log {
        true => Some(SystemLog::open(&arguments.on).map_err(no_journal)?),
        false => None,
    };
    let without = arguments.log_without.clone();
    let logs = Logs { file: log, system: system_log, without };
    let reporter = RunReporter::new(arguments.json, began, logs, online.clone());
    let application = arguments.image.clone();
    let stop = line_access::stop()?;
    let said = format!(
        "Drives {title} on {} to {}; Ctrl-C stops it: outputs to zero, all back to {}.",
        arguments.on, arguments.to, arguments.leave
    );
    match &selector {
        Selector::Cards(names) => {
            line_access::refuse(names)?;
            let mut line = Cards::open(names, clock)?;
            line.set_spin(arguments.spin_us);
            stop.wakes(&line.wake_handle()).map_err(line_access::no_wake_handle)?;
            let gateway = gateway::open(wanted_gateway, line.wake_handle(), online.clone())?;
            let ethernet = arguments.ethernet.open(line.wake_handle())?;
            online.set_ethernet(ethernet.watch());
            let socket = socket(arguments.control.as_deref(), line.wake_handle(), online)?;
            let real_time = Some(RealTime {
                priority: (arguments.priority > 0).then_some(arguments.priority),
                cpu: arguments.cpu,
                lock_memory: arguments.priority > 0,
            });
            let options = with_source(options, real_time, began.rfc3339());
            let bundles = arguments.bundles.start(began, names)?;
            let beside = (socket, gateway, ethernet, bundles);
            drive(line, wanted, &options, application, beside, &stop, &said, reporter, output)
        }
        Selector::Segment(path) => {
            // Without an end it goes no faster than the host's clock, for a person to look on; so it does for the IP stack of
            // this computer.
            let free = lasts.is_some() && !arguments.ethernet.wants_interface();
            let pace = if free { Pace::Free } else { Pace::Host };
            let line = line_access::virtual_line(path, pace)?;
            stop.wakes(&line.wake_handle()).map_err(line_access::no_wake_handle)?;
            let gateway = gateway::open(wanted_gateway, line.wake_handle(), online.clone())?;
            let ethernet = arguments.ethernet.open(line.wake_handle())?;
            online.set_ethernet(ethernet.watch());
            let socket = socket(arguments.control.as_deref(), line.wake_handle(), online)?;
            let mut options = options;
            if let Some(setup) = &mut options.diagnose {
                setup.clock = "virtual".to_owned();
            }
            // A virtual run has no date.
            let bundles = arguments.bundles.start(UnixTime::EPOCH, &[])?;
            let beside = (socket, gateway, ethernet, bundles);
            drive(line, wanted, &options, application, beside, &stop, &said, reporter, output)
        }
        Selector::Listen(_) | Selector::File(_) => {
            Err(line_access::not_drivable(&arguments.on, &selector))
        }
    }
}

/// What is to be run.
enum Source {
    AsFound,
    Project(Box<Project>),
    /// A plan, and the project that it was made of, unless that was an ENI.
    Planned(Box<Plan>, Option<Box<Project>>),
}

impl Source {
    fn read(path: &Path, cycle: Option<Span>, output: &Output) -> Result<Self, Failure> {
        if !Eni::is_one(&files::bytes(path, "a project or an ENI file", MOST)?) {
            let project = files::project(path)?;
            if !project.chooses() {
                return Ok(Self::Project(Box::new(project)));
            }
        }
        // What chooses more than who is where is planned from what it says.
        let PlanFile { plan, project, notes, .. } = PlanFile::open_with(path, cycle)?;
        // What is left out of it is not found out only when it is missed.
        notes.iter().for_each(|note| output.warn(note));
        Ok(Self::Planned(Box::new(plan), project.map(Box::new)))
    }
}

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

fn no_journal(error: std::io::Error) -> Failure {
    Failure::new(
        format!("--system-log: reaching journald at /run/systemd/journal/socket: {error}"),
        "run it where systemd-journald runs, or keep a log of its own: `--log FILE`",
    )
}

/// The diagnosis learns by which clock times are given.
fn with_source(
    mut options: SessionOptions,
    real_time: Option<RealTime>,
    start: Option<String>,
) -> SessionOptions {
    options.real_time = real_time;
    if let Some(setup) = &mut options.diagnose {
        setup.clock = "host, monotonic".to_owned();
        setup.start = start;
    }
    options
}

/// The diagnosis of the run, with a recorder of bundles beside it where one is wanted.
fn observer(setup: Setup, recorder: Option<BundleRecorder>) -> Box<dyn DiagnosisObserver> {
    let engine = Engine::new(setup);
    match recorder {
        Some(recorder) => Box::new(RecordedEngine::new(engine, recorder)),
        None => Box::new(engine),
    }
}

/// What runs beside the line.
type RunCompanions = (
    Option<ServiceSocket>,
    Option<MailboxGateway>,
    VirtualEthernet,
    Option<(BundleRecorder, BundleReceiver)>,
);

/// Runs the line in a thread of its own, and tells what happens meanwhile.
#[allow(clippy::too_many_arguments, reason = "called twice, from above")]
fn drive<L: Transport<Error = LinkError> + Send>(
    line: L,
    wanted: PlanSource,
    options: &SessionOptions,
    image: Option<PathBuf>,
    (socket, gateway, ethernet, bundles): RunCompanions,
    stop: &Stop,
    said: &str,
    mut reporter: RunReporter,
    output: &mut Output,
) -> Result<Status, Failure> {
    reporter.line(said, output);
    if let Some(gateway) = &gateway {
        reporter.line(&gateway::opened(gateway), output);
    }
    if let Some(text) = ethernet::opened(&ethernet) {
        reporter.line(&text, output);
    }
    let (notes, told) = mpsc::sync_channel(NOTES);
    let socket_watch = socket.as_ref().map(ServiceSocket::watch);
    let (recorder, news) = bundles.unzip();
    let look = |reporter: &mut RunReporter, output: &mut Output| {
        reporter.look_at_logs(output);
        if let Some(news) = &news {
            recording::tell(news, !reporter.is_json(), output);
        }
        if let Some(why) = socket_watch.as_ref().and_then(ControlSocketWatch::trouble) {
            reporter.complain(&why, output);
        }
    };
    let ended = std::thread::scope(|scope| {
        let beside = RunControls { stop, notes, socket, gateway, ethernet: Some(ethernet) };
        let judge = move |setup| observer(setup, recorder);
        let work = move || match image {
            None => running::run_observed(line, wanted, Idle, options, beside, judge),
            Some(path) => {
                running::run_observed(line, wanted, Shared::at(path), options, beside, judge)
            }
        };
        let thread = scope.spawn(work);
        let mut looked = std::time::Instant::now();
        loop {
            if looked.elapsed() >= LOOK_EVERY {
                looked = std::time::Instant::now();
                look(&mut reporter, output);
            }
            match told.recv_timeout(QUIET) {
                Ok(note) => reporter.note(&note, output),
                Err(RecvTimeoutError::Timeout) => {
                    reporter.flush(output);
                    output.look_for_reader();
                }
                Err(RecvTimeoutError::Disconnected) => break,
            }
            // A connection that broke, without a terminal, leaves nothing but this behind.
            if output.is_closed() && !stop.is_set() {
                output.warn("nobody reads standard output any more: the line is stopped");
                stop.set();
            }
        }
        reporter.flush(output);
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    look(&mut reporter, output);
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
    let RunOutcome { mut report, error, failed } =
        ended.map_err(|error| line_access::nobody(&error).at(&options.on))?;
    if let Some(diagnosis) = &mut report.diagnosis {
        diagnosis.tool = version::tool();
    }
    if reporter.is_json() {
        output.json(&report);
    } else {
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
        return Err(line_access::nobody(&error).at(&options.on));
    }
    if let Some(failure) = failed {
        // It was said when it happened.
        reporter.failed(&failure, output);
        return Ok(Status::NotJudged);
    }
    let faulty =
        report.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.verdict == Verdict::Faulty);
    Ok(if faulty || report.reached_ns.is_none() || !report.not_taken.is_empty() {
        Status::Findings
    } else if report.counts.undiagnosed > 0 {
        Status::Inconclusive
    } else {
        Status::Good
    })
}
