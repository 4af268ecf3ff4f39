//! `linesman sim`: a virtual segment on real interfaces, for any MainDevice.

use std::path::{Path, PathBuf};

use linesman_lab::drawing;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::control::Control;
use linesman_runtime::selector::Selector;
use linesman_runtime::serve::{Served, Server};
use linesman_runtime::wiring::Wiring;

use super::driven;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files::Plant;
use crate::output::Output;
use crate::text::drawing::labels;
use crate::text::quantity::{count, time};

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The segment (TOML)
    #[arg(value_name = "SEGMENT.toml")]
    segment: PathBuf,
    /// The network card whose cable leads to the MainDevice, or two for a ring: eth1, eth1+eth2
    #[arg(long, value_name = "NIC[+NIC]")]
    on: String,
    /// End after so many seconds; else Ctrl-C ends it
    #[arg(long, value_name = "N")]
    seconds: Option<f64>,
    /// Open a socket for `linesman fault`, to break and heal the segment while it runs
    #[arg(long, value_name = "SOCKET")]
    control: Option<PathBuf>,
}

/// Answers frames until asked to stop.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let Selector::Cards(names) = arguments.on.parse()? else {
        let reason = format!("`{}`: expected a network card, or two for a ring", arguments.on);
        return Err(Failure::new(reason, "say for example `--on eth1`"));
    };
    let plant = Plant::open(&arguments.segment)?;
    let until = until(arguments.seconds)?;
    let stop = driven::stop()?;
    for row in drawing::draw(plant.segment.tree(), &labels(&plant)) {
        output.line(&row.text);
    }
    let count_text = count(plant.segment.devices().count() as u64, "SubDevice");
    let wiring = Wiring::of(&plant.segment, &plant.project);
    let wires = match wiring.len() {
        0 => String::new(),
        wires => format!(" {} wired to inputs.", count(wires as u64, "output")),
    };
    let control = arguments.control.as_deref().map(open_control).transpose()?;
    let mut server = Server::open(plant.segment, wiring, &names)?;
    output.line(&format!("\n{count_text} on {}.{wires} Ctrl-C ends it.", names.join("+")));
    let result = server.run(until, &stop, control.as_ref());
    output.line(&summary(&server.served(), server.clock().now()));
    result?;
    Ok(Status::Good)
}

fn open_control(path: &Path) -> Result<Control, Failure> {
    Control::open(path).map_err(|error| {
        let reason = format!("{}: opening the control socket: {error}", path.display());
        Failure::new(reason, "name another path, in a directory where you may write")
    })
}

/// The end of a run that lasts so many seconds.
pub(crate) fn until(seconds: Option<f64>) -> Result<Instant, Failure> {
    let Some(seconds) = seconds else { return Ok(Instant::MAX) };
    if !(0.0..=1e9).contains(&seconds) {
        let reason = format!("--seconds {seconds}: expected a number from 0 to 1,000,000,000");
        return Err(Failure::new(reason, "leave it out to go on until Ctrl-C"));
    }
    Ok(Instant::ZERO + Span::ns((seconds * 1e9) as u64))
}

fn summary(served: &Served, ran: Instant) -> String {
    let mut parts = vec![
        format!("{} received", count(served.received, "frame")),
        format!("{} answered", served.sent),
    ];
    if served.damaged > 0 {
        parts.push(format!("{} came back damaged and were dropped", served.damaged));
    }
    if served.refused > 0 {
        parts.push(format!("{} could not be sent", served.refused));
    }
    if served.downs > 0 {
        parts.push("the interface was switched off for a while".to_owned());
    }
    parts.push(format!("answers at most {} late", time(served.latest.as_nanos())));
    format!("Ran for {}: {}.", time(ran.as_nanos()), parts.join(", "))
}
