//! `linesman run`: a line is driven: brought up, exchanging process data, watched, stopped.

pub(super) mod ads;
mod drive;
pub(super) mod ethernet;
pub(super) mod gateway;
mod reporter;
pub(super) mod several;

use std::path::{Path, PathBuf};

use linesman_config::eni::Eni;
use linesman_config::plan::{Plan, PlannedExchange};
use linesman_config::project::Project;
use linesman_diagnosis::{InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::EntryKind;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_runtime::event_log::{EventLog, EventLogWriter};
use linesman_runtime::online::OnlineState;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::{PlanChoices, PlanSource, RealTime, SessionOptions};
use linesman_runtime::selector::Selector;
use linesman_runtime::system_log::SystemLog;
use linesman_runtime::transport::{Cards, Pace, TimeShare};

use self::ads::AdsArguments;
use self::drive::{Companions, NetworkRun};
use self::ethernet::EthernetArguments;
use self::gateway::GatewayArguments;
use self::reporter::{Logs, RunReporter};
use self::several::NetworkChoices;
use super::bundle::recording::BundleArguments;
use super::line_access;
use crate::amount::{MICROSECOND, count as count_of, cycle, duration, lasting};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

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
    /// as it is. Of several networks one each, in the order of --on
    #[arg(value_name = "PROJECT.toml|ENI.xml")]
    files: Vec<PathBuf>,
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml. Given several times: several networks that have one
    /// time, which the first leads
    #[arg(long, value_name = "WHERE", required = true)]
    pub(crate) on: Vec<String>,
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
    /// /dev/shm/machine. Of several networks one each, in the order of --on
    #[arg(long, value_name = "FILE")]
    image: Vec<PathBuf>,
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
    /// Open a socket for service commands beside the run; it is there once the line is being driven. Of several networks
    /// one each, in the order of --on
    #[arg(long, value_name = "SOCKET")]
    control: Vec<PathBuf>,
    #[command(flatten)]
    gateway: GatewayArguments,
    #[command(flatten)]
    ads: AdsArguments,
    #[command(flatten)]
    ethernet: EthernetArguments,
    #[command(flatten)]
    bundles: BundleArguments,
    /// Do not judge the line meanwhile
    #[arg(long, conflicts_with = "bundles")]
    no_diagnosis: bool,
    /// Keep what happens in an event log, for `linesman log`; runs are added to a file that is there. Of several networks
    /// one each, in the order of --on
    #[arg(long, value_name = "FILE")]
    log: Vec<PathBuf>,
    /// Tell and log nothing of this kind (as in `linesman log --kind`): counter, link, state and others; may be
    /// given several times
    #[arg(long, value_name = "KIND", value_parser = super::log::kind)]
    log_without: Vec<EntryKind>,
    /// Tell the log of the system, too: `journalctl SYSLOG_IDENTIFIER=linesman`
    #[arg(long)]
    system_log: bool,
    /// At the end one JSON object, schema linesman.run/1, and nothing else; of several networks linesman.runs/1
    #[arg(long)]
    pub(crate) json: bool,
}

fn state(word: &str) -> Result<AlState, String> {
    let known = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
    let same = |state: &&AlState| state.to_string().eq_ignore_ascii_case(word);
    let found = known.iter().find(same).copied();
    found.ok_or_else(|| "expected INIT, PREOP, SAFEOP or OP".to_owned())
}

/// Drives the line, or several.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let selectors = arguments.on.iter().map(|on| on.parse()).collect::<Result<Vec<_>, _>>()?;
    let networks = several::networks(arguments)?;
    for (on, selector) in arguments.on.iter().zip(&selectors) {
        if matches!(selector, Selector::Listen(_) | Selector::File(_)) {
            return Err(line_access::not_drivable(on, selector));
        }
    }
    if selectors.iter().all(|selector| matches!(selector, Selector::Cards(_))) {
        return on_cards(arguments, &selectors, networks, output);
    }
    on_segments(arguments, &selectors, networks, output)
}

/// Drives lines on cards of this computer.
fn on_cards(
    arguments: &Arguments,
    selectors: &[Selector],
    networks: Vec<NetworkChoices<'_>>,
    output: &mut Output,
) -> Result<Status, Failure> {
    let sources = sources(arguments, &networks, output)?;
    // Times of all networks count from the same moment.
    let clock = HostClock::start();
    let began = clock.started_at();
    let real_time = Some(RealTime {
        priority: (arguments.priority > 0).then_some(arguments.priority),
        cpu: arguments.cpu,
        lock_memory: arguments.priority > 0,
    });
    let stop = line_access::stop()?;
    let mut runs = Vec::new();
    for ((network, source), selector) in networks.into_iter().zip(sources).zip(selectors) {
        let Selector::Cards(names) = selector else { continue };
        let mut run = network.prepare(arguments, source, began)?;
        line_access::refuse(names)?;
        let mut line = Cards::open(names, clock)?;
        line.set_spin(arguments.spin_us);
        let bundles = arguments.bundles.start(began, names)?;
        run.open(arguments, line.wake_handle(), bundles, &stop)?;
        run.options = with_source(run.options, real_time, began.rfc3339());
        runs.push((line, run));
    }
    drive::drive(runs, &stop, arguments.json, output)
}

/// Drives virtual lines in this process.
fn on_segments(
    arguments: &Arguments,
    selectors: &[Selector],
    networks: Vec<NetworkChoices<'_>>,
    output: &mut Output,
) -> Result<Status, Failure> {
    let sources = sources(arguments, &networks, output)?;
    // Without an end it goes no faster than the host's clock, for a person to look on; so it does for the IP stack of
    // this computer.
    let free = arguments.seconds.is_some() && !arguments.ethernet.wants_interface();
    let pace = if free { Pace::Free } else { Pace::Host };
    let began = HostClock::start().started_at();
    let stop = line_access::stop()?;
    let mut runs = Vec::new();
    let mut shares = TimeShare::of(selectors.len()).into_iter();
    for ((network, source), selector) in networks.into_iter().zip(sources).zip(selectors) {
        let Selector::Segment(path) = selector else { continue };
        let mut run = network.prepare(arguments, source, began)?;
        let mut line = line_access::virtual_line(path, pace)?;
        if let Some(share) = shares.next()
            && selectors.len() > 1
        {
            line.share_time(share);
        }
        // A virtual run has no date.
        let bundles = arguments.bundles.start(UnixTime::EPOCH, &[])?;
        run.open(arguments, line.wake_handle(), bundles, &stop)?;
        if let Some(setup) = &mut run.options.diagnose {
            setup.clock = "virtual".to_owned();
        }
        runs.push((line, run));
    }
    drive::drive(runs, &stop, arguments.json, output)
}

fn sources(
    arguments: &Arguments,
    networks: &[NetworkChoices<'_>],
    output: &Output,
) -> Result<Vec<Source>, Failure> {
    let read = |network: &NetworkChoices<'_>| match network.file {
        Some(path) => Source::read(path, arguments.cycle_us, output),
        None => Ok(Source::AsFound),
    };
    networks.iter().map(read).collect()
}

impl NetworkChoices<'_> {
    /// Makes what a run needs of its source, but for the line.
    fn prepare(
        self,
        arguments: &Arguments,
        source: Source,
        began: UnixTime,
    ) -> Result<NetworkRun, Failure> {
        let choices = PlanChoices {
            target: arguments.to,
            cycle: arguments.cycle_us,
            ..PlanChoices::default()
        };
        let title = match (&source, self.file) {
            (Source::Project(project), Some(path)) => {
                let devices = project.devices.len() as u64;
                format!("{} of {}", count(devices, "SubDevice"), path.display())
            }
            (Source::Planned(plan, _), Some(path)) => {
                format!("{} of {}", count(plan.devices.len() as u64, "SubDevice"), path.display())
            }
            _ => "what is there".to_owned(),
        };
        let gateway_options = arguments.gateway.wanted(&source)?;
        let options = SessionOptions {
            on: self.on.to_owned(),
            leave: arguments.leave,
            lasts: arguments.seconds,
            real_time: None,
            allowed_misses: self
                .image
                .is_some()
                .then_some(u32::try_from(arguments.misses).unwrap_or(u32::MAX)),
            hold: arguments.wait_for_outputs,
            diagnose: (!arguments.no_diagnosis).then(|| setup(&source, self.on)),
            group: self.place.clone(),
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
        let log = match self.log {
            Some(path) => {
                let project = self.file.map_or_else(String::new, |file| file.display().to_string());
                let log = EventLog::create(path)?;
                Some(EventLogWriter::start(log, began, self.on, &project, &version::tool())?)
            }
            None => None,
        };
        let online = OnlineState::new(self.on);
        let system_log = match arguments.system_log {
            true => Some(SystemLog::open(self.on).map_err(no_journal)?),
            false => None,
        };
        let without = arguments.log_without.clone();
        let logs = Logs { file: log, system: system_log, without };
        let (json, several) = (arguments.json, self.place.is_some());
        let reporter = RunReporter::new(json, self.on, several, began, logs, online.clone());
        if let Some(place) = self.place {
            online.set_group(place);
        }
        let said = format!(
            "Drives {title} on {} to {}; Ctrl-C stops it: outputs to zero, all back to {}.",
            self.on, arguments.to, arguments.leave
        );
        Ok(NetworkRun {
            wanted,
            options,
            image: self.image.cloned(),
            control: self.control.cloned(),
            gateway_options,
            ads_options: arguments.ads.wanted(),
            companions: Companions::default(),
            online,
            said,
            reporter,
        })
    }
}

/// The set-up of a line's diagnosis.
fn setup(source: &Source, on: &str) -> Setup {
    Setup {
        input: InputKind::Driven,
        project: match source {
            Source::Project(project) => Some((**project).clone()),
            Source::Planned(_, project) => project.as_deref().cloned(),
            Source::AsFound => None,
        },
        exchange: match source {
            Source::Planned(plan, _) => plan.exchange(),
            Source::AsFound | Source::Project(_) => PlannedExchange::default(),
        },
        source: on.to_owned(),
        probes: true,
        host_counters: true,
        ..Setup::default()
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
