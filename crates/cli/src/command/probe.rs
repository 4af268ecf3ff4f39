//! `linesman probe`: many long frames over each link of a line that nobody drives, and what became of
//! them, link by link. It finds lasting faults; one that comes and goes needs `diagnose` or
//! `counters --for` beside the running machine.

use linesman_diagnosis::Diagnosis;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_proto::topology::{End, Tree};
use serde::Serialize;

use super::counters::names;
use super::counters::samples::Samples;
use super::diagnose;
use super::service::ServiceLine;
use crate::amount;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::version;

/// The registers up to the SyncManagers: reading them changes nothing, and the frame is nearly as long as
/// one can be.
const FROM: RegisterAddress = RegisterAddress(0x0000);
const LONG: u16 = 0x05C0;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml
    #[arg(value_name = "WHERE")]
    pub(crate) line: String,
    /// How many frames go over each link at least (1000, 10k, 1M)
    #[arg(long, value_name = "COUNT", default_value = "1000", value_parser = amount::count(1, 10_000_000))]
    frames: u64,
    /// JSON, schema linesman.probe/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.probe/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Frames sent.
    sent: u64,
    /// Frames that nobody answered.
    lost: u64,
    /// The links, in the order in which a frame gets there.
    links: Vec<LinkReport>,
    /// What follows from it.
    diagnosis: Diagnosis,
}

/// What became of the frames of one link.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct LinkReport {
    /// The end nearer the MainDevice.
    near: String,
    /// The far end.
    far: String,
    /// Frames that went over it, out and back.
    frames: u64,
    /// Bad frames and bad symbols that the far end counted.
    away: [u64; 2],
    /// Bad frames and bad symbols that the near end counted; `null` for the card.
    back: Option<[u64; 2]>,
    /// Links lost at either end.
    lost_links: u64,
    /// Whether nothing was counted, by counters that could have.
    good: bool,
    /// Whether a counter of this link stands at its end, 255, and counts no more.
    full: bool,
}

/// Sends them.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let mut session = ServiceLine::open(&arguments.line)?;
    let Some(tree) = session.inventory().map(|inventory| inventory.tree().clone()) else {
        let reason = format!("{}: another process drives this line", session.place());
        let advice = "end it first, or watch beside it with `linesman counters --for 60`";
        return Err(Failure::new(reason, advice));
    };
    let mut samples = Samples::default();
    samples.read(&mut session, Span::ZERO)?;
    let over = send(&mut session, &mut samples, &tree, arguments.frames)?;
    // Longer than any counter may take to be up to date; frames of a later reading are not of this try.
    samples.read(&mut session, Span::s(1))?;
    let Some(diagnosis) = session.diagnosis() else { return Ok(Status::NotJudged) };
    let links = links(&session, &samples, &tree, &over);
    let status = diagnose::status(&diagnosis);
    if arguments.json {
        let (schema, tool) = ("linesman.probe/1".to_owned(), version::tool());
        let (sent, lost) = (samples.sent, samples.lost);
        output.json(&Report { schema, tool, sent, lost, links, diagnosis });
    } else {
        output.text(&table(&links, output));
        output.line(&format!("\n{} frames sent, {} not answered.\n", samples.sent, samples.lost));
        diagnose::print(&diagnosis, &names(&session), output);
    }
    Ok(status)
}

/// Sends the frames to the last SubDevice of each branch in turn, and tells how many went to each node.
fn send(
    session: &mut ServiceLine,
    samples: &mut Samples,
    tree: &Tree,
    frames: u64,
) -> Result<Vec<u64>, Failure> {
    let ends: Vec<usize> = tree
        .reached()
        .iter()
        .copied()
        .filter(|node| tree.children(*node).next().is_none())
        .collect();
    let mut over = vec![0; tree.len()];
    // A frame passes the whole line whomever it is for.
    let mut order = ends.iter().copied().cycle();
    for _ in 0..frames {
        let Some(node) = order.next() else { break };
        let answer = session.try_read(DeviceId(node as u32), FROM, LONG)?;
        samples.sent += 1;
        samples.lost += u64::from(answer.is_none());
        over.iter_mut().for_each(|count| *count += 1);
    }
    Ok(over)
}

fn links(session: &ServiceLine, samples: &Samples, tree: &Tree, over: &[u64]) -> Vec<LinkReport> {
    let count = |node: usize, port: Port| {
        let id = DeviceId(node as u32);
        [ErrorCounter::InvalidFrame(port), ErrorCounter::PhysicalLayer(port)]
            .map(|counter| samples.rise(id, counter))
    };
    let is_full = |node: usize, port: Port| {
        let latest = samples.latest(DeviceId(node as u32));
        let counters = [ErrorCounter::InvalidFrame(port), ErrorCounter::PhysicalLayer(port)];
        let at_end = |counter| latest.and_then(|all| all.value(counter)) == Some(u8::MAX);
        counters.into_iter().any(at_end)
    };
    let lost = |end: End| match end {
        End::Controller(node, port) => {
            samples.rise(DeviceId(node as u32), ErrorCounter::LostLink(port))
        }
        End::MainDevice(_) => 0,
    };
    let name = |end: End| match end {
        End::Controller(node, port) => {
            format!("{}.{port}", session.label(DeviceId(node as u32)))
        }
        End::MainDevice(path) => format!("card {path}"),
    };
    let mut list = Vec::new();
    for node in tree.reached() {
        let Some(above) = tree.link_above(*node).and_then(|link| tree.links().get(link)) else {
            continue;
        };
        let away = count(*node, tree.entry(*node));
        let back = match above.upstream {
            End::Controller(parent, port) => Some(count(parent, port)),
            End::MainDevice(_) => None,
        };
        let lost_links = lost(above.upstream) + lost(above.downstream);
        let errors: u64 = away.iter().chain(back.iter().flatten()).sum();
        let full = is_full(*node, tree.entry(*node))
            || matches!(above.upstream, End::Controller(parent, port) if is_full(parent, port));
        list.push(LinkReport {
            near: name(above.upstream),
            far: name(above.downstream),
            frames: over.get(*node).copied().unwrap_or(0),
            away,
            back,
            lost_links,
            good: errors + lost_links == 0 && !full,
            full,
        });
    }
    list
}

fn table(links: &[LinkReport], output: &Output) -> String {
    let paint = output.paint();
    let headings = ["from", "to", "frames", "bad there", "bad back", "links lost", ""];
    let mut table = Table::new(&headings, paint);
    let pair = |[frames, symbols]: [u64; 2]| format!("{frames}/{symbols}");
    for link in links {
        table.row([
            link.near.clone(),
            link.far.clone(),
            link.frames.to_string(),
            pair(link.away),
            link.back.map_or_else(|| "--".to_owned(), pair),
            link.lost_links.to_string(),
            match (link.good, link.full) {
                (true, _) => paint.good("good"),
                (false, true) => paint.warning("counter full"),
                (false, false) => paint.bad("errors"),
            },
        ]);
    }
    table.render()
}
