//! `linesman sim`: virtual segments on real interfaces, for any MainDevice.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use linesman_lab::drawing;
use linesman_link::error::LinkError;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::control::{Control, ControlSocketWatch};
use linesman_runtime::part::guard;
use linesman_runtime::selector::Selector;
use linesman_runtime::serve::ethernet_ports::EthernetPorts;
use linesman_runtime::serve::lateness::LatenessReport;
use linesman_runtime::serve::report::Status as SimStatus;
use linesman_runtime::serve::{ServeControls, Server};
use linesman_runtime::stop::Stop;
use linesman_runtime::truth_writer::{TruthWriter, TruthWriterWatch};
use linesman_runtime::wiring::Wiring;

use super::line_access;
use crate::amount::lasting;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files::Plant;
use crate::output::Output;
use crate::text::drawing::labels;
use crate::text::quantity::{count, time};

/// So often it is looked whether sockets and logs still work: an idle segment costs next to nothing.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Several segments: name each with its card, `linesman sim a.toml --on eth1 \
                        b.toml --on eth2`; --control and --log then once for each, in the same \
                        order, or not at all."
)]
pub(crate) struct Arguments {
    /// The segment (TOML); more than one, each with an --on
    #[arg(value_name = "SEGMENT.toml", required = true)]
    segments: Vec<PathBuf>,
    /// The network card whose cable leads to the MainDevice, or two for a ring: eth1, eth1+eth2
    #[arg(long, value_name = "NIC[+NIC]", required = true)]
    on: Vec<String>,
    /// End after so long (60, 10m); else Ctrl-C ends it
    #[arg(long, visible_alias = "for", value_name = "SECONDS", value_parser = lasting())]
    seconds: Option<Span>,
    /// Open a socket for `linesman fault`; it is there once the segment answers
    #[arg(long, value_name = "SOCKET")]
    control: Vec<PathBuf>,
    /// Write down what really happens: a line of JSON for each event, in a new file
    #[arg(long, value_name = "FILE")]
    log: Vec<PathBuf>,
    /// Lead an Ethernet port of a switch terminal to a network interface that is made, and removed at the end: S4.1=port1; of
    /// one segment only
    #[arg(long, value_name = "TERMINAL.PORT=INTERFACE", value_parser = ethernet_port)]
    ethernet_port: Vec<(String, String)>,
    /// At the end one JSON object per segment on a line, schema linesman.sim/1; nothing else
    #[arg(long)]
    pub(crate) json: bool,
}

/// A port and the interface it leads to.
fn ethernet_port(text: &str) -> Result<(String, String), String> {
    let halves = text.rsplit_once('=').filter(|(port, name)| !port.is_empty() && !name.is_empty());
    halves.map(|(port, name)| (port.to_owned(), name.to_owned())).ok_or_else(|| {
        "expected a port of a switch terminal and the interface it leads to, such as S4.1=port1"
            .to_owned()
    })
}

/// A segment that is ready to run.
struct Ready {
    server: Server,
    beside: ServeControls,
}

/// Answers frames until asked to stop.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let until = arguments.seconds.map_or(Instant::MAX, |lasts| Instant::ZERO + lasts);
    let cards = cards(arguments)?;
    let stop = line_access::stop()?;
    let mut ready = Vec::new();
    for (index, (file, names)) in arguments.segments.iter().zip(&cards).enumerate() {
        let control = arguments.control.get(index).map(PathBuf::as_path);
        let log = arguments.log.get(index).map(PathBuf::as_path);
        let shown = (!arguments.json).then_some(&mut *output);
        let ports = arguments.ethernet_port.as_slice();
        ready.push(prepare(file, names, control, log, ports, &stop, shown)?);
    }
    if !arguments.json {
        output.line("Ctrl-C ends it.");
    }
    let ended = serve(ready, until, &stop, output);
    let mut failure = None;
    for one in ended {
        if arguments.json {
            output.json_line(&one.status);
        } else {
            output.text(&summary(&one.status));
        }
        failure = failure.or(one.failure);
    }
    failure.map_or(Ok(Status::Good), Err)
}

/// The cards of each segment, each card once.
fn cards(arguments: &Arguments) -> Result<Vec<Vec<String>>, Failure> {
    let Arguments { segments, on, control, log, .. } = arguments;
    let refuse = |reason: String| {
        let each = segments.iter().map(|path| format!(" {} --on NIC", path.display()));
        let advice = format!(
            "name each segment with its card, `linesman sim{}`, and --control and --log once for each or \
             not at all",
            each.collect::<String>()
        );
        Failure::new(reason, advice)
    };
    if segments.len() > 1 && !arguments.ethernet_port.is_empty() {
        let reason = "--ethernet-port: expected one segment".to_owned();
        return Err(Failure::new(reason, "start each segment by a `linesman sim` of its own"));
    }
    if segments.len() != on.len() {
        let (files, cards) = (count(segments.len() as u64, "segment"), on.len());
        return Err(refuse(format!("{files}, but --on {cards} times: expected as many")));
    }
    for (what, paths) in [("--control", control), ("--log", log)] {
        if !paths.is_empty() && paths.len() != segments.len() {
            let (files, times) = (count(segments.len() as u64, "segment"), paths.len());
            return Err(refuse(format!("{files}, but {what} {times} times: expected as many")));
        }
        if let Some(twice) = doubled(paths) {
            return Err(refuse(format!("{what} {}: named twice", twice.display())));
        }
    }
    let mut all = Vec::new();
    for word in on {
        let Selector::Cards(names) = word.parse()? else {
            let reason = format!("`{word}`: expected a network card, or two for a ring");
            return Err(Failure::new(reason, "`linesman interfaces` lists the cards there are"));
        };
        all.push(names);
    }
    let names: Vec<&String> = all.iter().flatten().collect();
    match doubled(&names) {
        Some(twice) => Err(refuse(format!("{twice}: two segments cannot answer on one card"))),
        None => Ok(all),
    }
}

fn doubled<T: PartialEq>(things: &[T]) -> Option<&T> {
    things
        .iter()
        .enumerate()
        .find(|(index, one)| things[..*index].contains(one))
        .map(|(_, one)| one)
}

/// Builds a segment and opens its cards; then its socket, which tells that it is ready.
fn prepare(
    file: &Path,
    names: &[String],
    control: Option<&Path>,
    log: Option<&Path>,
    ports: &[(String, String)],
    stop: &Stop,
    shown: Option<&mut Output>,
) -> Result<Ready, Failure> {
    let mut plant = Plant::open(file)?;
    let drawing: Vec<_> = drawing::draw(plant.segment.tree(), &labels(&plant));
    let wiring = Wiring::of(&plant.segment, &plant.project);
    let said = described(&plant, &wiring, names);
    let mut beside = ServeControls::default();
    if control.is_some() || log.is_some() {
        let truth_writer = TruthWriter::begin(&plant.segment, log).map_err(|error| {
            let path = log.map(|path| format!("{}: ", path.display())).unwrap_or_default();
            let reason = format!("{path}writing down what happens: {error}");
            Failure::new(reason, "name a file that is not there yet, where you may write")
        })?;
        beside.truth_writer = Some(truth_writer);
    }
    let mut bridges = EthernetPorts::default();
    for (port, interface) in ports {
        let opened = bridges.open(&mut plant.segment, port, interface);
        opened.map_err(|error| Failure::from_error(&error))?;
    }
    let server = Server::open(plant.segment, wiring, names)?.with_ethernet_ports(bridges);
    stop.wakes(&server.wake_handle())
        .map_err(|error| Failure::new(format!("listening for Ctrl-C: {error}"), ""))?;
    if let Some(output) = shown {
        for row in drawing {
            output.line(&row.text);
        }
        output.line(&said);
    }
    if let (Some(path), Some(truth_writer)) = (control, &beside.truth_writer) {
        beside.control = Some(open_control(path, &server, truth_writer)?);
    }
    Ok(Ready { server, beside })
}

fn open_control(
    path: &Path,
    server: &Server,
    truth_writer: &TruthWriter,
) -> Result<Control, Failure> {
    Control::open(path, server.wake_handle(), truth_writer.reading()).map_err(|error| {
        let reason = format!("{}: opening the control socket: {error}", path.display());
        Failure::new(reason, "name another path, in a directory where you may write")
    })
}

/// What is on which card, in a line.
fn described(plant: &Plant, wiring: &Wiring, names: &[String]) -> String {
    let devices = count(plant.segment.devices().count() as u64, "SubDevice");
    let wires = match wiring.len() {
        0 => String::new(),
        wires => format!(" {} wired to inputs.", count(wires as u64, "output")),
    };
    format!("\n{devices} on {}.{wires}", names.join("+"))
}

/// How a segment ended.
struct Ended {
    status: SimStatus,
    failure: Option<Failure>,
}

/// Runs all segments, each in a thread of its own, to their end. When one cannot go on, all end:
/// the MainDevices would not learn of it otherwise.
fn serve(ready: Vec<Ready>, until: Instant, stop: &Stop, output: &Output) -> Vec<Ended> {
    let mut watch = Watch::of(&ready);
    let one = |Ready { mut server, mut beside }: Ready| {
        const EFFECT: &str = "all segments end";
        let served = guard("the segment", EFFECT, || server.run(until, stop, &mut beside));
        let result = served.map_err(Failure::from).and_then(|ran| ran.map_err(from_link));
        if result.is_err() {
            stop.set();
        }
        let status = server.status();
        drop(beside.control);
        let written = beside.truth_writer.map_or(Ok(()), TruthWriter::finish);
        let unwritten = |error| {
            let reason = format!("writing down what happened: {error}: the log is not complete");
            Failure::new(reason, "check the free space")
        };
        let failure = result.err().or(written.map_err(unwritten).err());
        Ended { status, failure }
    };
    thread::scope(|scope| {
        // Nothing is ever sent: the channel ends when the last thread lets go of it.
        let (running, ended) = mpsc::channel::<()>();
        let start = |ready| {
            let running = running.clone();
            scope.spawn(|| {
                let _running = running;
                one(ready)
            })
        };
        let threads: Vec<_> = ready.into_iter().map(start).collect();
        drop(running);
        while ended.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
            watch.look(output);
        }
        let joined = threads
            .into_iter()
            .map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        joined.collect()
    })
}

/// Sockets and logs that are looked after while segments run.
struct Watch {
    sockets: Vec<ControlSocketWatch>,
    logs: Vec<TruthWriterWatch>,
}

impl Watch {
    fn of(ready: &[Ready]) -> Self {
        let controls = ready.iter().filter_map(|one| one.beside.control.as_ref());
        let journals = ready.iter().filter_map(|one| one.beside.truth_writer.as_ref());
        Self {
            sockets: controls.map(Control::watch).collect(),
            logs: journals.map(TruthWriter::watch).collect(),
        }
    }

    /// Says once what does not work any more.
    fn look(&mut self, output: &Output) {
        self.sockets.retain(|socket| match socket.trouble() {
            Some(why) => {
                output.fail(&Failure::from_text(&why));
                false
            }
            None => true,
        });
        self.logs.retain(|log| match log.trouble() {
            Some(why) => {
                output.warn(&format!("writing down what happens: {why}: the log ends here"));
                false
            }
            None => true,
        });
    }
}

fn from_link(error: LinkError) -> Failure {
    error.into()
}

/// What went over the interfaces, and whether the host kept up: two lines and what is notable.
pub(crate) fn summary(status: &SimStatus) -> String {
    let SimStatus { name, interfaces, time_ns, frames, host, .. } = status;
    let mut parts = vec![
        format!("{} received", count(frames.received, "frame")),
        format!("{} answered", frames.answered),
    ];
    for (number, what) in [
        (frames.damaged, "came back damaged and were dropped"),
        (frames.outstanding, "vanished or are on their way"),
        (frames.refused, "could not be sent"),
    ] {
        if number > 0 {
            parts.push(format!("{number} {what}"));
        }
    }
    if host.downs > 0 {
        parts.push("the interface was switched off for a while".to_owned());
    }
    let title = if name.is_empty() { interfaces.join("+") } else { name.clone() };
    let ran = time(*time_ns);
    let mut text = format!("{title} ran for {ran}: {}.\n", parts.join(", "));
    let busy = 100.0 * host.busy_share;
    text.push_str(&format!("This host: busy {busy:.1} % of the time"));
    if frames.received > 0 {
        text.push_str(&format!("; it saw frames {} after they came", late(&host.pickup)));
    }
    if host.answer.frames > 0 {
        text.push_str(&format!(
            ", and sent answers {} after the model had them back, {} of them more than 100 µs and {} \
             more than 1 ms late",
            late(&host.answer), host.answer.over_100us, host.answer.over_1ms
        ));
    }
    text.push_str(".\n");
    if host.dropped > 0 {
        let lost = count(host.dropped, "frame");
        text.push_str(&format!("{lost} were lost because this host did not fetch them in time.\n"));
    }
    if !host.real_time {
        text.push_str(
            "It had no real-time priority: give it CAP_SYS_NICE, or start it with sudo.\n",
        );
    }
    text
}

fn late(report: &LatenessReport) -> String {
    let LatenessReport { p50_ns, p99_ns, max_ns, .. } = *report;
    format!("{} (99 %: {}, at most {})", time(p50_ns), time(p99_ns), time(max_ns))
}
