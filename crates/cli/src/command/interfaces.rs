//! `linesman interfaces`: which network cards there are and whether they suit EtherCAT.

use std::thread;

use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::interface::{self, Assessment, Duplex, Interface, NoteWeight, Suitability};
use linesman_link::socket::{Batch, ListenFilter, Listener, Ready};
use linesman_proto::time::Span;
use serde::Serialize;

use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table, wrapped};
use crate::version;

/// How long each card is listened to; a MainDevice at work sends at least every 100 ms.
const LISTEN: Span = Span::ms(300);

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// All interfaces, also those that cannot carry EtherCAT
    #[arg(long, short)]
    all: bool,
    /// JSON, schema linesman.interfaces/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.interfaces/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The interfaces, in the order of the system.
    interfaces: Vec<InterfaceReport>,
}

/// An interface.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct InterfaceReport {
    /// Its name.
    name: String,
    /// Its hardware address.
    mac: Option<String>,
    /// What stands behind it.
    kind: String,
    /// Its driver.
    driver: Option<String>,
    /// The bus it is on.
    bus: Option<String>,
    /// Whether it is switched on.
    up: bool,
    /// Whether there is a link.
    link: bool,
    /// Speed of the link in Mbit/s.
    speed_mbit: Option<u32>,
    /// Whether the link is full duplex.
    full_duplex: Option<bool>,
    /// `suitable`, `limited` or `unsuitable`.
    suitability: String,
    /// EtherCAT frames heard in 300 ms; `null` when it could not be listened to.
    ethercat_frames: Option<u64>,
    /// What matters to EtherCAT, heaviest first.
    notes: Vec<NoteReport>,
}

/// A note about an interface.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoteReport {
    /// `information`, `warning` or `obstacle`.
    weight: String,
    /// What it is.
    text: String,
    /// What to do about it; empty where there is nothing to do.
    action: String,
}

/// An interface with all there is to say about it.
struct Judged {
    interface: Interface,
    assessment: Assessment,
    heard: Result<u64, LinkError>,
}

/// Lists the interfaces.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let judged = judge(interface::list()?);
    if arguments.json {
        output.json(&report(&judged));
    } else {
        print(&judged, arguments.all, output);
    }
    Ok(Status::Good)
}

/// Listens on all interfaces at the same time.
fn judge(interfaces: Vec<Interface>) -> Vec<Judged> {
    thread::scope(|scope| {
        let listening: Vec<_> = interfaces
            .into_iter()
            .map(|interface| {
                let name = interface.name.clone();
                (interface, scope.spawn(move || listen(&name)))
            })
            .collect();
        let judged = listening.into_iter().map(|(interface, thread)| Judged {
            assessment: interface.assess(),
            heard: thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            interface,
        });
        judged.collect()
    })
}

/// How many EtherCAT frames are on the interface within [`LISTEN`].
fn listen(name: &str) -> Result<u64, LinkError> {
    let clock = HostClock::start();
    let mut listener = Listener::open(name, ListenFilter::EtherCat)?;
    let mut batch = Batch::new(64);
    let deadline = clock.now() + LISTEN;
    let mut heard = 0;
    loop {
        match listener.wait(&clock, deadline)? {
            Ready::Readable => heard += listener.recv_batch(&mut batch, &clock)? as u64,
            Ready::Deadline => return Ok(heard),
            Ready::Interrupted => {}
        }
        if clock.now() >= deadline {
            return Ok(heard);
        }
    }
}

fn report(judged: &[Judged]) -> Report {
    let one = |judged: &Judged| {
        let Judged { interface, assessment, heard } = judged;
        let notes = assessment.notes.iter().map(|note| NoteReport {
            weight: weight(note.weight).to_owned(),
            text: note.text.clone(),
            action: note.action.clone(),
        });
        InterfaceReport {
            name: interface.name.clone(),
            mac: interface.mac.map(|mac| mac.to_string()),
            kind: interface.kind.to_string(),
            driver: interface.driver.clone(),
            bus: interface.bus.clone(),
            up: interface.up,
            link: interface.carrier,
            speed_mbit: interface.speed_mbit,
            full_duplex: interface.duplex.map(|duplex| duplex == Duplex::Full),
            suitability: assessment.suitability.to_string(),
            ethercat_frames: heard.as_ref().ok().copied(),
            notes: notes.collect(),
        }
    };
    Report {
        schema: "linesman.interfaces/1".to_owned(),
        tool: version::tool(),
        interfaces: judged.iter().map(one).collect(),
    }
}

const fn weight(weight: NoteWeight) -> &'static str {
    match weight {
        NoteWeight::Information => "information",
        NoteWeight::Warning => "warning",
        NoteWeight::Obstacle => "obstacle",
    }
}

fn print(judged: &[Judged], all: bool, output: &mut Output) {
    let paint = output.paint();
    let shown: Vec<&Judged> = judged
        .iter()
        .filter(|judged| all || judged.assessment.suitability != Suitability::Unsuitable)
        .collect();
    let mut table = Table::new(&["interface", "link", "kind", "driver", "", "EtherCAT"], paint);
    for judged in &shown {
        let Judged { interface, assessment, heard } = judged;
        let suitability = assessment.suitability.to_string();
        table.row([
            paint.bold(&interface.name),
            link_text(interface),
            interface.kind.to_string(),
            interface.driver.clone().unwrap_or_else(|| "-".to_owned()),
            match assessment.suitability {
                Suitability::Suitable => paint.good(&suitability),
                Suitability::Limited => paint.warning(&suitability),
                Suitability::Unsuitable => paint.faint(&suitability),
            },
            match heard {
                Ok(0) => "none heard".to_owned(),
                Ok(frames) => paint.warning(&format!("{frames} frames in 300 ms")),
                Err(_) => "?".to_owned(),
            },
        ]);
    }
    if shown.is_empty() {
        output.line("No network interface here can carry EtherCAT.");
    } else {
        output.text(&table.render());
    }
    for judged in &shown {
        print_notes(judged, output);
    }
    let hidden = judged.len() - shown.len();
    if hidden > 0 {
        output.line(&format!("\n{hidden} more cannot carry EtherCAT; `--all` shows them."));
    }
    let refused = shown.iter().find_map(|judged| match &judged.heard {
        Err(error @ LinkError::NoPrivilege { .. }) => Some(Failure::from_error(error)),
        Ok(_) | Err(_) => None,
    });
    if let Some(Failure { next_step, .. }) = refused {
        output.line(&format!("\nWhether EtherCAT is on them can be heard after: {next_step}"));
    }
}

fn print_notes(judged: &Judged, output: &mut Output) {
    let Judged { interface, assessment, heard } = judged;
    let (paint, width) = (output.paint(), output.width());
    let driven = matches!(heard, Ok(1..));
    if assessment.notes.is_empty() && !driven {
        return;
    }
    let mut text = format!("\n{}\n", paint.bold(&interface.name));
    if driven {
        let words = format!(
            "a MainDevice is at work here. Watch it with `linesman diagnose listen:{}`",
            interface.name
        );
        text.push_str(&wrapped("  ! ", &words, width));
    }
    for note in &assessment.notes {
        let sign = match note.weight {
            NoteWeight::Information => "  - ",
            NoteWeight::Warning => "  ! ",
            NoteWeight::Obstacle => "  x ",
        };
        let action = match note.action.as_str() {
            "" => String::new(),
            action => format!(". Do: {action}"),
        };
        text.push_str(&wrapped(sign, &format!("{}{action}", note.text), width));
    }
    output.text(&text);
}

fn link_text(interface: &Interface) -> String {
    if !interface.up {
        return "off".to_owned();
    }
    if !interface.carrier {
        return "none".to_owned();
    }
    interface.speed_mbit.map_or_else(|| "yes".to_owned(), |speed| format!("{speed} Mbit/s"))
}
