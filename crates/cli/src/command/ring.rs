//! `linesman ring`: sets up a ring step by step. The line is scanned with the ring open, then its end is plugged into the
//! second card, the end is checked, and the project written with which `run` drives it.
//!
//! Source: S0 L1106-1113.

pub(crate) mod report;

use std::path::{Path, PathBuf};
use std::time::Duration;

use linesman_config::fault::FaultName;
use linesman_config::inventory::Inventory;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_config::project::Project;
use linesman_link::clock::HostClock;
use linesman_link::interface;
use linesman_proto::address::{DeviceId, Path as CardPath};
use linesman_proto::port::Port;
use linesman_proto::sii::PortKind;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_proto::topology::End;
use linesman_runtime::run::{scan, scan::PATIENCE};
use linesman_runtime::selector::Selector;
use linesman_runtime::transport::{Cards, Pace, SegmentTransport};
use linesman_runtime::wait::look_until;
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment_file::FaultEntry;

use self::report::{Report, RingCable, RingTrouble, StepTeller, cables};
use super::line_access;
use crate::amount;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the ring is: eth0+eth1, the card at its beginning first; or sim:plant.toml
    #[arg(value_name = "WHERE")]
    pub(crate) place: String,
    /// The port that closes the ring, such as 9.B for port B of SubDevice 9; the free port at the end of the line unless
    /// said
    #[arg(long, value_name = "NO.PORT")]
    end: Option<String>,
    /// How long to wait for a cable, in s
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = amount::count(0, 86_400))]
    wait: u64,
    /// Write what was found as a project with its ring, for `linesman run`
    #[arg(long, value_name = "machine.toml")]
    save: Option<PathBuf>,
    /// JSON, schema linesman.ring/1; the steps go to standard error
    #[arg(long)]
    pub(crate) json: bool,
}

/// A port of a SubDevice, by its place in the order of processing.
type RingEnd = (usize, Port);

/// Where the ring is.
enum RingSite {
    /// Two cards.
    Cards([String; 2]),
    /// A virtual segment of a file, which begins anew with each scan; its cables are plugged by this program.
    Segment(PathBuf),
}

impl RingSite {
    fn of(word: &str) -> Result<Self, Failure> {
        let selector: Selector = word.parse()?;
        match &selector {
            Selector::Cards(names) => match names.as_slice() {
                [first, second] => Ok(Self::Cards([first.clone(), second.clone()])),
                _ => Err(Failure::new(
                    format!("{word}: a ring begins at one card and ends at another, expected two"),
                    format!(
                        "name the second one too: `linesman ring {word}+eth1`; `linesman interfaces` lists them"
                    ),
                )),
            },
            Selector::Segment(path) if files::segment_file(path)?.ring.is_none() => {
                let advice = "name a segment with [ring]; `linesman schema segment` lists all keys";
                Err(Failure::new(format!("{}: there is no [ring] in it", path.display()), advice))
            }
            Selector::Segment(path) => Ok(Self::Segment(path.clone())),
            Selector::Listen(_) | Selector::File(_) => {
                Err(line_access::not_drivable(word, &selector))
            }
        }
    }

    /// The names of its cards.
    fn cards(&self) -> [&str; 2] {
        match self {
            Self::Cards([first, second]) => [first, second],
            Self::Segment(_) => ["card A", "card B"],
        }
    }

    /// Scans by these cards; of a segment with its end unplugged or plugged in.
    fn scan(&self, names: &[String], is_plugged: bool) -> Result<Inventory, Failure> {
        let stop = line_access::stop()?;
        match self {
            Self::Cards(_) => {
                let line = Cards::open(names, HostClock::start())?;
                let scanned = scan::scan(line, PATIENCE, &stop);
                scanned.map_err(|error| line_access::nobody(&error).at(&names.join("+")))
            }
            Self::Segment(path) => {
                let line = match is_plugged {
                    true => line_access::virtual_line(path, Pace::Free)?,
                    false => unplugged(path)?,
                };
                let patience = PATIENCE + Span::s(line.segment().tree().len() as u64);
                let scanned = scan::scan(line, patience, &stop);
                scanned.map_err(|error| line_access::nobody(&error))
            }
        }
    }

    /// Scans by both cards.
    fn scan_ring(&self) -> Result<Inventory, Failure> {
        match self {
            Self::Cards(names) => self.scan(names, true),
            Self::Segment(_) => self.scan(&[], true),
        }
    }

    /// Scans by the first card, with the ring open.
    fn scan_line(&self) -> Result<Inventory, Failure> {
        match self {
            Self::Cards([first, second]) => {
                let from = |name: &String| self.scan(std::slice::from_ref(name), false);
                from(first).map_err(|nobody| match from(second) {
                    Ok(other) => Failure::new(
                        format!(
                            "{first} reaches nobody, and {second} reaches {}: the cards are exchanged, or the first cable \
                             is out",
                            count(other.devices.len() as u64, "SubDevice")
                        ),
                        format!("plug the IN port of the first SubDevice into {first}, or say `linesman ring {second}+{first}`"),
                    ),
                    Err(_) => nobody,
                })
            }
            Self::Segment(_) => self.scan(&[], false),
        }
    }
}

/// A virtual segment whose cable to the second card is out.
fn unplugged(path: &Path) -> Result<SegmentTransport, Failure> {
    let mut plant = files::Plant::open(path)?;
    if let Some(ring) = files::segment_file(path)?.ring {
        let at = format!("{}-maindevice.B", ring.closes_at);
        let entry = FaultEntry::new(FaultName::LinkOpen).at(&at);
        let pulled = plant.segment.inject(linesman_proto::time::Instant::ZERO, &entry);
        pulled.map_err(|error| Failure::from_error(&error))?;
    }
    let wiring = Wiring::of(&plant.segment, &plant.project);
    SegmentTransport::new(plant.segment, wiring, true, Pace::Free)
        .map_err(line_access::no_wake_handle)
}

/// Sets up a ring.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if let Some(path) = &arguments.save {
        files::refuse_to_overwrite(path)?;
    }
    let site = RingSite::of(&arguments.place)?;
    let [first, second] = site.cards();
    if let RingSite::Cards(names) = &site {
        line_access::refuse(names)?;
    }
    let patience = Duration::from_secs(arguments.wait);
    let mut told = StepTeller { json: arguments.json, output };
    told.line(&format!("Step 1 of 4: scan with the ring open, by {first}"));
    wait_until_open(&site, patience, &mut told)?;
    let line = site.scan_line()?;
    let last = line.devices.last().map(|device| device.label()).unwrap_or_default();
    told.line(&format!(
        "  {} found, the last one {last}",
        count(line.devices.len() as u64, "SubDevice")
    ));
    refuse_reversed(&line, &site)?;
    let wanted = match &arguments.end {
        Some(word) => named_end(&line, word)?,
        None => free_end(&line).ok_or_else(|| {
            Failure::new(
                format!("{}: no port for a cable is free at the end of the line", arguments.place),
                "name the port that shall close the ring: `--end 9.B`",
            )
        })?,
    };
    let end = written(&line, wanted);
    told.line(&format!("Step 2 of 4: plug a cable from {end} into {second}"));
    let ring = wait_until_closed(&site, line.devices.len(), patience)?;
    told.line(&format!("  {second} receives what {first} sends: the ring is closed"));
    told.line("Step 3 of 4: its end");
    let closes_at = ring.tree().closes_at();
    let found = closes_at.map(|end| written(&ring, end)).unwrap_or_default();
    told.line(&format!("  it closes at {found}"));
    let wrong = wrong_end(&ring, closes_at, wanted, &end).or_else(|| others(&line, &ring));
    let mut report = Report {
        schema: "linesman.ring/1".to_owned(),
        tool: version::tool(),
        on: arguments.place.clone(),
        devices: ring.devices.len() as u32,
        expected_end: numbered(wanted),
        end: closes_at.map(numbered),
        wrong: None,
        cables: Vec::new(),
        saved: None,
    };
    if let Some(wrong) = wrong {
        report.wrong =
            Some(RingTrouble { reason: wrong.reason.clone(), next_step: wrong.next_step.clone() });
        told.output.complain(&wrong);
        if arguments.json {
            told.output.json(&report);
        }
        return Ok(Status::Findings);
    }
    told.line("Step 4 of 4: checked");
    report.cables = plan(&ring).map(|plan| cables(&plan)).unwrap_or_default();
    for text in checked(&ring, &report.cables) {
        told.line(&format!("  {text}"));
    }
    let next = match &arguments.save {
        Some(path) => {
            let name = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
            files::write_new(
                path,
                "the project",
                &Project::from_inventory(&name, &ring).to_toml(),
            )?;
            report.saved = Some(path.display().to_string());
            told.line(&format!("Saved as {}.", path.display()));
            format!("linesman run {} --on {}", path.display(), arguments.place)
        }
        None => format!("linesman ring {} --save machine.toml", arguments.place),
    };
    told.line(&format!("Next: {next}"));
    if arguments.json {
        told.output.json(&report);
    }
    Ok(Status::Good)
}

/// True if what one card sends arrives at the other.
fn is_closed(inventory: &Inventory) -> bool {
    let tree = inventory.tree();
    let is_of_second = |node| tree.upstream(node) == Some(End::MainDevice(CardPath::B));
    tree.closes_at().is_some() && !(0..tree.len()).any(is_of_second)
}

/// Waits until the cable of the second card is out.
fn wait_until_open(
    site: &RingSite,
    patience: Duration,
    told: &mut StepTeller<'_>,
) -> Result<(), Failure> {
    let RingSite::Cards([_, second]) = site else { return Ok(()) };
    let mut is_told = false;
    let is_open = look_until(patience, || {
        // Nobody, or another line, is no closed ring; the scan tells.
        let is_open = !site.scan_ring().is_ok_and(|inventory| is_closed(&inventory));
        if !is_open && !std::mem::replace(&mut is_told, true) {
            told.line(&format!("  the ring is closed: pull the cable out of {second}"));
        }
        is_open.then_some(())
    });
    is_open.ok_or_else(|| {
        let reason = format!("{second}: its cable is still plugged in: the ring is closed");
        Failure::new(reason, format!("pull it out of {second}, and begin again"))
    })
}

/// Waits until the ring is closed; what is still wrong when the time is up.
fn wait_until_closed(
    site: &RingSite,
    expected: usize,
    patience: Duration,
) -> Result<Inventory, Failure> {
    let mut last = None;
    let closed = look_until(patience, || match site.scan_ring() {
        Ok(ring) if !is_closed(&ring) => {
            last = Some(ring);
            None
        }
        ended => Some(ended),
    });
    match (closed, last) {
        (Some(ended), _) => ended,
        (None, Some(ring)) => Err(still_open(site, expected, &ring)),
        (None, None) => site.scan_ring(),
    }
}

/// Why a ring of so many SubDevices is not closed.
fn still_open(site: &RingSite, expected: usize, ring: &Inventory) -> Failure {
    let [first, second] = site.cards();
    let answering = ring.devices.len();
    if answering > expected {
        return Failure::new(
            format!(
                "{second}: its cable is that of another line: {answering} SubDevices answer, with the ring open {expected}"
            ),
            format!(
                "plug the cable of the last SubDevice into {second}, or name the card that it is in"
            ),
        );
    }
    let tree = ring.tree();
    let of_second =
        (0..tree.len()).find(|node| tree.upstream(*node) == Some(End::MainDevice(CardPath::B)));
    if let Some(node) = of_second {
        let label = ring.devices.get(node).map(|device| device.label()).unwrap_or_default();
        return Failure::new(
            format!(
                "the ring is open within the line: {second} reaches {label} from the other side"
            ),
            "plug in the cable at which the two halves end: `linesman scan` shows them",
        );
    }
    let has_link = interface::find(second).is_ok_and(|card| card.carrier);
    match has_link {
        false => Failure::new(
            format!("{second}: it has no link, the cable to it is not plugged in"),
            format!(
                "plug the cable of the last SubDevice into {second}; `linesman interfaces` shows its link"
            ),
        ),
        true => Failure::new(
            format!(
                "{second}: it has a link, but nothing that {first} sends arrives there: its cable is that of another line"
            ),
            format!(
                "plug the cable of the last SubDevice into {second}, or name the card that it is in"
            ),
        ),
    }
}

/// A line that is entered by a port for what follows.
fn refuse_reversed(line: &Inventory, site: &RingSite) -> Result<(), Failure> {
    let tree = line.tree();
    let Some(node) = tree.first(CardPath::A).filter(|node| tree.is_reversed(*node)) else {
        return Ok(());
    };
    let [first, second] = site.cards();
    let label = line.devices.get(node).map(|device| device.label()).unwrap_or_default();
    Err(Failure::new(
        format!(
            "{first}: it enters {label} by port {}: it is at the far end of the line",
            tree.entry(node)
        ),
        format!("exchange the cables, or say `linesman ring {second}+{first}`"),
    ))
}

/// The free port at the end of the line: of the last SubDevice with two ports, or of the last coupler (RED-07).
fn free_end(line: &Inventory) -> Option<RingEnd> {
    let tree = line.tree();
    let kind =
        |node: usize, port: Port| line.devices.get(node)?.profile.ports.map(|ports| ports[port]);
    let is_cable =
        |node: usize, port: Port| kind(node, port).is_none_or(|kind| kind == PortKind::Mii);
    let mut node = tree.first(CardPath::A)?;
    // Along the last cable of each.
    while let Some((_, next)) =
        tree.children(node).filter(|(_, below)| is_cable(*below, tree.entry(*below))).last()
    {
        node = next;
    }
    let is_free = |port: &Port| {
        *port != tree.entry(node) && !tree.is_open(node, *port) && is_cable(node, *port)
    };
    [Port::B, Port::C, Port::D].into_iter().find(is_free).map(|port| (node, port))
}

/// The port that a word such as `9.B` means.
fn named_end(line: &Inventory, word: &str) -> Result<RingEnd, Failure> {
    let end = word.rsplit_once('.').and_then(|(device, port)| {
        let no: usize = device.parse().ok()?;
        let node = no.checked_sub(1).filter(|node| *node < line.devices.len())?;
        let port = Port::ALL.into_iter().find(|one| one.to_string() == port)?;
        Some((node, port))
    });
    end.ok_or_else(|| {
        let devices = line.devices.len();
        Failure::new(
            format!("--end {word}: expected a number and a port, 1.A to {devices}.D"),
            "`linesman scan` lists the numbers",
        )
    })
}

fn written(inventory: &Inventory, (node, port): RingEnd) -> String {
    let label = inventory.devices.get(node).map(|device| device.label()).unwrap_or_default();
    format!("port {port} of {label}")
}

/// As on the command line: `9.B`.
fn numbered((node, port): RingEnd) -> String {
    format!("{}.{port}", node + 1)
}

/// An end that is not the one that was named, or not a legal one.
fn wrong_end(
    ring: &Inventory,
    closes_at: Option<RingEnd>,
    wanted: RingEnd,
    end: &str,
) -> Option<Failure> {
    let plan = plan(ring);
    let doubts = plan.as_ref().map(Plan::doubts).unwrap_or_default();
    if let Some(doubt) = doubts.into_iter().find(|doubt| doubt.name == "ring-end") {
        return Some(Failure::new(doubt.text, doubt.advice));
    }
    let found = closes_at.map(|end| written(ring, end)).unwrap_or_default();
    (closes_at != Some(wanted)).then(|| {
        Failure::new(
            format!("the ring closes at {found}, expected {end}"),
            format!("plug the cable into {end}, or name the end that it has with --end"),
        )
    })
}

/// SubDevices that are others than with the ring open.
fn others(line: &Inventory, ring: &Inventory) -> Option<Failure> {
    let advice = "check what was plugged meanwhile, and begin again";
    if line.devices.len() != ring.devices.len() {
        let (open, closed) = (line.devices.len(), ring.devices.len());
        let reason =
            format!("{open} SubDevices were found with the ring open, {closed} with it closed");
        return Some(Failure::new(reason, advice));
    }
    let mut pairs = line.devices.iter().zip(&ring.devices);
    let (before, now) = pairs.find(|(before, now)| before.identity != now.identity)?;
    let reason = format!("{} with the ring open is {} with it closed", before.label(), now.label());
    Some(Failure::new(reason, advice))
}

fn plan(inventory: &Inventory) -> Option<Plan> {
    let devices = inventory.planned(AlState::Op);
    Plan::build(&devices, inventory.tree().clone(), &PlanOptions::default()).ok()
}

/// What the ring protects, and what not.
fn checked(ring: &Inventory, cables: &[RingCable]) -> Vec<String> {
    if cables.is_empty() {
        return Vec::new();
    }
    let safe = cables.iter().filter(|cable| cable.may_break).count() as u64;
    let verb = if safe == 1 { "breaks" } else { "break, one at a time" };
    let mut told = vec![format!("nobody is lost when {} {verb}", count(safe, "cable"))];
    for cable in cables.iter().filter(|cable| !cable.may_break) {
        let ids = cable.lost.iter().filter_map(|no| DeviceId::from_no(*no));
        let lost: Vec<String> = ids.map(|id| ring.label(id)).collect();
        told.push(format!(
            "a cable outside of the ring: without it {} lost",
            match lost.as_slice() {
                [one] => format!("{one} is"),
                all => format!("{} are", all.join(", ")),
            }
        ));
    }
    told
}
