//! `linesman online`: a network as it is now, once or again and again.
//!
//! Of a line that a MainDevice drives its socket is asked; a line that nobody drives is looked at with
//! nothing but reads; a saved report is shown again.

mod detail;
mod live;
mod read_only;
mod table;

use std::path::{Path, PathBuf};
use std::time::Duration;

use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_proto::state::NetworkState;
use linesman_proto::time::Span;
use linesman_runtime::online::report::{OnlineReport, SCHEMA};
use linesman_runtime::selector::Selector;
use linesman_runtime::service;

use self::live::{Live, Pace};
use crate::amount::{MILLISECOND, SECOND, duration};
use crate::command::line_access;
use crate::command::service::{is_socket, silent};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;

/// Most bytes of a saved report.
const MOST: u64 = 256 * 1024 * 1024;
/// Looks at a network until it shows that it was reset, and the time between them.
const LOOKS_AFTER_RESET: u32 = 100;
const BETWEEN_LOOKS: Duration = Duration::from_millis(10);

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: the socket of `run --control`; eth0, eth0+eth1 (a ring) or sim:plant.toml for a
    /// line that nobody drives; or a report that was saved (a path ending in .json)
    #[arg(value_name = "WHERE", required_unless_present = "control")]
    pub(crate) place: Option<String>,
    /// One SubDevice in detail: its number (3), station address (0x1003), position (position:2) or name, also as
    /// answers write it ("Term 4 (EL3104)"); all unless said
    #[arg(value_name = "DEVICE")]
    device: Option<String>,
    /// The socket of a running MainDevice, instead of WHERE
    #[arg(long, value_name = "SOCKET")]
    control: Option<PathBuf>,
    /// Again and again: a table on a terminal (q ends it), else a line for each change
    #[arg(long, short)]
    live: bool,
    /// How long to look (5, 10m); live without an end unless said
    #[arg(long, visible_alias = "for", value_name = "SECONDS", value_parser = duration(SECOND, Span::ZERO, Span::s(86_400)))]
    seconds: Option<Span>,
    /// Time between two looks of the live view (500, 1s)
    #[arg(
        long,
        visible_alias = "interval",
        value_name = "MS",
        default_value = "500",
        value_parser = duration(MILLISECOND, Span::ms(20), Span::s(60))
    )]
    interval_ms: Span,
    /// Let counts begin at 0 first. Errors: the registers too, which are read and cleared in one go
    #[arg(long, value_name = "WHAT", value_enum)]
    clear: Option<What>,
    /// Reset the network first: outputs that are locked after a link error are sent again
    #[arg(long)]
    reset: bool,
    /// Keep the report in a file, to be shown again later
    #[arg(long, value_name = "FILE.json")]
    save: Option<PathBuf>,
    /// JSON, schema linesman.online/1; with --live one object a line
    #[arg(long)]
    pub(crate) json: bool,
}

/// Which counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
enum What {
    /// Error counters and change counters
    Errors,
    /// Frames sent and lost
    Frames,
    /// Both
    All,
}

impl What {
    const fn errors(self) -> bool {
        matches!(self, Self::Errors | Self::All)
    }

    const fn frames(self) -> bool {
        matches!(self, Self::Frames | Self::All)
    }
}

/// Shows what was asked for.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if let Some(path) = &arguments.save {
        files::refuse_to_overwrite(path)?;
    }
    let (place, device) = match (&arguments.control, &arguments.place, &arguments.device) {
        // With an option for the socket the first word is the SubDevice.
        (Some(_), place, None) => (None, place.as_deref()),
        (Some(_), Some(_), Some(_)) => return Err(twice()),
        (_, place, device) => (place.as_deref(), device.as_deref()),
    };
    let place = place.unwrap_or_default().to_owned();
    let socket = match &arguments.control {
        Some(path) => Some(path.clone()),
        None => is_socket(&place).then(|| PathBuf::from(&place)),
    };
    if arguments.reset && socket.is_none() {
        return Err(refuse_reset(&place));
    }
    let report = if let Some(path) = socket {
        driven(&path, arguments, output)?
    } else if Path::new(&place).extension().is_some_and(|ending| ending == "json") {
        saved(Path::new(&place))?
    } else {
        line_access::refuse_missing_socket(&place)?;
        match place.parse::<Selector>()? {
            Selector::Cards(names) => read_only::cards(&names, &place, arguments, output)?,
            Selector::Segment(path) => read_only::segment(&path, &place, arguments, output)?,
            selector @ (Selector::Listen(_) | Selector::File(_)) => {
                return Err(line_access::not_drivable(&place, &selector));
            }
        }
    };
    conclude(&report, device, arguments, output)
}

fn twice() -> Failure {
    Failure::new("WHERE and --control both say where the line is", "leave one of them out")
}

fn conclude(
    report: &OnlineReport,
    device: Option<&str>,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<Status, Failure> {
    if let Some(path) = &arguments.save {
        let text = serde_json::to_string_pretty(report)
            .map_err(|error| Failure::new(format!("writing JSON: {error}"), ""))?;
        files::write_new(path, "the report", &text)?;
    }
    let chosen = match device {
        Some(word) => Some(detail::find(report, word)?),
        None => None,
    };
    // A live view has shown all that there was.
    if !arguments.live {
        if arguments.json {
            output.json(report);
        } else if let Some(device) = chosen {
            output.text(&detail::text(report, device, output));
        } else {
            output.text(&table::text(report, None, output));
        }
    }
    Ok(if report.has_trouble() { Status::Findings } else { Status::Good })
}

fn interval(arguments: &Arguments) -> Duration {
    Duration::from_nanos(arguments.interval_ms.as_nanos())
}

/// How long to look; `None`: until somebody ends it.
fn lasts(arguments: &Arguments) -> Option<Duration> {
    arguments.seconds.map(|lasts| Duration::from_nanos(lasts.as_nanos()))
}

/// A line that a MainDevice drives.
fn driven(
    path: &Path,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<OnlineReport, Failure> {
    if let Some(what) = arguments.clear {
        clear(path, what, output)?;
    }
    if arguments.reset {
        reset(path, output)?;
    }
    let pace = Pace { interval: interval(arguments), lasts: lasts(arguments) };
    if !arguments.live {
        if let Some(lasts) = pace.lasts {
            std::thread::sleep(lasts);
        }
        return ask(path);
    }
    let mut live = Live::start(arguments.json, pace, output)?;
    loop {
        let report = ask(path)?;
        live.show(&report, output)?;
        if !live.wait(output)? {
            return Ok(report);
        }
    }
}

fn ask(path: &Path) -> Result<OnlineReport, Failure> {
    let answer = service::online(path).map_err(|error| silent(path, &error))?;
    match (answer.online, answer.error) {
        (Some(report), _) => Ok(OnlineReport { on: path.display().to_string(), ..*report }),
        (None, Some(why)) => {
            let (reason, advice) = why.split_once(". Do: ").unwrap_or((&why, "ask again"));
            Err(Failure::new(format!("{}: {reason}", path.display()), advice))
        }
        (None, None) => {
            let reason =
                format!("{}: whoever listens there does not say how the line is", path.display());
            Err(Failure::new(reason, "name the socket of `linesman run --on NIC --control SOCKET`"))
        }
    }
}

/// The registers first, each read and cleared in one go; then what was summed up.
fn clear(path: &Path, what: What, output: &Output) -> Result<(), Failure> {
    if what.errors() {
        for device in ask(path)?.devices {
            let Some(id) = DeviceId::from_no(device.no) else { continue };
            let answer = service::ask(path, id.no(), &Service::ClearCounters)
                .map_err(|error| silent(path, &error))?;
            if let Some(why) = answer.error {
                // The others are cleared all the same.
                output.warn(&format!("its counters stand: {why}"));
            }
        }
    }
    let answer = service::clear(path, what.errors(), what.frames());
    answer.map(drop).map_err(|error| silent(path, &error))
}

/// Ends what keeps outputs locked.
fn reset(path: &Path, output: &Output) -> Result<(), Failure> {
    let answer = service::reset(path).map_err(|error| silent(path, &error))?;
    if let Some(why) = answer.error {
        output.warn(&format!("nothing was reset: {why}"));
        return Ok(());
    }
    // What is shown is the latest look at the network, which may have been before the reset.
    for _ in 0..LOOKS_AFTER_RESET {
        if ask(path)?.state.word & NetworkState::LOCKED == 0 {
            break;
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
    Ok(())
}

/// Refusal of a reset of a line that no MainDevice drives.
fn refuse_reset(place: &str) -> Failure {
    let reason = format!("{place}: no MainDevice drives it, so there is nothing to reset");
    Failure::new(reason, "name the socket of `linesman run --on NIC --control SOCKET`")
}

/// A report that was kept.
fn saved(path: &Path) -> Result<OnlineReport, Failure> {
    let bytes = files::bytes(path, "a report of `linesman online`", MOST)?;
    let advice = "name a file that `linesman online WHERE --save FILE.json` has written";
    let report: OnlineReport = serde_json::from_slice(&bytes)
        .map_err(|error| Failure::new(format!("{}: {error}", path.display()), advice))?;
    if report.schema != SCHEMA {
        let found = &report.schema;
        let reason = format!("{}: schema `{found}`, expected `{SCHEMA}`", path.display());
        return Err(Failure::new(reason, advice));
    }
    Ok(report)
}
